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
