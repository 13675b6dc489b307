"""A counter that wraps: fringes of an interferometer, or lines of an encoder, that start again."""

from __future__ import annotations

import numpy as np

from identification.gap.data import GapData

_WHOLE = 0.8  # of the range, by one jump
_ELSE = 0.2  # of it at most, by the readings before and after
_ALIKE = 0.05  # of the jump
_AGAIN = 3


def wraps(data: GapData) -> float | None:
    """By how much (m) the displacement jumps, again and again, from one end of its range to the
    other and against the way that it goes before and after, while the force goes on; None where it
    doesn't."""
    step, push = np.diff(data.displacement), np.abs(np.diff(data.force))
    if len(step) < _AGAIN * 3 or not np.ptp(data.displacement) > 0:
        return None
    span = float(np.ptp(data.displacement))
    jump, before, after = step[1:-1], step[:-2], step[2:]
    against = (jump * before < 0) & (jump * after < 0)
    small = np.maximum(np.abs(before), np.abs(after)) < _ELSE * span
    calm = push[1:-1] <= _ELSE * float(np.ptp(data.force))  # what is let go at once comes back
    same = (data.run[3:] == data.run[:-3]) & against & small & calm
    size = np.abs(jump[same & (np.abs(jump) > _WHOLE * span)])
    if len(size) < _AGAIN or np.ptp(size) > _ALIKE * size.max():
        return None
    return float(np.median(size))
