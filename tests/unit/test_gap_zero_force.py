"""Force at zero load, before a single staircase and after it: what it shows of a drift."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.data import LOADING, UNLOADING, ZERO, GapData
from identification.gap.effects import library
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

SPRING, HOLD = 1e5, 8
LEVELS = np.array([0, *range(1, 11), *range(9, 0, -1), 0])


def staircase(settles_N: float) -> GapData:
    """One run up and down, whose amplifier settles by so much while it lasts."""
    rng, n = np.random.default_rng(2), len(LEVELS) * HOLD
    level = np.repeat(LEVELS, HOLD)
    turned = np.repeat(np.arange(len(LEVELS)) > LEVELS.argmax(), HOLD)
    t = 9.0 * np.arange(n)
    drift = settles_N * (1 - np.exp(-t / (0.4 * t[-1])))
    load = 25.0 * level
    return bench_data(
        load + drift + rng.normal(0, 0.1, n),
        load / SPRING + rng.normal(0, 1e-6, n),
        session=t,
        step=level,
        branch=np.where(level == 0, ZERO, np.where(turned, UNLOADING, LOADING)),
    )


def shapes(data: GapData) -> set[str]:
    return {v.info["path"] for v in library(make_bench(data), ["force_drift"])}


def test_a_force_that_reads_otherwise_without_load_has_drifted_along_any_slow_path() -> None:
    data = staircase(-40.0)
    assert shapes(data) > {"linear", "root"}
    found = explained(data)
    assert found.verdict == "force_drift"
    drift = found.effects[0].parameters["drift_over_session"]
    assert drift.value == pytest.approx(-40.0 * (1 - np.exp(-2.5)), rel=0.1)


def test_where_it_reads_the_same_a_curve_of_the_load_is_no_drift() -> None:
    assert shapes(staircase(0.0)) == {"linear"}


def runs(rate: float, *, ends: bool, tare: str = "session", offset_N: float = 0.0) -> GapData:
    """Three runs up and down, 60 s apart, that begin without a load, and end there or one level
    above it; the amplifier drifts all the time, or from every taring on, at a rate in N/s."""
    rng, kept = np.random.default_rng(3), slice(None) if ends else slice(None, -1)
    level = np.tile(np.repeat(LEVELS[kept], HOLD), 3)
    n = len(level) // 3
    time = np.tile(2.0 * np.arange(n), 3)
    run = np.repeat(np.arange(3), n)
    session = time + run * (2.0 * n + 60.0)
    drift = rate * (time if tare == "run" else session) + offset_N
    turned = np.tile(np.repeat(np.arange(len(LEVELS)) > LEVELS.argmax(), HOLD)[:n], 3)
    return bench_data(
        25.0 * level + drift + rng.normal(0, 0.1, 3 * n),
        25.0 * level / SPRING + rng.normal(0, 1e-6, 3 * n),
        session=session,
        time=time,
        run=run,
        repetition=run,
        step=level,
        tare=tare,
        branch=np.where(level == 0, ZERO, np.where(turned, UNLOADING, LOADING)),
    )


@pytest.mark.parametrize(("ends", "tare"), [(True, "session"), (False, "session"), (True, "run")])
def test_the_true_load_is_what_is_read_less_what_is_read_without_one(ends: bool, tare: str) -> None:
    bench = make_bench(runs(0.008, ends=ends, tare=tare))
    level = 25.0 * np.round(bench.load / 25.0 - 0.15)
    assert np.abs(bench.load - level).max() > 2.0
    assert bench.true_load == pytest.approx(level, abs=0.5)


def test_runs_that_are_tared_each_and_end_under_load_tell_of_no_drift() -> None:
    assert not make_bench(runs(0.02, ends=False, tare="run")).zero_line.any()


def test_what_stands_still_is_off_by_its_mean_and_noise_by_nothing() -> None:
    assert make_bench(runs(0.0, ends=True, offset_N=2.0)).zero_line == pytest.approx(2.0, abs=0.1)
    assert not make_bench(runs(0.0, ends=True)).zero_line.any()
