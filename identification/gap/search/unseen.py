"""Loads between readings: a hand that turns the screw too far, and back, before a level is read.

No row shows it, and all that remembers does: friction, plays and knees stand on another branch
then, and what lags shows it at the first readings of the hold. Where the best explanations remember
and leave more than noise, such loads are looked for, one hold after the other, and put in where the
data gain more by them than it costs to say where they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import lgamma, log
from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.effects import EFFECTS
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.imperfection import IMPERFECTION
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.model.bench import Bench
from identification.gap.model.variants import block
from identification.gap.recording.rows import Rows

SIZES = (0.03, 0.06, 0.12, 0.24)  # of the largest load, by which it goes beyond a level
_FEWEST = 8  # holds that a load was brought to: of fewer nobody tells chance from habit
_MOST = 1_000_000  # holds times rows: of more it would last longer than all the rest
_LOOKED_AT = 12  # explanations
_SWEEPS = 3
_LOADED = 0.02  # of the largest load: less is none, and nobody pulls at a contact
_OFF = 2.0  # standard deviations: holds that are nearer to what is expected are left alone
_PLAIN = 10.0  # nats that are gained at least, for all to be searched once more


@dataclass(frozen=True, eq=False)
class Unseen:
    """overshoot (n,) as in `Rows`; count of the holds beyond which the load went, of how many;
    cost: nats that it takes to say which, and how far."""

    overshoot: Array
    count: int
    of: int

    @property
    def cost(self) -> float:
        """Any of the holds, by any of the sizes, equally likely."""
        places = lgamma(self.of + 1) - lgamma(self.count + 1) - lgamma(self.of - self.count + 1)
        return places + log(self.of + 1) + self.count * log(len(SIZES))


def unseen(found: SearchResult) -> Unseen | None:
    """What the best explanation that remembers says of the loads between the readings of levels;
    None where that gains no more than a few nats and what better explanations are ahead."""
    engine = found.engine
    rows = engine.bench.rows
    if rows.continuous or engine.bench.imposed:
        return None
    at = _brought_to(rows)
    if len(at) < _FEWEST or len(at) * rows.n > _MOST:
        return None
    for explanation in found.explanations[:_LOOKED_AT]:
        path = _Paths(engine, explanation, at)
        if path.remembers:
            out, gain = path.found()
            more = Unseen(out, int(np.count_nonzero(out)), len(at))
            behind = found.explanations[0].log_weight - explanation.log_weight
            return more if gain > behind + _PLAIN else None
    return None


def _brought_to(rows: Rows) -> Ints:
    """First rows of holds under a load that was brought there from another, unread."""
    size = np.abs(rows.force)
    new = rows.hold_starts & ~rows.starts & ~rows.zero & ~rows.on_the_way
    new[1:] &= ~rows.on_the_way[:-1]
    return np.flatnonzero(new & (size > _LOADED * size.max(initial=0.0)))


class _Fitted(NamedTuple):
    """coefficients (k,) of an explanation, its effect (size,) by them, what that leaves (white),
    and the log evidence, but for what no path and no imperfection change."""

    coefficients: Array
    effect: Array
    left: Array
    log_evidence: float


class _Paths:
    """An explanation along paths that are tried, with the coefficients it has along them."""

    def __init__(self, engine: Engine, explanation: Explanation, at: Ints) -> None:
        """at: first rows of the holds that the load may have gone beyond."""
        bench = engine.bench
        self._engine, self._at = engine, at
        load, top = bench.load[at], float(np.abs(bench.load).max())
        further = np.sign(load - bench.load[at - 1]) * top / load
        # back to none at most: a screw does not pull
        self._beyond = np.maximum(np.multiply.outer(np.array(SIZES), further), -1.0)  # (s, holds)
        everywhere = np.zeros(bench.rows.n)
        everywhere[at] = self._beyond[-1]
        self._parts = [_Columns(bench, p, everywhere) for p in explanation.parts]
        self.remembers = any(p.remembers for p in self._parts)
        # along the right path a law misses no more than laws do
        self._white = _White(engine, IMPERFECTION * max(explanation.sizes, default=0.0))
        likely = engine.etas[engine.etas <= explanation.eta].tolist()
        self._likely = [_White(engine, eta) for eta in likely]
        self._root = block([np.diag(engine.base.sd), *(p.root for p in explanation.parts)])

    def found(self) -> tuple[Array, float]:
        """(n,) overshoot that the data gain by, and nats gained."""
        out = np.zeros(self._engine.bench.rows.n)
        none = self._log_evidence(out)
        for _ in range(_SWEEPS):
            before = out.copy()
            self._sweep(out)
            if np.array_equal(out, before):
                break
        return out, self._log_evidence(out) - none if out.any() else 0.0

    def _log_evidence(self, overshoot: Array) -> float:
        """At what the law likeliest misses along a path: no more than along the straight one."""
        effect = self._effect(overshoot)
        return max(self._fit(effect, white).log_evidence for white in self._likely)

    def _fit(self, effect: Array, whitened: _White) -> _Fitted:
        white = whitened(np.hstack([self._engine.base.columns, effect]) @ self._root)
        target = whitened(self._engine.target[:, None])[:, 0]
        precision = white.T @ white + np.eye(white.shape[1])
        inner = np.linalg.solve(precision, white.T @ target)
        w = (self._root @ inner)[self._engine.base.columns.shape[1] :]
        left = target - white @ inner
        square = float(left @ left + inner @ inner)
        freedom = float(np.linalg.slogdet(precision)[1])
        return _Fitted(w, effect @ w, left, -(square + freedom + whitened.log_variance) / 2)

    def _sweep(self, out: Array) -> None:
        """Puts in, takes out or changes what gains, hold after hold, with coefficients as they
        fit in the beginning."""
        cost = 2 * log(len(self._at) * len(SIZES))  # twice the nats: of a sum of squares
        first = self._fit(self._effect(out), self._white)
        now, left = first.effect, first.left
        off = self._white.off(left, self._at)
        for i, k in enumerate(self._at.tolist()):
            if off[i] < _OFF and out[k] == 0:
                continue
            best = (0.0, float(out[k]), left, now)
            for beyond in sorted({0.0, *self._beyond[:, i].tolist()} - {float(out[k])}):
                trial = out.copy()
                trial[k] = beyond
                then = self._effect(trial) @ first.coefficients
                rest = left - self._white((then - now)[:, None])[:, 0]
                paid = cost * (int(beyond != 0) - int(out[k] != 0))
                gain = float(left @ left - rest @ rest) - paid
                if gain > best[0]:
                    best = (gain, beyond, rest, then)
            _, out[k], left, now = best

    def _effect(self, overshoot: Array) -> Array:
        return np.hstack([p.along(overshoot) for p in self._parts])


class _Columns:
    """Columns (size, k) of one part of an explanation, along any path; remembers: whether a path
    makes a difference to them."""

    def __init__(self, bench: Bench, part: Part, everywhere: Array) -> None:
        """everywhere (n,): a path that goes beyond every hold."""
        self._bench, self._laws = bench, EFFECTS[part.word].laws
        self._law, self._scale = self._laws.of(bench, part.variant)
        self._straight = self._made(bench)
        self.remembers = not np.allclose(self._made(bench.along(everywhere)), self._straight)

    def along(self, overshoot: Array) -> Array:
        """Along a path (n,)."""
        if not self.remembers or not overshoot.any():
            return self._straight
        return self._made(self._bench.along(overshoot))

    def _made(self, bench: Bench) -> Array:
        return self._laws.rows(bench, self._law) * self._scale


class _White:
    """Stacked values (size, k) over their standard deviations: rows about the means of their holds,
    and these means, which a law misses by `size` m. log_variance: log of the determinant of the
    rows' covariance (m^2)."""

    def __init__(self, engine: Engine, size: float) -> None:
        bench = engine.bench
        self._rows, self._rest = bench.rows, bench.sigma[bench.rows.n :, None]
        noise = np.hypot(bench.noise.response, size)
        self._root = np.sqrt(1 / noise**2)[:, None]
        edges = self._rows.edges
        information = np.add.reduceat(self._root[:, 0] ** 2, edges)
        self._share = (self._root[:, 0] ** 2 / information[self._rows.hold])[:, None]
        common = np.hypot(bench.noise.hold[edges], size)
        self._mean_sd = np.sqrt(1 / information + common**2)[:, None]
        within = float(np.log1p(common**2 * information).sum())
        self.log_variance = 2 * float(np.log(noise).sum()) + within

    def __call__(self, values: Array) -> Array:
        n, edges = self._rows.n, self._rows.edges
        mean = np.add.reduceat(values[:n] * self._share, edges, axis=0)
        about = (values[:n] - mean[self._rows.hold]) * self._root
        return np.vstack([about, mean / self._mean_sd, values[n:] / self._rest])

    def off(self, left: Array, at: Ints) -> Array:
        """How many standard deviations the first rows `at` or the means of their holds are off."""
        n = self._rows.n
        return np.maximum(np.abs(left[at]), np.abs(left[n + self._rows.hold[at]]))
