"""What is driven: where it moves, where it stands, and how steeply the other channel answers."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.data import GapData
from identification.gap.recording.rows import Rows
from identification.gap.recording.turns import turns
from identification.gap.recording.white import white_sd

_REACH = 3  # rows to either side, over which a local slope is taken,
# or more, where hardly a tenth of them move by so many standard deviations; up to an eighth of all
_TOLD, _MOVING, _FARTHEST = 5.0, 0.9, 8


def steepness(rows: Rows, driven: Array, answer: Array, sd: float, simulated: Array) -> Array:
    """(n,) how much the answer changes per unit of what is driven, about a row within its run, over
    as many rows as tell its motion from its noise; changes of what is driven below three standard
    deviations count as that much. About a turn both are back where they were, and the steeper side
    counts. Where its motion drowns, at least what is simulated (n,); where it stands, no more than
    that: what goes on meanwhile is no answer."""
    reach, least = _reach(rows, driven, sd), max(3 * sd, 1e-300)
    a, b = _about(rows, reach or _REACH)
    here = np.arange(rows.n)

    def between(first: Ints, last: Ints) -> Array:
        way = np.maximum(np.abs(driven[last] - driven[first]), least)
        return np.asarray(np.abs(answer[last] - answer[first]) / way)

    about, beside = between(a, b), np.maximum(between(a, here), between(here, b))
    turned = np.abs(driven[b] - driven[a]) < least
    steep = np.where(turned, np.maximum(about, beside), about)
    steep = steep if reach else np.maximum(steep, simulated)
    return np.where(_stands(rows, driven, sd), np.minimum(steep, simulated), steep)


def _reach(rows: Rows, driven: Array, sd: float) -> int:
    """How many rows to either side tell the motion of what is driven from its noise: a few where it
    moves plainly over them or stands, more where it does most of the time over more; 0 where it
    goes one way, but never plainly."""
    a, b = _about(rows, reach := _REACH)
    if np.quantile(np.abs(driven[b] - driven[a]), _MOVING) >= _TOLD * sd:
        return _REACH
    while 2 * reach * _FARTHEST <= rows.n:
        a, b = _about(rows, reach := 2 * reach)
        if np.median(np.abs(driven[b] - driven[a])) >= _TOLD * sd:
            return reach
    return _REACH if np.ptp(driven) > _GOES * sd or _run(driven) <= _TREND * sd else 0


def _about(rows: Rows, reach: int) -> tuple[Ints, Ints]:
    """(n,) the rows that lie `reach` before and after every row, within its run."""
    number, run, edges = np.arange(rows.n), np.cumsum(rows.starts) - 1, rows.run_edges
    return np.maximum(number - reach, edges[run]), np.minimum(number + reach, edges[run + 1] - 1)


_LONG = 8  # rows of a stretch in which a channel stands
_BAND, _TREND = 3.0, 1.5  # of the rows' noise: how far it strays there, and runs
_GOES, _SLOWLY = 20.0, 10.0  # of that: in all, and over _REACH rows to either side at the most;
_BENDS = 12.0  # it bends over these: five times what the noise alone does


def driven(data: GapData, rows: Rows, imposed: bool) -> Array:
    """(n,) the displacement (m) if that is imposed, or the force (N), with its mean wherever it
    stands still within its noise: a model that is driven by noise answers with noise that the rig
    never showed."""
    meter = data.instruments
    if rows.continuous:
        if imposed:
            return with_dwell_means(rows, rows.displacement, meter.displacement)
        return with_dwell_means(rows, rows.force, meter.force)
    return rows.rested if imposed else rows.force


def with_dwell_means(rows: Rows, driven: Array, stated: float) -> Array:
    """What is driven (n,) with the mean of every stretch of a running recording in which it stands.
    Of what goes so slowly all the time that a few rows hardly tell it from standing, or goes
    straight on, the mean about every row."""
    if rows.n <= _LONG:
        return driven
    sd = _jitter(driven, stated)
    before, after = _about(rows, _REACH)
    way = np.abs(driven[after] - driven[before])
    bend = np.abs(driven[after] - 2 * driven + driven[before])
    slow_or_straight = way.max() < _SLOWLY * sd or bend.max() < _BENDS * sd
    if np.ptp(driven) > _GOES * sd and slow_or_straight:
        return _means(rows, driven, _reach(rows, driven, sd))
    out = driven.copy()
    for mine in _stretches(rows, driven, sd):
        out[mine] = driven[mine].mean()
    return out


def _stands(rows: Rows, driven: Array, stated: float) -> Flags:
    """(n,) whether what is driven is in a stretch in which it stands."""
    out = np.zeros(rows.n, dtype=bool)
    for mine in _stretches(rows, driven, _jitter(driven, stated)):
        out[mine] = True
    return out


def _stretches(rows: Rows, driven: Array, sd: float) -> Iterator[slice]:
    """Rows over which what is driven stands still within its noise."""
    for a, b in pairwise(rows.run_edges.tolist()):
        first = a
        while first < b:
            last = _stretch(driven[first:b], _BAND * sd) + first
            mine = slice(first, last)
            if last - first >= _LONG and _run(driven[mine]) <= _TREND * sd:
                yield mine
            first = last


def _jitter(driven: Array, stated: float) -> float:
    """Noise of the rows of what is driven: as they scatter, no more than is stated by far, and no
    less than steps of the reading make, if what is stated has room for them."""
    steps = np.abs(np.diff(driven))
    if len(steps) < 2:
        return 0.0
    scatter = white_sd(np.diff(driven, 2))
    coarse = float(np.mean(steps == 0)) > _REPEATED
    step = float(steps[steps > 0].min(initial=np.inf)) / 12**0.5
    return max(min(scatter, 3 * stated), step if coarse and step <= stated else 0.0)


_REPEATED = 0.3  # of the readings are the one before again


def _means(rows: Rows, values: Array, reach: int) -> Array:
    """(n,) means over up to `reach` rows to either side, as many to both, and none beyond where a
    path turns: of straight ones they lie on it."""
    a, b = _about(rows, reach)
    number = np.arange(rows.n)
    side = np.minimum(number - a, b - number)
    for start, end in pairwise(rows.run_edges):
        for turn in turns(values[start:end]):
            side = np.minimum(side, np.abs(number - (start + turn)))
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray((total[number + side + 1] - total[number - side]) / (2 * side + 1))


def _stretch(values: Array, band: float) -> int:
    """How many values stay within `band` of the mean of those before them, at least one."""
    mean = np.cumsum(values) / np.arange(1, len(values) + 1)
    away = np.abs(values[1:] - mean[:-1]) > band
    return int(away.argmax()) + 1 if away.any() else len(values)


def _run(values: Array) -> float:
    """By how much a straight line through the values changes along them."""
    at = np.linspace(-0.5, 0.5, len(values))
    return abs(float(at @ values) / float(at @ at))
