"""Counters that start again at the end of their range."""

from __future__ import annotations

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.diagnose import diagnose_gap
from identification.gap.recording.wraps import wraps
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running

N, TOP = 1200, 100.0
FORCE = TOP * np.sin(2 * np.pi * np.arange(N) / 200)
TURN = 6e-4  # m, of a fringe counter; the rig moves by 1 mm either way


def counted(u: Array) -> Array:
    """(n,) as read: from -TURN / 2 to TURN / 2."""
    noise = np.random.default_rng(3).normal(0, 1e-6, len(u))
    return np.asarray((u + noise + TURN / 2) % TURN - TURN / 2)


def test_a_counter_that_wraps_is_told_and_nothing_explains_it() -> None:
    data = running(FORCE, counted(FORCE / SPRING), imposed="force")
    assert wraps(data) == pytest.approx(TURN, rel=0.05)
    found = diagnose_gap(data)
    assert found.verdict == "unknown"
    assert any("jumps by 0." in note and "Unwrap it" in note for note in found.notes)


@pytest.mark.parametrize("what", ["straight", "twice", "snaps", "fast", "runs", "sizes"])
def test_what_jumps_for_a_reason_is_no_counter(what: str) -> None:
    force, u, run = FORCE, FORCE / SPRING, np.zeros(N, dtype=np.int64)
    if what == "twice":
        u = counted(u)[:60]
        force, run = force[:60], run[:60]
    elif what == "snaps":  # to the other side, the way that it is pushed
        u = u + 2e-2 * np.sign(np.roll(force, 20))
    elif what == "fast":  # few readings a stroke
        u = np.tile([1e-3, -1e-3], N // 2)
    elif what == "runs":  # each starts where it was zeroed
        u, run = (np.arange(N) % 100) * 1e-5, np.arange(N) // 100
    elif what == "sizes":  # something lets go, and is pushed up again
        starts = (0.0, 0.05, 0.15, 0.0)
        u = 1e-3 * np.concatenate([np.linspace(start, 1.0, N // 4) for start in starts])
    data = bench_data(force, u, step=np.full(len(u), -1), run=run)
    assert wraps(data) is None
