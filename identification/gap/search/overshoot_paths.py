"""One explanation along paths that no reading shows: before which holds its load went beyond them.

Holds are tried one after the other, in runs that do not see each other at once, with coefficients
as they fit along what the sweep before has found.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import cached_property
from math import lgamma, log
from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.effects import EFFECTS
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.imperfection import IMPERFECTION
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.model.bench import Bench
from identification.gap.model.variants import block

SIZES = (0.03, 0.06, 0.12, 0.24)  # of the largest load, by which it goes beyond a level
_CLOSER = (2**-0.5, 2**-0.25)  # steps between these, from the best of them on
_FURTHEST = SIZES[-1] / (_CLOSER[0] * _CLOSER[1])
_COUNT = 4 * len(SIZES)  # in all
_SWEEPS = 3
_OFF = 2.0  # standard deviations: holds that are nearer to what is expected are left alone
# Of what they cost: overshoots that gain less in the first sweep came to 0.45 at last in 130
# explanations that were looked at, and those that were there gained half of it at least.
_GIVE_UP = 0.25
SELDOM = 0.5  # of the holds at most: whose law needs more is no law with a hand beside it


@dataclass(frozen=True, eq=False)
class Overshoots:
    """words of the explanation that asks for it; overshoot (n,) as in `Rows`; count of the holds
    beyond which the load went, of how many; cost: nats that it takes to say which, and how far."""

    words: frozenset[str]
    overshoot: Array
    count: int
    of: int

    @property
    def cost(self) -> float:
        """Any of the holds, by any of the sizes, equally likely."""
        places = lgamma(self.of + 1) - lgamma(self.count + 1) - lgamma(self.of - self.count + 1)
        return places + log(self.of + 1) + self.count * log(_COUNT)


class _Run(NamedTuple):
    """holds of a run, by their number; seen: the white values (flags) that loads in them change."""

    holds: list[int]
    seen: Flags


_Asking = Generator[tuple[int, float], float, None]
_MOVED = 1e-9  # of an effect: less is rounding


def _next(asking: _Asking, left: Array) -> tuple[int, float] | None:
    """What is asked next, after the sum of squares of what is left (white)."""
    try:
        return asking.send(float(left @ left))
    except StopIteration:
        return None


class _Fitted(NamedTuple):
    """coefficients (k,) of an explanation, its effect (size,) by them, what that leaves (white),
    and the log evidence, but for what no path and no imperfection change."""

    coefficients: Array
    effect: Array
    left: Array
    log_evidence: float


class Paths:
    """An explanation along paths that are tried, with the coefficients it has along them. memory:
    its shapes to which a path makes a difference."""

    def __init__(
        self, engine: Engine, explanation: Explanation, at: Ints, calibration_rows: Flags | None
    ) -> None:
        """at: first rows of the holds that the load may have gone beyond; calibration_rows as in
        `overshoots_of_best`."""
        bench = engine.bench
        self._engine, self._at, self._words = engine, at, explanation.words
        load, top = bench.load[at], float(np.abs(bench.load).max())
        further = np.sign(load - bench.load[at - 1]) * top / load
        # back to none at most: a screw does not pull
        self._beyond = np.maximum(np.multiply.outer(np.array(SIZES), further), -1.0)  # (s, holds)
        everywhere = np.zeros(bench.rows.n)
        everywhere[at] = np.maximum(_FURTHEST * further, -1.0)
        self._parts = [_Columns(bench, p, everywhere) for p in explanation.parts]
        self._everywhere = everywhere
        both = zip(self._parts, explanation.parts, strict=True)
        self.memory = frozenset(part.variant for p, part in both if p.remembers)
        # along the right path a law misses no more than laws do
        self._white = _White(engine, IMPERFECTION * max(explanation.sizes, default=0.0))
        likely = engine.etas[engine.etas <= explanation.eta].tolist()
        self._likely = [_White(engine, eta) for eta in likely]
        self._root = block([np.diag(engine.base.sd), *(p.root for p in explanation.parts)])
        self._calibration = (
            None if calibration_rows is None else _white_rows(engine, calibration_rows)
        )

    @cached_property
    def at_once(self) -> list[list[_Run]]:
        """Runs that may be looked at at once, as none sees what is tried in another."""
        rows = self._engine.bench.rows
        straight = self._effect(rows.overshoot)
        run, out = rows.run[self._at], list[list[_Run]]()
        for each in np.unique(run):
            holds = np.flatnonzero(run == each)
            mine = np.isin(np.arange(rows.n), self._at[holds])
            change = self._effect(np.where(mine, self._everywhere, rows.overshoot)) - straight
            far = np.abs(change).max(axis=1) > _MOVED * np.abs(straight).max()
            one = _Run(holds.tolist(), self._white.of(far))
            blind = (r for r in out if not any((one.seen & other.seen).any() for other in r))
            together = next(blind, None)
            if together is None:
                out.append([one])
            else:
                together.append(one)
        return out

    def found(self) -> tuple[Overshoots, float]:
        """What the data gain by, and nats gained; from what is known of it on. The last sweeps are
        told by all rows. What gains next to nothing at first, or goes beyond most holds, is given
        up."""
        known = self._engine.bench.rows.overshoot
        out, none = known.copy(), self._log_evidence(known)
        for i in range(_SWEEPS):
            before = out.copy()
            self._sweep(out, self._calibration if i + 1 < _SWEEPS else None)
            gain, more = self._log_evidence(out) - none, self._overshoots(out)
            if gain < _GIVE_UP * more.cost or more.count > SELDOM * more.of:
                return self._overshoots(known.copy()), 0.0
            if np.array_equal(out, before):
                break
        self._sweep(out, None, _CLOSER)
        return self._overshoots(out), self._log_evidence(out) - none

    def _overshoots(self, out: Array) -> Overshoots:
        return Overshoots(self._words, out, int(np.count_nonzero(out)), len(self._at))

    def _log_evidence(self, overshoot: Array) -> float:
        """At what the law likeliest misses along a path: no more than along the straight one."""
        return max(self._each(overshoot))

    def misses(self, overshoot: Array) -> float:
        """That, m."""
        return float(self._engine.etas[int(np.argmax(self._each(overshoot)))])

    def _each(self, overshoot: Array) -> list[float]:
        effect = self._effect(overshoot)
        return [self._fit(effect, white).log_evidence for white in self._likely]

    def _fit(self, effect: Array, whitened: _White, calibration: Flags | None = None) -> _Fitted:
        """calibration: of the white values, those that tell the coefficients; left out: all do."""
        white = whitened(np.hstack([self._engine.base.columns, effect]) @ self._root)
        target = whitened(self._engine.target[:, None])[:, 0]
        tell = np.ones(len(target)) if calibration is None else calibration.astype(float)
        precision = white.T @ (tell[:, None] * white) + np.eye(white.shape[1])
        inner = np.linalg.solve(precision, white.T @ (tell * target))
        w = (self._root @ inner)[self._engine.base.columns.shape[1] :]
        left = target - white @ inner
        square = float(left @ left + inner @ inner)
        freedom = float(np.linalg.slogdet(precision)[1])
        return _Fitted(w, effect @ w, left, -(square + freedom + whitened.log_variance) / 2)

    def _sweep(self, out: Array, calibration: Flags | None, closer: tuple[float, ...] = ()) -> None:
        """Puts in, takes out or changes what gains, hold after hold, with coefficients as they
        fit in the beginning; calibration as in `_fit`."""
        first = self._fit(self._effect(out), self._white, calibration)
        off = self._white.off(first.left, self._at)
        for runs in self.at_once:
            left, asking = self._left_along(out, first), []
            for run in runs:
                tried = [i for i in run.holds if off[i] >= _OFF or out[self._at[i]] != 0]
                square = float(left[run.seen] @ left[run.seen])
                asking.append(self._hold_by_hold(out, tried, square, closer))
            asked = {r: next(asks, None) for r, asks in enumerate(asking)}
            while asked := {r: further for r, further in asked.items() if further is not None}:
                trial = out.copy()
                for k, beyond in asked.values():
                    trial[k] = beyond
                left = self._left_along(trial, first)
                asked = {r: _next(asking[r], left[runs[r].seen]) for r in asked}

    def _left_along(self, overshoot: Array, first: _Fitted) -> Array:
        """What is left (white) along a path (n,), with coefficients as they fit first."""
        start, effect = 0, np.zeros(len(first.effect))
        for part in self._parts:
            columns = part.along(overshoot)
            effect += columns @ first.coefficients[start : start + columns.shape[1]]
            start += columns.shape[1]
        return first.left - self._white((effect - first.effect)[:, None])[:, 0]

    def _hold_by_hold(
        self, out: Array, holds: list[int], square: float, closer: tuple[float, ...]
    ) -> _Asking:
        """Asks, row and size, for the sum of squares along what it tries in its holds, and
        puts into `out` what gains; square: the sum of squares along what is there."""
        cost = 2 * log(len(self._at) * _COUNT)  # twice the nats: of a sum of squares
        for i in holds:
            k = int(self._at[i])
            gained, best, least = 0.0, float(out[k]), square
            for step in (0.0, *closer):
                near = {best * step, max(best / step, -1.0)} if step else self._sizes(i)
                for beyond in sorted(near - {best}):
                    then = yield k, beyond
                    gain = square - then - cost * (int(beyond != 0) - int(out[k] != 0))
                    if gain > gained:
                        gained, best, least = gain, beyond, then
                if best == 0:
                    break
            out[k], square = best, least

    def _sizes(self, i: int) -> set[float]:
        return {0.0, *self._beyond[:, i].tolist()}

    def _effect(self, overshoot: Array) -> Array:
        return np.hstack([p.along(overshoot) for p in self._parts])


def _white_rows(engine: Engine, rows: Flags) -> Flags:
    """Of the values of `_White`, those of rows (n,) and of all without a load."""
    bench = engine.bench
    read = rows | bench.rows.zero
    held = read[bench.rows.edges]
    return np.concatenate([read, held, bench.layout.read_in(read, held)[bench.rows.n :]])


class _Columns:
    """Columns (size, k) of one part of an explanation, along any path; remembers: whether a path
    makes a difference to them."""

    def __init__(self, bench: Bench, part: Part, everywhere: Array) -> None:
        """everywhere (n,): a path that goes beyond every hold."""
        self._bench, self._laws = bench, EFFECTS[part.word].laws
        self._law, self._scale = self._laws.of(bench, part.variant)
        self._to_actual = part.variant.to_actual_bench
        self._straight = self._made(bench)
        self.remembers = not np.allclose(self._made(bench.along(everywhere)), self._straight)

    def along(self, overshoot: Array) -> Array:
        """Along a path (n,)."""
        known = self._bench.rows.overshoot
        if not self.remembers or np.array_equal(overshoot, known):
            return self._straight
        return self._made(self._bench.along(overshoot))

    def _made(self, bench: Bench) -> Array:
        there = bench if self._to_actual is None else self._to_actual(bench)
        return self._laws.rows(there, self._law) * self._scale


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

    def of(self, moved: Flags) -> Flags:
        """Of the white values, those to which the values (size,) that moved contribute."""
        n, edges = self._rows.n, self._rows.edges
        held = np.logical_or.reduceat(moved[:n], edges)
        return np.concatenate([held[self._rows.hold], held, moved[n:]])

    def off(self, left: Array, at: Ints) -> Array:
        """How many standard deviations the first rows `at` or the means of their holds are off."""
        n = self._rows.n
        return np.maximum(np.abs(left[at]), np.abs(left[n + self._rows.hold[at]]))
