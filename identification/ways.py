"""Samples on their way from one level to the next, whichever of the two they bear the name of: one
rule, for curves and diagnosis."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.running import first_rows

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

SEEN = 4.0  # standard deviations
AWAY = 0.01  # of the range: so far the outermost sample of a way has to go at least
# What leaves may do so along a steeper or flatter part of the curve than the whole of it, and has
# crept on meanwhile: so much more of its range one channel may go than the other.
_STEEPER = 4.0
_MIDDLE = (0.35, 0.75)  # of a hold: it rests there, if it ever does
_AT_REST, _ONWARD = 0.1, 0.02  # of the step to the next one


def elsewhere(
    force: Array, displacement: Array, sd: tuple[float, float], hold: Ints, there: Flags,
    about: float,
) -> tuple[Flags, Array]:  # fmt: skip
    """Samples (n,) at which force and displacement (n,) are both elsewhere than the mean of their
    hold (n,) over those that are there (n,), to the sides that belong together, by shares of their
    ranges of which none is more than `about` times the other; and how far (n,), the larger share.
    sd: of one sample of each."""
    away, far = [], []
    for values, u in zip((force, displacement), sd, strict=True):
        mean = np.bincount(hold, values * there) / np.maximum(np.bincount(hold, there), 1)
        off = values - mean[hold]
        away.append(off / u)
        far.append(np.abs(off) / (np.ptp(values) or 1.0))
    sense = np.sign((force - force.mean()) @ (displacement - displacement.mean()))
    alike = away[0] * away[1] * sense > 0
    alike &= (np.minimum(*np.abs(away)) > 1) & (np.maximum(*far) < about * np.minimum(*far))
    return np.asarray(alike & (np.hypot(*away) > SEEN)), np.asarray(np.maximum(*far))


def leading_on(
    force: Array, displacement: Array, sd: tuple[float, float], hold: Ints
) -> Iterator[tuple[int, int]]:
    """Of one run, the samples at the end of a hold that has come to rest which are on their way to
    the next one: (first of them, first of the next). force, displacement, hold (n,); sd: of one
    sample of each. Where every sample is named after the level next to it, that is the first half
    of every ramp."""
    hold = hold - hold[0]
    starts = first_rows(hold)
    count = np.diff(np.append(starts, len(hold)))
    share = (np.arange(len(hold)) - np.repeat(starts, count)) / np.repeat(count, count)
    middle = (share >= _MIDDLE[0]) & (share < _MIDDLE[1])
    going, far = elsewhere(force, displacement, sd, hold, middle, _STEEPER)
    level = np.bincount(hold, force * middle) / np.maximum(np.bincount(hold, middle), 1)
    for a, b in pairwise(starts.tolist()):
        there, step = force[a:b][middle[a:b]], level[hold[b]] - level[hold[a]]
        rested = there.size > 1 and np.ptp(there) < _AT_REST * abs(step)
        onward = (force[b - 1] - level[hold[a]]) * step > _ONWARD * step**2
        if rested and onward and far[b - 1] > AWAY and going[b - 1]:
            yield a + int(np.flatnonzero(~going[a:b]).max(initial=0)) + 1, b
