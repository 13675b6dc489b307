"""Samples that become one row each: what is kept of them.

A hold gives many nearly equal samples; creep, lag and drift need its beginning and its length, not
every second of it. A continuous recording is cut at its turning points and binned evenly; a short
one is kept as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, Ints
from identification.gap.data import GapData
from identification.gap.recording.turns import passes
from identification.running import first_rows

_ROWS_PER_PASS, _MOST_ROWS = 80, 4000  # memory needs the turning points of every cycle
CONTINUOUS_ROWS = 500  # bins of a continuous recording; more tells no effect from another

_T = TypeVar("_T", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Bins:
    """Bins of n samples. edges (k,): their first samples. running: of a continuous recording."""

    n: int
    edges: Ints
    running: bool

    @classmethod
    def of(cls, data: GapData, hold: Ints, running: bool) -> Bins:
        """hold (n,): as `hold_ids` has it."""
        edges = _continuous_edges(data) if running else _hold_edges(hold, data.time)
        return cls(len(data.force), edges, running)

    @cached_property
    def count(self) -> Ints:
        """(k,) samples in every bin."""
        return np.diff(np.append(self.edges, self.n))

    def first(self, values: NDArray[_T]) -> NDArray[_T]:
        """(k, ...) values (n, ...) where the bins begin."""
        return values[self.edges]

    def last(self, values: NDArray[_T]) -> NDArray[_T]:
        """(k, ...) of the last sample in each bin."""
        ends: Ints = np.append(self.edges[1:], self.n) - 1
        return values[ends]

    def mean(self, values: Array) -> Array:
        """(k, ...) of values (n, ...)."""
        sums = np.add.reduceat(values, self.edges, axis=0)
        return np.asarray(sums / (self.count if values.ndim == 1 else self.count[:, None]))

    def mean_of(self, values: Array | None) -> Array | None:
        """The same of what may not have been recorded."""
        return None if values is None else self.mean(values)

    def scatter(self, values: Array, other: Array) -> Array:
        """(k,) mean square of values (n,) about their row; of a running recording, about their line
        in it over another channel (n,)."""
        u = values - values.mean()
        square = np.maximum(self.mean(u**2) - self.mean(u) ** 2, 0.0)
        if not self.running:
            return square
        x = other - other.mean()
        var, both = self.mean(x**2) - self.mean(x) ** 2, self.mean(x * u)
        each = (both - self.mean(x) * self.mean(u)) / np.maximum(var, 1e-300)
        slope = np.where(var > 0, each, 0.0)
        about_line = np.maximum(square - slope**2 * var, 0.0)
        return np.where(var > 0, self._unbiased(about_line), square)

    def _unbiased(self, square: Array) -> Array:
        """(k,) mean squares about a row's mean, from those (k,) about a line in it, which takes
        another degree of freedom; of two samples it leaves none, and they scatter as the others."""
        free = np.maximum(self.count - 2, 0)
        if not free.any():
            return square
        one = float((self.count * square)[free > 0].sum() / free.sum())
        few = one * (self.count - 1) / self.count
        return np.where(free > 0, square * (self.count - 1) / np.maximum(free, 1), few)

    def trend(self, time: Array, values: Array) -> Array:
        """(k,) mean product of time and values (n,) about the row; zero where the load runs."""
        if self.running:
            return np.zeros(len(self.edges))
        t, u = time - time.mean(), values - values.mean()
        return self.mean(t * u) - self.mean(t) * self.mean(u)


def _hold_edges(hold: Ints, time: Array) -> Ints:
    """Bins of 1, 1, 2, 4, 8 ... samples from the start of every hold; where these are taken ever
    more seldom, as creep often is, no bin over more than twice its time since then. None is a large
    part of the recording: a room warms and cools while a weight hangs."""
    starts = first_rows(hold)
    count = np.diff(np.append(starts, len(hold)))
    within = np.arange(len(hold)) - np.repeat(starts, count)
    edge = (within & (within - 1)) == 0  # 0, 1, 2, 4, 8 ...
    most = max(_FINE, len(hold) // CONTINUOUS_ROWS)
    late = np.repeat(count > max(_LONG, _PART * len(hold)), count) & (within >= most)
    edge = np.where(late, within % most == 0, edge)
    since = np.maximum(time - np.repeat(time[starts], count), 0.0)
    begin = np.flatnonzero(edge)
    size = np.diff(np.append(begin, len(hold)))
    ratio = since / np.repeat(np.maximum(since[begin], 1e-300), size)
    last = np.repeat(np.maximum.reduceat(ratio, begin), size)
    doubled = np.where(
        (last > _SELDOM) & (within > 0), np.floor(np.log2(np.maximum(ratio, 1.0))), 0
    )
    edge |= np.diff(doubled, prepend=0.0) > 0
    return np.flatnonzero(edge).astype(np.int64)


_LONG, _PART = 64, 0.05  # samples of a hold that is, and its part of the recording, at least
_FINE = 8  # samples of its bins, at least
_SELDOM = 3.0  # times: samples evenly spaced keep a bin below 2


def _continuous_edges(data: GapData) -> Ints:
    """Bins of equal path; every run starts one."""
    n = len(data.force)
    wanted = int(np.clip(_ROWS_PER_PASS * passes(data.force), CONTINUOUS_ROWS, _MOST_ROWS))
    if n <= (_MOST_ROWS if data.arm else wanted):  # an arm's few levels are left in a sample or two
        return np.arange(n, dtype=np.int64)
    number = even_path(data.force, data.displacement, wanted)
    return first_rows(number, data.run)


def even_path(force: Array, displacement: Array, wanted: int) -> Ints:
    """(n,) number of the bin, of up to `wanted`: bins of equal path in time and both channels (n,)
    together, so that fast and slow parts count alike, a ramp of a moment as much as the hold after
    it, and no bin straddles much of either."""
    n = len(force)
    path, width = np.arange(n) / n, max(1, n // (4 * wanted))
    for values in (force, displacement):
        coarse = np.repeat(values[::width], width)[:n]  # steps of the noise are no path
        step = np.abs(np.diff(coarse, prepend=coarse[0]))
        path = path + np.cumsum(step) / (step.sum() or 1.0)
    return np.asarray(np.floor(path / path[-1] * wanted * (1 - 1e-12)), dtype=np.int64)
