"""Products of whitened columns under every size of imperfection, made where they are asked for.

A pool has thousands of columns, and an explanation takes a few of them: all products of all columns
would be most of the work, and gigabytes. What is asked for are the small squares of the variants,
once, and whole rows for the few columns that an effect is built from.

Columns are taken apart into what is common to a hold and what differs in it; an imperfection of
holds and rows is then a weight of every part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.gap.data import Array

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

_AT_ONCE = 100_000  # numbers of columns that are gathered at a time
_FEW = 500  # rows
_SPARSE = 0.2  # share of numbers that are not zero, below which zeros are left out


@dataclass(frozen=True, eq=False)
class Weights:
    """What an imperfection leaves of the precision: of hold means (holds,), of joint readings
    (6 holds,), and of contrasts (rows,)."""

    hold: Array
    q: Array
    contrast: Array


@dataclass(frozen=True, eq=False)
class Some:
    """Few of many columns: at (p,) the place of every column in `values`, the last one (a row of
    zeros) for those that are not among them; values (k + 1, rows), a column to a row."""

    at: NDArray[np.intp]
    values: Array

    @classmethod
    def of(cls, columns: Array) -> Some:
        """Of columns (p, rows), those that are not all zero."""
        kept = np.flatnonzero(np.any(columns != 0, axis=1))
        at = np.full(len(columns), len(kept), dtype=np.intp)
        at[kept] = np.arange(len(kept))
        return cls(at, np.vstack([columns[kept], np.zeros((1, columns.shape[1]))]))

    @classmethod
    def joined(cls, parts: Sequence[Some]) -> Some:
        """The columns of all parts, one after the other."""
        starts = np.cumsum([0, *(part.none for part in parts)])
        at = [np.where(p.at == p.none, starts[-1], p.at + start)
              for p, start in zip(parts, starts[:-1], strict=True)]  # fmt: skip
        values = [*(part.values[:-1] for part in parts), parts[0].values[-1:]]
        return cls(np.concatenate(at), np.vstack(values))

    def picked(self, columns: NDArray[np.intp]) -> Some:
        """Some of all columns (k,)."""
        at = self.at[columns]
        here = np.flatnonzero(at != self.none)
        place = np.full(len(at), len(here), dtype=np.intp)
        place[here] = np.arange(len(here))
        return Some(place, self.values[np.append(at[here], self.none)])

    @property
    def none(self) -> int:
        """Place of what is not there."""
        return len(self.values) - 1


def _together(mine: Array, other: Array, weights: Sequence[Array]) -> list[Array]:
    """`(mine * w) @ other.T` for every w; few rows of mine go through the other ones in one go."""
    if len(mine) * len(weights) > _FEW:
        return [np.asarray((mine * w) @ other.T) for w in weights]
    stacked = np.vstack([mine * w for w in weights]) @ other.T
    return np.split(stacked, len(weights))


def _scaled(thin: csr_matrix, weights: Array, other: Array) -> Array:
    """`(thin * weights) @ other.T`"""
    from scipy.sparse import csr_matrix

    each = csr_matrix((thin.data * weights[thin.indices], thin.indices, thin.indptr), thin.shape)
    return np.asarray(each @ other.T)


@dataclass(frozen=True, eq=False)
class White:
    """Whitened stacked columns (p): even (p, holds + rest), means of the response per hold and the
    channels without imperfection; q: per joint those that touch its readings; contrast: those
    that vary within holds. holds: how many of `even` are means."""

    even: Array
    q: tuple[Some, ...]
    contrast: Some
    holds: int

    def __len__(self) -> int:
        return len(self.even)

    @classmethod
    def joined(cls, parts: Sequence[White]) -> White:
        """The columns of all parts, one after the other."""
        return cls(
            np.vstack([part.even for part in parts]),
            tuple(Some.joined(each) for each in zip(*(part.q for part in parts), strict=True)),
            Some.joined([part.contrast for part in parts]),
            parts[0].holds,
        )

    def between(self, columns: White, weights: list[Weights]) -> list[Array]:
        """Per set of weights (k, p): products of all these columns with all those of another."""
        evens = [self._even(w) for w in weights]
        out = _together(self.even, columns.even, evens)
        qs = list(zip(*(self._q(w) for w in weights), strict=True))
        parts = [*zip(self.q, columns.q, qs, strict=True),
                 (self.contrast, columns.contrast, [w.contrast for w in weights])]  # fmt: skip
        for mine, other, each in parts:
            if mine.none and other.none:
                products = _together(mine.values, other.values, each)
                for rows, product in zip(out, products, strict=True):
                    np.add(rows, product[np.ix_(mine.at, other.at)], out=rows)
        return out

    def sparsely(self, columns: White, w: Weights) -> Array:
        """The same, where most numbers of these columns are zero."""
        if self._thin is None:
            return self.between(columns, [w])[0]
        even, contrast = self._thin
        out = _scaled(even, self._even(w), columns.even)
        mine, other = self.contrast, columns.contrast
        if mine.none and other.none:
            product = _scaled(contrast, w.contrast, other.values)
            out += product[np.ix_(mine.at, other.at)]
        return out

    @cached_property
    def _thin(self) -> tuple[csr_matrix, csr_matrix] | None:
        """Means and contrasts without their zeros, None where there are few of these."""
        from scipy.sparse import csr_matrix

        if np.count_nonzero(self.even) > _SPARSE * self.even.size:
            return None
        return csr_matrix(self.even), csr_matrix(self.contrast.values)

    def picked(self, columns: NDArray[np.intp]) -> White:
        """Some of these columns (k,)."""
        q = tuple(s.picked(columns) for s in self.q)
        return White(self.even[columns], q, self.contrast.picked(columns), self.holds)

    def squares(self, columns: NDArray[np.intp], w: Weights) -> Array:
        """(v, k, k): products of the columns (v, k) of every variant."""
        out = squares_of(self.even, columns, self._even(w))
        for some, weight in zip((*self.q, self.contrast), (*self._q(w), w.contrast), strict=True):
            at = some.at[columns]
            mine = np.flatnonzero((at != some.none).any(axis=1))
            if mine.size:
                out[mine] += squares_of(some.values, at[mine], weight)
        return out

    def _even(self, w: Weights) -> Array:
        return np.concatenate([w.hold, np.ones(self.even.shape[1] - self.holds)])

    def _q(self, w: Weights) -> list[Array]:
        return np.split(w.q, len(self.q)) if self.q else []


def squares_of(values: Array, columns: NDArray[np.intp], weight: Array | float = 1.0) -> Array:
    """(v, k, k): weighted products of the columns (v, k) of every variant, each a row of values."""
    v, k = columns.shape
    out = np.empty((v, k, k))
    step = max(1, _AT_ONCE // max(k * values.shape[1], 1))
    for i in range(0, v, step):
        mine = values[columns[i : i + step]]
        out[i : i + step] = (mine * weight) @ np.swapaxes(mine, 1, 2)
    return out
