"""A dial that rounds: its readings of a hold share their error; and a drift that nobody saw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.data import GapData
from identification.gap.laws.drift import paths, rates
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

DIAL = 25.4e-6  # m, a thousandth of an inch
SPRING = 1e5  # N/m, as simulated


def stepped(noise: float, readings: int = 10, weight: float = 46.3, times: int = 1) -> GapData:
    """Dead weights on a spring, up and down, under a dial that shows full divisions."""
    step = np.repeat([0, *[1, 2, 3, 4, 5, 4, 3, 2, 1, 0] * times], readings)
    branch = np.repeat([0, *[*[1] * 5, *[2] * 5] * times], readings)
    force = weight * step
    moved = force / SPRING + np.random.default_rng(0).normal(0, noise, len(step))
    seen = np.round(moved / DIAL) * DIAL
    data = bench_data(force, seen, step=step, branch=branch)
    sure = replace(data.instruments, displacement=DIAL / 2, force=0.1)
    return replace(data, instruments=sure, imposed="force")


def test_readings_that_a_dial_rounds_share_their_error() -> None:
    standing = make_bench(stepped(0.02 * DIAL, weight=3.3)).noise.hold  # levels one division apart
    assert standing == pytest.approx(DIAL / 12**0.5, rel=0.05)
    assert make_bench(stepped(0.6 * DIAL, weight=3.3)).noise.hold.max() < 0.5 * standing.min()
    apart = make_bench(stepped(0.02 * DIAL)).noise.hold  # no two of them tell what a division is
    assert apart == pytest.approx(DIAL / 2, rel=0.02)
    finer = stepped(0.0)
    finer = replace(finer, instruments=replace(finer.instruments, displacement=1e-6))
    assert make_bench(finer).noise.hold.max() < 1.5e-6  # no more than is stated


@pytest.mark.parametrize("weight", [11.9, 14.3, 23.7])  # N
def test_divisions_of_a_dial_are_no_effect(weight: float) -> None:
    assert explained(stepped(0.02 * DIAL, weight=weight)).verdict == "none"


def test_a_reading_next_to_an_edge_is_a_whole_division_off() -> None:
    edges = stepped(0.02 * DIAL, weight=2.5 * DIAL * SPRING)  # every second level lies on one
    bench = make_bench(edges)
    assert bench.noise.response * bench.rows.weight**0.5 == pytest.approx(DIAL / 12**0.5, rel=0.05)
    assert explained(edges).verdict == "none"


def test_a_drift_is_over_only_after_some_readings() -> None:
    few = make_bench(stepped(0.0, readings=1, times=3))
    many = make_bench(stepped(0.0, readings=60, times=3))
    assert {"linear", "T 0.5"} <= set(paths(few)) < set(paths(many))
    assert "T 0.03" in paths(many)
    assert "T 0.03" not in paths(few)
    assert len(rates(few)) == len(rates(many))  # several at once are what they were
