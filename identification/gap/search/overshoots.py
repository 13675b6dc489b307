"""Loads between readings: a hand that turns the screw too far, and back, before a level is read.

No row shows it, and all that remembers does: friction, plays and knees stand on another branch
then, and what lags shows it at the first readings of the hold. Where the best explanations remember
and leave more than noise, such loads are looked for, one hold after the other, and put in where the
data gain more by them than it costs to say where they are.

A law may take such a load over: a knee that was pushed further in one repetition bends once more at
the largest load, for all that the fit can tell. No other repetition foretells that; there the first
ones alone say what the law does, and the others where a hand went.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, islice
from math import inf, lgamma, log
from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.effects import EFFECTS
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.imperfection import IMPERFECTION
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, SearchResult, explain
from identification.gap.model.bench import Bench
from identification.gap.model.history import sampling_time
from identification.gap.model.variants import block
from identification.gap.recording.rows import Rows

SIZES = (0.03, 0.06, 0.12, 0.24)  # of the largest load, by which it goes beyond a level
_CLOSER = (2**-0.5, 2**-0.25)  # steps between these, from the best of them on
_FURTHEST = SIZES[-1] / (_CLOSER[0] * _CLOSER[1])
_COUNT = 4 * len(SIZES)  # in all
_FEWEST = 8  # holds that a load was brought to: of fewer nobody tells chance from habit
_MOST = 3_000_000  # holds times rows: of more it would last longer than all the rest
_FLOWING = 10  # times as long takes a path along which something flows
_LOOKED_AT, _SEVERAL = 12, 3  # explanations; that remember, where none foretells the others
_SELDOM = 0.5  # of the holds at most: whose law needs more is no law with a hand beside it
_PARTS = 3  # of an explanation at most, where none foretells the others: more say nothing of loads
_SWEEPS = 3
_LOADED = 0.02  # of the largest load: less is none, and nobody pulls at a contact
_OFF = 2.0  # standard deviations: holds that are nearer to what is expected are left alone
_PLAIN = 10.0  # nats that are gained at least, for all to be searched once more
_PAYS, _LEAST = 0.7, -inf  # of their cost, beside what leaves more than noise; and beside noise


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


def overshoots_of_best(
    found: SearchResult, calibration_rows: Flags | None = None
) -> Overshoots | None:
    """What the best explanation that remembers says of the loads between the readings of levels;
    None where that gains no more than a few nats and what better explanations are ahead. told_by:
    rows (n,) that alone tell what a law does, where it does not foretell the others: then it is
    what the one says that is ahead with its loads, and none has to gain more."""
    engine = found.engine
    rows, at = engine.bench.rows, _looked_for(engine)
    if not at.size:
        return None
    first = found.explanations[0].log_weight
    quick = (e for e in found.explanations if _is_quick(e, at, rows))
    able = (e for e in quick if calibration_rows is None or len(e.parts) <= _PARTS)
    each = ((e, Paths(engine, e, at, calibration_rows)) for e in islice(able, _LOOKED_AT))
    remember = ((first - e.log_weight, path) for e, path in _unlike(each))
    asked = (
        (behind, *path.found())
        for behind, path in islice(remember, 1 if calibration_rows is None else _SEVERAL)
    )
    pays = _LEAST if found.explanations[0].eta <= engine.bench.noise.stated else _PAYS
    worth = ((gain - behind, more) for behind, more, gain in asked if _worth(more, gain, pays))
    if calibration_rows is None:
        return next((more for ahead, more in worth if ahead > _PLAIN), None)
    return _of_the_one_ahead(worth, rows.overshoot)


def by_one_word(found: SearchResult) -> Iterator[Overshoots]:
    """What words alone say of the loads between readings, the likeliest first, where each leaves
    less along them, and no more than the best explanation does: several laws together, none of
    which is right, may miss less along the straight path than the one that is. Lags of the laser
    are asked each: along the straight path the likeliest is any."""
    engine, first = found.engine, found.explanations[0]
    at = _looked_for(engine)
    rows = engine.bench.rows
    single = (e for e in found.explanations if len(e.parts) == 1 and _is_quick(e, at, rows))
    near = (e for e in single if e.log_weight > first.log_weight - _BEHIND)
    for e in chain(islice(near, _SEVERAL), _lags(found)) if at.size else ():
        path = Paths(engine, e, at, None)
        more, gain = path.found() if path.memory else (None, 0.0)
        if not more or not _worth(more, gain, _PAYS):
            continue
        missed = path.misses(more.overshoot)
        if missed < e.eta and missed <= first.eta:
            yield more


_BEHIND = 1000.0  # nats that a word alone may gain by loads that no row shows


def _lags(found: SearchResult) -> Iterator[Explanation]:
    """Lags of the laser, between delay and filter, as long as they would hardly be noticed."""
    engine = found.engine
    if not engine.bench.data.arm:
        return
    longest = _NOTICED * sampling_time(engine.bench.rows)
    shapes = [v for v in found.variants if v.lags_freely and v.lag_s <= longest]
    for s in score(engine, engine.levels, shapes):
        yield explain(engine, (Part(s.variant, s.scale),), s.log_evidence)


_NOTICED = 2.5  # samples


def _looked_for(engine: Engine) -> Ints:
    """First rows of the holds that loads may have gone beyond; none where nobody could tell."""
    rows = engine.bench.rows
    if rows.continuous or engine.bench.imposed:
        return np.zeros(0, dtype=int)
    at = brought_to(rows)
    able = len(at) >= _FEWEST and len(at) * rows.n <= _MOST
    return at if able else at[:0]


def _is_quick(explanation: Explanation, at: Ints, rows: Rows) -> bool:
    """Whether its paths before the holds `at` take no longer than those of the longest table."""
    flows = any(part.variant.flows for part in explanation.parts)
    return len(at) * rows.n * (_FLOWING if flows else 1) <= _MOST


def _unlike(each: Iterable[tuple[Explanation, Paths]]) -> Iterator[tuple[Explanation, Paths]]:
    """Those that remember; of several whose memory is the same, whatever they have beside it, the
    first."""
    known = set()
    for explanation, path in each:
        if path.memory and path.memory not in known:
            known.add(path.memory)
            yield explanation, path


def _worth(more: Overshoots, gain: float, pays: float) -> bool:
    """Whether a path may be one: not with loads before most of the holds, which is a law that is
    wrong, nor where they gain (nats) too small a share of what they cost."""
    return more.count <= _SELDOM * more.of and gain > pays * more.cost


def _of_the_one_ahead(paths: Iterator[tuple[float, Overshoots]], known: Array) -> Overshoots | None:
    """Of what paths ask for beyond what is known (n,) of overshoot, that which gains most (nats)
    beyond what it costs; the first where none gains that."""
    first: Overshoots | None = None
    best, most = first, 0.0
    for ahead, more in paths:
        if np.array_equal(more.overshoot, known):
            continue
        first = first or more
        if ahead - more.cost > most:
            best, most = more, ahead - more.cost
    return best or first


def brought_to(rows: Rows) -> Ints:
    """First rows of holds under a load that was brought there from another, unread."""
    size = np.abs(rows.force)
    new = rows.hold_starts & ~rows.starts & ~rows.zero & ~rows.in_ramp
    new[1:] &= ~rows.in_ramp[:-1]
    return np.flatnonzero(new & (size > _LOADED * size.max(initial=0.0)))


class _Run(NamedTuple):
    """holds of a run, by their number; seen: the white values (flags) that loads in them change."""

    holds: list[int]
    seen: Flags


_Asking = Generator[tuple[int, float], float, None]
_MOVED = 1e-9  # of an effect: less is rounding


def _told(asking: _Asking, mine: Flags, left: Array) -> tuple[int, float] | None:
    """What is asked next, after the sum of squares of one's own of what is left (white)."""
    try:
        return asking.send(float(left[mine] @ left[mine]))
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
        """at: first rows of the holds that the load may have gone beyond; told_by as in
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
        self._told_by = None if calibration_rows is None else _white_rows(engine, calibration_rows)

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
        told by all rows."""
        out = self._engine.bench.rows.overshoot.copy()
        none = self._log_evidence(out)
        for i in range(_SWEEPS):
            before = out.copy()
            self._sweep(out, self._told_by if i + 1 < _SWEEPS else None)
            if np.array_equal(out, before):
                break
        self._sweep(out, None, _CLOSER)
        more = Overshoots(self._words, out, int(np.count_nonzero(out)), len(self._at))
        return more, self._log_evidence(out) - none

    def _log_evidence(self, overshoot: Array) -> float:
        """At what the law likeliest misses along a path: no more than along the straight one."""
        return max(self._each(overshoot))

    def misses(self, overshoot: Array) -> float:
        """That, m."""
        return float(self._engine.etas[int(np.argmax(self._each(overshoot)))])

    def _each(self, overshoot: Array) -> list[float]:
        effect = self._effect(overshoot)
        return [self._fit(effect, white).log_evidence for white in self._likely]

    def _fit(
        self, effect: Array, whitened: _White, calibration_rows: Flags | None = None
    ) -> _Fitted:
        """told_by: of the white values, those that tell the coefficients; left out: all do."""
        white = whitened(np.hstack([self._engine.base.columns, effect]) @ self._root)
        target = whitened(self._engine.target[:, None])[:, 0]
        tell = np.ones(len(target)) if calibration_rows is None else calibration_rows.astype(float)
        precision = white.T @ (tell[:, None] * white) + np.eye(white.shape[1])
        inner = np.linalg.solve(precision, white.T @ (tell * target))
        w = (self._root @ inner)[self._engine.base.columns.shape[1] :]
        left = target - white @ inner
        square = float(left @ left + inner @ inner)
        freedom = float(np.linalg.slogdet(precision)[1])
        return _Fitted(w, effect @ w, left, -(square + freedom + whitened.log_variance) / 2)

    def _sweep(
        self, out: Array, calibration_rows: Flags | None, closer: tuple[float, ...] = ()
    ) -> None:
        """Puts in, takes out or changes what gains, hold after hold, with coefficients as they
        fit in the beginning; told_by as in `_fit`."""
        first = self._fit(self._effect(out), self._white, calibration_rows)
        off = self._white.off(first.left, self._at)
        for runs in self.at_once:
            left = self._left_along(out, first)
            groups = []
            for run in runs:
                tried = [i for i in run.holds if off[i] >= _OFF or out[self._at[i]] != 0]
                square = float(left[run.seen] @ left[run.seen])
                groups.append((self._hold_by_hold(out, tried, square, closer), run.seen))
            asked = {r: next(asking, None) for r, (asking, _) in enumerate(groups)}
            while asked := {r: further for r, further in asked.items() if further is not None}:
                trial = out.copy()
                for k, beyond in asked.values():
                    trial[k] = beyond
                left = self._left_along(trial, first)
                asked = {r: _told(*groups[r], left) for r in asked}

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
