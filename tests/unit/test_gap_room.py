"""A weight that hangs for hours in a room that warms and cools: what follows it, and how late."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.bench import make_bench
from identification.gap.bins import Bins
from identification.gap.data import Array, GapData
from identification.gap.diagnose import diagnose_gap
from identification.gap.effects import library
from identification.gap.history import followed
from tests.unit.test_gap_operators import bench_data


def hung(moved: Array, every_s: float, **changes: object) -> GapData:
    """A weight is put on after eight readings without, and hangs."""
    n = len(moved)
    on = (np.arange(n) >= 8).astype(np.int64)
    noise = 0.1 * np.random.default_rng(5).standard_normal(n)
    given = {"step": on, "branch": on, "time": every_s * np.arange(n),
             "session": every_s * np.arange(n), "imposed": "force"}  # fmt: skip
    force = 80.0 * on + noise
    return bench_data(force, 1e-5 * force + moved, **(given | changes))


def room(n: int, every_s: float) -> Array:
    """K: a room over a day and a half."""
    return 3 * np.sin(2 * np.pi * every_s * np.arange(n) / 43200)


@pytest.mark.parametrize("late_s", [0.0, 4000.0])
def test_a_frame_follows_the_room_late(late_s: float) -> None:
    """By the thermometer that was beside it, one of an arm's six or the only one."""
    n, every_s = 1000, 120.0
    warm = room(n, every_s)
    moved = 1e-5 * (followed(warm, every_s * np.arange(n), np.array([late_s or 1e-3]))[:, 0])
    moved += 1e-6 * np.random.default_rng(4).standard_normal(n)
    result = diagnose_gap(hung(moved, every_s, temperature=20 + warm[:, None]))
    assert result.verdict == "thermal_drift"
    (effect,) = result.effects
    assert ("late" in effect.label) is (late_s > 0)
    assert effect.label.startswith("mean temperature")


@pytest.mark.parametrize(("back", "large"), [(0.2, False), (0.5, True)])
def test_a_temperature_that_goes_to_and_fro_may_do_much(back: float, large: bool) -> None:
    """One that only rises is but a curve of a load that is put on meanwhile."""
    at = np.linspace(0.0, 1.0, 100)
    warm = at + back * np.sin(12 * at) / 0.9
    data = bench_data(80 * at, 8e-4 * at, step=np.full(100, -1), temperature=warm[:, None])
    found = library(make_bench(data), ["thermal_drift"])
    assert sum(" late " in v.label for v in found) == sum("lags_s" in v.info for v in found) > 2
    assert all((max(v.scales) > 0.1 * 8e-4) is large for v in found)


def test_a_long_hold_shows_what_swings_in_it() -> None:
    """Though most of the session is one level, and nothing tells the temperature."""
    n, every_s = 1000, 120.0
    swing = 2e-5 * room(n, every_s) + 1e-6 * np.random.default_rng(4).standard_normal(n)
    assert diagnose_gap(hung(swing, every_s)).verdict == "thermal_drift"
    creep = 4e-5 * (1 - np.exp(-np.arange(n) / 200)) + 1e-6 * np.random.default_rng(4).normal(
        size=n
    )
    assert diagnose_gap(hung(creep, every_s)).verdict == "joint_creep"


def test_bins_of_long_holds_are_a_small_part_of_the_recording() -> None:
    """Those of short ones are as they were: 1, 1, 2, 4 ... samples."""
    for n, most in ((64, 32), (65, 8), (1000, 8), (20_000, 40)):
        hold = np.zeros(n, dtype=np.int64)
        data = bench_data(np.zeros(n), np.zeros(n))
        bins = Bins.of(data, hold, running=False)
        assert bins.count.max() == most
        assert bins.count[:4].tolist() == [1, 1, 2, 4]


def test_what_follows_late_is_exact_between_readings() -> None:
    """Against small steps of the same equation, with readings at odd times."""
    clock = np.array([0.0, 3.0, 3.0, 11.0, 40.0, 41.0])
    read = np.array([5.0, 7.0, 7.0, 2.0, 9.0, 9.0])
    times = np.array([4.0, 30.0])
    fine = np.linspace(0.0, 41.0, 41_001)
    way, z = np.interp(fine, clock, read) - 5.0, np.zeros((len(fine), 2))
    for i in range(1, len(fine)):
        middle = 0.5 * (way[i] + way[i - 1])
        z[i] = z[i - 1] + (fine[i] - fine[i - 1]) * (middle - z[i - 1]) / times
    at = np.searchsorted(fine, clock)
    assert followed(read, clock, times) == pytest.approx(z[at], abs=1e-3)
