"""Ramps that were recorded under the name of the level they lead to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.answer.designs import _levels
from identification.gap.data import Array, GapData
from identification.gap.model.bench import make_bench
from identification.gap.recording.holds import hold_ids, is_continuous, rest_ids, scatter_within
from identification.gap.recording.ramps import ramps_told
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
    told = ramps_told(data)
    rows = reduce_rows(told)
    off = rows.force - level[np.searchsorted(data.time, rows.time)]
    assert np.abs(off[~rows.on_the_way]).max() < 0.3
    assert np.abs(off[rows.on_the_way]).max() > 5
    np.testing.assert_array_equal(rows.force[rows.on_the_way], rows.measured_force[rows.on_the_way])
    assert np.sum(rows.steady & ~rows.on_the_way) > 20
    # nor of its noise, nor a vibration
    assert scatter_within(data.force, hold_ids(data)) > 0.1
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
    assert ramps_told(data) is data


def test_levels_to_both_sides_are_levels_whatever_leads_to_them() -> None:
    """20 to 80 N and let go at once, then the same to the other side: nothing runs."""
    up = np.repeat([20.0, 40.0, 60.0, 80.0], 12)
    force = np.concatenate([up, [80.0], np.zeros(11), -up, [-80.0], np.zeros(11)])
    step = np.concatenate([np.repeat([1, 2, 3, 4, 0], 12)] * 2)
    branch = np.where(step > 0, 1, 0)
    data = bench_data(force, SPRING * force, step=step, branch=branch)
    assert not is_continuous(data, hold_ids(data))
    told = ramps_told(data)
    assert told.on_the_way is not None
    assert np.flatnonzero(told.on_the_way).tolist() == [48, 108]  # still loaded, at no load
    assert not reduce_rows(told).continuous


def test_of_what_runs_only_the_way_to_no_load_is_told() -> None:
    force = np.concatenate([np.zeros(20), np.linspace(0, 100, 60), np.linspace(99, 0, 40),
                            np.zeros(20)])  # fmt: skip
    branch = np.repeat([0, 1, 0], [20, 60, 60])
    data = bench_data(force, SPRING * force, step=np.full(140, -1), branch=branch)
    told = ramps_told(data)
    assert told.on_the_way is not None
    assert np.all(told.branch[told.on_the_way] == 0)
    assert 30 <= told.on_the_way.sum() <= 41


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
