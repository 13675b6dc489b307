"""Figures of a diagnosis: their numbers, their marks, and that odd data get a picture too."""

from __future__ import annotations

import csv
import io
import pickle
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from identification.gap.model.base import prediction
from rig import cli
from rig.dataset import write
from rig.diagnosis.diagnose import Diagnosis, diagnose
from rig.diagnosis.diagnose_text import LEAST_PROBABILITY, _share, render
from rig.diagnosis.gap_curve import curve, legs
from rig.diagnosis.gap_figures import draw
from rig.diagnosis.gap_layout import GREEN, blank, noise_axis
from rig.diagnosis.gap_map import _cells, _lines
from rig.diagnosis.gap_points import (
    FALLING,
    RISING,
    held_table,
    point_table,
    points,
    remainder_table,
    shown,
    write_table,
)
from rig.diagnosis.gap_ranking import change, probabilities, withheld
from rig.diagnosis.gap_residual import residual
from rig.digits import likely
from rig.report.gap_view import view_of
from rig.tables import import_table

META = """robot: none
directions: {x: [1, 0, 0], y: [0, 1, 0]}
instruments: {force: {standard_uncertainty_N: 0.1}, displacement: {standard_uncertainty_mm: 0.002}}
simulation: {stiffness_N_per_mm: {x: 95.0, y: 60.0}, stiffness_relative_sd: 0.1}
"""
IMPOSED = META.replace("robot: none", "robot: none\nimposed: displacement")
FIGURES = ("curve", "map", "residual", "probabilities", "withheld", "remainder")


def table(*, slip_mm: float = 0.08, repetitions: int = 2, samples: int = 2) -> str:
    """Steps up and down; y slips by `slip_mm` beyond 60 N, for good; x is linear."""
    rng = np.random.default_rng(5)
    out = ["direction,repetition,branch,step,time_s,force_N,displacement_mm"]
    for direction, k in (("x", 95.0), ("y", 60.0)):
        lasting = 0.0
        for repetition in range(1, repetitions + 1):
            steps = [("zero", 0, 0.0)]
            steps += [("loading", i, 20.0 * i) for i in range(1, 6)]
            steps += [("unloading", i, 20.0 * i) for i in range(4, 0, -1)]
            for t, (branch, step, force) in enumerate(steps):
                if direction == "y" and force > 60:
                    lasting = max(lasting, slip_mm * (force - 60) / 40)
                u = force / k + lasting + rng.normal(0, 0.002)
                at = 10 * t + 2 * np.arange(samples) / samples
                out += [
                    f"{direction},{repetition},{branch},{step},{s},{force + e:.4f},{u:.6f}"
                    for s, e in zip(at, rng.normal(0, 0.1, samples), strict=True)
                ]
    return "\n".join(out) + "\n"


def cycles(samples: int = 900) -> str:
    """A running recording through zero, with dry friction beside the spring."""
    t = np.arange(samples) / 10
    u = np.sin(2 * np.pi * t / 30)
    friction = 30 * np.tanh(50 * np.cos(2 * np.pi * t / 30))
    force = 95 * u + friction + np.random.default_rng(2).normal(0, 0.1, samples)
    rows = "".join(f"{a},x,{f:.4f},{d:.6f}\n" for a, f, d in zip(t, force, u, strict=True))
    return "time_s,direction,force_N,displacement_mm\n" + rows


def diagnosed(folder: Path, text: str, meta: str = META) -> Diagnosis:
    (folder / "samples.csv").write_text(text)
    (folder / "meta.yaml").write_text(meta)
    return diagnose(import_table(folder / "samples.csv", folder / "meta.yaml"))


@pytest.fixture(scope="module")
def slipped(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    return diagnosed(tmp_path_factory.mktemp("slip"), table())


def test_points_are_the_measurement_and_its_simulations(slipped: Diagnosis) -> None:
    r = slipped.result
    p = points(r)
    assert len(p.force) == 40  # 2 directions, 2 repetitions, 10 holds
    k = np.where(p.setup == 0, 95.0, 60.0)
    assert np.allclose(p.before, p.force / k, rtol=1e-9, atol=1e-12)
    assert np.allclose(p.measured, p.displacement)
    fitted = (prediction(r.bench)[: r.bench.rows.n] + r.fit.response) * 1e3
    hold, weight = r.bench.rows.hold, r.bench.rows.weight
    assert np.allclose(p.after, np.bincount(hold, weight * fitted) / np.bincount(hold, weight))
    rms = np.sqrt(np.mean(p.gap_after**2))
    assert rms < 0.2 * np.sqrt(np.mean(p.gap_before**2))
    assert p.sense.tolist()[:10] == [0, 1, 1, 1, 1, 1, 2, 2, 2, 2]


def test_table_of_points_has_units_and_names(slipped: Diagnosis) -> None:
    p = points(slipped.result)
    t: dict[str, Any] = dict(point_table(shown(slipped.result), p))
    assert "simulated_after_mm" in t
    assert "simulated_after_N" not in t
    assert set(t["direction"]) == {"x", "y"}
    assert np.allclose(t["gap_after_mm"], t["displacement_mm"] - t["simulated_after_mm"])


def test_words_that_share_the_doubt_are_told_together(slipped: Diagnosis) -> None:
    r = slipped.result
    line = next(t for t in render(r).splitlines() if t.startswith("Probability of being"))
    likely_ones = [w for w, p in r.probabilities.items() if p >= LEAST_PROBABILITY]
    assert all(f" {w} " in line for w in likely_ones)
    assert line.count(" %") == len(likely_ones) + 1
    rest = 1 - sum(r.probabilities[w] for w in likely_ones)
    assert line.endswith(f"all others together {likely(rest)}")


def test_withheld_table_begins_with_the_fit_and_ends_with_the_rivals(slipped: Diagnosis) -> None:
    r = slipped.result
    t = held_table(shown(r))
    assert t["judged_on"][0] == "fitted"
    assert t["before_rms_mm"][0] == pytest.approx(r.before * 1e3)
    assert list(t["explanation"][len(t["explanation"]) - len(r.runners_up) :]) == list(r.runners_up)
    assert t["after_rms_mm"][1] == pytest.approx(r.held_out[0].after * 1e3)


def test_the_axis_of_probabilities_ends_at_one_with_room_for_the_labels(
    slipped: Diagnosis,
) -> None:
    figure = probabilities(shown(slipped.result))
    figure.canvas.draw()
    (axes,) = figure.axes
    assert axes.get_xlim() == (0, 1)
    assert all(text.get_window_extent().x1 < figure.bbox.x1 for text in axes.texts)


def test_labels_over_short_changes_touch_no_marker(slipped: Diagnosis) -> None:
    """A change by a quarter: its label is wider than the line between its markers."""
    view = replace(shown(slipped.result), after=0.8 * slipped.result.before)
    figure = withheld(view)
    figure.canvas.draw()
    (axes,), point = figure.axes, figure.dpi / 72
    markers = [
        (x, y, (line.get_markersize() / 2 + line.get_markeredgewidth() / 2) * point)
        for line in axes.lines
        if line.get_marker() == "o" and len(line.get_xdata())
        for x, y in axes.transData.transform(line.get_xydata())
    ]
    for box in (text.get_window_extent() for text in axes.texts):
        for x, y, radius in markers:
            beside = x + radius < box.x0 or x - radius > box.x1
            assert beside or y + radius + point < box.y0 or y - radius - point > box.y1


def test_without_an_arm_a_spring_is_called_by_its_direction(tmp_path: Path) -> None:
    wrong = META.replace(
        "y: 60.0}, stiffness_relative_sd: 0.1", "y: 90.0}, stiffness_relative_sd: 0.05"
    )
    found = diagnosed(tmp_path, table(slip_mm=0), wrong)
    (effect,) = found.to_json()["effects"]
    assert (effect["name"], effect["form"]) == ("joint_stiffness_error", "direction y")
    assert list(effect["parameters"]) == ["factor_y"]
    assert effect["parameters"]["factor_y"]["value"] == pytest.approx(60 / 90, rel=0.01)
    assert "\n    factor_y = 0.66" in found.to_text()


@pytest.mark.parametrize(
    ("label", "said"),
    [
        ("joint 2", "direction y"),
        ("joints 1 and 2", "directions x and y"),
        ("all joints", "all directions"),
        ("all joints but 2", "all directions but y"),
        ("joint 1 T 1.5 s", "direction x T 1.5 s"),
    ],
)
def test_shapes_name_directions_where_there_are_no_joints(
    slipped: Diagnosis, label: str, said: str
) -> None:
    result = slipped.result
    shown = replace(result, effects=(replace(result.effects[0], label=label),))
    assert replace(slipped, result=shown).to_json()["effects"][0]["form"] == said


@pytest.mark.slow
def test_what_a_report_draws_travels_without_the_samples(tmp_path: Path) -> None:
    sizes = []
    for samples in (2, 60):  # of a hold
        found = diagnosed(tmp_path, table(samples=samples))
        sizes.append(len(pickle.dumps(view_of(found, "a", png=False))))
    assert sizes[1] < sizes[0] + 1000
    assert sizes[0] < 20_000


BANNER = "EMULATED: these values come from simulated devices; nothing was measured."


@pytest.fixture(scope="module")
def drawn(slipped: Diagnosis, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Files of a diagnosis of emulated data, in a folder that was not there before."""
    marked = Diagnosis(slipped.dataset, slipped.result, (BANNER,))
    return draw(marked, tmp_path_factory.mktemp("drawn") / "new", "slip.h5")


def test_every_figure_is_written_with_its_numbers(slipped: Diagnosis, drawn: list[Path]) -> None:
    names = {p.name for p in drawn}
    assert {f"gap_{f}.{kind}" for f in FIGURES for kind in ("png", "svg")} <= names
    assert {p for p in names if p.endswith(".csv")} == {
        "gap_points.csv",
        "gap_probabilities.csv",
        "gap_withheld.csv",
        "gap_remainder.csv",
    }
    assert all(p.stat().st_size > 100 for p in drawn)
    lines = drawn[0].with_name("gap_probabilities.csv").read_text().splitlines()
    assert lines[1] == f"# rig diagnose slip.h5: {slipped.result.verdict}"
    total = sum(float(row["probability"]) for row in csv.DictReader(lines[2:]))
    assert total == pytest.approx(1, abs=1e-6)


def test_emulated_data_are_marked_in_every_figure_and_table(drawn: list[Path]) -> None:
    for path in drawn:
        if path.suffix == ".svg":
            # letters are drawn as paths; matplotlib notes each text as a comment
            assert "<!-- EMULATED -->" in path.read_text(), path.name
        if path.suffix == ".csv":
            assert path.read_text().startswith(f"# {BANNER}\n"), path.name


@pytest.mark.slow
def test_imposed_displacement_is_told_in_newtons(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, cycles(), IMPOSED)
    p = points(found.result)
    t: dict[str, Any] = dict(point_table(shown(found.result), p))
    assert np.allclose(t["simulated_before_N"], 95 * p.displacement, atol=1e-6)
    assert np.allclose(t["gap_before_mm"], p.force / 95 - p.displacement, atol=1e-6)
    # rising while the displacement rises, though on the plateau the force only scatters
    speed = np.gradient(p.displacement)
    moving = np.abs(speed) > 0.3 * np.abs(speed).max()
    assert np.mean((p.sense == 1) == (speed > 0), where=moving) > 0.95
    assert len(draw(found, tmp_path / "figures")) == 16
    assert len(remainder_table(shown(found.result), _remainder(found))["load_N"]) > 10


def _remainder(found: Diagnosis) -> Any:
    from identification.gap.answer.remainder import remainder

    return remainder(found.result.engine, found.result.fit)


@pytest.mark.parametrize(
    "rows",
    [
        pytest.param("x,1,loading,1,0,10,0.1\n", id="one sample"),
        pytest.param(
            "".join(f"x,1,loading,{i},{i},50,0.5\n" for i in range(9)),
            id="constant force",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "".join(f"x,1,loading,{i},{i},0,0\n" for i in range(50)),
            id="all zero",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_thin_data_are_drawn_too(rows: str, tmp_path: Path) -> None:
    text = table().splitlines()[0] + "\n" + rows
    assert len(draw(diagnosed(tmp_path, text), tmp_path / "figures")) == 16


def test_cells_cover_the_range_without_holes() -> None:
    x, gap = np.array([3.0, 0.0, 1.0]), np.array([30.0, 0.0, 10.0])
    assert _cells(x, gap, 3.0) == [(-0.5, 0.5, 0.0), (0.5, 2.0, 10.0), (2.0, 4.0, 30.0)]
    many = np.linspace(0, 1, 1000) ** 2
    cells = _cells(many, many, 1.0)
    assert all(a[1] == b[0] for a, b in pairwise(cells))
    assert cells[0][0] == 0.0
    assert cells[-1][1] == 1.0
    assert all(low <= value <= high for low, high, value in cells)


def test_no_line_crosses_what_nobody_looked_at(tmp_path: Path) -> None:
    steps = [("zero", 0, 0.0), *(("loading", i, 20.0 * i) for i in (1, 2, 3)), ("zero", 0, 0.0)]
    rows = [f"x,{r},{b},{s},{i},{f},{f / 95}" for r in (1, 2) for i, (b, s, f) in enumerate(steps)]
    text = "\n".join([table().splitlines()[0], *rows, ""])
    result = diagnosed(tmp_path, text).result
    p = points(result)
    found = [leg.tolist() for leg in legs(p, p.force, 0)]
    assert found == [[0, 1, 2, 3], [4], [5, 6, 7, 8], [9]]
    figure = curve(shown(result), p)
    upper, lower = figure.axes[:2]
    told = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {f"gap {w}: load taken off" for w in ("before", "after")} <= set(told)
    for axes in (upper, lower):  # a point that no line reaches is drawn all the same
        lone = [line for line in axes.lines if len(line.get_xdata()) == 1]
        assert len(lone) == (2 if axes is upper else 4)
        assert {line.get_marker() for line in lone} == {"."}


def test_many_points_are_seen_beside_the_lines_of_many_runs(
    slipped: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rig.diagnosis.gap_curve.MANY", 5)
    upper, _, lower, _ = curve(shown(slipped.result), points(slipped.result)).axes
    dots = [line for line in upper.lines if str(line.get_label()).startswith("measured, loading")]
    after = [line for line in upper.lines if line.get_color() == GREEN]
    assert dots[0].get_zorder() > max(line.get_zorder() for line in after)
    gaps = [line for line in lower.lines if len(line.get_xdata()) > 2]
    assert gaps
    assert {line.get_linestyle() for line in gaps} == {"None"}


@pytest.mark.parametrize(
    ("sense", "load", "found"),
    [
        ([0, 1, 1, 0], [0, 10, 100, 0], [[0, 1, 2], [3]]),  # a large step up is a step
        ([0, 1, 1, 0], [0, 100, 40, 0], [[0, 1, 2, 3]]),  # a cycle's last small step
        ([0, 1, 2, 0], [0, 100, 90, 0], [[0, 1, 2, 3]]),
    ],
)
def test_only_the_load_taken_off_at_once_ends_a_line(
    sense: list[int], load: list[float], found: list[list[int]]
) -> None:
    nil = np.zeros(4, int)
    run: Any = SimpleNamespace(setup=nil, run=nil, sense=np.array(sense))
    assert [leg.tolist() for leg in legs(run, np.array(load), 0)] == found


def test_lines_follow_the_load_step_by_step(slipped: Diagnosis) -> None:
    p = points(slipped.result)
    runs = [np.flatnonzero((p.setup == 1) & (p.run == i)) for i in np.unique(p.run[p.setup == 1])]
    assert [leg.tolist() for leg in legs(p, p.force, 1)] == [run.tolist() for run in runs]


@pytest.mark.parametrize(
    ("sense", "last"),
    [([RISING, RISING, 0], "x: back at zero"), ([RISING, FALLING, 0], "x: unloading")],
)
def test_what_only_came_back_to_zero_was_not_read_while_unloading(
    sense: list[int], last: str
) -> None:
    force, nil = np.array([50.0, 100 if sense[1] == RISING else 40, 0]), np.zeros(3, int)
    run: Any = SimpleNamespace(setup=nil, run=nil, sense=np.array(sense), force=force)
    seen: Any = SimpleNamespace(setups=(("", "x"),), setup_name=lambda _: "x")
    assert [name for name, _ in _lines(seen, run)] == ["x: loading", last]


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "less than 1 %"),
        (0.004, "less than 1 %"),
        (0.005, "less than 1 %"),
        (0.006, "1 %"),
        (0.61, "61 %"),
    ],
)
def test_what_is_there_is_more_than_nothing_of_the_gap(share: float, text: str) -> None:
    assert _share(share) == text


def test_change_of_the_gap_in_words() -> None:
    assert change(1.8, 0.0679, (18.04, 38.86)) == "26.5 times smaller (18 to 38.9)"
    assert change(1.0, 1.25, (0.5, 0.8)) == "1.25 times larger (1.25 to 2)"
    assert change(2.0, 1.0) == "2 times smaller"
    assert change(2.0, 1.0, (2.0, 2.0)) == "2 times smaller"  # nothing told how far it is off
    assert change(2.0, 1.0, (0.0, 3.0)) == "2 times smaller"
    assert change(0.0, 0.0) == "unchanged"


def test_small_gaps_show_beside_large_ones() -> None:
    axes = blank(4, 3).add_subplot()
    axes.plot([0, 1], [0.0, 6.0])
    noise_axis(axes, 1.0, 6.0)
    assert axes.get_yscale() == "linear"
    axes.plot([0, 1], [-0.02, 6.0])
    noise_axis(axes, 0.003, 6.0)
    assert axes.get_yscale() == "symlog"
    assert axes.get_yticks().tolist() == [-1, -0.1, -0.01, 0, 0.01, 0.1, 1]
    assert axes.yaxis.get_major_formatter()(-0.01) == "\N{MINUS SIGN}0.01"


@pytest.mark.parametrize(("further", "leaves"), [(3.0, False), (40.0, True)])
def test_a_simulation_that_is_far_off_does_not_hide_what_was_measured(
    slipped: Diagnosis, further: float, leaves: bool
) -> None:
    r, p = shown(slipped.result), points(slipped.result)
    figure = curve(r, replace(p, before=further * p.before))
    for s, axes in enumerate(a for a in figure.axes if a.get_title()):
        low, high = axes.get_ylim()
        measured, before = p.displacement[p.setup == s], further * p.before[p.setup == s]
        assert low < measured.min()
        assert high > measured.max()
        assert bool(high < before.max()) is leaves
        assert high - low < 4 * np.ptp(measured)


def test_the_noise_band_is_as_wide_as_each_point_s_own_noise(slipped: Diagnosis) -> None:
    """y is softer: there the same noise of the force is more of the displacement."""
    r, p = shown(slipped.result), points(slipped.result)
    x, y = (float(np.median(p.noise[p.setup == s])) for s in (0, 1))
    assert y > 1.1 * x
    each = [2 * p.noise[p.setup == s].max() for s in (0, 1)]
    assert [b for axes in curve(r, p).axes for b in _bands(axes)] == pytest.approx(each)
    left, right = residual(r, p).axes
    assert _bands(left) == pytest.approx(each)
    assert _bands(right) == pytest.approx([2 * p.noise.max()])


def _bands(axes: Any) -> list[float]:
    """Upper edges of what is filled."""
    return [float(c.get_paths()[0].vertices[:, 1].max()) for c in axes.collections]


def test_tables_keep_nine_digits_and_leave_out_what_is_not_defined(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_table({"word": ["a", "b,c"], "x_mm": np.array([1 / 3, np.nan])}, ["first"], path)
    text = path.read_text()
    assert text == '# first\nword,x_mm\na,0.333333333\n"b,c",\n'
    assert list(csv.DictReader(io.StringIO(text.split("\n", 1)[1])))[1]["word"] == "b,c"


def test_command_writes_the_figures_and_refuses_a_file_for_a_folder(tmp_path: Path) -> None:
    (tmp_path / "samples.csv").write_text(table(repetitions=1))
    (tmp_path / "meta.yaml").write_text(META)
    write(import_table(tmp_path / "samples.csv", tmp_path / "meta.yaml"), tmp_path / "d.h5")
    args = ["diagnose", str(tmp_path / "d.h5"), "--json", str(tmp_path / "d.json"), "--figures"]
    done = CliRunner().invoke(cli.app, [*args, str(tmp_path / "new")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "new/gap_curve.png").exists()
    refused = CliRunner().invoke(cli.app, [*args, str(tmp_path / "d.h5")])
    assert "d.h5 is a file, no folder" in str(refused.exception)


@pytest.mark.parametrize("remembers", [False, True])
def test_what_remembers_is_simulated_run_by_run(slipped: Diagnosis, remembers: bool) -> None:
    """Sorted by force, ways there and back would be one zigzag."""
    told, p = shown(slipped.result), points(slipped.result)
    figure = curve(replace(told, remembers=remembers), p)
    before = [line for line in figure.axes[0].lines if line.get_linestyle() == "--"]
    runs = len(list(legs(p, p.force, 0)))
    assert runs > 1
    assert len(before) == (runs if remembers else 1)
    assert sum(not str(line.get_label()).startswith("_") for line in before) == 1
