"""Samples on their way from one level to the next, whichever of the two they bear the name of: one
rule, for curves and diagnosis."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from identification.arrays import Array, Flags, Ints
from identification.running import first_rows

SEEN = 4.0  # standard deviations
AWAY = 0.01  # of the range: so far the outermost sample of a way has to go at least
# What leaves may do so along a steeper or flatter part of the curve than the whole of it, and has
# crept on meanwhile: so much more of its range one channel may go than the other.
_STEEPER = 4.0
_REST = 0.4  # of a hold: so long it rests, if it ever does
_AT_REST, _ONWARD = 0.1, 0.02  # of the step to the next one
_FEWEST = 3  # samples that show whether they come to rest
_SCATTER, _AT_MOST = 8.0, 0.25  # standard deviations; of a way: so far readings at rest range


def elsewhere(
    force: Array,
    displacement: Array,
    sd: tuple[float, float],
    hold: Ints,
    there: Flags,
    about: float,
) -> tuple[Flags, Array]:
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
    of every ramp; where it is named after the level left, all of it. What comes to rest in the end
    is a level: holds that begin at the level before are named after where they lead."""
    hold = hold - hold[0]
    starts = first_rows(hold)
    rests = _rests(force, np.append(starts, len(hold)))
    going, far = elsewhere(force, displacement, sd, hold, rests, _STEEPER)
    level = np.bincount(hold, force * rests) / np.maximum(np.bincount(hold, rests), 1)
    for a, b in pairwise(starts.tolist()):
        there, step = force[a:b][rests[a:b]], level[hold[b]] - level[hold[a]]
        rested = there.size > 1 and np.ptp(there) < _range_at_rest(step, step, sd[0])
        onward = (force[b - 1] - level[hold[a]]) * step > _ONWARD * step**2
        if rested and onward and far[b - 1] > AWAY and going[b - 1]:
            leaves = a + int(np.flatnonzero(~going[a:b]).max(initial=0)) + 1
            end = force[b - max(2, (b - leaves) // 2) : b]
            gone = float(force[b - 1] - level[hold[a]])
            if b - leaves < _FEWEST or np.ptp(end) > _range_at_rest(step, gone, sd[0]):
                yield leaves, b


def _range_at_rest(step: float, way: float, sd: float) -> float:
    """N over which readings at rest may range beside a step and a way."""
    return max(_AT_REST * abs(step), min(_SCATTER * sd, _AT_MOST * abs(way)))


def _rests(force: Array, edges: Ints) -> Flags:
    """(n,) the part of every hold, `_REST` of its samples in a row, in which the force (n,) changes
    least; about the middle of the hold where that is as good. edges (h + 1,): first samples."""
    out, count = np.zeros(len(force), dtype=bool), np.diff(edges)
    few = count < _FEWEST + 1  # one sample of them, the middle one
    out[edges[:-1][few] + (count[few] - 1) // 2] = True
    for a, b in zip(edges[:-1][~few].tolist(), edges[1:][~few].tolist(), strict=True):
        width = max(1, round(_REST * (b - a)))
        inside = slice(width // 2, width // 2 + b - a - width + 1)  # windows that lie in the hold
        spans = (maximum_filter1d(force[a:b], width) - minimum_filter1d(force[a:b], width))[inside]
        middle = (b - a - width) / 2
        quiet = np.flatnonzero(spans <= _AS_QUIET * spans.min())
        first = a + int(quiet[np.argmin(np.abs(quiet - middle))])
        out[first : first + width] = True
    return out


_AS_QUIET = 1.5  # times: noise of a few samples differs by as much
