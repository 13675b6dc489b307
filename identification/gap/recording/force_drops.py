"""Forces that let go: while a stroke goes on, the force falls at once, again and again, or by much.

Springs, friction, flow and play only ever resist a stroke more, or less steeply, as it goes on;
what lets go of a force within a reading or two is unstable: stick and slip, a snap through, a
crack, a magnet, a grip. No word names that.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.data import GapData
from identification.gap.recording.white import white_noise


@dataclass(frozen=True)
class ForceDrops:
    """How often the force lets go, and by how much at the most and together, as shares of the range
    of the force; number of the reading, from 0, where it first does."""

    count: int
    largest: float
    together: float
    first: int


_WITHIN = 2  # readings in which it falls
_AROUND = 5  # readings before and after, over which the stroke goes on
_BESIDE, _PACE = 2, 0.25  # readings next to a fall; of the stroke's mean speed
_LEAST = 0.08  # of the range of the force: of less an upper yield point falls, too
_NOISE = 8.0  # standard deviations
_FASTER = 4.0  # times what the force mostly changes so near to it: a lag only turns back
_FEWEST = 60  # readings
TOGETHER = 0.2  # of the range: what so little lets go is no cause of a gap


def let_go(data: GapData) -> ForceDrops | None:
    """Of a recording whose force nobody drove; None where it does not let go."""
    few = len(data.force) < _FEWEST or data.imposed == "force"
    if few or not (np.ptp(data.displacement) > 0 and np.ptp(data.force) > 0):
        return None
    fall, steady = _falls(data)
    span = float(np.ptp(data.force))
    noise = max(data.instruments.force, white_noise(data.force))
    least = max(_LEAST * span, _NOISE * noise)
    at = np.flatnonzero(steady & (fall > np.maximum(least, _FASTER * _usual(data.force))))
    if not at.size:
        return None
    events = np.split(at, np.flatnonzero(np.diff(at) > _WITHIN) + 1)
    sizes = [float(fall[e].max()) / span for e in events]
    found = ForceDrops(len(sizes), max(sizes), sum(sizes), int(at[0]))
    return found if found.together > TOGETHER else None


def _falls(data: GapData) -> tuple[Array, Flags]:
    """(n,) N by which the force falls, against the sense of the stroke, within the next readings;
    and whether the stroke goes on around there."""
    u, force = data.displacement, data.force
    i, last = np.arange(len(u)), len(u) - 1
    at = [np.clip(i + k, 0, last) for k in (-_AROUND, 0, _WITHIN, _WITHIN + _AROUND)]
    way = u[at[-1]] - u[at[0]]
    sense = np.sign(way)
    # before, through and after the fall it goes on at its pace, and it nowhere turns next to it
    on = (sense != 0) & (data.run[at[-1]] == data.run[at[0]])
    for here, there in pairwise(at):
        least = _PACE * np.abs(way) * (there - here) / np.maximum(at[-1] - at[0], 1)
        on &= sense * (u[there] - u[here]) >= least
    noise = _WITHIN * data.instruments.displacement
    for k in range(-_BESIDE, _WITHIN + _BESIDE):
        step = u[np.clip(i + k + 1, 0, last)] - u[np.clip(i + k, 0, last)]
        on &= sense * step >= -noise
    falls = [sense * (force - force[np.minimum(i + k, last)]) for k in range(1, _WITHIN + 1)]
    return np.max(falls, axis=0), np.asarray(on)


def _usual(force: Array) -> Array:
    """(n,) N: how much the force mostly changes in as many readings, near each."""
    from scipy.ndimage import median_filter

    steps = np.abs(force - np.roll(force, -_WITHIN))
    return np.asarray(median_filter(steps, size=6 * _AROUND + 1, mode="nearest"))
