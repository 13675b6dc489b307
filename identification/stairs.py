"""Levels of a staircase whose steps bear no numbers: one rule, for curves and diagnosis.

A table without step numbers is taken for a recording that runs on. Where what is driven plainly
goes from level to level, stands there for several readings while the answer stands as well, and
does little else, its levels are numbered here as META's author would have: readings of a level then
show their noise, and what goes on while a load stands is seen. Slow ramps that were read coarsely
have levels too, on which the answer goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Ints

_PLAIN = 8.0  # standard uncertainties of one sample, from one level to the next
_STEP = 0.02  # of the range: a level is not left by less
_FEWEST = 3  # readings of a level; levels of a run
_SHARE = 0.6  # of the samples of every run: so many stand on levels
_SAME = 0.3  # of the smallest step: levels that lie closer are one
_NO_LOAD = 0.02  # of the largest force


def steps_of_stairs(
    runs: Sequence[tuple[Array, Array]], sd: tuple[float, float]
) -> list[tuple[Ints, Ints]] | None:
    """Of every run (force N, displacement; (n,) each), the number of the step of every sample (n,),
    0 without load, and the first row (n,) of its level; samples between two levels belong to the
    one they lead to. None where a run is no staircase. sd: standard uncertainty of one sample of
    each channel."""
    forces, moved = [force for force, _ in runs], [moved for _, moved in runs]
    if np.ptp(np.concatenate(forces)) <= 2 * _PLAIN * sd[0]:
        return None  # a displacement that jumps under a force that stands is no staircase
    for driven, answer, u in ((forces, moved, sd[0]), (moved, forces, sd[1])):
        stairs = [_levels(d, a, u) for d, a in zip(driven, answer, strict=True)]
        if all(stairs):
            return _numbers(forces, driven, stairs)
    return None


def _levels(driven: Array, answer: Array, sd: float) -> list[slice]:
    """Rows of the levels of one run; none where it is no staircase. driven, answer (n,); sd: of one
    sample of what is driven."""
    least = max(_PLAIN * sd, _STEP * float(np.ptp(driven)))
    left = np.flatnonzero(np.abs(np.diff(driven)) > 0.5 * least) + 1
    found = [
        r
        for r in _joined(driven, [0, *left.tolist(), len(driven)], 0.5 * least)
        if r.stop - r.start >= _FEWEST and np.ptp(driven[r]) < least + _PLAIN * sd
    ]
    stands = sum(r.stop - r.start for r in found)
    if len(found) < _FEWEST or stands < _SHARE * len(driven):
        return []
    plain = np.abs(np.diff([driven[r].mean() for r in found])).min() > least
    return found if plain and not _goes_on(answer, found) else []


def _joined(values: Array, edges: list[int], least: float) -> list[slice]:
    """Stretches between edges, neighbours joined whose means lie closer than that: in a long level
    some reading jumps off by chance."""
    total = np.concatenate([[0.0], np.cumsum(values)])

    def mean(a: int, b: int) -> float:
        return float(total[b] - total[a]) / (b - a)

    begins = [edges[0]]
    for a, b in pairwise(edges):
        if a > begins[-1] and abs(mean(a, b) - mean(begins[-1], a)) >= least:
            begins.append(a)
    return [slice(a, b) for a, b in pairwise([*begins, edges[-1]])]


def _goes_on(answer: Array, levels: list[slice]) -> bool:
    """Whether the answer (n,) does as much on the levels as on the steps between them."""
    inside = sum(abs(answer[r.stop - 1] - answer[r.start]) for r in levels)
    steps = sum(abs(answer[b.start] - answer[a.stop - 1]) for a, b in pairwise(levels))
    return bool(inside >= steps)


def _numbers(
    forces: list[Array], driven: list[Array], stairs: list[list[slice]]
) -> list[tuple[Ints, Ints]]:
    """Numbers of the steps by the size of what is driven, 0 without load; levels that are met again
    have the same one. With the first rows of the levels."""
    means = [
        np.array([d[r].mean() for r in found]) for d, found in zip(driven, stairs, strict=True)
    ]
    force = np.array([f[r].mean() for f, found in zip(forces, stairs, strict=True) for r in found])
    smallest = min(float(np.abs(np.diff(m)).min()) for m in means)
    every = np.concatenate(means)
    size = np.abs(every - every[np.argmin(np.abs(force))])
    order = np.argsort(size)
    number = np.empty(len(size), dtype=np.int64)
    number[order] = np.cumsum(np.diff(size[order], prepend=0.0) > _SAME * smallest)
    loaded = np.abs(force) > _NO_LOAD * np.abs(force).max()
    number += np.any(loaded & (number == 0))
    out = []
    of_run = np.split(number, np.cumsum([len(found) for found in stairs])[:-1])
    for d, found, step in zip(driven, stairs, of_run, strict=True):
        first, ends = np.array([(r.start, r.stop) for r in found], dtype=np.int64).T
        level = np.minimum(np.searchsorted(ends, np.arange(len(d)), "right"), len(found) - 1)
        out.append((step[level], first[level]))
    return out
