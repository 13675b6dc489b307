"""Log evidence of variants that are alike in size, at the levels of imperfection that may count.

An explanation fits a gap at the levels about its own imperfection; of the evidence of the others
there is a bound, which needs no look at them. With C the covariance of target and effect together,
the evidence is `-1/2 y' C^-1 y - 1/2 log|C|`. C grows with the size eta of the imperfection, but
no faster than eta^2, and the effect only adds to its determinant: `y' C^-1 y` of one level bounds
that of the levels below, and, by the ratio of eta^2, that of those above.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from identification.gap.data import Array, Ints
from identification.gap.evidence import Engine, Level
from identification.gap.imperfection import log_level
from identification.gap.signs import Limits, log_odds

_COUNTS = 40.0  # nats below the best: what lies further down adds nothing


@dataclass(frozen=True, eq=False)
class Stack:
    """Variants of one word: columns (v, k), roots (v, k, k), scales (v, s), mean squares (v, k, k),
    limits; by number of the level their products (v, k, k), once they are asked for."""

    columns: Ints
    root: Array
    scales: Array
    plain: Array
    limits: Limits | None
    squares: dict[int, Array] = field(default_factory=dict)


class Table:
    """logs (l, v, s): log evidence by level, variant and scale, -inf where it can't count."""

    def __init__(self, engine: Engine, levels: list[Level], stack: Stack, already: float) -> None:
        """already: mean square (m^2) of the effects that the levels contain."""
        self._engine, self._levels, self._stack, self._already = engine, levels, stack, already
        v, k = stack.columns.shape
        size = len(levels), v, stack.scales.shape[1]
        self.logs = np.full(size, -np.inf)
        self._seen = np.zeros(size[:2], dtype=bool)
        self._ceiling = np.array([lv.log_base + 0.5 * lv.misfit for lv in levels])
        self._most = np.repeat(self._ceiling[:, None], v, axis=1)
        self._vectors = np.empty((*size[:2], k, k))  # eigenvectors of the coefficients' precision,
        self._mean, self._variance = np.empty((*size, k)), np.empty((*size, k))  # and along them

    def look(self) -> None:
        """Makes what may count beside the best level and scale of its own variant: from the level
        that fits the base best down, then up."""
        start = int(np.argmax([lv.log_base for lv in self._levels]))
        for i in (*range(start, -1, -1), *range(start + 1, len(self._levels))):
            best = self.logs.max(axis=(0, 2))
            which = np.flatnonzero(~self._seen[i] & (self._most[i] > best - _COUNTS))
            if which.size:
                self._make(i, which)

    def limit(self) -> None:
        """Takes away what the limits cost that physics sets, where it counts among all shapes."""
        done = np.zeros(self.logs.shape, dtype=bool)
        while self._stack.limits is not None:
            todo = (self.logs > self.logs.max() - _COUNTS) & ~done
            if not todo.any():
                return
            for i in np.flatnonzero(todo.any(axis=(1, 2))):
                which, scale = np.nonzero(todo[i])
                self.logs[i, which, scale] += self._odds(self._stack.limits, int(i), which, scale)
            done |= todo
            self.look()

    def _make(self, i: int, which: Ints) -> None:
        level, root = self._levels[i], self._stack.root[which]
        moment = np.einsum("vji,vj->vi", root, level.moment[self._stack.columns[which]])
        values, vectors = np.linalg.eigh(self._gram(level, which, root))
        values = np.maximum(values, 0.0)
        beta = np.einsum("vji,vj->vi", vectors, moment)
        s2 = self._stack.scales[which][:, :, None] ** 2  # (w, s, 1)
        gain = 1 + s2 * values[:, None, :]
        mean = s2 * beta[:, None, :] / gain
        taken = np.sum(mean * beta[:, None, :], axis=2)
        fit = 0.5 * taken - 0.5 * np.log(gain).sum(axis=2)
        turned = mean @ np.swapaxes(vectors, 1, 2)
        energy = np.sum((turned @ self._stack.plain[which]) * turned, axis=2) + self._already
        self.logs[i, which] = level.log_base + fit + log_level(self._engine.etas, i, energy)
        self._vectors[i, which], self._mean[i, which] = vectors, mean
        self._variance[i, which] = s2 / gain
        self._seen[i, which] = True
        self._bound(i, which, fit.max(axis=1), level.misfit - taken.max(axis=1))

    def _gram(self, level: Level, which: Ints, root: Array) -> Array:
        """Products (w, k, k) of unit coefficients of some variants."""
        squares, columns = self._stack.squares, self._stack.columns
        if level.number not in squares:
            squares[level.number] = self._engine.squares(columns, level.number)
        part = squares[level.number][which]
        if len(level.taken):
            gone = level.taken[:, columns[which]].transpose(1, 0, 2)  # (w, r, k)
            part -= np.swapaxes(gone, 1, 2) @ gone
        return np.asarray(np.swapaxes(root, 1, 2) @ part @ root)

    def _bound(self, i: int, which: Ints, fit: Array, left: Array) -> None:
        """What one level says of the others: by how much (w,) nats it fits better than the base at
        the most, and the least that is left (w,) of the target."""
        etas = self._engine.etas
        below = self._ceiling[:i, None] - 0.5 * self._levels[i].misfit + fit
        share = (etas[i] / etas[i + 1 : len(self._levels)]) ** 2
        above = self._ceiling[i + 1 :, None] - 0.5 * share[:, None] * left
        others = np.arange(len(self._levels)) != i
        most = np.concatenate([below, above])
        self._most[np.ix_(others, which)] = np.minimum(self._most[np.ix_(others, which)], most)

    def _odds(self, limits: Limits, i: int, which: Ints, scale: Ints) -> Array:
        """log odds (w,) that coefficients of variants `which` at their scales keep the limits."""
        root = self._stack.root[which]
        before = np.linalg.norm((limits.rows[which, :1] @ root)[:, 0], axis=1)
        spread = np.swapaxes(root @ self._vectors[i, which], 1, 2)  # to the coefficients
        centre = (self._mean[i, which, scale][:, None] @ spread)[:, 0]
        roots = np.sqrt(self._variance[i, which, scale])[:, :, None] * spread
        sd = before * self._stack.scales[which, scale]
        return log_odds(limits, which, sd, centre, roots)
