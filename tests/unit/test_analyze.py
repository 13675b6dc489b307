"""The analysis of a data set as text, JSON and figures."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.analysis.analyze import Analysis, Options, analyze, weighting
from rig.analysis.figures import curve, draw, pointwise
from rig.digits import brief, number
from rig.errors import InputError
from rig.terminal import folded
from tests.unit.stiffness_tables import Table, run, table

GOLDEN = Path(__file__).parents[1] / "golden" / "analyze_text.txt"
SHARED = Path(__file__).parents[2] / "../shared"
X = (20.0, 60.0, 100.0, 140.0, 180.0, 220.0)
Y = (7.5, 22.5, 37.5, 52.5, 67.5, 75.0, 78.0, 82.0)
FACTORS = (1.0, 1.005, 0.996)


def softening(force: float) -> float:
    return force / 133.0 * (1 + force / 256.0)


def giving_way(force: float) -> float:
    return force / 57.42 if force < 75.0 else 75.0 / 57.42 + (force - 75.0) / 1.25


def session(**more: Any) -> Table:
    rows = []
    for r, factor in enumerate(FACTORS, start=1):
        rows += run(lambda f, c=factor: c * softening(f), X, repetition=r)
    for r, factor in enumerate(FACTORS, start=1):
        law = lambda f, c=factor: c * giving_way(f)  # noqa: E731
        rows += run(law, Y, direction="y", repetition=r)
    return table(rows, **more)


@pytest.fixture(scope="module")
def analysis() -> Analysis:
    lines = (
        "EMULATED: these values come from simulated devices; nothing was measured.",
        "INCOMPLETE: the measurement did not reach its end (stopped by the operator).",
    )
    return analyze(session(origin="emulated", complete=False, lines=lines))


def test_the_text_word_for_word(analysis: Analysis) -> None:
    """After a deliberate change: write `analysis.to_text()` to the golden file, and read it."""
    assert analysis.to_text() + "\n" == GOLDEN.read_text(encoding="utf-8")


def test_sentences_are_lines_and_a_terminal_folds_them_but_no_table(analysis: Analysis) -> None:
    lines = analysis.to_text().splitlines()
    after = [line for line in lines if line.startswith("Not counted")]
    assert [line[-1] for line in after] == ["."]
    tables = [line for line in lines if line.startswith("  ") and ";" not in line]
    assert set(tables) <= set(folded("\n".join(lines), 80).splitlines())


def test_json_has_what_other_programs_rely_on(analysis: Analysis) -> None:
    result = json.loads(json.dumps(analysis.to_json(), allow_nan=False))
    assert result["schema"] == "rig.analysis/1"
    assert result["dataset"] == "00000000-0000-4000-8000-000000000000"
    assert (result["origin"], result["complete"]) == ("emulated", False)
    assert list(result["directions"]) == ["x", "y"]
    y = result["directions"]["y"]
    k = y["stiffness_N_per_mm"]
    assert {"value", "standard_uncertainty", "ci95"} <= k.keys()
    assert k["ci95"][0] < k["value"] < k["ci95"][1]
    assert k["value"] == pytest.approx(57.42, rel=0.002)
    assert y["weighting"] == "proportional (s grows with displacement), through the origin"
    assert {"force_N", "displacement_mm", "sd_mm", "n", "branch"} <= y["curve"][0].keys()
    assert y["curve"][0]["displacement_mm"] == pytest.approx(7.5 / 57.42, rel=0.001)
    assert {"force_N", "stiffness_N_per_mm", "sd_N_per_mm"} <= y["pointwise"][0].keys()
    assert [e["step"] for e in y["excluded"]] == [7, 8]
    assert y["knee"]["force_N"]["value"] == pytest.approx(75.0, abs=0.2)
    x = result["directions"]["x"]["stiffness_N_per_mm"]["value"]
    assert result["anisotropy"]["x/y"]["value"] == pytest.approx(x / k["value"])


def test_directions_of_two_poses_carry_the_pose() -> None:
    rows = [
        *run(softening, X, pose="P1"),
        *run(softening, X, pose="P2"),
        *run(giving_way, Y, pose="P2", direction="y"),
    ]
    result = analyze(table(rows))
    assert list(result.directions) == ["P1/x", "P2/x", "y"]
    assert list(result.to_json()["anisotropy"]) == ["P2/x/y"]
    text = result.to_text()
    assert "P2/x is 1." in text
    assert "times as stiff as y" in text
    assert "Direction P1/x\n" in text
    assert "Direction y, pose P2\n" in text


def test_only_directions_of_one_pose_are_compared() -> None:
    rows = []
    for pose in ("P1", "P2"):
        rows += run(softening, X, pose=pose)
        rows += run(giving_way, Y, pose=pose, direction="y")
    result = analyze(table(rows))
    assert list(result.to_json()["anisotropy"]) == ["P1/x/P1/y", "P2/x/P2/y"]
    assert "as stiff as P2/y" in " ".join(result.to_text().split())


def test_undefined_stiffness_is_null_and_a_sentence() -> None:
    result = analyze(table(run(lambda f: f / 100.0, (0.0, 0.0, 0.0))))
    entry = result.to_json()["directions"]["x"]
    assert entry["status"] == "undefined"
    assert entry["stiffness_N_per_mm"]["value"] is None
    assert "run.h5: k in x is undefined.\n" in result.to_text()  # and no brackets to explain
    assert (
        "The stiffness is undefined: the force is 0 N from its zero throughout." in result.to_text()
    )


def test_zero_load_alone_and_nothing_at_all() -> None:
    assert "k in x is undefined" in analyze(table(run(softening, ()))).to_text()
    empty = analyze(table(run(softening, X)[:0]))
    assert empty.to_text() == "run.h5: there are no samples to analyze."
    assert empty.to_json()["directions"] == {}


def test_wishes_reach_the_estimator() -> None:
    data = session()
    every = analyze(data, Options(keep_after_knee=True)).directions["y"].result
    assert every.excluded == ()
    choice = analyze(data, Options("none", intercept=True)).directions["x"].result.choice
    assert choice.label == "none (every level counts alike), with intercept"
    eiv = analyze(data, Options(errors_in_variables=True)).directions["x"].result.choice
    assert eiv.weighting == "errors-in-variables"


def test_wishes_that_exclude_each_other() -> None:
    with pytest.raises(InputError) as caught:
        analyze(session(), Options("none", errors_in_variables=True))
    assert str(caught.value) == (
        "--weighting none and --errors-in-variables exclude each other: errors in variables "
        "weight by the uncertainties of force and displacement. Leave one of the two out."
    )


def test_an_unknown_weighting_is_named_with_a_suggestion() -> None:
    assert weighting("auto") == "auto"
    assert weighting("1/s^2") == "1/s^2"
    with pytest.raises(InputError) as caught:
        weighting("proportionl")
    assert str(caught.value) == (
        '--weighting: "proportionl" is not known. Did you mean "proportional"? '
        "Allowed: auto, proportional, 1/s^2, none, errors-in-variables."
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (95.9277, "95.93"),
        (1234567.0, "1234567"),
        (0.000123456, "0.0001235"),
        (1.2e-7, "1.200e-07"),
        (0.0, "0"),
        (math.nan, "-"),
        (-3.14159, "-3.142"),
        (3.2e9, "3.200e+09"),
    ],
)
def test_numbers_read_well_at_any_scale(value: float, text: str) -> None:
    assert number(value) == text


def test_numbers_of_one_quantity_are_written_alike() -> None:
    assert number(5847289.0, 2, 1e9) == "5.8e+06"
    assert number(5847289.0, 2, 1e6) == "5847289"
    assert number(0.0, 2, 1e9) == "0"
    rows = []
    for r in (1, 2, 3):
        rows += run(lambda f, r=r: f / 1e9 * (1 + 0.01 * r), X, repetition=r)
    text = analyze(table(rows)).to_text()
    line = next(part for part in text.splitlines() if part.startswith("k = "))
    assert re.fullmatch(
        r"k = \d\.\d{3}e\+08 N/mm, standard uncertainty \d\.\de\+06 N/mm, "
        r"95 % from \d\.\d{3}e\+08 to \d\.\d{3}e\+0[89] N/mm",
        line,
    )


def test_thousands_are_written_out() -> None:
    assert [brief(v, 3) for v in (1044.0, 0.25, -2.0e6, 1.0)] == ["1040", "0.25", "-2000000", "1"]
    assert brief(1.2345e9) == "1.234e+09"
    assert brief(3.2e-7) == "3.2e-07"


def test_figures_are_written_twice_and_alike(analysis: Analysis, tmp_path: Path) -> None:
    files = draw(analysis, tmp_path / "new")
    assert [f.name for f in files] == [
        "curve.png",
        "curve.svg",
        "pointwise.png",
        "pointwise.svg",
    ]
    assert all(f.stat().st_size > 5000 for f in files)
    again = draw(analysis, tmp_path / "again")
    assert files[1].read_bytes() == again[1].read_bytes()


def texts(figure: Any) -> list[str]:
    from matplotlib.text import Text

    return [t.get_text() for t in figure.findobj(Text)]


def test_the_curve_shows_bars_line_and_what_was_left_out(analysis: Analysis) -> None:
    figure = curve(analysis)
    (axes,) = figure.axes
    assert axes.get_xlabel() == "Force in N"
    labels = axes.get_legend_handles_labels()[1]
    assert "y: not counted towards k" in labels
    assert any(label.startswith("x: k = 9") for label in labels)
    assert len(axes.containers) == 2  # error bars of two directions
    lines = {line.get_label(): line for line in axes.get_lines()}
    k_line = next(line for label, line in lines.items() if str(label).startswith("y: k ="))
    f, u = k_line.get_data()
    assert np.diff(f)[0] / np.diff(u)[0] == pytest.approx(57.42, rel=0.002)
    assert f[-1] == pytest.approx(75.0)


def test_the_mark_of_what_was_not_measured(analysis: Analysis) -> None:
    assert "EMULATED · INCOMPLETE" in texts(curve(analysis))
    assert "EMULATED · INCOMPLETE" in texts(pointwise(analysis))
    assert not any("EMULATED" in t for t in texts(curve(analyze(session()))))


def test_figures_of_nothing(tmp_path: Path) -> None:
    empty = analyze(table(run(softening, X)[:0]))
    assert "no data" in texts(curve(empty))
    assert len(draw(empty, tmp_path)) == 4


def test_a_folder_that_refuses(analysis: Analysis, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match=r"figures can't be written there .* --figures"):
        draw(analysis, tmp_path / "file")


CASES = sorted(
    p.parent for kind in ("gap-cases", "real") for p in SHARED.glob(f"{kind}/*/meta.yaml")
)


@pytest.mark.skipif(
    not CASES, reason="the labelled and real measurements are not beside the project"
)
@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_measurements_at_hand_are_analyzed(tmp_path: Path, every: int) -> None:
    from rig.tables import import_table

    for case in CASES[::every]:
        data = import_table(case / "samples.csv", case / "meta.yaml", tmp_path / "data.h5")
        result = analyze(data)
        json.dumps(result.to_json(), allow_nan=False)
        assert result.to_text()
        assert result.directions
        for direction in result.directions.values():
            assert direction.result.k is not None
            if case.parent.name == "gap-cases":
                assert direction.result.status == "ok"
                assert 10e3 < direction.result.k.value < 300e3
