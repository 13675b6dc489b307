"""A weight that hangs for hours in a room that warms and cools: what follows it, and how late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.parameters import parameters
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.evidence.parts import Part
from identification.gap.laws.drift import _way, own_clock, waited
from identification.gap.model.bench import make_bench
from identification.gap.model.history import followed
from identification.gap.recording.bins import Bins
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data


def hung(moved: Array, every_s: float, **changes: object) -> GapData:
    """A weight is put on after eight readings without, and hangs."""
    n = len(moved)
    on = (np.arange(n) >= 8).astype(np.int64)
    noise = 0.1 * np.random.default_rng(5).standard_normal(n)
    given = {
        "step": on,
        "branch": on,
        "time": every_s * np.arange(n),
        "session": every_s * np.arange(n),
        "imposed": "force",
    }
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
    result = explained(hung(moved, every_s, temperature=20 + warm[:, None]))
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


def test_what_is_late_is_behind_at_the_end_and_as_likely_as_what_is_not() -> None:
    """And no lag is looked for that a few rows can't tell."""
    n = 400
    warm = np.linspace(0.0, 5.0, n)
    data = bench_data(
        80.0 * (np.arange(n) % 50),
        np.zeros(n),
        temperature=warm[:, None],
        step=np.full(n, -1),
        session=np.arange(n, dtype=float),
    )
    bench = make_bench(data)
    found = [v for v in library(bench, ["thermal_drift"]) if v.info.get("sensor") == "1"]
    late = [v for v in found if "lags_s" in v.info]
    assert sum(v.prior for v in late) == pytest.approx(1.0)
    assert min(v.info["lags_s"][0] for v in late) > 2
    last = max(late, key=lambda v: v.info["lags_s"][0])
    w = np.array([1e-5, 0.0])
    told = parameters(bench, Part(last, 1.0), w, np.zeros((2, 2)))["drift_over_session_x"]
    behind = last.info["lags_s"][0] / bench.load_history.session_span
    assert told.value == pytest.approx(1e-2 * (1 - behind * (1 - np.exp(-1 / behind))), rel=1e-3)


def test_a_screw_that_relaxes_and_is_put_right_is_no_room() -> None:
    n = 1000
    sags = 1 - 0.05 * (np.arange(n) % 250) / 250
    data = hung(np.zeros(n), 120.0)
    noise = 1e-6 * np.random.default_rng(4).standard_normal(n)
    data = replace(data, force=data.force * sags, displacement=1e-5 * data.force * sags + noise)
    assert not own_clock(make_bench(data))


def test_a_long_hold_shows_what_swings_in_it() -> None:
    """Though most of the session is one level, and nothing tells the temperature."""
    n, every_s = 1000, 120.0
    swing = 2e-5 * room(n, every_s) + 1e-6 * np.random.default_rng(4).standard_normal(n)
    assert explained(hung(swing, every_s)).verdict == "thermal_drift"
    creep = 4e-5 * (1 - np.exp(-np.arange(n) / 200)) + 1e-6 * np.random.default_rng(4).normal(
        size=n
    )
    assert explained(hung(creep, every_s)).verdict == "joint_creep"


def test_swings_that_come_again_and_again_may_be_small_and_quick() -> None:
    """Eight of them, each a quarter of the slow way; of noise there is no swing."""
    n, every_s = 900, 20.0
    at, rng = np.arange(n) / n, np.random.default_rng(4)
    noise = 1e-6 * rng.standard_normal(n)
    slow = -2.5e-5 * at
    swings = slow + 7e-6 * np.sin(2 * np.pi * 8 * at)
    assert not own_clock(make_bench(hung(slow + noise, every_s)))
    assert own_clock(make_bench(hung(swings + noise, every_s)))
    assert explained(hung(swings + noise, every_s)).verdict == "thermal_drift"
    # the load reads alike all the time, and nobody turns a screw
    assert not library(make_bench(hung(swings + noise, every_s)), ["force_drift"])


def test_bins_of_long_holds_are_a_small_part_of_the_recording() -> None:
    """Those of short ones, and of many, are as they were: 1, 1, 2, 4 ... samples."""
    for n, holds, wanted in (
        (64, 1, [1, 1, 2, 4, 8, 16, 32]),
        (80, 1, [1, 1, 2, 4, *[8] * 9]),
        (20_000, 1, [1, 1, 2, 4, 8, 16, 8, *[40] * 499]),
        (3000, 30, [1, 1, 2, 4, 8, 16, 32, 36] * 30),
    ):
        hold = np.repeat(np.arange(holds), n // holds)
        bins = Bins.of(bench_data(np.zeros(n), np.zeros(n)), hold, running=False)
        assert bins.count.tolist() == wanted


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


@pytest.mark.parametrize(("before", "verdict"), [(True, "thermal_drift"), (False, "joint_creep")])
def test_what_moves_before_any_load_does_not_creep(before: bool, verdict: str) -> None:
    """A weight of an hour, with a quarter of an hour without it before and after."""
    n, every_s = 400, 12.0
    on = (np.arange(n) >= 75) & (np.arange(n) < 350)
    step = on.astype(np.int64)
    rng = np.random.default_rng(7)
    force = 80.0 * on + rng.normal(0, 0.1, n)
    drift = 4e-5 * (1 - np.exp(-np.arange(n) / 150))
    if not before:
        z = np.zeros(n)
        for i in range(1, n):
            z[i] = z[i - 1] + (on[i] - z[i - 1]) / 100
        drift = 4e-5 * z
    moved = 1e-5 * force + drift + rng.normal(0, 1e-6, n)
    clock = every_s * np.arange(n)
    data = bench_data(force, moved, step=step, branch=step, time=clock, session=clock)
    assert own_clock(make_bench(data)) is before
    assert explained(data).verdict == verdict


@pytest.mark.parametrize("n", [75, 300, 1000])
def test_a_rest_that_only_scatters_is_no_drift(n: int) -> None:
    rng = np.random.default_rng(n)
    assert not any(_way(1e-6 * rng.standard_normal(n), 1e-6) for _ in range(50))
    digit = np.zeros(n)
    digit[-n // 4 :] = 1e-6  # the last digit, once
    assert not _way(digit, 1e-6)
    path = np.linspace(0.0, 1e-5, n) + 1e-6 * rng.standard_normal(n)
    assert _way(path, 1e-6) == pytest.approx(6.7e-6, rel=0.1)  # from third to third


def test_a_pause_between_two_runs_is_no_hold() -> None:
    """The arm stands unloaded then, for however long; a force that drifts shows at the next run."""
    data = arm_data()
    assert data.session is not None
    later = 10 * float(np.ptp(data.session)) * (data.run > 0)
    bench = make_bench(replace(data, session=data.session + later))
    assert not waited(bench).any()
    assert library(bench, ["force_drift"])
