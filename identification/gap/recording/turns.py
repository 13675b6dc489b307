"""Where a signal turns, and how far it goes back."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array, Flags
from identification.turns import turning_points


def passes(force: Array) -> int:
    """How often the force goes up or down by a quarter of its range: passes of the cycles."""
    return len(turns(force)) + 1


def turns(force: Array, share: float = 0.25) -> list[int]:
    """Where it turns from one such pass to the next. share: of its range that a pass takes."""
    stride = max(1, len(force) // 20_000)
    back = share * float(np.ptp(force))
    return [at * stride for at in turning_points(force[::stride], back)]


def largest_reversal(path: Array) -> float:
    """How far a path (n,) falls back from the largest value before."""
    return float((np.maximum.accumulate(path) - path).max())


def rises(values: Array) -> Flags:
    """(n,): whether a signal goes up there, or stands."""
    return np.gradient(values) >= 0 if len(values) > 1 else np.ones(len(values), dtype=bool)
