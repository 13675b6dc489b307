from __future__ import annotations

import dataclasses
from collections import Counter
from functools import cache
from math import isclose, radians
from pathlib import Path
from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.errors import InputError
from rig.protocol import MeasurementProtocol, Run, Step, load_protocol, parse_protocol

PROTOCOLS = Path(__file__).parents[2] / "protocols"
GOLDEN = Path(__file__).parents[1] / "golden"
PAPER = (PROTOCOLS / "paper_xy.yaml").read_text("utf-8")
PATH = Path("P")


def changed(*changes: tuple[str, str]) -> str:
    """The paper's protocol with words replaced; every one must be there once."""
    text = PAPER
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def said(*changes: tuple[str, str]) -> list[str]:
    """Problems of a changed protocol, the file's name and place left out."""
    with pytest.raises(InputError) as caught:
        parse_protocol(changed(*changes), PATH)
    return [line.split(": ", 1)[1] for line in str(caught.value).splitlines()]


@cache
def load_paper() -> MeasurementProtocol:
    return load_protocol(PROTOCOLS / "paper_xy.yaml")


@pytest.fixture
def paper() -> MeasurementProtocol:
    return load_paper()


def test_the_papers_protocol(paper: MeasurementProtocol) -> None:
    assert paper.poses["P1"].q_rad[0] == pytest.approx(radians(13.43))
    assert paper.runs[0].forces_N == tuple(20.0 * i for i in range(1, 12))
    assert paper.runs[1].forces_N[-3:] == (75.0, 78.0, 82.0)
    assert paper.directions == {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
    assert paper.prompts["before_run"].startswith("Check")
    assert paper.text == PAPER
    assert paper.limits.force_N is not None
    assert (paper.limits.force_N.max, paper.limits.force_N.at) == (240.0, "stop")


def test_the_wider_half_band_counts(paper: MeasurementProtocol) -> None:
    assert paper.force_band.half_width_N(20) == 0.5
    assert paper.force_band.half_width_N(-220) == 2.2


def test_a_protocol_from_a_data_set_is_the_same(paper: MeasurementProtocol) -> None:
    again = parse_protocol(paper.text, PATH)
    assert dataclasses.replace(again, path=paper.path) == paper


def test_unloading_goes_back_down_and_shares_the_numbers(paper: MeasurementProtocol) -> None:
    both = dataclasses.replace(paper, branches="loading-unloading")
    assert both.steps(Run("P1", "x", (10.0, 20.0, 30.0))) == (
        Step(1, "loading", 10.0),
        Step(2, "loading", 20.0),
        Step(3, "loading", 30.0),
        Step(2, "unloading", 20.0),
        Step(1, "unloading", 10.0),
    )
    assert paper.steps(Run("P1", "x", (10.0, 20.0)))[-1] == Step(2, "loading", 20.0)


def test_sequence_follows_the_order(paper: MeasurementProtocol) -> None:
    by_run = [(index, n) for index, _, n in paper.sequence()]
    assert by_run == [(0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3)]
    other = dataclasses.replace(paper, order="by_repetition")
    assert [(index, n) for index, _, n in other.sequence()] == [
        (0, 1),
        (1, 1),
        (0, 2),
        (1, 2),
        (0, 3),
        (1, 3),
    ]


@settings(deadline=None)
@given(
    levels=st.lists(st.integers(1, 500), min_size=1, max_size=30, unique=True),
    repetitions=st.integers(1, 5),
    order=st.sampled_from(["by_run", "by_repetition"]),
)
def test_every_level_is_measured_as_often_as_asked(
    levels: list[int], repetitions: int, order: Literal["by_run", "by_repetition"]
) -> None:
    run = Run("P1", "x", tuple(float(f) for f in sorted(levels)))
    protocol = dataclasses.replace(
        load_paper(),
        runs=(run, run),
        repetitions=repetitions,
        order=order,
        branches="loading-unloading",
    )
    pairs = [(index, n) for index, _, n in protocol.sequence()]
    assert sorted(pairs) == [(i, n) for i in (0, 1) for n in range(1, repetitions + 1)]
    steps = protocol.steps(run)
    counted = Counter(step.target_N for step in steps)
    assert counted.pop(run.forces_N[-1]) == 1
    assert all(n == 2 for n in counted.values())
    assert all(run.forces_N[step.number - 1] == step.target_N for step in steps)


def test_percent_of_the_rated_load() -> None:
    iso = load_protocol(PROTOCOLS / "iso9283_static_compliance.yaml")
    assert len(iso.runs) == 6
    for run in iso.runs:
        assert run.forces_N == pytest.approx([12.26 * i for i in range(1, 11)])
    assert iso.directions["-z"] == (0.0, 0.0, -1.0)


def test_the_protocol_for_diagnosis_has_what_diagnosis_needs() -> None:
    protocol = load_protocol(PROTOCOLS / "load_unload_hold.yaml")
    assert {run.pose for run in protocol.runs} == {"P1", "P2"}
    assert protocol.branches == "loading-unloading"
    assert protocol.hold_s >= 10
    assert protocol.zero.before_s >= 10
    assert protocol.zero.after_s >= 10
    assert protocol.repetitions == 3


def test_directions_written_with_few_digits_get_length_one() -> None:
    protocol = parse_protocol(changed(("y: [0, 1, 0]", "y: [0.7071, -0.7071, 0]")), PATH)
    vector = protocol.directions["y"]
    assert isclose(sum(v * v for v in vector), 1.0, abs_tol=1e-15)
    assert vector[0] == -vector[1]


def test_positions_in_radians() -> None:
    q = "q_deg: [13.43, -99.84, -108.10, -62.06, 90.0, -76.57]"
    protocol = parse_protocol(changed((q, "q_rad: [1, -1, 0.5, 0, 0, 0]")), PATH)
    assert protocol.poses["P1"].q_rad == (1.0, -1.0, 0.5, 0.0, 0.0, 0.0)


def mistakes() -> list[tuple[str, str, str]]:
    """(what is replaced, by what, the message) of every case in the golden file."""
    cases = (GOLDEN / "protocol_mistakes.txt").read_text("utf-8").split("\n\n")[1:]
    read = [[line[2:].replace("\\n", "\n") for line in case.splitlines()] for case in cases]
    return [(old, new, message) for old, new, message in read]


@pytest.mark.parametrize(("old", "new", "message"), mistakes())
def test_a_mistake_is_said_word_for_word(old: str, new: str, message: str) -> None:
    assert message in said((old, new))


def test_a_bad_name_is_refused() -> None:
    text = changed(("  P1:", "  a/b:"))
    with pytest.raises(InputError, match=r"poses\.a/b: a name has letters, digits, _, \+ and -"):
        parse_protocol(text, PATH)


def test_steps_without_a_value_are_said_with_other_values_that_are_wrong() -> None:
    levels = "steps_N: [7.5, 15, 22.5, 30, 37.5, 45, 52.5, 60, 67.5, 75, 78, 82]"
    found = said(("\nrepetitions: 3", "\n#"), ("rest_s: 10", "rest_s: ten"), (levels, "steps_N: "))
    assert [line.split(":")[0] for line in found[:-1]] == ["repetitions", "runs[1]", "rest_s"]


def test_three_mistakes_are_one_message_with_their_places() -> None:
    text = changed(
        ("repetitions: 3", "repetitons: 3"),
        ("direction: y", "direction: Y"),
        ("tcp_xyz_mm: [0,", "tcp_xyz_mn: [9000,"),
    )
    with pytest.raises(InputError) as caught:
        parse_protocol(text, PATH)
    assert str(caught.value).splitlines() == [
        'P:10:5: poses.P1.tcp_xyz_mn: unknown key. Did you mean "tcp_xyz_mm"?',
        "P:10:18: poses.P1.tcp_xyz_mm[0]: 9000 mm is no tool; allowed: -2000 to 2000 mm.",
        'P:23:27: runs[1].direction: "Y" is unknown. Known: x, y.',
        'P:24:1: repetitons: unknown key. Did you mean "repetitions"?',
    ]


def test_what_could_not_be_checked_is_said() -> None:
    unknown = ("direction: y", "direction: Y")  # a matter of several keys
    text = changed(("repetitions: 3\n", ""), ("rest_s: ", "rest_s: ten # "), unknown)
    with pytest.raises(InputError) as caught:
        parse_protocol(text, PATH)
    first, second, last = str(caught.value).splitlines()
    assert "repetitions: is missing" in first
    assert 'rest_s: the text "ten" is not allowed' in second
    assert last == "P: whether its values fit each other is checked once that is mended."
    assert "is checked once" not in "".join(said(unknown))


@pytest.mark.parametrize(
    ("hold_s", "rate_Hz", "samples"), [(0, 1, 5), (5.2, 1, 6), (6.5, 1, 7), (12.5, 4.4, 55)]
)
def test_a_step_has_samples_for_at_least_its_hold(
    hold_s: float, rate_Hz: float, samples: int
) -> None:
    paper = load_protocol(PROTOCOLS / "paper_xy.yaml")
    sampling = dataclasses.replace(paper.sampling, rate_Hz=rate_Hz)
    protocol = dataclasses.replace(paper, hold_s=hold_s, sampling=sampling)
    assert protocol.samples_of_step == samples
