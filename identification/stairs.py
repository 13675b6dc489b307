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
# Of a step: what the answer does on a level, in the middle of all levels. Of a ramp that was read
# coarsely it does twice as much at least as on the step between two.
_GOES_ON = 1.0
_SAME = 0.3  # of the smallest step: levels that lie closer are one
_NO_LOAD = 0.02  # of the largest force


def steps_of_stairs(
    runs: Sequence[tuple[Array, Array]], sd: tuple[float, float]
) -> list[tuple[Ints, Ints]] | None:
    """Of every run (force N, displacement; (n,) each), the number of the step of every sample (n,),
    0 without load, and the first row (n,) of its level; samples between two levels belong to the
    one they lead to. None where a run is no staircase. sd: standard uncertainty of one sample of
    each channel."""
    forces = [force for force, _ in runs]
    for driven, answer, u in (
        (forces, [moved for _, moved in runs], sd[0]),
        ([moved for _, moved in runs], forces, sd[1]),
    ):
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
        slice(a, b)
        for a, b in pairwise([0, *left.tolist(), len(driven)])
        if b - a >= _FEWEST and np.ptp(driven[a:b]) < least
    ]
    stands = sum(r.stop - r.start for r in found)
    if len(found) < _FEWEST or stands < _SHARE * len(driven):
        return []
    plain = np.abs(np.diff([driven[r].mean() for r in found])).min() > least
    return found if plain and np.median(_goes_on(answer, found)) < _GOES_ON else []


def _goes_on(answer: Array, levels: list[slice]) -> Array:
    """(k,) what the answer (n,) does on a level, of the step that led there."""
    inside = np.array([answer[r.stop - 1] - answer[r.start] for r in levels[1:]])
    step = np.array([answer[b.start] - answer[a.stop - 1] for a, b in pairwise(levels)])
    return np.asarray(np.abs(inside) / np.maximum(np.abs(step), np.finfo(float).tiny))


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
    out, each = [], iter(number.tolist())
    for d, found in zip(driven, stairs, strict=True):
        ends = np.array([r.stop for r in found])
        level = np.minimum(np.searchsorted(ends, np.arange(len(d)), "right"), len(found) - 1)
        step = np.array([next(each) for _ in found], dtype=np.int64)
        out.append((step[level], np.array([r.start for r in found], dtype=np.int64)[level]))
    return out
