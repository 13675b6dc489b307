"""Counters that start again at the end of their range."""

from __future__ import annotations

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.recording.wraps import wraps
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running

N, TOP = 1200, 100.0
FORCE = TOP * np.sin(2 * np.pi * np.arange(N) / 200)
TURN = 6e-4  # m, of a fringe counter; the rig moves by 1 mm either way


def counted(u: Array) -> Array:
    """(n,) as read: from -TURN / 2 to TURN / 2."""
    noise = np.random.default_rng(3).normal(0, 1e-6, len(u))
    return np.asarray((u + noise + TURN / 2) % TURN - TURN / 2)


@pytest.mark.slow
def test_a_counter_that_wraps_is_told_and_nothing_explains_it() -> None:
    data = running(FORCE, counted(FORCE / SPRING), imposed="force")
    assert wraps(data) == pytest.approx(TURN, rel=0.05)
    found = explained(data)
    assert found.verdict == "unknown"
    assert any("jumps by 0." in note and "Unwrap it" in note for note in found.notes)


PLAIN = FORCE / SPRING
RUNS = np.arange(N) // 100
STARTS = (0.0, 0.05, 0.15, 0.0)
SAWTOOTH = TOP * (np.arange(N) % 100) / 100


def pieces(*ends: tuple[float, float]) -> Array:
    """(n,) m, from one end to the other of each."""
    return 1e-3 * np.concatenate([np.linspace(a, b, N // len(ends)) for a, b in ends])


@pytest.mark.parametrize(
    ("force", "u"),
    [
        (FORCE, PLAIN),
        (FORCE[:60], counted(PLAIN)[:60]),
        (FORCE, PLAIN + 2e-2 * np.sign(np.roll(FORCE, 20))),
        (FORCE, np.tile([1e-3, -1e-3], N // 2)),
        (FORCE, pieces(*((a, 1.0) for a in STARTS))),
        (FORCE, pieces(*((a, a + 1) for a in (0.0, 0.5, 1.0, 1.5)))),
        (SAWTOOTH, SAWTOOTH / SPRING),
        (FORCE[:0], PLAIN[:0]),
    ],
    ids=["straight", "twice", "snaps", "fast", "lets go", "slips by half", "let go", "empty"],
)
def test_what_jumps_for_a_reason_is_no_counter(force: Array, u: Array) -> None:
    data = bench_data(force, u, step=np.full(len(u), -1))
    assert wraps(data) is None


def test_runs_that_start_where_they_were_zeroed_are_no_counter() -> None:
    data = bench_data(FORCE, (np.arange(N) % 100) * 1e-5, step=np.full(N, -1), run=RUNS)
    assert wraps(data) is None
