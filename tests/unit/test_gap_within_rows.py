"""Samples of one row: what an effect goes on within it is no scatter."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.model.bench import Bench, make_bench
from identification.gap.recording.holds import steadied
from identification.gap.recording.ramps import with_ramps_marked
from identification.gap.recording.rows import reduce_rows
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

SPRING, HOLD, LEVELS = 1e-5, 16, 12


def settling(size: float = 2e-5, noise: float = 0.0) -> tuple[Bench, Array]:
    """Levels of 16 samples each, at which the displacement settles; samples of it."""
    step = np.repeat(np.arange(1, LEVELS + 1), HOLD)
    within = np.tile(np.arange(HOLD), LEVELS) + 1.0
    force = 10.0 * step
    rng = np.random.default_rng(2)
    u = SPRING * force - size * np.exp(-within / 5.0) + rng.normal(0, 1.0, len(step)) * noise
    return make_bench(bench_data(force, u, step=step)), u


def row_of(bench: Bench, values: Array) -> Array:
    count = bench.rows.weight.astype(int)
    edges = np.cumsum(count) - count
    return np.asarray(np.add.reduceat(values, edges) / count)


def test_the_speed_of_what_settles_is_followed_and_that_of_a_line_exact() -> None:
    bench, _ = settling()
    rows = bench.rows
    line = rows.speed(3.0 + 2.0 * rows.time + 100.0 * rows.hold)
    np.testing.assert_allclose(line, 2.0, rtol=1e-9)
    within = rows.time - rows.time[rows.hold_starts][rows.hold]
    many = rows.weight > 1
    settles = rows.speed(-np.exp(-within / 5.0))
    np.testing.assert_allclose(settles[many], 0.2 * np.exp(-within / 5.0)[many], rtol=0.35)


def test_after_a_step_nothing_goes_on() -> None:
    """A reading that is late jumps to where it was going: a parabola through it would overshoot."""
    bench, _ = settling()
    first = bench.rows.hold_starts.astype(float)
    assert not bench.rows.speed(-first).any()


def test_what_grows_faster_and_faster_is_not_carried_beyond_what_was_seen() -> None:
    bench, _ = settling()
    rows = bench.rows
    values = (rows.time - rows.time[rows.hold_starts][rows.hold]) ** 3
    last = np.append(rows.hold_starts[1:], True)
    ends = np.flatnonzero(last)
    slope = (values[ends] - values[ends - 1]) / (rows.time[ends] - rows.time[ends - 1])
    np.testing.assert_allclose(rows.speed(values)[last], slope, rtol=1e-9)


def test_rows_that_are_few_in_their_hold_have_no_speed() -> None:
    single = reduce_rows(bench_data(np.arange(5.0), np.arange(5.0), step=np.arange(5)))
    assert single.speed(single.time**2).tolist() == [0.0] * 5
    two = reduce_rows(bench_data(np.arange(6.0), np.arange(6.0), step=np.arange(6) // 2))
    assert two.hold_starts.tolist() == [True, False] * 3
    assert two.speed(4.0 * two.time).tolist() == [0.0] * 6


def test_what_is_foreseen_within_rows_is_not_left() -> None:
    bench, u = settling()
    seen = bench.scatter_about(row_of(bench, u))
    assert np.sqrt(bench.scatter.max()) > 1e-6  # rows of many samples: they move on
    assert seen.sum() < 0.2 * bench.scatter.sum()
    assert bench.scatter_about(np.zeros(bench.rows.n)) == pytest.approx(bench.scatter)


def test_noise_within_rows_is_left_whatever_is_foreseen() -> None:
    bench, _ = settling(size=0.0, noise=1e-6)
    smooth = SPRING * bench.load
    np.testing.assert_allclose(bench.scatter_about(smooth), bench.scatter, rtol=1e-9)


def test_after_of_a_rig_that_settles_does_not_count_its_settling() -> None:
    bench, _ = settling(size=6e-5, noise=5e-7)
    found = explained(bench.data)
    assert found.verdict in ("joint_creep", "time_lag")
    moves = np.sqrt(bench.rows.weight @ bench.scatter / bench.rows.weight.sum())
    assert found.after < 0.7 * moves
    assert found.held_out[0].after < 0.7 * moves


def ramped(reads_late: bool = False, drift: float = 0.0) -> tuple[Array, Array, Array]:
    """Force N, displacement m and step, recorded all the time: from 60 N the load takes three
    samples to each lower level, of which they bear the name, and at last to none."""
    levels = [60.0, 30.0, 0.0]
    force, step = [np.full(8, 60.0)], [np.full(8, 2)]
    for i, (a, b) in enumerate(pairwise(levels)):
        force.append(np.concatenate([a + (b - a) * np.array([0.25, 0.5, 0.75]), np.full(17, b)]))
        step.append(np.full(20, 1 - i))
    true, steps = np.concatenate(force), np.concatenate(step)
    read = np.append(true[:1], true[:-1]) if reads_late else true
    return read + drift * np.arange(len(true)), SPRING * true, steps


@pytest.mark.parametrize("late", [False, True])
def test_a_load_on_its_way_to_none_is_no_zero(late: bool) -> None:
    """But a force that is read late, or drifts, is one that nobody loads."""
    force, u, step = ramped(late, drift=0.02)
    branch = np.where(step > 0, 2, 0)
    rows = reduce_rows(with_ramps_marked(bench_data(force, u, step=step, branch=branch)))
    at_zero = rows.branch == 0
    loaded = at_zero & (rows.displacement > 1e-6)
    assert loaded.any()
    np.testing.assert_array_equal(rows.zero, at_zero & ~loaded)
    assert (np.abs(rows.measured_force[rows.zero]) > 0.5).all()  # as it drifted


def test_a_load_on_its_way_is_none_of_its_level() -> None:
    """A force that scatters by a third of the step hides it; the displacement does not."""
    step = np.repeat(np.arange(1, LEVELS + 1), HOLD)
    true = 10.0 * step - np.where(np.arange(len(step)) % HOLD == 0, 5.0, 0.0)
    rng = np.random.default_rng(5)
    force = true + rng.normal(0, 3.0, len(step))
    data = bench_data(force, SPRING * true, step=step)
    rows = reduce_rows(replace(data, instruments=replace(data.instruments, force=3.0)))
    first, others = rows.hold_starts & (rows.step > 1), ~rows.hold_starts
    np.testing.assert_array_equal(rows.force[first], rows.measured_force[first])
    settled = [force[HOLD * k + 1 : HOLD * (k + 1)].mean() for k in range(LEVELS)]
    np.testing.assert_allclose(rows.force[others], np.array(settled)[rows.hold[others]])


def test_a_run_that_begins_unloaded_comes_from_nowhere() -> None:
    """While it warms up, and its force drifts with that: all of it is read at no load."""
    warm = 1 - np.exp(-np.arange(30) / 10.0)
    data = bench_data(3 * warm, 3e-5 * warm, step=np.zeros(30, dtype=int), branch=np.zeros(30, int))
    assert reduce_rows(with_ramps_marked(data)).zero.all()


def test_steps_of_one_number_to_and_fro_are_two_levels() -> None:
    step = np.repeat([1, 1, 2, 2], HOLD)
    true = np.repeat([20.0, -20.0, 40.0, -40.0], HOLD)
    force = true + np.random.default_rng(1).normal(0, 1.0, len(true))
    branch = np.full(len(true), 3)
    data = bench_data(force, SPRING * true, step=step, branch=branch)
    rows = reduce_rows(replace(data, instruments=replace(data.instruments, force=1.0)))
    assert rows.steady.all()
    means = [force[HOLD * k : HOLD * (k + 1)].mean() for k in range(4)]
    np.testing.assert_allclose(rows.force, np.array(means)[rows.hold])


def test_what_does_not_count_makes_nothing_steady() -> None:
    values = np.concatenate([np.zeros(35), np.linspace(0.0, 12.0, 5)])
    weight, hold = np.repeat([0.0, 1.0], [35, 5]), np.zeros(40, dtype=int)
    assert not steadied(hold, values, weight, 1.0)[1].any()
    assert not steadied(hold[35:], values[35:], weight[35:], 1.0)[1].any()
