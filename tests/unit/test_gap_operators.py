"""Operators with memory, and rows: against closed forms and conservation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.gap.data import GapData, Instruments, Setup
from identification.gap.model import flowing
from identification.gap.model.flowing import flowing_play
from identification.gap.model.history import (
    PEAK,
    averaged,
    bristles,
    delayed,
    play,
    rests,
    retarded,
)
from identification.gap.model.path import load_path, worked_in
from identification.gap.recording.rows import Rows, reduce_rows


def bench_data(force: np.ndarray, displacement: np.ndarray, **changes: object) -> GapData:
    """A bench without an arm: one spring of 1e5 N/m."""
    n = len(force)
    setup = Setup(
        "",
        "x",
        np.array([1.0, 0, 0]),
        np.ones(1),
        np.eye(3)[1:],
        np.zeros((2, 1)),
        np.zeros((1, 3)),
        np.zeros((1, 1)),
        np.zeros(3),
        np.zeros(0),
        np.zeros(1),
    )
    zeros = np.zeros(n, dtype=np.int64)
    values: dict[str, object] = {
        "arm": False,
        "setups": (setup,),
        "time": np.arange(n, dtype=float),
        "session": None,
        "run": zeros,
        "setup": zeros,
        "repetition": zeros + 1,
        "branch": zeros + 1,
        "step": np.arange(n, dtype=np.int64) + 1,
        "force": force,
        "displacement": displacement,
        "compliance": np.array([1e-5]),
        "compliance_relative_sd": np.array([0.1]),
        "instruments": Instruments(0.1, 1e-6, 0.005, 0.003),
    }
    return GapData(**(values | changes))  # type: ignore[arg-type]


def fresh(n: int) -> np.ndarray:
    return np.arange(n) == 0


def test_play_follows_after_its_radius_and_stays_on_return() -> None:
    load = np.array([0.0, 1.0, 3.0, 2.0, 0.0, -3.0])[:, None]
    state = play(load, np.array([1.0]), fresh(6), fresh(6))[:, 0]
    assert state.tolist() == [0.0, 0.0, 2.0, 2.0, 1.0, -2.0]


def test_play_loses_its_memory_only_where_told() -> None:
    load = np.array([0.0, 3.0, 0.0, 0.0])[:, None]
    rest = np.array([True, False, False, True])
    kept = play(load, np.array([1.0]), rest, fresh(4))[:, 0]
    lost = play(load, np.array([1.0]), rest, rest)[:, 0]
    assert kept.tolist() == [0.0, 2.0, 1.0, 1.0]
    assert lost[-1] == 0.0


@given(st.lists(st.floats(-100, 100), min_size=2, max_size=30), st.floats(0.01, 50))
def test_stop_never_carries_more_than_its_strength(path: list[float], radius: float) -> None:
    load = np.array(path)[:, None]
    state = play(load, np.array([radius]), fresh(len(path)), fresh(len(path)))
    assert np.all(np.abs(load - state) <= radius + 1e-9)


@given(st.lists(st.floats(-100, 100), min_size=2, max_size=30), st.booleans())
def test_bristles_stay_within_one(path: list[float], elastic: bool) -> None:
    z = bristles(np.array(path), np.array([3.0, 30.0]), fresh(len(path)), elastic)
    assert np.all(np.abs(z) <= 1 + 1e-12)


def test_dahl_is_exact_on_the_virgin_curve_and_bouc_wen_lets_go_linearly() -> None:
    load = np.array([0.0, 5.0, 10.0, 9.0])
    dahl = bristles(load, np.array([4.0]), fresh(4), elastic=False)[:, 0]
    wen = bristles(load, np.array([4.0]), fresh(4), elastic=True)[:, 0]
    assert dahl[:3] == pytest.approx(1 - np.exp(-load[:3] / 4), abs=1e-12)
    assert wen[3] == pytest.approx(wen[2] - 0.25, abs=1e-12)
    assert dahl[3] == pytest.approx(-1 + (1 + dahl[2]) * np.exp(-0.25), abs=1e-12)


def test_worked_in_friction_starts_where_a_cycle_ends() -> None:
    load = np.array([0.0, 10.0, 0.0, 10.0])
    path = worked_in(load_path(load, fresh(4), fresh(4), None, np.zeros(4)))
    assert path.plays(np.array([2.0]))[:, 0].tolist() == [2.0, 8.0, 2.0, 8.0]


def test_a_load_that_went_beyond_leaves_what_remembers_on_its_other_branch() -> None:
    load, beyond = np.array([0.0, 5.0, 10.0, 4.0]), np.array([0.0, 0.0, 0.2, -1.0])
    straight = load_path(load, fresh(4), fresh(4), None, 0 * beyond)
    path = load_path(load, fresh(4), fresh(4), None, beyond)
    radius = np.array([1.0])
    assert path.load.tolist() == [0.0, 5.0, 12.0, 10.0, 0.0, 4.0]
    assert straight.plays(radius)[:, 0].tolist() == [0.0, 4.0, 9.0, 5.0]
    assert path.plays(radius)[:, 0].tolist() == [0.0, 4.0, 11.0, 3.0]
    assert path.bristles(radius, elastic=False)[2, 0] < 0 < straight.bristles(radius, False)[2, 0]
    assert worked_in(path).load.tolist() == [12.0, 0.0, *path.load]
    assert worked_in(path).plays(radius)[:, 0].tolist() == [1.0, 4.0, 11.0, 3.0]


def test_a_fresh_start_and_a_rest_come_before_the_load_goes_beyond() -> None:
    load, beyond, again = np.array([10.0, 10.0]), np.array([0.0, 0.5]), np.array([True, True])
    weight = np.array([3.0, 3.0])
    path = load_path(load, again, again, weight, beyond)
    assert path.rest.tolist() == path.fresh.tolist() == [True, True, False]
    assert path.plays(np.array([1.0]))[:, 0].tolist() == [10.0, 12.0]  # of 12 and 14 as it hung
    assert path.weight is not None
    assert path.weight.tolist() == [3.0] * 3


def rows_of(data: GapData) -> Rows:
    return reduce_rows(data)


def test_retardation_is_exact_under_a_held_load() -> None:
    """A step half way between two samples, then a hold: z = 1 - exp(-t/T)."""
    n, T = 60, 10.0
    step = np.where(np.arange(n) < 1, 0, 1)
    force = np.where(step > 0, 1.0, 0.0)
    data = bench_data(force, force * 1e-5, step=step.astype(np.int64))
    rows = rows_of(data)
    z = retarded(rows.force[:, None], np.array([T]), rows, fresh(rows.n))[:, 0]
    t = rows.time - 0.5  # the load stands from there
    held = rows.time >= 1.0
    assert z[held] == pytest.approx(1 - np.exp(-t[held] / T), abs=1e-9)


STRAIGHT, BEYOND = np.zeros(6), np.array([0.0, 0.0, 0.3, 0.0, -0.25, 0.0])
HANDS = pytest.mark.parametrize("beyond", [STRAIGHT, BEYOND], ids=["straight", "too far"])


def staircase(beyond: np.ndarray) -> tuple[Rows, np.ndarray, np.ndarray]:
    """Rows of holds of six samples, the last ones in one row; the clock and load that made them:
    a ramp from half a second after the last sample to half a second before the next, in which it
    goes beyond the level by a share of it, and back."""
    start = 10.0 * np.arange(6)
    time = (start[:, None] + np.arange(6.0)).ravel()
    level = 10.0 * np.array([0, 1, 2, 3, 2, 1])
    step = np.repeat(np.arange(6), 6)
    data = bench_data(level[step], level[step] * 1e-5, step=step.astype(np.int64), time=time)
    far = start[beyond != 0] - 0.5 - 4.0 * (1 - PEAK)
    corner = np.concatenate([start - 0.5, start + 5.5, far])
    there = np.concatenate([level, level, (level * (1 + beyond))[beyond != 0]])
    order, grid, rows = np.argsort(corner), np.arange(0.0, 56.0, 1e-3), rows_of(data)
    overshoot = np.zeros(rows.n)
    overshoot[rows.edges] = beyond
    load = np.interp(grid, corner[order], there[order])
    return replace(rows, overshoot=overshoot), grid, load


@HANDS
def test_retardation_follows_a_staircase_of_thinned_holds(beyond: np.ndarray) -> None:
    rows, grid, load = staircase(beyond)
    z, state = np.zeros_like(grid), 0.0
    for i in range(1, len(grid)):
        state += (0.5 * (load[i] + load[i - 1]) - state) * -np.expm1(-1e-3 / 3.0)
        z[i] = state
    found = retarded(rows.force[:, None], np.array([3.0]), rows, fresh(rows.n))[:, 0]
    alone = rows.weight == 1  # a row of several samples stands for their middle
    assert found[alone] == pytest.approx(np.interp(rows.time, grid, z)[alone], abs=0.01)


@HANDS
@pytest.mark.parametrize("square", [False, True])
def test_slow_flow_follows_a_staircase_of_thinned_holds(square: bool, beyond: np.ndarray) -> None:
    rows, grid, load = staircase(beyond)
    y, state = np.zeros_like(grid), 0.0
    for i in range(1, len(grid)):
        beyond = np.clip(state, load[i] - 8.0, load[i] + 8.0) - state
        state += beyond * 1e-3 / 4.0 * (abs(beyond) / 8.0 if square else 1.0)
        y[i] = state
    both = flowing_play(
        rows.force,
        np.array([8.0, 8.0]),
        np.array([4.0, 4.0]),
        rows,
        fresh(rows.n),
        square=np.array([square, False]),
    )
    limit = 0.35 if beyond.any() else 0.15  # four parts a ramp
    assert both[:, 0] == pytest.approx(np.interp(rows.time, grid, y), abs=limit)
    alone = flowing_play(rows.force, np.array([8.0]), np.array([4.0]), rows, fresh(rows.n))
    assert both[:, 1] == pytest.approx(alone[:, 0], abs=1e-12)  # whatever flows beside it


def two_runs() -> tuple[Rows, np.ndarray, np.ndarray]:
    """Rows of two runs, up a step and back to zero, 10 s apart; the clock and load that made them:
    nothing is loaded in between until the screw comes to the load in the last five seconds."""
    corner = np.array([0.0, 3.5, 7.5, 57.5, 61.5, 68.0, 73.0, 77.5, 110.0])
    there = np.array([0.0, 0.0, 100.0, 100.0, 0.0, 0.0, 0.0, 60.0, 60.0])
    time = np.concatenate([np.arange(4.0), np.arange(8.0, 58.0), np.arange(62.0, 69.0)])
    time = np.append(time, np.arange(78.0, 98.0))
    step = np.repeat([0, 1, 2, 1], [4, 50, 7, 20])
    force = np.interp(time, corner, there)
    run = (time > 70.0).astype(np.int64)
    data = bench_data(force, force * 1e-5, step=step, branch=step, run=run, time=time, session=time)
    grid = np.arange(0.0, 98.0, 5e-3)
    return rows_of(data), grid, np.interp(grid, corner, there)


def test_what_crept_goes_back_for_the_seconds_of_a_rest() -> None:
    rows, grid, load = two_runs()
    z, state = np.zeros_like(grid), 0.0
    for i in range(1, len(grid)):
        state += (0.5 * (load[i] + load[i - 1]) - state) * -np.expm1(-5e-3 / 20.0)
        z[i] = state
    found = retarded(rows.force[:, None], np.array([20.0]), rows, rests(rows))[:, 0]
    alone = rows.weight == 1
    assert found[alone] == pytest.approx(np.interp(rows.time, grid, z)[alone], abs=0.01)


@pytest.mark.parametrize("square", [False, True])
def test_what_flowed_flows_back_for_the_seconds_of_a_rest(square: bool) -> None:
    rows, grid, load = two_runs()
    y, state = np.zeros_like(grid), 0.0
    for i in range(1, len(grid)):
        over = min(max(state, load[i] - 20.0), load[i] + 20.0) - state
        state += over * 5e-3 / 25.0 * (abs(over) / 20.0 if square else 1.0)
        y[i] = state
    radius, time = np.array([20.0]), np.array([25.0])
    found = flowing_play(rows.force, radius, time, rows, fresh(rows.n), square=square)[:, 0]
    alone = rows.weight == 1
    assert found[alone] == pytest.approx(np.interp(rows.time, grid, y)[alone], abs=0.35)


def test_plays_that_flow_are_the_same_few_or_many_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rows, _, _ = two_runs()
    radius, time = np.linspace(5.0, 60.0, 40), np.geomspace(0.5, 200.0, 40)
    square, memory = np.arange(40) % 2 == 1, rows.starts
    many = flowing_play(rows.force, radius, time, rows, memory, square=square)
    monkeypatch.setattr(flowing, "_AT_ONCE", 40 * 7)  # pieces of a few steps
    assert flowing_play(rows.force, radius, time, rows, memory, square=square) == pytest.approx(
        many, abs=1e-9
    )
    for k in (0, 17, 39):
        one = (radius[[k]], time[[k]], rows, memory)
        alone = flowing_play(rows.force, *one, square=square[[k]])
        assert alone[:, 0] == pytest.approx(many[:, k], abs=1e-9)
        assert np.ptp(alone) > 1.0


@HANDS
def test_a_delay_of_thinned_holds_is_that_of_the_load(beyond: np.ndarray) -> None:
    rows, grid, load = staircase(beyond)
    found = delayed(rows.force, 1.8, rows)
    alone = rows.weight == 1
    assert found[alone] == pytest.approx(np.interp(rows.time - 1.8, grid, load)[alone], abs=1e-9)


@HANDS
@pytest.mark.parametrize("window", [0.4, 3.0, 14.0])
def test_a_mean_over_the_last_readings_is_that_of_the_load(
    window: float, beyond: np.ndarray
) -> None:
    rows, grid, load = staircase(beyond)
    area = np.concatenate([[0.0], np.cumsum((load[1:] + load[:-1]) / 2 * 1e-3)])
    before = np.interp(rows.time - window, grid, area) + load[0] * np.minimum(rows.time - window, 0)
    mean = (np.interp(rows.time, grid, area) - before) / window
    alone = rows.weight == 1
    found = averaged(rows.force, window, rows)
    assert found[alone] == pytest.approx(mean[alone], abs=1e-6)
    both = averaged(np.column_stack([rows.force, -2 * rows.force]), window, rows)
    assert both == pytest.approx(np.column_stack([found, -2 * found]))


def test_delay_shows_the_step_before_and_nothing_later_in_the_hold() -> None:
    step = np.repeat(np.arange(1, 5), 4)
    time = np.repeat(np.arange(4) * 10.0, 4) + np.tile(np.arange(4.0), 4)
    force = step * 10.0
    rows = rows_of(bench_data(force, force * 1e-5, step=step, time=time))
    late = delayed(rows.force, 1.0, rows) - rows.force
    first = rows.hold_starts.copy()
    first[0] = False
    assert np.all(late[first] < 0)
    assert late[~first] == pytest.approx(0.0, abs=1e-12)


def test_rows_keep_every_sample_once_and_first_samples_alone() -> None:
    step = np.repeat([1, 2, 3], 20)
    force = step * 10.0
    rows = rows_of(bench_data(force, force * 1e-5, step=step))
    assert rows.weight.sum() == 60
    assert rows.weight[rows.hold_starts].tolist() == [1.0, 1.0, 1.0]
    assert rows.n == 3 * 6  # 1, 1, 2, 4, 8, 4 samples


@pytest.mark.parametrize(("arm", "samples"), [(False, 300), (True, 4000)])
def test_short_continuous_recordings_are_not_thinned(arm: bool, samples: int) -> None:
    """What lags behind an arm's levels that nobody numbered shows in a sample or two."""
    force = np.linspace(0, 100, samples)
    data = bench_data(force, force * 1e-5, step=np.full(samples, -1), arm=arm)
    rows = rows_of(data)
    assert rows.continuous
    assert rows.n == samples
    assert (rows_of(replace(data, arm=False)).n == samples) is (samples == 300)


def test_long_continuous_recordings_become_few_rows_with_all_turning_points() -> None:
    t = np.arange(200_000) * 1e-3
    force = 100 * np.sin(2 * np.pi * t / 20)
    data = bench_data(force, force * 1e-5, step=np.full(t.size, -1), time=t)
    rows = rows_of(data)
    assert rows.n <= 4000
    assert rows.force.max() > 99.0
    assert rows.weight.sum() == t.size


def test_noise_of_a_steady_force_is_smoothed_a_moving_force_is_not() -> None:
    rng = np.random.default_rng(1)
    step = np.repeat([1, 2, 3], 20)
    noisy = step * 10.0 + rng.normal(0, 0.1, 60)
    steady = rows_of(bench_data(noisy, noisy * 1e-5, step=step))
    assert np.all(steady.steady)
    assert len(np.unique(steady.force)) == 3
    lagging = step * 10.0 - np.tile(np.r_[3.0, np.zeros(19)], 3)
    assert not np.any(rows_of(bench_data(lagging, noisy * 1e-5, step=step)).steady)
