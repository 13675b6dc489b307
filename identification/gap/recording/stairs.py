"""Levels of a staircase whose steps bear no numbers.

A table without step numbers is taken for a recording that runs on. Where what is driven plainly
goes from level to level, stands there for several readings while the answer stands as well, and
does little else, its levels are numbered here as META's author would have: readings of a level then
show their noise, and what goes on while a load stands is seen. Slow ramps that were read coarsely
have levels too, on which the answer goes on.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.data import GapData

_PLAIN = 8.0  # standard uncertainties of one sample, from one level to the next
_STEP = 0.02  # of the range: a level is not left by less
_FEWEST = 3  # readings of a level; levels of a run
_SHARE = 0.8  # of the samples of every run: so many stand on levels
# Of a step: what the answer does on a level, in the middle of all levels. Of a ramp that was read
# coarsely it does twice as much at least as on the step between two.
_GOES_ON = 1.0
_SAME = 0.3  # of the smallest step: levels that lie closer are one
_NO_LOAD = 0.02  # of the largest force


def numbered(data: GapData) -> GapData:
    """The data with the steps of staircases numbered (0: no load), samples between two levels like
    the one they lead to; as they are where a step is numbered, or a run is no staircase."""
    if np.any(data.step >= 0):
        return data
    meter = data.instruments
    for driven, answer, sd in (
        (data.force, data.displacement, meter.force),
        (data.displacement, data.force, meter.displacement),
    ):
        stairs = [_levels(driven, answer, sd, run) for run in _runs(data)]
        if all(stairs):
            return replace(data, step=_numbers(data, driven, stairs))
    return data


def _runs(data: GapData) -> list[slice]:
    edges = [0, *(np.flatnonzero(np.diff(data.run)) + 1).tolist(), len(data.run)]
    return [slice(a, b) for a, b in pairwise(edges)]


def _levels(driven: Array, answer: Array, sd: float, run: slice) -> list[slice]:
    """Rows of the levels of one run; none where it is no staircase. driven, answer (n,); sd: of one
    sample of what is driven."""
    values = driven[run]
    least = max(_PLAIN * sd, _STEP * float(np.ptp(values)))
    left = np.flatnonzero(np.abs(np.diff(values)) > 0.5 * least) + 1
    edges = (run.start + np.array([0, *left, len(values)])).tolist()
    found = [
        slice(a, b) for a, b in pairwise(edges) if b - a >= _FEWEST and np.ptp(driven[a:b]) < least
    ]
    stands = sum(r.stop - r.start for r in found)
    if len(found) < _FEWEST or stands < _SHARE * len(values):
        return []
    plain = np.abs(np.diff([driven[r].mean() for r in found])).min() > least
    return found if plain and np.median(_goes_on(answer, found)) < _GOES_ON else []


def _goes_on(answer: Array, levels: list[slice]) -> Array:
    """(k,) what the answer (n,) does on a level, of the step that led there."""
    inside = np.array([answer[r.stop - 1] - answer[r.start] for r in levels[1:]])
    step = np.array([answer[b.start] - answer[a.stop - 1] for a, b in pairwise(levels)])
    return np.asarray(np.abs(inside) / np.maximum(np.abs(step), np.finfo(float).tiny))


def _numbers(data: GapData, driven: Array, stairs: list[list[slice]]) -> Ints:
    """(n,) numbers of steps: 0 without load, else by the size of what is driven (n,); levels that
    are met again have the same one."""
    levels = [r for found in stairs for r in found]
    means = np.array([driven[r].mean() for r in levels])
    force = np.array([data.force[r].mean() for r in levels])
    apart = [abs(driven[b].mean() - driven[a].mean()) for run in stairs for a, b in pairwise(run)]
    size = np.abs(means - means[np.argmin(np.abs(force))])
    order = np.argsort(size)
    number = np.empty(len(levels), dtype=np.int64)
    number[order] = np.cumsum(np.diff(size[order], prepend=0.0) > _SAME * min(apart))
    loaded = np.abs(force) > _NO_LOAD * np.abs(force).max()
    number += np.any(loaded & (number == 0))
    step, each = np.empty(len(driven), dtype=np.int64), iter(number.tolist())
    for run, found in zip(_runs(data), stairs, strict=True):
        begin = run.start
        for r in found:
            step[begin : r.stop] = last = next(each)
            begin = r.stop
        step[begin : run.stop] = last
    return step
