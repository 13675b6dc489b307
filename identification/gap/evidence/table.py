"""Log evidence of variants that are alike in size, at the levels of imperfection that may count.

An explanation fits a gap at the levels about its own imperfection; of the evidence of the others
there is a bound, which needs no look at them. With C the covariance of target and effect together,
the evidence is `-1/2 y' C^-1 y - 1/2 log|C|`. C grows with the size eta of the imperfection, but
no faster than eta^2, and the effect only adds to its determinant: `y' C^-1 y` of one level bounds
that of the levels below, and, by the ratio of eta^2, that of those above.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.evidence.engine import Engine, NoiseLevel
from identification.gap.evidence.imperfection import log_level
from identification.gap.evidence.signs import Limits, log_odds, log_odds_together, padded

_COUNTS = 40.0  # nats below the best: what lies further down adds nothing; limits add four at most
_NEAR = 8.0  # nats below the best: what is looked at closely
_FEW = 16  # at a time: of more the time goes into numbers, of fewer into calls
# Nats by which no variant has been seen to catch up at another level: of 90 diagnoses none changed
# by 1e-6, with 40 nats one did.
_HOPELESS = 60.0


@dataclass(frozen=True, eq=False)
class Stack:
    """Variants of one word: columns (v, k), roots (v, k, k), scales (v, s), 0 for one that is not
    there, mean squares (v, k, k) of unit coefficients, limits; what the products of the columns at
    all levels have in common; by number of the level these products (v, k, k), once they are asked
    for. Of a variant with fewer coefficients than k the further ones have a root of 0."""

    columns: Ints
    root: Array
    scales: Array
    plain: Array
    limits: Limits
    unweighed: Array
    squares: dict[int, Array] = field(default_factory=dict)

    def at(self, level: NoiseLevel) -> Array:
        """Products (v, k, k) of the columns at a level, but for what effects take there."""
        if level.number not in self.squares:
            made = level.engine.squares(self.columns, level.number, self.unweighed)
            self.squares[level.number] = made
        return self.squares[level.number]


class EvidenceTable:
    """logs (l, v, s): log evidence by level, variant and scale, -inf where it can't count; scales
    (v, s), 0 where a variant has fewer."""

    def __init__(
        self, engine: Engine, levels: list[NoiseLevel], stacks: list[Stack], already: float
    ) -> None:
        """stacks: of several words, one after the other. already: mean square (m^2) of the effects
        that the levels contain."""
        self._engine, self._levels, self._stacks, self._already = engine, levels, stacks, already
        self._columns = np.concatenate([s.columns for s in stacks])
        self._root = np.concatenate([s.root for s in stacks])
        self.scales = padded([s.scales for s in stacks])
        self._limits = Limits.joined([s.limits for s in stacks])
        self._plain = np.concatenate([s.plain for s in stacks])
        self._sizes = [len(s.columns) for s in stacks]
        self._edges = np.cumsum([0, *self._sizes]).tolist()
        v, k = self._columns.shape
        size = len(levels), v, self.scales.shape[1]
        self.logs, self._best = np.full(size, -np.inf), np.full(v, -np.inf)
        self._seen = np.zeros(size[:2], dtype=bool)
        self._ceiling = np.array([lv.log_base + 0.5 * lv.misfit for lv in levels])
        self._most = np.repeat(self._ceiling[:, None], v, axis=1)
        self._vectors = np.empty((*size[:2], k, k))  # eigenvectors of the coefficients' precision,
        self._mean, self._variance = np.empty((*size, k)), np.empty((*size, k))  # and along them

    def look(self) -> None:
        """Makes what may count beside the best level and scale of its own variant: from the level
        that fits the base best down, then up."""
        if not self._open(slice(None)).any():
            return
        start = int(np.argmax([lv.log_base for lv in self._levels]))
        for i in (*range(start, -1, -1), *range(start + 1, len(self._levels))):
            which = np.flatnonzero(self._open(i))
            if which.size:
                self._make(i, which)

    def _open(self, i: int | slice) -> Flags:
        """(v,), or (l, v): what was not made at a level and may count there."""
        counts = (self._most[i] > self._best - _COUNTS) & ~self._seen[i]
        return np.asarray(counts & ~self._hopeless())

    def _hopeless(self) -> Flags:
        """Variants that were looked at and lie far below the best one of their word."""
        best = self._best
        return (best > -np.inf) & (best < self._of_word() - _HOPELESS)

    def _of_word(self) -> Array:
        """(v,) the best of each one's word."""
        best = np.maximum.reduceat(self._best, self._edges[:-1])
        return np.repeat(best, self._sizes)

    def limit(self) -> None:
        """Takes away what the limits cost that physics sets, where it counts among the shapes of
        the word; what all of them together cost only near the best. Where one after the other falls
        behind the next one, ever more of them are looked at together."""
        done = {closely: np.zeros(self.logs.shape, dtype=bool) for closely in (False, True)}
        closely, wider = False, 1.0
        while True:
            nats = _NEAR if closely else _COUNTS
            found = self._near(nats, done[closely])
            if 0 < found[1].size < _FEW:
                wider *= 2.0
                found = self._near(wider * nats, done[closely])
            if found[1].size:
                done[closely][found] = True
                self.logs[found] += self._odds(*found, closely=closely)
                which = np.unique(found[1])
                self._best[which] = self.logs[:, which].max(axis=(0, 2))
                self.look()
            elif closely:
                return
            closely = not found[1].size

    def _near(self, nats: float, done: Flags) -> tuple[Ints, Ints, Ints]:
        """Levels, variants with limits, and scales that are so near to the best of their word, but
        for what is done (l, v, s)."""
        floor = self._of_word() - nats
        some = np.flatnonzero(self._limits.asked.any(axis=1) & (self._best > floor))
        todo = (self.logs[:, some] > floor[some, None]) & ~done[:, some]
        level, place, scale = np.nonzero(todo)
        return level, some[place], scale

    def _make(self, i: int, which: Ints) -> None:
        level, root = self._levels[i], self._root[which]
        moment = np.einsum("vji,vj->vi", root, level.moment[self._columns[which]])
        values, vectors = np.linalg.eigh(self._gram(level, which, root))
        values = np.maximum(values, 0.0)
        beta = np.einsum("vji,vj->vi", vectors, moment)
        s2 = self.scales[which][:, :, None] ** 2  # (w, s, 1)
        gain = 1 + s2 * values[:, None, :]
        mean = s2 * beta[:, None, :] / gain
        taken = np.sum(mean * beta[:, None, :], axis=2)
        fit = 0.5 * taken - 0.5 * np.log(gain).sum(axis=2)
        fit = np.where(s2[..., 0] > 0, fit, -np.inf)
        turned = mean @ np.swapaxes(vectors, 1, 2)
        energy = np.sum((turned @ self._plain[which]) * turned, axis=2) + self._already
        energy = np.minimum(energy, self._engine.most)
        self.logs[i, which] = level.log_base + fit + log_level(self._engine.etas, i, energy)
        self._vectors[i, which], self._mean[i, which] = vectors, mean
        self._variance[i, which] = s2 / gain
        self._best[which] = np.maximum(self._best[which], self.logs[i, which].max(axis=1))
        self._seen[i, which] = True
        self._bound(i, which, fit.max(axis=1), level.misfit - taken.max(axis=1))

    def _gram(self, level: NoiseLevel, which: Ints, root: Array) -> Array:
        """Products (w, k, k) of unit coefficients of some variants."""
        ends = pairwise(np.searchsorted(which, self._edges))
        part = np.concatenate(
            [
                stack.at(level)[which[a:b] - start]
                for stack, start, (a, b) in zip(self._stacks, self._edges[:-1], ends, strict=True)
                if a < b
            ]
        )
        if len(level.taken):
            gone = level.taken[:, self._columns[which]].transpose(1, 0, 2)  # (w, r, k)
            part -= np.swapaxes(gone, 1, 2) @ gone
        return np.asarray(np.swapaxes(root, 1, 2) @ part @ root)

    def _bound(self, i: int, which: Ints, fit: Array, left: Array) -> None:
        """What one level says of the others: by how much (w,) nats it fits better than the base at
        the most, and the least that is left (w,) of the target."""
        etas = self._engine.etas
        below = self._ceiling[:i, None] - 0.5 * self._levels[i].misfit + fit
        share = (etas[i] / etas[i + 1 : len(self._levels)]) ** 2
        above = self._ceiling[i + 1 :, None] - 0.5 * share[:, None] * left
        self._most[:i, which] = np.minimum(self._most[:i, which], below)
        self._most[i + 1 :, which] = np.minimum(self._most[i + 1 :, which], above)

    def _odds(self, level: Ints, which: Ints, scale: Ints, *, closely: bool) -> Array:
        """log odds (w,) that coefficients of variants `which`, at their levels and scales, keep the
        limits; closely: what is to be added to that because they must keep all at once."""
        new = np.append(True, (np.diff(level) != 0) | (np.diff(which) != 0))
        place = np.cumsum(new) - 1  # scales of one variant at one level share the rest
        rows = self._limits.rows[which[new]] @ self._root[which[new]]  # (u, m, k), of unit
        before = np.linalg.norm(rows, axis=2)[place] * self.scales[which, scale][:, None]
        rows = (rows @ self._vectors[level[new], which[new]])[place]  # and along the eigenvectors
        sums = np.einsum("wmk,wk->wm", rows, self._mean[level, which, scale])
        rows *= np.sqrt(self._variance[level, which, scale])[:, None]
        odds = log_odds(self._limits, which, before, sums, rows)
        if not closely:
            return odds
        most = log_odds_together(self._limits, which, before, sums, rows)
        return np.minimum(most - odds, 0.0)
