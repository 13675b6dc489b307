"""Ramps that were recorded under the name of the level they lead to."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.designs import _levels
from identification.gap.data import GapData
from identification.gap.model.bench import make_bench
from identification.gap.recording.holds import hold_ids, is_continuous, rest_ids, scatter_within
from identification.gap.recording.ramps import _leading_on, with_ramps_marked
from identification.gap.recording.rows import reduce_rows
from tests.unit.test_gap_operators import bench_data

SPRING, RAMP, HOLD = 1e-5, 7, 16  # m/N; samples


def straight(x: Array) -> Array:
    return x


def eased(x: Array) -> Array:
    return np.asarray((1 - np.cos(np.pi * x)) / 2)


def recorded(path: object = straight, sd_N: float = 0.05) -> tuple[GapData, Array]:
    """Eight levels to which the load takes 7 s, and then rests for 9; the level of every sample."""
    assert callable(path)
    level = np.repeat(10.0 * np.arange(1, 9), HOLD)
    along = path(np.minimum(1.0, np.arange(len(level)) % HOLD / RAMP))
    force = level - 10.0 * (1 - along)
    rng = np.random.default_rng(2)
    read = force + rng.normal(0, sd_N, len(force))
    moved = SPRING * force + rng.normal(0, 1e-6, len(force))
    data = bench_data(read, moved, step=(level / 10).astype(int))
    return replace(data, instruments=replace(data.instruments, force=sd_N)), level


@pytest.mark.parametrize("path", [straight, eased])
def test_a_ramp_before_a_level_is_no_part_of_its_hold(path: object) -> None:
    data, level = recorded(path)
    told = with_ramps_marked(data)
    rows = reduce_rows(told)
    off = rows.force - level[np.searchsorted(data.time, rows.time)]
    assert np.abs(off[~rows.in_ramp]).max() < 0.3
    assert np.abs(off[rows.in_ramp]).max() > 5
    np.testing.assert_array_equal(rows.force[rows.in_ramp], rows.measured_force[rows.in_ramp])
    assert np.sum(rows.steady & ~rows.in_ramp) > 20
    # nor of its noise, nor a vibration
    rests = rest_ids(told, hold_ids(told))
    assert scatter_within(told.force, rests) == pytest.approx(0.05, rel=0.25)
    assert make_bench(replace(told, arm=True)).noise.swings < 0.5
    # nor a level of the next procedure
    assert _levels(make_bench(told), 0) == pytest.approx(10.0 * np.arange(1, 9), abs=0.3)


@pytest.mark.parametrize("what", ["creeps", "relaxes", "lags", "drifts", "scatters"])
def test_what_goes_on_while_the_load_stands_is_no_way(what: str) -> None:
    """Only one channel of a creep, a lag or a drift, or both against each other where a screw
    relaxes while the arm gives way; and chance."""
    _, level = recorded()
    n, rng = len(level), np.random.default_rng(3)
    late = np.exp(-(np.arange(n) % HOLD) / 4.0)
    force, moved = level.copy(), SPRING * level
    if what in ("creeps", "relaxes"):
        moved -= 1e-5 * late
        force += (0.6 if what == "relaxes" else 0.0) * late
    if what == "lags":
        force -= 10.0 * late
    if what == "drifts":
        moved += 1e-6 * np.arange(n)
    noise = 3.0 if what == "scatters" else 1.0
    force += noise * rng.normal(0, 0.05, n)
    moved += noise * rng.normal(0, 1e-6, n)
    data = bench_data(force, moved, step=(level / 10).astype(int))
    data = replace(data, instruments=replace(data.instruments, force=0.05))
    assert with_ramps_marked(data) is data


def test_levels_to_both_sides_are_levels_whatever_leads_to_them() -> None:
    """20 to 80 N and let go at once, then the same to the other side: nothing runs."""
    up = np.repeat([20.0, 40.0, 60.0, 80.0], 12)
    force = np.concatenate([up, [80.0], np.zeros(11), -up, [-80.0], np.zeros(11)])
    step = np.concatenate([np.repeat([1, 2, 3, 4, 0], 12)] * 2)
    branch = np.where(step > 0, 1, 0)
    data = bench_data(force, SPRING * force, step=step, branch=branch)
    assert not is_continuous(data, hold_ids(data))
    told = with_ramps_marked(data)
    assert told.in_ramp is not None
    assert np.flatnonzero(told.in_ramp).tolist() == [48, 108]  # still loaded, at no load
    assert not reduce_rows(told).continuous


def test_of_what_runs_only_the_way_to_no_load_is_told() -> None:
    force = np.concatenate(
        [np.zeros(20), np.linspace(0, 100, 60), np.linspace(99, 0, 40), np.zeros(20)]
    )
    branch = np.repeat([0, 1, 0], [20, 60, 60])
    data = bench_data(force, SPRING * force, step=np.full(140, -1), branch=branch)
    told = with_ramps_marked(data)
    assert told.in_ramp is not None
    assert np.all(told.branch[told.in_ramp] == 0)
    assert 30 <= told.in_ramp.sum() <= 41


def test_levels_are_levels_though_a_lag_hides_the_way_there() -> None:
    """The force comes within three readings, far across zero; the displacement follows slowly. A
    stroke whose force stands soon, because it rubs, runs on."""
    level = np.repeat([0.0, 30, 90, 50, -40, -100, -20, 60, 0, 80, -70, 0], 14)
    coming = np.minimum(1.0, (np.arange(len(level)) % 14 + 1) / 3)
    before = np.concatenate([np.zeros(14), level[:-14]])
    force = before + (level - before) * coming
    late = SPRING * force
    for _ in range(2):
        late = np.convolve(late, 0.5 ** np.arange(1, 40))[: len(level)]
    step = np.repeat(np.arange(12), 14)
    held = bench_data(force, late, step=step)
    assert not is_continuous(held, hold_ids(held))
    way, within = np.where(step % 2 == 0, 1.0, -1.0), np.arange(168) % 14
    slid = bench_data(100 * way * np.clip(within - 1.0, -1, 1), 1e-4 * np.cumsum(way), step=step)
    assert is_continuous(slid, hold_ids(slid))
    once = 100 * np.minimum(1.0, np.arange(40) / 10)  # two ramps with their holds are one recording
    twice = np.concatenate([once, 100 - once])
    ramp = bench_data(twice, SPRING * twice, step=np.repeat([1, 2], 40))
    assert is_continuous(ramp, hold_ids(ramp))


def named_late(hardens: bool = False) -> tuple[GapData, Array, Array]:
    """Levels and none between, with gentle ramps whose first samples bear the name of the level
    they leave, on a part that creeps; the level that a sample rests at or goes to, and which rest.
    """
    path = [0.0, 20.0, 40.0, 60.0, 0.0, 60.0, 0.0, 0.0]
    step = [0, 1, 2, 3, 0, 3, 0, 0]
    x = np.arange(1, 11) / 10
    eases = (1 - np.cos(np.pi * x)) / 2
    load, leads_to, named = [], [], []
    for k, (a, b) in enumerate(pairwise(path)):
        load += [np.full(40, a), a + (b - a) * eases]
        leads_to += [np.full(40, a), np.full(10, b)]
        named += [np.full(47, step[k]), np.full(3, step[k + 1])]
    force, to, steps = (np.concatenate(each) for each in (load, leads_to, named))
    u = SPRING * 60.0 * (force / 60.0) ** (0.7 if hardens else 1.0)  # soft at first
    late = np.zeros(len(u))
    for i in range(1, len(u)):
        late[i] = late[i - 1] + (0.05 * u[i] - late[i - 1]) / 15.0
    rng = np.random.default_rng(4)
    data = bench_data(
        force + rng.normal(0, 0.02, len(u)),
        u + late + rng.normal(0, 1e-6, len(u)),
        step=steps,
        branch=np.where(steps == 0, 0, 1),
        imposed="force",
    )
    at_rest = np.abs(force - to) < 1e-9
    return replace(data, instruments=replace(data.instruments, force=0.02)), to, at_rest


@pytest.mark.parametrize("hardens", [False, True])
def test_a_ramp_named_after_the_level_it_leaves_belongs_to_the_next(hardens: bool) -> None:
    data, leads_to, at_rest = named_late(hardens)
    assert is_continuous(data, hold_ids(data))  # half of every way is in its hold
    told = with_ramps_marked(data)
    assert not is_continuous(told, hold_ids(told))
    rows = reduce_rows(told)
    assert not rows.continuous
    still = ~rows.in_ramp & (rows.weight > 1)
    where = np.searchsorted(data.time, rows.time[still])
    assert np.abs(rows.force[still] - leads_to[where]).max() < 2.0
    assert np.sum(told.ways & at_rest) <= 1
    assert np.sum(~told.ways & ~at_rest) <= 6  # the first, gentle, sample of a ramp
    # nor does what is still loaded show the force at no load
    assert np.abs(rows.force[rows.zero]).max() < 0.5


@pytest.mark.parametrize(("ramp", "sd"), [(6, 0.05), (9, 0.05), (9, 0.4)])
def test_long_ramps_that_bear_the_name_of_the_level_left_belong_to_the_next(
    ramp: int, sd: float
) -> None:
    """Twelve samples at every level, and then the whole way to the next one under its name: no part
    of the level, though it begins before three quarters of what bears the name. Readings of a
    level may range over more than a tenth of the step."""
    rng, hold = np.random.default_rng(4), 12
    on = np.concatenate([np.zeros(hold), np.arange(1, ramp + 1) / (ramp + 1)])
    number = np.repeat(np.arange(5), hold + ramp)
    load = 10.0 * (number + np.tile(on, 5))
    data = bench_data(
        load + rng.normal(0, sd, len(load)), SPRING * load, step=number, imposed="force"
    )
    data = replace(data, instruments=replace(data.instruments, force=sd))
    way = (np.tile(on, 5) > 0) & (number < 4)
    wrong = _leading_on(data).step != number + way
    assert wrong.sum() <= (4 if sd > 0.1 else 0)  # the first of a ramp may drown


@pytest.mark.parametrize(("late", "hold"), [(2, 5), (4, 10), (9, 20)])
def test_holds_that_begin_at_the_level_before_keep_their_names(late: int, hold: int) -> None:
    """The number is set before the screw is turned; the load then settles."""
    rng, number = np.random.default_rng(8), np.repeat(np.arange(1, 9), hold)
    since = np.tile(np.arange(hold), 8) - late
    gone = np.where(since < 0, 0.0, 1 - 0.05 * np.exp(-np.maximum(since, 0) / 2))
    force = 10.0 * (number - 1 + gone) + rng.normal(0, 0.02, len(number))
    data = bench_data(force, SPRING * force, step=number, imposed="force")
    data = replace(data, instruments=replace(data.instruments, force=0.02))
    np.testing.assert_array_equal(_leading_on(data).step, number)


def test_only_what_rested_leaves() -> None:
    """Neither a triangle cut into steps nor a part that creeps on at its level changes names."""
    load = np.concatenate([np.linspace(0, 60, 90), np.linspace(60, 0, 90)])
    cut = bench_data(load, SPRING * load, step=(load // 10).astype(int), imposed="force")
    np.testing.assert_array_equal(_leading_on(cut).step, cut.step)
    level = np.repeat([0.0, 20.0, 40.0, 20.0, 0.0], 40)
    u = SPRING * level * (1 + 0.2 * (np.arange(200) % 40) / 40)
    held = bench_data(level, u, step=(level / 20).astype(int), imposed="force")
    np.testing.assert_array_equal(_leading_on(held).step, held.step)
    away = np.concatenate([np.full(40, 20.0), np.linspace(18, 2, 5), np.zeros(40)])
    runs = np.repeat([0, 1], [45, 40])  # a run that ends on its way belongs to no other one
    two = bench_data(away, SPRING * away, step=1 - runs, run=runs, imposed="force")
    np.testing.assert_array_equal(_leading_on(two).step, two.step)
    one = replace(two, run=0 * runs)
    assert np.sum(_leading_on(one).step != one.step) == 5
    slack = np.concatenate([np.linspace(100, 92, 40), np.full(40, 150.0), np.full(40, 50.0)])
    screw = bench_data(slack, SPRING * slack, step=np.repeat([1, 2, 3], 40), imposed="force")
    np.testing.assert_array_equal(_leading_on(screw).step, screw.step)  # not on its way up
    late = np.cumsum(np.tile([10.0, 6.0, 2.0, 1.0], 4))
    few = bench_data(late, SPRING * late, step=np.repeat([1, 2, 3, 4], 4), imposed="force")
    np.testing.assert_array_equal(_leading_on(few).step, few.step)  # four samples do not rest
