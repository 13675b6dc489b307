"""Second values to curves: every assumption that `rig.reduce` states."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from identification.curve import Curve, Point
from identification.stiffness import Options, analyze_curve
from identification.turns import turning_points
from rig.passes import TURN, binned, is_held
from rig.reduce import curves
from tests.unit.stiffness_tables import Table, meta, run, table

LEVELS = (20.0, 40.0, 60.0, 80.0)


def only(data: Table) -> Curve:
    (curve,) = curves(data).values()
    return curve


def loading(curve: Curve) -> list[Point]:
    return [p for p in curve.points if p.branch == "loading"]


def test_levels_are_means_in_si() -> None:
    curve = only(table(run(lambda f: f / 100, LEVELS)))
    assert [p.force for p in loading(curve)] == pytest.approx(LEVELS)
    assert [p.displacement for p in loading(curve)] == pytest.approx([f * 1e-5 for f in LEVELS])
    assert (curve.origin, curve.held, curve.gain_sd_force) == (True, True, 0.005)


def test_a_drift_between_two_plateaus_is_taken_off() -> None:
    curve = only(table(run(lambda f: f / 100, LEVELS, zero_N=lambda t: 3.0 + 0.05 * t)))
    assert [p.force for p in loading(curve)] == pytest.approx(LEVELS, abs=1e-9)


def test_one_plateau_is_taken_off_as_it_is_and_said_to_be_single() -> None:
    rows = run(lambda f: f / 100, LEVELS, zero_N=lambda t: 3.0, zeros=(4, 0))
    curve = only(table(rows))
    assert [p.force for p in loading(curve)] == pytest.approx(LEVELS)
    assert "1 of 1 runs have one zero-load plateau" in curve.notes[0]


def test_without_plateaus_nothing_is_taken_off_and_the_origin_is_unknown() -> None:
    rows = run(lambda f: f / 100, LEVELS, zero_N=lambda t: 3.0, zeros=(0, 0))
    curve = only(table(rows))
    assert [p.force for p in loading(curve)] == pytest.approx([f + 3.0 for f in LEVELS])
    assert not curve.origin
    said = "No run has a zero-load plateau: force and displacement are taken as measured."
    assert curve.notes == (said,)


@pytest.mark.parametrize(
    ("without", "said"),
    [
        (
            {2},
            "Repetition 2 has no zero-load plateau: force and displacement are taken as measured.",
        ),
        ({1, 3}, "Repetitions 1 and 3 have no zero-load plateau: "),
        ({1, 2, 4}, "Repetitions 1, 2 and 4 have no zero-load plateau: "),
    ],
)
def test_repetitions_without_a_plateau_are_listed_in_words(without: set[int], said: str) -> None:
    rows = []
    for n in (1, 2, 3, 4):
        zeros = (0, 0) if n in without else (4, 4)
        rows += run(lambda f: f / 100, LEVELS, repetition=n, zeros=zeros)
    assert only(table(rows)).notes[0].startswith(said)


def test_the_zero_lines_uncertainty_is_part_of_a_levels() -> None:
    quiet = loading(only(table(run(lambda f: f / 100, LEVELS))))
    random = np.random.default_rng(1)
    noise = {t: 0.5 * random.standard_normal() for t in range(100)}
    rows = run(lambda f: f / 100, LEVELS, zero_N=lambda t: noise[int(t)] if t < 4 else 0.0)
    loud = loading(only(table(rows)))
    scatter = np.std([noise[t] for t in range(4)], ddof=1) / 2.0
    assert quiet[0].u_force == pytest.approx(0.1)
    # the first level stands at 5.5 s, between plateaus at 1.5 and 21.5 s; the line's slope itself
    # adds a little scatter within the hold
    assert loud[0].u_force == pytest.approx(math.hypot(0.1, 0.8 * scatter), rel=1e-4)
    assert loud[-1].u_force < loud[0].u_force


def test_each_repetition_counts_from_its_own_unloaded_position() -> None:
    rows = run(lambda f: f / 100, LEVELS)
    rows += run(lambda f: f / 100, LEVELS, repetition=2, datum_mm=0.25)
    curve = only(table(rows))
    assert [p.displacement for p in loading(curve)[4:]] == pytest.approx([f * 1e-5 for f in LEVELS])
    assert "lie 0.25 mm apart" in curve.notes[0]
    reset = only(table(rows, meta=meta(datum="repetition")))
    assert reset.notes == ()


def test_what_remains_after_the_run_is_not_taken_for_a_drift_of_the_laser() -> None:
    rows = run(lambda f: f / 100, LEVELS)
    rows[-4:] = [(*row[:-1], 0.5) for row in rows[-4:]]
    curve = only(table(rows))
    assert [p.displacement for p in loading(curve)] == pytest.approx([f * 1e-5 for f in LEVELS])
    assert curve.points[-1].displacement == pytest.approx(0.5e-3)


def test_discarded_samples_do_not_count() -> None:
    rows = run(lambda f: f / 100, LEVELS)
    wrong = [(*row[:6], 999.0, 99.0) for row in rows]
    data = table([*wrong, *rows])
    data.columns["discarded"][: len(wrong)] = True
    assert [p.force for p in loading(only(data))] == pytest.approx(LEVELS)


def creeping() -> list[tuple[float, str, str, int, str, int, float, float]]:
    rows = run(lambda f: f / 100, LEVELS)
    return [
        (*row[:-1], row[-1] - 0.1) if row[4] == "loading" and i % 4 < 2 else row
        for i, row in enumerate(rows)
    ]


def test_an_imported_hold_counts_with_its_second_half() -> None:
    curve = only(table(creeping()))
    assert [p.displacement for p in loading(curve)] == pytest.approx([f * 1e-5 for f in LEVELS])
    assert {p.n for p in loading(curve)} == {2}


def test_samples_known_to_be_settled_count() -> None:
    data = table(creeping())
    data.columns["settled"] = np.array([float(i % 4 == 3) for i in range(len(creeping()))])
    assert {p.n for p in loading(only(data))} == {1}
    assert not [note for note in only(data).notes if "settled" in note]
    data.columns["settled"][:] = 0.0
    assert {p.n for p in loading(only(data))} == {2}  # none settled: nearest to rest at its end


def resumed_midway(repetitions: tuple[int, ...]) -> Table:
    """As earlier versions went on: the third and the fourth level after another tare."""
    rows, segment = [], []
    for n in repetitions:
        rows += run(lambda f: f / 100, LEVELS, repetition=n)
        midway = n == 2
        segment += [3 * n + (midway and i >= 12) for i in range(24)]
    data = table(rows)
    data.columns["segment"] = np.array(segment)
    return data


def test_a_repetition_that_was_resumed_midway_is_left_out() -> None:
    curve = only(resumed_midway((1, 2, 3)))
    assert {p.repetition for p in curve.points} == {1, 3}
    assert curve.notes[0] == (
        "Repetition 2 was interrupted and taken up again midway, with the force tared anew and "
        "from no load: left out."
    )


def test_the_only_repetition_counts_with_a_warning_if_it_was_resumed_midway() -> None:
    curve = only(resumed_midway((2,)))
    assert {p.repetition for p in curve.points} == {2}
    assert "from no load: it counts, because there is no other; measure it" in curve.notes[0]


def test_a_sample_without_value_is_skipped() -> None:
    rows = run(lambda f: f / 100, LEVELS)
    rows[7] = (*rows[7][:-1], math.nan)
    curve = only(table(rows))
    assert loading(curve)[0].n == 1
    assert loading(curve)[0].displacement == pytest.approx(2e-4)


def test_interleaved_runs_are_told_apart() -> None:
    x1 = run(lambda f: f / 100, LEVELS)
    y1 = run(lambda f: f / 50, LEVELS, direction="y")
    x2 = run(lambda f: f / 100, LEVELS, repetition=2)
    found = curves(table([*x1, *y1, *x2]))
    assert list(found) == [("P1", "x"), ("P1", "y")]
    assert [p.repetition for p in loading(found["P1", "x"])] == [1] * 4 + [2] * 4


def cycle(n: int, amplitude: float = 10.0, periods: float = 3.0) -> Table:
    t = np.linspace(0.0, periods, n)
    force = amplitude * np.sin(2 * math.pi * t)
    columns = {
        "time_s": t,
        "pose": np.full(n, ""),
        "direction": np.full(n, "x"),
        "repetition": np.ones(n, dtype=np.int64),
        "branch": np.full(n, "cycle"),
        "step": np.full(n, -1),
        "force_N": force,
        "displacement_mm": force / 40.0 + 0.7,
        "discarded": np.zeros(n, dtype=bool),
    }
    return Table(columns, meta())


def test_a_cycle_is_cut_at_its_turning_points_and_binned() -> None:
    curve = only(cycle(6000))
    assert not curve.held
    assert not curve.origin
    assert "6000 samples: cut into 7 passes" in curve.notes[0]
    assert {p.branch for p in curve.points} == {"loading", "unloading"}
    result = analyze_curve(curve)
    assert result.k is not None
    assert result.k.value == pytest.approx(40e3, rel=1e-9)
    assert result.intercept == pytest.approx(0.7e-3, rel=1e-9)


def test_a_ramp_within_one_step_is_continuous() -> None:
    n = 200
    ramp = np.linspace(0.0, 50.0, n)
    rows = [(float(i), "", "x", 1, "loading", 1, f, f / 25.0) for i, f in enumerate(ramp)]
    curve = only(table(rows))
    assert not curve.held
    assert len(curve.points) == 20
    result = analyze_curve(curve)
    assert result.k is not None
    assert result.k.value == pytest.approx(25e3, rel=1e-9)


def named_late() -> Table:
    """Levels of 30 s, with ramps of 10 s whose first 7 samples bear the name of the level they
    leave."""
    ends, rows = [0.0, 10.0, 20.0, 30.0, 60.0, 0.0, 0.0], []
    for a, b in pairwise(ends):
        force = [*[a] * 30, *(a + (b - a) * k / 10 for k in range(1, 11))]
        for k, f in enumerate(force):
            name = a if k < 37 else b
            branch = "loading" if name else "zero"
            rows.append((float(len(rows)), "", "x", 1, branch, int(name), f, f / 100))
    return table(rows)


def test_a_way_under_the_name_of_the_level_it_leaves_counts_to_the_next() -> None:
    curve = only(named_late())
    assert curve.held
    assert [p.force for p in loading(curve)] == pytest.approx([10.0, 20.0, 30.0, 60.0])
    assert [p.displacement for p in loading(curve)] == pytest.approx([1e-4, 2e-4, 3e-4, 6e-4])
    gap = named_late()  # a reading that is missing
    gap.columns["force_N"][12] = np.nan
    assert only(gap).held
    data = named_late()  # what the procedure recorded stands where it says
    data.columns["settled"] = np.ones(len(data.columns["step"]))
    assert not only(data).held


@pytest.mark.parametrize("missing", [(), (0, 1, 100), tuple(range(45, 60))])
def test_a_staircase_whose_steps_bear_no_numbers_has_levels(missing: tuple[int, ...]) -> None:
    data = named_late()
    data.columns["step"][:] = -1
    data.columns["force_N"][list(missing)] = np.nan
    curve = only(data)
    assert curve.held
    assert [p.force for p in loading(curve)] == pytest.approx([10.0, 20.0, 30.0, 60.0])
    assert [p.step for p in loading(curve)] == [1, 2, 3, 4]
    assert "No steps are numbered" in curve.notes[0]
    assert "No steps" not in " ".join(only(named_late()).notes)
    data.columns["force_N"][:] = data.columns["time_s"] / 10  # a ramp has none
    data.columns["displacement_mm"][:] = data.columns["force_N"] / 100
    assert not only(data).held


def test_held_cycles_are_sorted_by_whether_the_load_grows() -> None:
    forces = (10.0, 20.0, 10.0, -10.0, -20.0, -10.0)
    rows = [
        (float(i), "", "x", 1, "cycle", i // 4 + 1, forces[i // 4], forces[i // 4] / 10)
        for i in range(24)
    ]
    branches = [p.branch for p in only(table(rows)).points]
    assert branches == ["loading", "loading", "unloading", "loading", "loading", "unloading"]


def test_turning_points_ignore_noise() -> None:
    t = np.arange(1000)
    force = np.sin(t / 50.0) + 0.05 * np.sin(37.0 * t)
    turns = turning_points(force, TURN * float(np.ptp(force)))
    expected = [50 * math.pi * (i + 0.5) for i in range(6)]
    assert len(turns) == 6
    assert np.abs(np.array(turns) - expected).max() < 20


def test_a_recording_that_begins_at_a_turn_has_no_empty_pass() -> None:
    assert turning_points(np.array([0.0, 5.0, 10.0, 5.0, 0.0]), TURN * 10.0) == [2]
    assert turning_points(np.array([10.0, 5.0, 0.0, 5.0, 10.0]), TURN * 10.0) == [2]
    assert turning_points(np.zeros(5), 0.0) == []


def test_two_samples_of_a_level_count_as_held() -> None:
    branch, step = np.array(["loading"] * 4), np.array([1, 1, 2, 2])
    pair, ramp = np.array([10.0, 11.0, 20.0, 21.0]), np.array([0.0, 10.0, 20.0, 30.0])
    assert is_held([(branch, step, pair, pair)])
    assert not is_held([(branch, np.full(4, 1), ramp, ramp)])


def test_bins_of_a_falling_pass_begin_with_the_highest() -> None:
    force = np.linspace(10.0, 0.0, 101)
    numbers = [number for number, *_ in binned(force, force, 0.0, 10.0)]
    assert numbers == list(range(20, 0, -1))


@pytest.mark.parametrize("scale", [1e-7, 1.0, 1e4])
def test_no_threshold_is_absolute(scale: float) -> None:
    data = cycle(2000, amplitude=10.0 * scale)
    data.columns["displacement_mm"] = data.columns["force_N"] / 40.0
    data.meta.instruments.force.standard_uncertainty_N = 0.01 * scale
    assert len(only(data).points) == len(only(cycle(2000)).points)


def test_a_force_that_is_zero_throughout_is_undefined() -> None:
    data = cycle(500)
    data.columns["force_N"][:] = 0.0
    result = analyze_curve(only(data))
    assert result.status == "undefined"
    assert "undefined" in result.sentence


def test_a_million_samples_of_thousands_of_cycles() -> None:
    curve = only(cycle(1_000_000, periods=2000.0))
    assert "cut into 4001 passes" in curve.notes[0]
    assert "every 41 cycles as a repetition" in curve.notes[0]
    assert {p.repetition for p in curve.points} == set(range(1, 50))
    assert sum(p.n for p in curve.points) == 1_000_000


def ended(*, recorded: bool) -> Table:
    """An arm that gives way behind 60 N, with the displacement's limit in the way of step 4; files
    of earlier versions have no row there."""
    reached = (20.0, 40.0, 60.0, 65.0)[: 4 if recorded else 3]
    data = table(run(lambda f: f / 100 if f < 61 else 6.0, reached))
    rows = 4 + 3 * 4  # the zero plateau, and three levels
    top = {"kind": "top", "branch": "loading", "step": 4, "sample": rows, "text": ""}
    return replace(data, events=[top])


def test_a_level_at_which_the_displacement_ended_loading_is_no_part_of_k() -> None:
    curve = only(ended(recorded=True))
    assert curve.ends == {4}
    found = analyze_curve(curve)
    assert found.k is not None
    assert found.k.value == pytest.approx(1e5)
    assert [e.step for e in found.excluded] == [4]
    assert [level.step for level in found.levels if level.branch == "loading"] == [1, 2, 3, 4]
    every = analyze_curve(curve, Options(keep_after_knee=True))
    assert every.k is not None
    assert every.k.value < found.k.value
    assert "without that level k is 100 N/mm" in every.notes[-1]


def test_an_end_of_loading_without_rows_in_use_leaves_the_levels_as_they_are() -> None:
    assert not only(ended(recorded=False)).ends
    data = ended(recorded=True)
    data.columns["discarded"][data.columns["step"] == 4] = True
    assert not only(data).ends
