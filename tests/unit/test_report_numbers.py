"""Every number of a report stands in its JSON, and that is what the other commands write."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.analysis.analyze import analyze
from rig.analysis.identify import identify
from rig.coupling.couple import couple
from rig.dataset import load
from rig.diagnosis.diagnose import diagnose
from rig.digits import likely
from rig.report.document import Block, Number, Section, Table, rich
from rig.report.report import Report
from rig.report.results import Node
from rig.report.wishes import Wishes
from tests.recovery.emulated_sets import PAPER_C, REFERENCE_Q, measure, protocol
from tests.unit.report_sets import Page, bench, sketch

MODEL = Path(__file__).parents[2] / "data" / "models" / "F1.yaml"


def clean(value: Any) -> Any:
    """As it comes out of a JSON file."""
    return json.loads(json.dumps(value, allow_nan=False))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "arm.h5"
    runs = [(0, "x", 100.0), (0, "y", 60.0)]
    measure(protocol(REFERENCE_Q[None, :], runs, levels=5), np.asarray(PAPER_C), 5, path)
    return path


@pytest.fixture(scope="module")
def of_arm(arm: Path) -> Report:
    return sketch([arm], Wishes(couple=MODEL, gap=False, made="2026-03-01T12:00:00+01:00"))


@pytest.fixture(scope="module")
def of_bench(tmp_path_factory: pytest.TempPathFactory) -> Report:
    folder = tmp_path_factory.mktemp("bench")
    soft = bench(folder / "soft.h5", lambda f, r: f / 95 + (f / 60) ** 3 / 95 * (1 + r / 1e3))
    return sketch([soft, bench(folder / "stiff.h5")], Wishes(made="now"))


def look_up(document: Any, pointer: str) -> Any:
    """What stands at a pointer; KeyError, IndexError where nothing does."""
    value = document
    for step in pointer.split("/")[1:]:
        key = step.replace("~1", "/").replace("~0", "~")
        value = value[int(key)] if isinstance(value, list) else value[key]
    return value


def shown(page: Page) -> list[tuple[str, float, str, float]]:
    """(pointer, value in full, text, scale) of every number of the page."""
    return [
        (
            e.attributes["data-pointer"],
            float(e.attributes["value"]),
            e.text,
            float(e.attributes.get("data-scale", "1")),
        )
        for e in page.all("data")
    ]


def last_digit(text: str) -> float:
    """What one in the last digit of a printed number means."""
    mantissa, _, exponent = text.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals)


@pytest.mark.parametrize("which", ["of_arm", pytest.param("of_bench", marks=pytest.mark.slow)])
def test_every_number_stands_in_the_json(which: str, request: pytest.FixtureRequest) -> None:
    report: Report = request.getfixturevalue(which)
    data = clean(report.to_json())
    numbers = shown(Page(report.to_html()))
    assert len(numbers) > 150
    for pointer, value, text, scale in numbers:
        assert look_up(data, pointer) == value, pointer
        if text in ("> 99", "< 1"):  # probabilities next to certain
            assert likely(value) == f"{text} %", pointer
            continue
        if text == "< 0.001":  # a p value
            assert value < 1e-3, pointer
            continue
        assert abs(float(text) - value * scale) <= 0.501 * last_digit(text), (pointer, text)


@pytest.mark.parametrize("which", ["of_arm", "of_bench"])
def test_no_cell_of_a_table_holds_a_number_from_elsewhere(
    which: str, request: pytest.FixtureRequest
) -> None:
    """Digits in the columns of numbers belong to a `Number`, which has its place in the JSON."""
    found = list(tables(request.getfixturevalue(which).document.sections))
    assert len(found) > 8
    for table in found:
        for row in table.rows:
            assert len(row) == len(table.header), table.caption
            words = [p for cell in row[table.words :] for p in rich(cell) if isinstance(p, str)]
            assert not [w for w in words if any(c.isdigit() for c in w)], table.caption


def tables(blocks: Sequence[Block]) -> Iterator[Table]:
    for block in blocks:
        if isinstance(block, Table):
            yield block
        elif isinstance(block, Section):
            yield from tables(block.blocks)


def test_the_json_is_what_the_other_commands_write(arm: Path, of_arm: Report) -> None:
    data = clean(of_arm.to_json())
    one = data["datasets"][0]
    assert one["analyze"] == clean(analyze(load(arm)).to_json())
    assert one["identify"] == clean(identify([arm]).to_json())
    assert one["diagnose"] is None
    assert data["couple"] == clean(couple(MODEL).to_json())
    assert (data["schema"], one["complete"], one["origin"]) == ("rig.report/1", True, "emulated")


def test_so_is_the_diagnosis(of_bench: Report) -> None:
    session = of_bench.gathered.sessions[0]
    written = clean(diagnose(load(session.path)).to_json())
    assert clean(of_bench.to_json())["datasets"][0]["diagnose"] == written
    page = Page(of_bench.to_html())
    assert written["verdict"] in [e.text for e in page.all("strong")]


@pytest.mark.parametrize(
    ("p", "written"), [(0.0, "< 0.001"), (3e-9, "< 0.001"), (0.0123, "0.012"), (1.0, "1.0")]
)
def test_no_p_value_is_nil(p: float, written: str) -> None:
    (shown,) = Node({"p": p})["p"].chance()
    assert isinstance(shown, Number)
    assert (shown.text, shown.value, shown.pointer) == (written, p, "/p")


def test_pointers_of_names_with_slashes_and_tildes() -> None:
    node = Node({"P1/x": {"a~b": [1.5, None]}})
    found = node["P1/x"]["a~b"]
    assert found[0].pointer == "/P1~1x/a~0b/0"
    assert look_up(node.value, found[0].pointer) == 1.5
    assert found[1].number() == ("-",)
    with pytest.raises(KeyError, match="/P1~1x/none"):
        node["P1/x"]["none"]


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.0, "0"), (1.0, "100"), (0.9996, "100"), (0.9994, "99.9"), (-1e-17, "0"), (0.23062, "23.1")],
)
def test_shares_as_percent(share: float, text: str) -> None:
    shown_text = Node(share).percent()[0]
    assert not isinstance(shown_text, str)
    assert shown_text.text == text


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "< 1 %"), (0.004, "< 1 %"), (0.04, "4.00 %"), (1.0, "100 %")]
)
def test_an_effect_that_is_there_does_something_to_the_gap(share: float, text: str) -> None:
    shown = "".join(c if isinstance(c, str) else c.text for c in Node(share).share())
    assert shown == text


@pytest.mark.parametrize("p", [0.0, 0.004, 0.5, 0.934, 0.996, 1.0])
def test_probabilities_are_told_as_on_the_terminal(p: float) -> None:
    shown_text = "".join(c if isinstance(c, str) else c.text for c in Node(p).probability())
    assert shown_text == likely(p)


def test_numbers_keep_their_digits() -> None:
    node = Node({"value": 57.2513, "ci95": [56.01, 58.5], "stated": 0.002, "count": 3})
    texts = [
        p if isinstance(p, str) else p.text
        for p in (*node["value"].number(3), *node["stated"].stated(), *node["count"].number())
    ]
    assert texts == ["57.3", "0.002", "3"]
    assert math.isclose(float(node["stated"].stated(100)[0].text), 0.2)  # type: ignore[union-attr]
