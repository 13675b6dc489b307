"""Whether the stiffness that was stated is met anywhere along what an explanation fits.

On a rig without an arm a mechanism brings a mean stiffness of its own, and may so stand for a
spring or a gain that is off by far more than it does itself: a little friction beside a spring half
as stiff as stated, a few percent of curvature beside a gain. But what was stated of a joint that
hardens, yields or rubs is its stiffness somewhere: where it begins, where it ends, after a turn.
Where the load goes along no piece of its way with that stiffness, spring or gains are off by what
the nearest piece says; and where that does far more than all the rest, it is the main cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import hypot, log
from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import (
    Explanation,
    SearchResult,
    joined,
    up_to_likeliest,
)
from identification.gap.explanations.fit import fit
from identification.gap.judging.dead_zone import where_it_sits
from identification.gap.judging.heldout import simulated_line
from identification.gap.laws.specimens import without_springs
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant
from identification.gap.words import LATE, LINEAR, MECHANISMS
from identification.turns import turning_points

_PIECE = 0.02  # of the range of the load, or of what it does; a stiffness is read off two of them
_TURNS = 0.02  # of the range of the load: what goes back by less is no turn
_SDS = 3.0  # standard deviations of spring and gains together: so far they may be off
_ALIKE = 1.5  # times: pieces that are about as steep
# Times all the rest: a metal that flows over most of its way is far from any line, whatever was
# stated of its spring, and what the rest takes back of the line is none of its error.
_LEADS = 3.0
_AS_GOOD = 5.0  # nats: spring and gains differ in what was stated of them alone


class Springs(NamedTuple):
    """rms m of what springs or gains that are off do to the gap, and of all the rest."""

    off: float
    rest: float


def led_by_springs(found: SearchResult, near: Sequence[Explanation]) -> SearchResult:
    """The result for a rig without an arm in which springs or gains that are off lead where they do
    most, whatever the effect beside them says of its own mean stiffness. near: the explanations
    that matter. What speaks for those without a linear effect is the best one by linear effects
    alone; beside that, and others about as good, their own effect is looked for in shapes that have
    no spring of their own.
    """
    engine, ranked = found.engine, {e.words: e for e in found.explanations}
    ranked |= {e.words: _led(engine, e) for e in near if len(e.words) > 1 and e.words & LINEAR}
    linear = [e for e in found.explanations if e.adequate and e.words and e.words <= LINEAR]
    heirs = [e for e in linear if e.log_weight > linear[0].log_weight - _AS_GOOD]
    representatives = dict(found.representatives)
    for e in near:
        if not heirs or not e.parts or e.words & LINEAR or not off_from_stated(engine, e):
            continue
        representatives[e.words] = heirs[0]
        for both in (_beside(engine, found.variants, heir, e) for heir in heirs):
            known = ranked.get(both.words)
            if known is None or known.log_weight < both.log_weight:
                ranked[both.words] = both
    best_first = tuple(sorted(ranked.values(), key=lambda e: -e.log_weight))
    return replace(found, explanations=best_first, representatives=representatives)


def _led(engine: Engine, explanation: Explanation) -> Explanation:
    """With the linear effect first, if it does most."""
    e = explanation
    found = None if e.parts[0].word in LINEAR else off_from_stated(engine, e)
    if found is None:
        return e
    does = {True: found.off, False: found.rest}  # by whether an effect is linear
    sizes = [(p.word in LINEAR, s) for p, s in zip(e.parts, e.sizes, strict=True)]
    each = {kind: max(hypot(*(s for k, s in sizes if k == kind)), 1e-300) for kind in does}
    return e.sized(does[kind] * s / each[kind] for kind, s in sizes)


def _beside(
    engine: Engine, variants: Sequence[Variant], heir: Explanation, other: Explanation
) -> Explanation:
    """The heir with the largest effect of the other explanation beside it, if that is better."""
    mine = other.parts[0].variant
    same = [v for v in variants if v.word == mine.word and v.joint == mine.joint and not v.has_line]
    stripped = (without_springs(v) if v.other_springs else v for v in same)
    shapes = list({v.columns: v for v in stripped}.values())
    if not shapes or heir.eta <= engine.bench.noise.stated:
        return heir
    levels, energy = up_to_likeliest(engine, heir.parts)
    scored = score(engine, levels, shapes, energy)
    both = _led(engine, joined(engine, heir.parts, scored, energy))
    first = both.parts[0].word in LINEAR
    return both if first and both.log_weight > heir.log_weight else heir


def off_from_stated(engine: Engine, explanation: Explanation) -> Springs | None:
    """Of springs or gains that are off, where they do far more to the gap than all the rest."""
    bench, fitted = engine.bench, fit(engine, explanation)
    whole = fitted.beyond_known(engine)
    goes = MECHANISMS | LINEAR  # with the load, without a delay
    words = explanation.words
    paths = [whole - fitted.together(engine, words - goes)]
    if words & LATE:  # all that comes, and what comes at once
        paths.append(whole - fitted.together(engine, words - (goes - LATE)))
    joint, line = explanation.parts[0].variant.joint, simulated_line(bench)
    mine = where_it_sits(bench, explanation)
    factor = _nearest(bench, mine, paths, joint)
    if factor is None:
        return None
    off, rest = (
        bench.rows.rms_about_means(v * mine) for v in ((factor - 1) * line, whole - factor * line)
    )
    return Springs(off, rest) if off > _LEADS * rest else None


def _nearest(
    bench: Bench, mine: Flags, paths: list[Array], joint: int | None = None
) -> float | None:
    """The slope of responses (n,) over the simulated one that comes nearest to 1; None where what
    was stated is met within its uncertainty, or nothing was passed. joint: the direction that they
    are of, None: all."""
    each = [_passed(bench, mine, path) for path in paths]
    if not each[0].size:
        return None
    common = [float(np.median(s)) for s in each if s.size]
    if min(common) < 0 < max(common):  # between what comes at once and all
        return None
    meter, springs = bench.data.instruments, bench.data.compliance_relative_sd
    sd = hypot(
        float(springs.max() if joint is None else springs[joint]),
        meter.force_gain,
        meter.displacement_gain,
    )
    near = float(min(np.concatenate(each), key=abs))
    stiffness = float(np.exp(near if bench.imposed else -near))
    return None if abs(stiffness - 1) < _SDS * sd else float(np.exp(near))


def _passed(bench: Bench, mine: Flags, response: Array) -> Array:
    """(k,) logarithms of the slopes that a response passes over the simulated one: of any two
    neighbouring pieces that are about as steep. A corner is no slope."""
    line, out = simulated_line(bench), [np.zeros(0)]
    spans = np.array([np.ptp(line[mine]), np.ptp(response[mine])])
    if not spans.min() > 0:
        return out[0]
    for run in np.unique(bench.rows.run[mine]):
        rows = np.flatnonzero(mine & (bench.rows.run == run))
        way = np.column_stack([line[rows], response[rows]])
        ends = [0, *turning_points(way[:, 0], _TURNS * spans[0]), len(rows) - 1]
        for a, b in pairwise(ends):
            slopes = np.log(np.maximum(_slopes(way[a : b + 1], spans), _NONE))
            one, other = slopes[:-1], slopes[1:]
            out.append(((one + other) / 2)[np.abs(one - other) < log(_ALIKE)])
    return np.concatenate(out)


_NONE = 1e-6  # of what was stated: no stiffness


def _slopes(way: Array, spans: Array) -> Array:
    """Slopes (k,) of the pieces of one pass (n, 2), simulated and response, each as long as may be
    seen in one of the two: a stiff beginning may take but a hundredth of an imposed way."""
    line, response = way[np.argsort(way[:, 0], kind="stable")].T
    gone = np.maximum(np.abs(np.diff(line)) / spans[0], np.abs(np.diff(response)) / spans[1])
    length = np.concatenate([[0.0], np.cumsum(gone)])
    at = np.linspace(0.0, length[-1], int(length[-1] / _PIECE) + 1)
    rise, run = (np.diff(np.interp(at, length, v)) for v in (response, line))
    return np.asarray(rise[run > 0] / run[run > 0])
