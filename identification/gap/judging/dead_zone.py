"""What a curve that is passed both ways says of lost motion: a play is a dead zone with sharp ends.

A free curve passes for any play, and a play with soft ends beside a curve for any curve. The two
are told apart by the stiffness along what they fit: within a play it falls to next to nothing, and
is back where it was within a small part of the play; springs that harden, contacts and rubber
change theirs over all of the way, and stages of a gear's stiffness lie within a factor of two.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.explanations.verdict import FLANKS
from identification.gap.model.bench import Bench

PLAY, CURVE = "joint_backlash", "joint_nonlinear_stiffness"


class DeadZoneCriteria(NamedTuple):
    """Of a play: stiffness within it, of that of the flanks; way from loose to stiff, of it; how
    much stiffer flanks may get towards the ends of the way."""

    loose: float
    sharp: float
    hardens: float


# To say play although a curve is likelier; to say it where that is the likelier one, as it is of
# few curves: what hardens as fast as a cubic spring passes. Tissue hardens ever more, as exp(u),
# and leaves its soft middle fast; teeth that are pressed together get stiffer by less (Hertz 1881).
PLAINLY, SOMEHOW = DeadZoneCriteria(0.2, 0.2, 1.75), DeadZoneCriteria(0.3, 0.35, np.inf)
_POINTS = 400  # over the way of the displacement
_STIFF, _STIFFEST = 0.75, 0.95  # quantiles of the stiffness: that of the flanks; at their ends
_SOFT, _BACK = 0.4, 0.6  # of it: at the ends of the play; beyond them, and across a step
_WIDTHS = (0.01, 0.7)  # of the way
_FEWEST = 100  # places that were read, of the points
_FOLLOWS = 10.0  # times the imperfection of the play: a curve that needs more does not go that way


def spoken_for(
    engine: Engine, ranked: tuple[Explanation, ...]
) -> dict[frozenset[str], Explanation]:
    """Words of the best explanation, where a play or a curve is its largest effect -> that with the
    other one in its place, where that is what it shows. Of a rig without an arm that is loaded both
    ways, and was read at so many places that corners lie between neighbouring ones."""
    best, bench = ranked[0], engine.bench
    if not best.parts or best.parts[0].word not in FLANKS:
        return {}
    load = bench.load[where_it_sits(bench, best)]
    if bench.load_history.one_sided or len(_distinct(np.sort(load), load)[0]) < _FEWEST:
        return {}
    rest, word = best.words - FLANKS, best.parts[0].word
    others = {min(e.words & FLANKS): e for e in ranked if _is_one_beside(e, rest)}
    other = others.get(PLAY if word == CURVE else CURVE)
    if other is None:
        return {}
    if word == PLAY and other.eta > _FOLLOWS * best.eta:
        return {}
    u, force = _curve(engine, best)
    if word == PLAY and _is_a_step(u, force):
        return {}
    plainly = PLAINLY._replace(hardens=np.inf) if rest else PLAINLY  # what rubs is stiff at turns
    play = has_dead_zone(u, force, plainly if word == CURVE else SOMEHOW)
    return {} if play == (word == PLAY) else {best.words: other}


def _is_one_beside(explanation: Explanation, rest: frozenset[str]) -> bool:
    """Whether it has a play, or a curve, as its largest effect, and the rest beside it."""
    e = explanation
    return len(e.words & FLANKS) == 1 and e.words - FLANKS == rest and e.parts[0].word in FLANKS


def _curve(engine: Engine, explanation: Explanation) -> tuple[Array, Array]:
    """Displacement (m,) and force (m,) of a fit, in the units of the load, in the direction in
    which its largest effect sits; without what takes another way there than back."""
    bench, fitted = engine.bench, fit(engine, explanation)
    response = fitted.beyond_known(engine)
    for i, part in enumerate(explanation.parts):
        if part.word not in FLANKS and not part.variant.is_loose:
            response = response - fitted.contribution(engine, i)[: bench.rows.n]
    response = response / bench.slope
    mine = where_it_sits(bench, explanation)
    both = bench.load[mine], response[mine]
    return both if bench.imposed else both[::-1]


def where_it_sits(bench: Bench, explanation: Explanation) -> Flags:
    """(n,) rows of the direction in which the largest effect sits."""
    joint = explanation.parts[0].variant.joint
    everywhere = np.ones(bench.rows.n, dtype=bool)
    return everywhere if joint is None else np.asarray(bench.lever[:, joint] != 0)


def has_dead_zone(u: Array, force: Array, limits: DeadZoneCriteria) -> bool:
    """Whether force (n,) over displacement u (n,) has a dead zone with sharp ends, inside. None of
    what has no stiff flanks."""
    share = _stiffness(u, force)
    if np.quantile(share, _STIFFEST) > limits.hardens:
        return False
    return any(_is_play(share, a, b, limits) for a, b in _soft(share))


def _is_a_step(u: Array, force: Array) -> bool:
    """Whether all that is softer than the flanks of a fit is passed between a few readings: the
    displacement jumps there, as no curve does, and nobody sees what the ends are like."""
    soft = _stretches(_stiffness(u, force) <= _BACK)
    at = np.linspace(float(u.min()), float(u.max()), _POINTS)
    inside = [_stretches((u >= at[a]) & (u <= at[b - 1])) for a, b in soft]
    return bool(soft) and all(b - a <= _UNSEEN for each in inside for a, b in each)


_UNSEEN = 3  # readings in a row


def _stiffness(u: Array, force: Array) -> Array:
    """(p,) of force (n,) over displacement u (n,), row by row, at even points of its way, as a
    share of that of the flanks; ones where none is stiff. The mean of there and back: a part that
    stays where it was left in its play meets the same ends at other forces. The median of a few
    neighbours: where a random drive turns within the play, friction stands otherwise at every
    passage, and steps from one to the next."""
    at = np.linspace(float(u.min()), float(u.max()), _POINTS)
    back = _falls(u)
    ways = [_rise(u[mine], force[mine], at) for mine in (~back, back) if mine.sum() > 1]
    count = np.isfinite(ways).sum(axis=0)
    stiffness = np.nansum(ways, axis=0) / np.maximum(count, 1)
    stiffness = np.interp(at, at[count > 0], stiffness[count > 0])
    beside = np.pad(stiffness, _BESIDE, mode="edge")
    stiffness = np.median(np.lib.stride_tricks.sliding_window_view(beside, 2 * _BESIDE + 1), axis=1)
    flank = float(np.quantile(stiffness, _STIFF))
    return stiffness / flank if flank > 0 else np.ones(_POINTS)


_BESIDE = 2  # points on each side; half of the narrowest play


def _falls(u: Array) -> Flags:
    """(n,) rows on the way down; where it stands, as it came."""
    change = np.diff(u, prepend=u[:1])
    last = np.maximum.accumulate(np.where(change != 0, np.arange(len(u)), 0))
    return np.asarray(change[last] < 0)


def _rise(u: Array, force: Array, at: Array) -> Array:
    """(p,) of force (n,) from point to point of displacement; NaN where that was not read."""
    order = np.argsort(u, kind="stable")
    read, answer = _distinct(u[order], force[order])
    rise = np.gradient(np.interp(at, read, answer))
    return np.where((at >= read[0]) & (at <= read[-1]), rise, np.nan)


def _distinct(u: Array, force: Array) -> tuple[Array, Array]:
    """The same with the mean force of neighbours that lie closer than two points do: of there and
    back, between which friction is."""
    cell = np.floor((u - u[0]) / (float(np.ptp(u)) or 1.0) * _POINTS).astype(np.int64)
    _, which = np.unique(cell, return_inverse=True)
    count = np.bincount(which)
    return np.bincount(which, u) / count, np.bincount(which, force) / count


def _soft(share: Array) -> list[tuple[int, int]]:
    """The stretches of points that are soft; over a few in between, at which what rubs sticks."""
    soft = np.asarray(share < _SOFT)
    each = _stretches(soft)
    for (_, a), (b, _) in pairwise(each):
        soft[a:b] |= b - a <= _LEAST
    return _stretches(soft)


def _stretches(inside: Flags) -> list[tuple[int, int]]:
    """First point, and first one behind it, of every stretch that is inside."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
    return list(pairwise(edges.tolist()))[::2]


def _is_play(share: Array, a: int, b: int, limits: DeadZoneCriteria) -> bool:
    """Whether the stretch from a to b of stiffness, as a share of that of the flanks, is loose
    within and stiff again soon on both sides."""
    width = b - a
    if not _WIDTHS[0] < width / len(share) < _WIDTHS[1]:
        return False
    loose = a + np.flatnonzero(share[a:b] < limits.loose)
    before, behind = np.flatnonzero(share[:a] > _BACK), b + np.flatnonzero(share[b:] > _BACK)
    if not (loose.size and before.size and behind.size):
        return False
    ends = loose[0] - before[-1], behind[0] - loose[-1]
    return bool(max(ends) <= max(limits.sharp * width, _LEAST))


_LEAST = 4  # points, of a corner that lies between two readings, or of what sticks within a play
