"""Records that swing faster than rows tell: nothing is wrong with their springs, and yet not all is
explained."""

from __future__ import annotations

import numpy as np
import pytest

from tests.explained import explained
from tests.unit.test_gap_running import SPRING, running, triangle

N = 12000  # samples: a swing takes a dozen, a row of what is compared more


@pytest.mark.parametrize(("times", "verdict"), [(0.0, "none"), (1.0, "none"), (12.0, "unknown")])
def test_a_drive_that_hunts_under_load_is_not_nothing(times: float, verdict: str) -> None:
    """Above half of the load the displacement goes to and fro, by so many times the noise."""
    rng, force = np.random.default_rng(5), 100 * np.abs(triangle(N, 2.0))
    noise, n = 1e-6, np.arange(N)
    hunts = times * noise * np.sin(2 * np.pi * n / 17.3) * (force > 50)
    moved = force / SPRING + hunts + rng.normal(0, noise, N)
    found = explained(running(force, moved, imposed="force"))
    assert found.verdict == verdict
