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

from collections.abc import Iterable, Iterator
from itertools import chain, islice
from math import inf

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, SearchResult, explain
from identification.gap.explanations.fit import fit
from identification.gap.model.history import sampling_time
from identification.gap.recording.rows import Rows
from identification.gap.search.overshoot_paths import SELDOM, Overshoots, Paths

_FEWEST = 8  # holds that a load was brought to: of fewer nobody tells chance from habit
_MOST = 3_000_000  # holds times rows: of more it would last longer than all the rest
_FLOWING = 10  # times as long takes a path along which something flows
_LOOKED_AT, _SEVERAL = 12, 3  # explanations; that remember, where none foretells the others
_PARTS = 3  # of an explanation at most, where none foretells the others: more say nothing of loads
_LOADED = 0.02  # of the largest load: less is none, and nobody pulls at a contact
_PLAIN = 10.0  # nats that are gained at least, for all to be searched once more
_PAYS, _LEAST = 0.7, -inf  # of their cost, beside what leaves more than noise; and beside noise


def overshoots_of_best(
    found: SearchResult, calibration_rows: Flags | None = None
) -> Overshoots | None:
    """What the best explanation that remembers says of the loads between the readings of levels;
    None where that gains no more than a few nats and what better explanations are ahead.
    calibration_rows: rows (n,) that alone tell what a law does, where it does not foretell the
    others: then it is what the one says that is ahead with its loads, and none has to gain more."""
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
    """Lags of the laser, between delay and filter, as long as they would hardly be noticed; none
    where one alone leaves more than the best explanation does of readings that it is over for:
    there no path helps it."""
    engine, first = found.engine, found.explanations[0]
    if not engine.bench.data.arm:
        return
    longest = _NOTICED * sampling_time(engine.bench.rows)
    shapes = [v for v in found.variants if v.lags_freely and v.lag_s <= longest]
    for s in score(engine, engine.levels, shapes):
        lag = explain(engine, (Part(s.variant, s.scale),), s.log_evidence)
        if _left_when_over(engine, lag) <= max(_SETTLED * engine.bench.noise.stated, first.eta):
            yield lag


def _left_when_over(engine: Engine, lag: Explanation) -> float:
    """rms (m) of the response that a lag leaves in rows so long after the first of their hold that
    what came before is gone."""
    rows = engine.bench.rows
    late = rows.time - rows.time[rows.edges][rows.hold] > _OVER * lag.parts[0].variant.lag_s
    if not late.any():
        return 0.0
    left = engine.target[: rows.n] - fit(engine, lag).response
    return float(np.sqrt(np.average(left[late] ** 2, weights=rows.weight[late])))


_OVER = 4.0  # times its time constant
_SETTLED = 1.5  # times the noise

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
    return more.count <= SELDOM * more.of and gain > pays * more.cost


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
