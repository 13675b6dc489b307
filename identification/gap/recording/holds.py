"""Samples that belong together: holds at one level, and the noise in them."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.data import GapData
from identification.running import first_rows, runs_through


def hold_ids(data: GapData) -> Ints:
    """(n,) number of the hold of every sample: same run, branch and step, without a pause, at rest
    or on the way there, and on one side of no load: steps of the same size to and fro may bear the
    same number."""
    keys = np.column_stack([data.run, data.branch, data.step, data.ways])
    new = np.any(np.diff(keys, axis=0) != 0, axis=1)
    loaded = (data.step > 0) & (np.abs(data.force) > _LOADED * data.instruments.force)
    side = np.where(loaded, side_of(data.force), 0.0)
    new |= side[1:] * side[:-1] < 0
    return np.concatenate([[0], np.cumsum(new)]).astype(np.int64)


def rest_ids(data: GapData, hold: Ints) -> Ints:
    """(n,) the same holds (n,), in which samples on the way stand alone: what they do is no
    scatter."""
    way = data.ways
    new = (np.diff(hold) != 0) | way[1:] | way[:-1]
    return np.concatenate([[0], np.cumsum(new)]).astype(np.int64)


_NUMBERED, _ONCE = 60, 0.9  # levels a run; readings that are alone on theirs, as a share


def _numbered(data: GapData, hold: Ints) -> bool:
    """Whether steps count readings. Levels are looked up only where there are as many holds."""
    least = max(_NUMBERED * len(np.unique(data.run)), _ONCE * len(hold))
    if hold[-1] + 1 < least:
        return False
    return len(np.unique(np.column_stack([data.run, data.step]), axis=0)) >= least


def is_continuous(data: GapData, hold: Ints) -> bool:
    """Whether the force runs instead of resting at levels; or rests at one all the time. Without an
    arm so many levels, each read once and never met again, are no levels, but numbered readings."""
    if np.any(data.step < 0) or (hold[-1] == 0 and not data.arm):
        return True
    if not data.arm and _numbered(data, hold):
        return True
    first = first_rows(hold)
    whole = float(np.ptp(data.force))
    side = max(float(np.ptp(np.clip(data.force * sign, 0.0, None))) for sign in (1.0, -1.0))
    span = np.where(data.step[first] > 0, side, whole)  # where holds end with their side
    span[data.ways[first]] = np.inf  # what is on its way to a level comes to rest there
    return runs_through(data.force, data.displacement, first, span)


_SIDE = 0.05  # of the largest force: less is no load, nor
_LOADED = 5.0  # standard uncertainties of one sample


def side_of(force: Array) -> Array:
    """Sign of forces (n,), 0 of what is no load."""
    return np.where(np.abs(force) > _SIDE * np.abs(force).max(initial=0.0), np.sign(force), 0.0)


# Noise reaches this square sum in one hold of ten thousand (chi squared of 1 to 8 degrees);
# what really moves (a lagging channel, a relaxing screw) goes far beyond it.
_STEADY_PER_ROW, _STEADY_ONCE = 2.6, 12.5
# What is stated is known to a factor of two (GUM G.4.2): a force that scatters more than that may
# really tremble.
_MISJUDGED = 2.0
ENOUGH = 30  # second differences: then their scatter is known to about an eighth


def scatter_within(values: Array, hold: Ints, comes: Array | None = None) -> float | None:
    """Standard deviation of the white part of values (n,), from second differences within holds,
    the first sample left out (it may lag); trimmed at 5 %, corrected for that (normal noise:
    0.8713). Of holds that settle, in their later parts. None where there are too few, or most of
    them goes by the way that a hold was come to; comes (n,): what tells that, if not the values."""
    part = _late(hold, _FOUR) if _settles(values, hold) else hold
    if _goes_on(values, part, values if comes is None else comes):
        return None
    return _trimmed(_second(values, part)[0])


def _settles(values: Array, hold: Ints) -> bool:
    """Whether values (n,) scatter more right after the first samples of their holds than later on:
    a channel that lags by two samples, or a screw that relaxes, makes second differences which are
    no noise."""
    each, which = _second(values, hold)
    late, _ = _second(values, _late(hold, _FOUR))
    early = each[np.diff(which, prepend=-1) != 0]
    begins, ends = _trimmed(early), _trimmed(late)
    if not begins or not ends:
        return False
    chance = (1 / (2 * len(early)) + 1 / (2 * len(late))) ** 0.5
    return bool(np.log(begins / ends) > _SURELY * chance)


def _goes_on(values: Array, hold: Ints, comes: Array) -> bool:
    """Whether the second differences of values (n,) go by the way that their holds were come to, by
    more than chance, and mostly: what slows down for all of a short hold does."""
    each, which = _second(values, hold)
    if len(each) < ENOUGH:
        return False
    first = first_rows(hold)
    came = np.sign(np.diff(comes[first], prepend=comes[0]))
    along = each * came[np.searchsorted(hold[first], which)]
    rms = float(np.sqrt(np.mean(along**2)))
    return bool(abs(along.mean()) > rms * max(_SURELY / len(each) ** 0.5, _MOSTLY))


_FOUR = 4  # samples that a second difference needs, and one before
_SURELY = 3.0  # standard errors
_MOSTLY = 0.6  # of their rms


def _late(hold: Ints, least: int) -> Ints:
    """(n,) the second halves of the holds, of at least so many samples; every one before alone."""
    first = first_rows(hold)
    count = np.diff(np.append(first, len(hold)))
    place = np.arange(len(hold)) - np.repeat(first, count)
    begin = np.clip(count - least, 0, count // 2)
    return np.cumsum(place <= np.repeat(begin, count)).astype(np.int64)


def _second(values: Array, hold: Ints) -> tuple[Array, Ints]:
    """(k,) second differences within holds but for their first samples, as large as the values
    scatter; (k,) their holds."""
    if len(values) < _FOUR:
        return np.zeros(0), hold[:0]
    same = hold[3:] == hold[:-3]
    second = values[3:] - 2 * values[2:-1] + values[1:-2]
    return np.asarray(second[same] / 6**0.5), hold[3:][same]


def in_common(values: Array, others: Array, hold: Ints) -> tuple[float, float]:
    """Size of the mean product of what two channels (n,) scatter in holds, and its standard error;
    0 where there are too few."""
    ours, theirs = (_second(v, hold)[0] for v in (values, others))
    if len(ours) < ENOUGH:
        ours, theirs = (_of_three(v, hold)[0] for v in (values, others))
    if len(ours) < ENOUGH:
        return 0.0, 0.0
    product = ours * theirs
    return abs(float(product.mean())), float(product.std()) / float(len(product) ** 0.5)


def scatter_of_three(values: Array, hold: Ints) -> float | None:
    """The same of holds that are too short for that, from their last two readings: None where these
    go on the way that the hold was come to, or there are too few."""
    step, came = _of_three(values, hold)
    onward = step * came
    if abs(onward.sum()) > _ONWARD * float(np.sqrt(onward @ onward)):
        return None
    return _trimmed(step)


def _of_three(values: Array, hold: Ints) -> tuple[Array, Array]:
    """(k,) steps between the last two readings of holds of three, as large as the values scatter;
    (k,) the sense in which these holds were come to."""
    first = first_rows(hold)
    three = np.diff(np.append(first, len(hold))) == _THREE
    came = np.sign(np.diff(values[first], prepend=values[0]))
    last = first[three] + _THREE - 1
    return (values[last] - values[last - 1]) / 2**0.5, came[three]


_THREE = 3
_ONWARD = 2.5  # standard errors


def _trimmed(unit: Array) -> float | None:
    """Standard deviation of values (k,) that scatter about zero."""
    squares = np.sort(unit**2)
    if squares.size < ENOUGH:
        return None
    return float(np.sqrt(squares[: int(0.95 * squares.size)].mean()) / 0.8713)


def swing_within(values: Array, hold: Ints) -> float:
    """rms of what values (n,) have in common with the next one about the line through their hold: a
    vibration that samples follow, or noise of many colours; not their own noise, nor what settles.
    0 where holds are too short, or where chance does as much."""
    hold = _late(hold, _SWINGS) if _settles(values, hold) else hold
    count = np.bincount(hold)[hold]

    def about_mean(x: Array) -> Array:
        return np.asarray(x - np.bincount(hold, weights=x)[hold] / count)

    left, at = about_mean(values), about_mean(np.arange(len(values), dtype=float))
    steep = np.bincount(hold, weights=left * at) / np.maximum(np.bincount(hold, at**2), 1e-300)
    left = left - steep[hold] * at
    pairs = (hold[1:] == hold[:-1]) & (count[1:] >= _SWINGS)
    common = (left[1:] * left[:-1])[pairs]
    if common.size < ENOUGH:
        return 0.0
    sure = float(common.mean()) - _BY_CHANCE * float(common.std()) / common.size**0.5
    return float(max(sure, 0.0) ** 0.5)


_SWINGS = 5  # samples of a hold
_BY_CHANCE = 2.0  # standard deviations of the mean


def noise_in_holds(values: Array, hold: Ints, stated: float) -> float:
    """What values (n,) scatter in their holds: as stated, or more as far as that may be wrong."""
    return min(max(stated, scatter_within(values, hold) or 0.0), _MISJUDGED * stated)


def steadied(hold: Ints, values: Array, weight: Array, sd: float) -> tuple[Array, Flags]:
    """Values (n,) with their mean in holds in which they stand still within noise; these (n,).
    weight (n,): 0 of what does not count."""
    count = np.maximum(np.bincount(hold, weights=weight), 1e-300)
    mean = np.bincount(hold, weights=weight * values) / count
    square = np.bincount(hold, weights=weight * (values - mean[hold]) ** 2) / sd**2
    rows = np.bincount(hold, weights=weight > 0)
    steady = (square <= _STEADY_PER_ROW * rows + _STEADY_ONCE)[hold]
    return np.where(steady, mean[hold], values), steady
