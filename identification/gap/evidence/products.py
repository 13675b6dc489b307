"""Products of whitened columns under every size of imperfection, made where they are asked for.

A pool has thousands of columns, and an explanation takes a few of them: all products of all columns
would be most of the work, and gigabytes. What is asked for are the small squares of the variants,
once, and whole rows for the few columns that an effect is built from.

Columns are taken apart into what is common to a hold and what differs in it; an imperfection of
holds and rows is then a weight of every part. Most rows are weighed like many others under every
imperfection: products over these are made once for all sizes of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.gap.model.growing import Growing

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_AT_ONCE = 100_000  # numbers of columns that are gathered at a time
_FEW = 500  # rows
_SPARSE = 0.2  # share of numbers that are not zero, below which zeros are left out


@dataclass(frozen=True, eq=False)
class Weights:
    """What an imperfection leaves of the precision: of hold means (holds,), of joint readings
    (m holds,) or of what they are taken apart into, and of contrasts (rows,). log_q: log of its
    determinant in the readings."""

    hold: Array
    q: Array
    log_q: float
    contrast: Array


@dataclass(frozen=True, eq=False)
class SparseColumns:
    """p columns of which few are not zero. values (1 + k, rows): a row of zeros, then the k that
    are not, one to a row; at (p,): the row of `values` that holds each column."""

    at: NDArray[np.intp]
    values: Array

    @classmethod
    def of(cls, columns: Array) -> SparseColumns:
        """Of columns (p, rows), those that are not all zero."""
        kept = np.flatnonzero(np.any(columns != 0, axis=1))
        at = np.zeros(len(columns), dtype=np.intp)
        at[kept] = 1 + np.arange(len(kept))
        return cls(at, np.vstack([np.zeros((1, columns.shape[1])), columns[kept]]))

    def followed(self, parts: Sequence[SparseColumns], room: Growing) -> SparseColumns:
        """With the columns of all parts after these, whose values are in `room`."""
        starts = np.cumsum([len(self.values) - 1, *(len(p.values) - 1 for p in parts)])
        at = [np.where(p.at == 0, 0, p.at + s) for p, s in zip(parts, starts[:-1], strict=True)]
        room.put(p.values[1:] for p in parts)
        return SparseColumns(np.concatenate([self.at, *at]), room.values)

    def picked(self, columns: NDArray[np.intp]) -> SparseColumns:
        """Some of all columns (k,)."""
        at = self.at[columns]
        here = np.flatnonzero(at)
        place = np.zeros(len(at), dtype=np.intp)
        place[here] = 1 + np.arange(len(here))
        return SparseColumns(place, self.values[np.append(0, at[here])])

    @property
    def any(self) -> bool:
        """Whether any column is there."""
        return len(self.values) > 1


def _together(mine: Array, other: Array, weights: Sequence[Array]) -> list[Array]:
    """`(mine * w) @ other.T` for every w; few rows of mine go through the other ones in one go."""
    if len(mine) * len(weights) > _FEW:
        return [np.asarray((mine * w) @ other.T) for w in weights]
    stacked = np.vstack([mine * w for w in weights]) @ other.T
    return list(stacked.reshape(len(weights), len(mine), -1))


def _alike(mine: Array, other: Array, groups: Sequence[slice], weights: Array) -> Array:
    """(w, p, k): the same for rows that come in groups, with weights (w, g) of these."""
    each = np.stack([mine[:, g] @ other[:, g].T for g in groups])
    return np.tensordot(weights, each, axes=1)


def _scaled(thin: csr_matrix, weights: Sequence[Array], other: Array) -> list[Array]:
    """`(thin * w) @ other.T` for every w"""
    rows, each = np.ascontiguousarray(other.T), thin.copy()
    out = []
    for w in weights:
        each.data = thin.data * w[thin.indices]
        out.append(np.asarray(each @ rows))
    return out


@dataclass(frozen=True, eq=False)
class WhitenedColumns:
    """Whitened stacked columns (p): even (p, holds + rest), means of the response per hold and the
    channels without imperfection; q: per joint those that touch its readings; contrast: those
    that vary within holds. holds: how many of `even` are means. groups: of contrasts that are
    weighed alike, all of them or none."""

    even: Array
    q: tuple[SparseColumns, ...]
    contrast: SparseColumns
    holds: int
    groups: tuple[slice, ...]

    def __len__(self) -> int:
        return len(self.even)

    def between(self, columns: WhitenedColumns, weights: list[Weights]) -> list[Array]:
        """Per set of weights (k, p): products of all these columns with all those of another."""
        means, others = self.even[:, : self.holds], columns.even[:, : self.holds]
        out = _together(means, others, [w.hold for w in weights])
        rest = self.even[:, self.holds :] @ columns.even[:, self.holds :].T
        out = [products + rest for products in out]
        qs = zip(*(self._q(w) for w in weights), strict=True)
        for mine, other, each in zip(self.q, columns.q, qs, strict=True):
            if mine.any and other.any:
                _add(out, mine, other, _together(mine.values, other.values, each))
        mine, other = self.contrast, columns.contrast
        if mine.any and other.any:
            _add(out, mine, other, self._contrasts(mine.values, other.values, weights))
        return out

    def _contrasts(self, mine: Array, other: Array, weights: list[Weights]) -> list[Array]:
        if not self.groups:
            return _together(mine, other, [w.contrast for w in weights])
        shares = np.array([self._of_groups(w) for w in weights])
        return list(_alike(mine, other, self.groups, shares))

    def _of_groups(self, w: Weights) -> Array:
        return w.contrast[[g.start for g in self.groups]]

    def sparsely(self, columns: WhitenedColumns, weights: list[Weights]) -> list[Array]:
        """The same, where most numbers of these columns are zero."""
        if self._thin is None:
            return self.between(columns, weights)
        even, contrast = self._thin
        out = _scaled(even, [self._even(w) for w in weights], columns.even)
        mine, other = self.contrast, columns.contrast
        if mine.any and other.any:
            each = _scaled(contrast, [w.contrast for w in weights], other.values)
            _add(out, mine, other, each)
        return out

    @cached_property
    def _thin(self) -> tuple[csr_matrix, csr_matrix] | None:
        """Means and contrasts without their zeros, None where there are few of these."""
        from scipy.sparse import csr_matrix

        if np.count_nonzero(self.even) > _SPARSE * self.even.size:
            return None
        return csr_matrix(self.even), csr_matrix(self.contrast.values)

    def picked(self, columns: NDArray[np.intp]) -> WhitenedColumns:
        """Some of these columns (k,)."""
        q = tuple(s.picked(columns) for s in self.q)
        return WhitenedColumns(
            self.even[columns], q, self.contrast.picked(columns), self.holds, self.groups
        )

    def unweighed(self, columns: NDArray[np.intp]) -> Array:
        """(1 + groups, v, k, k): what `squares` is made of that no weight is needed for."""
        out = np.zeros((1 + len(self.groups), *columns.shape, columns.shape[1]))
        out[0] = squares_of(self.even[:, self.holds :], columns)
        for i, group in enumerate(self.groups, start=1):
            _add_squares(out[i], self.contrast, columns, group)
        return out

    def squares(self, columns: NDArray[np.intp], w: Weights, unweighed: Array) -> Array:
        """(v, k, k): products of the columns (v, k) of every variant."""
        out = np.tensordot(np.append(1.0, self._of_groups(w)), unweighed, axes=1)
        out += squares_of(self.even[:, : self.holds], columns, w.hold)
        for some, weight in zip(self.q, self._q(w), strict=True):
            _add_squares(out, some, columns, weight=weight)
        if not self.groups:
            _add_squares(out, self.contrast, columns, weight=w.contrast)
        return out

    def _even(self, w: Weights) -> Array:
        return np.concatenate([w.hold, np.ones(self.even.shape[1] - self.holds)])

    def _q(self, w: Weights) -> list[Array]:
        return list(w.q.reshape(len(self.q), -1)) if self.q else []


class Gathered:
    """White columns that more are put after; `white` are those that are there."""

    def __init__(self, white: WhitenedColumns) -> None:
        """white: the first ones."""
        self.white = white
        self._even, self._contrast = Growing(white.even), Growing(white.contrast.values)
        self._q = [Growing(some.values) for some in white.q]

    def put(self, parts: Sequence[WhitenedColumns]) -> None:
        """Puts the columns of all parts after those that are there."""
        self._even.put(part.even for part in parts)
        q = zip(self.white.q, zip(*(part.q for part in parts), strict=True), self._q, strict=True)
        self.white = WhitenedColumns(
            self._even.values,
            tuple(some.followed(each, room) for some, each, room in q),
            self.white.contrast.followed([part.contrast for part in parts], self._contrast),
            self.white.holds,
            self.white.groups,
        )


def _add(
    out: list[Array], mine: SparseColumns, other: SparseColumns, products: list[Array]
) -> None:
    """Adds products (p, k) of what is there of two to each of those of all columns."""
    place = np.ix_(mine.at, other.at)
    for rows, product in zip(out, products, strict=True):
        np.add(rows, product[place], out=rows)


def _add_squares(
    out: Array,
    some: SparseColumns,
    columns: NDArray[np.intp],
    rows: slice = slice(None),
    weight: Array | float = 1.0,
) -> None:
    """Adds weighted products over some rows, where columns (v, k) are there."""
    at = some.at[columns]
    mine = np.flatnonzero(at.any(axis=1))
    if mine.size:
        out[mine] += squares_of(some.values[:, rows], at[mine], weight)


def squares_of(values: Array, columns: NDArray[np.intp], weight: Array | float = 1.0) -> Array:
    """(v, k, k): weighted products of the columns (v, k) of every variant, each a row of values."""
    v, k = columns.shape
    out = np.empty((v, k, k))
    step = max(1, _AT_ONCE // max(k * values.shape[1], 1))
    for i in range(0, v, step):
        mine = values[columns[i : i + step]]
        out[i : i + step] = (mine * weight) @ np.swapaxes(mine, 1, 2)
    return out
