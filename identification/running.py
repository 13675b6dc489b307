"""Whether a load rests at its levels or runs through them: one rule, for curves and diagnosis."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, Ints

_RUNNING_SHARE = 0.5  # a level through which the force runs by half its range is none
_SEVERAL, _FEWEST = 4, 5  # levels; samples of one
_COMING, _AT_REST = 0.4, 0.1  # of its samples; of all that a channel went


def first_rows(*keys: NDArray[Any]) -> Ints:
    """First rows of the stretches in which no key (n,) changes."""
    new = np.logical_or.reduce([k[1:] != k[:-1] for k in keys])
    return np.concatenate([[0], np.flatnonzero(new) + 1]).astype(np.int64)


def stretches(*keys: NDArray[Any]) -> Ints:
    """(n,) numbers, from 0, of the stretches in which no key (n,) changes; of one row at least."""
    first = first_rows(*keys)
    return np.repeat(np.arange(first.size), np.diff(np.append(first, len(keys[0]))))


def runs_through(force: Array, displacement: Array, first: Ints, span: Array | float) -> bool:
    """Whether the force (n,) runs through more than half of its range span (h,) within one of the
    levels that begin at rows first (h,), and does not come to rest in it: displacement (n,). Two
    samples of a level can't say, and count as held."""
    count = np.diff(np.append(first, len(force)))
    width = np.maximum.reduceat(force, first) - np.minimum.reduceat(force, first)
    runs = (count > 2) & (width > _RUNNING_SHARE * span) & (np.asarray(span) > 0)
    return bool(runs.any() and np.any(runs & ~_comes_to_rest(force, displacement, first, count)))


def _comes_to_rest(
    force: Array, displacement: Array, first: Ints, count: Ints
) -> NDArray[np.bool_]:
    """(h,) levels at whose beginning the load comes from another one, whatever lags: after that
    neither force nor displacement goes on."""
    if len(first) < _SEVERAL:
        return np.zeros(len(first), dtype=bool)
    late = first + (_COMING * count).astype(np.int64)
    out = count >= _FEWEST
    for values in (force, displacement):
        least = _AT_REST * float(np.ptp(values))
        goes = [np.ptp(values[a:b]) for a, b in zip(late, first + count, strict=True)]
        out &= np.array(goes) <= least
    return np.asarray(out)
