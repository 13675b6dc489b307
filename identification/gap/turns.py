"""Where a signal turns, and how far it goes back."""

from __future__ import annotations

import numpy as np

from identification.gap.data import Array, Flags


def passes(force: Array) -> int:
    """How often the force goes up or down by a quarter of its range: passes of the cycles."""
    return len(turns(force)) + 1


def turns(force: Array, share: float = 0.25) -> list[int]:
    """Where it turns from one such pass to the next. share: of its range that a pass takes."""
    stride = max(1, len(force) // 20_000)
    coarse = force[::stride].tolist()
    back = share * float(np.ptp(force))
    out: list[int] = []
    low, high, rising = coarse[0], coarse[0], None
    at_low = at_high = 0
    for i, x in enumerate(coarse):
        if x < low:
            low, at_low = x, i
        if x > high:
            high, at_high = x, i
        if rising is not False and high - x > back:
            if rising:
                out.append(at_high * stride)
            rising, low, at_low = False, x, i
        elif rising is not True and x - low > back:
            if rising is False:
                out.append(at_low * stride)
            rising, high, at_high = True, x, i
    return out


def way_back(path: Array) -> float:
    """How far a path (n,) falls back from the largest value before."""
    return float((np.maximum.accumulate(path) - path).max())


def rises(values: Array) -> Flags:
    """(n,): whether a signal goes up there, or stands."""
    return np.gradient(values) >= 0 if len(values) > 1 else np.ones(len(values), dtype=bool)
