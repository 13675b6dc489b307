"""Where a joint changes flanks: centre, width and corners of its play, placed by the data.

A rig without an arm has no weight that says where a joint's torque passes zero, and neither channel
need be zeroed: the crossing lies anywhere. Laws, by what is driven:

- displacement: no force inside the play, then springs, `dead_zone(u - centre)`;
- displacement: friction on the far side holds the force until the play was passed, at every turn
  and wherever that is, `play_w/2(u - start)` (backlash as of control engineering);
- force: friction `r` holds the flank until the load has turned, then it changes within a zone `e`
  of no more than the friction, `tanh(play_r(F - centre) / e)`;
- either: friction inside the play alone, which springs back or holds, and an end that friction does
  not pass: the same place of `play_r(x - centre)` instead of `x - centre`, `r` of any size.

They are met to a few percent or not at all: corners are sharp, and a grid of places would miss
them. So the places are found by least squares (compass search), before the evidence is asked. Play:
Krasnosel'skii, Pokrovskii 1989. Where no play passes through the load's range none is placed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from identification.arrays import Array
from identification.gap.model.bench import Bench

ENOUGH = 0.3  # rms that may be left of what a straight line leaves
ENOUGH_BESIDE = 0.5  # and of what line and friction do
CORNERS = 0.8  # round ones: of what a smooth curve leaves beside the same friction
SHARP = 0.15  # corners over a smaller share of the half width are none of a smooth curve
BETTER = 0.7  # friction within the play, than beside it or at its flanks
HOPEFUL = 0.8  # a search that starts from no better is not begun
_BEYOND = 0.03  # of the load's range: so far it has to go past either corner
_BACK = 0.1  # of the slope of the springs
_CENTRES = np.linspace(-0.25, 0.25, 9)  # starts, of the range
_HALVES = (0.03, 0.07, 0.13, 0.2)
_WIDER = (0.3, 0.4)  # of a play that is carried along
_SIDES = (-1.0, -0.5, 0.0, 0.5, 1.0)  # of it, on which it may be at first
_CORNERS = (0.02, 0.2)  # of the half width
_FRICTIONS = (0.002, 0.005, 0.01, 0.02)  # radius inside the play, of the range
_HELD = (0.003, 0.01, 0.03)  # radius that holds a flank, of the range
_DRAGS = (0.01, 0.03, 0.1)  # radius within the play, of the range
_ZONES = (0.15, 0.4, 0.9)  # of that radius
_DESCENTS, _HALVINGS, _ROUNDS = 3, 6, 4  # of the search; halvings of its steps; rounds each


@dataclass(frozen=True)
class Flanks:
    """All in units of the load (Nm; N without an arm). kind: "gap", "carried", "held" or "dragged".
    centre: of the play; of a carried one, where it was at first. zone: half width of a gap, or
    within what load a held joint changes flanks; corner: over which the gap's corners are round;
    friction: radius of the play operator beside it, or within it if dragged."""

    kind: str
    centre: float
    zone: float
    corner: float
    friction: float


def shapes(bench: Bench, load: Array, flanks: Flanks) -> tuple[Array, Array]:
    """Of a load (n,): place within the play (-1/2 .. 1/2), and the friction beside it."""
    x = load - flanks.centre
    radii = [flanks.friction, *([flanks.zone] if flanks.kind == "carried" else [])]
    states = bench.plays(x, np.array(radii)).T
    return _place(load, states[-1], flanks), -(x - states[0]) / (2 * flanks.friction)


def placed(bench: Bench, load: Array) -> Flanks | None:
    """Flanks for the load (n,) of a bench by least squares on its response; None where the play
    leaves more than ENOUGH of what a straight line does, or other laws do without it."""
    if len(bench.data.setups) > 1:  # one direction at a time is what this can place
        return None
    weight, span = bench.rows.weight, float(np.ptp(load))
    if not span > 0 or bench.rows.n < 20:
        return None
    plain = _left([load], bench.response, weight)
    if not plain > bench.noise.stated:
        return None
    find = _gap if bench.imposed else _held
    found, left = find(bench, load, span, HOPEFUL * plain)
    dragged, rest = _dragged(bench, load, span, HOPEFUL * plain)
    if rest < BETTER * left and not _snaps(bench, load, dragged):
        found, left = dragged, rest
    if bench.imposed:
        carried, rest = _carried(bench, load, span, HOPEFUL * plain)
        if BETTER * rest < left:  # the simplest of them
            found, left = carried, rest
    if left < ENOUGH * plain and _crossed(load, found) and _needed(bench, load, found, left):
        return found
    return None


def _snaps(bench: Bench, load: Array, found: Flanks) -> bool:
    """Whether the answer of an imposed displacement turns back within the play: a joint that is
    dragged through it goes no faster than what drags it, but what is unstable does."""
    if not bench.imposed:
        return False
    root = np.sqrt(bench.rows.weight)[:, None]
    columns = np.column_stack([load, shapes(bench, load, found)[0], np.ones(len(load))])
    (spring, play, _), *_ = np.linalg.lstsq(columns * root, bench.response * root[:, 0], rcond=None)
    return bool((spring + play / (2 * found.zone)) * spring < -_BACK * spring**2)


def _crossed(load: Array, found: Flanks) -> bool:
    """Whether the load (n,) went clearly beyond both ends of the play."""
    inside = {"gap": found.zone, "held": found.friction}.get(
        found.kind, found.zone + found.friction
    )
    margin = _BEYOND * float(np.ptp(load))
    if found.kind == "carried":  # anywhere
        return 2 * (found.zone + margin) < float(np.ptp(load))
    low, high = float(load.min()) + margin, float(load.max()) - margin
    return low < found.centre - inside and found.centre + inside < high


def _needed(bench: Bench, load: Array, found: Flanks, left: float) -> bool:
    """Whether neither the friction beside the play does without it, nor a smooth curve: one of
    eight freedoms may be as good as sharp corners where both come down to the noise. What carries
    the play along no friction beside it does: that goes the other way at a turn; but it has to be
    seen to go either way, or a contact does."""
    y, weight = bench.response, bench.rows.weight
    if found.kind == "carried":
        moves = np.diff(bench.plays(load - found.centre, np.array([found.zone]))[:, 0])
        either = min(moves[moves > 0].sum(), -moves[moves < 0].sum())
        return bool(either > _BEYOND * np.ptp(load) and left < _left(_powers(load), y, weight))
    rub = shapes(bench, load, found)[1]
    if left > ENOUGH_BESIDE * _left([load, rub], y, weight):
        return False
    sharp = found.kind == "held" or found.corner < SHARP * found.zone
    return left < (1.0 if sharp else CORNERS) * _left([*_powers(load), rub], y, weight)


def _powers(load: Array) -> list[Array]:
    """Powers up to the seventh (Chebyshev, so that they are told apart)."""
    x = 2 * (load - load.min()) / np.ptp(load) - 1
    return list(np.polynomial.chebyshev.chebvander(x, 7)[:, 1:].T)


def _place(load: Array, state: Array, flanks: Flanks) -> Array:
    if flanks.kind == "held":
        return np.asarray(np.tanh(state / flanks.zone) / 2)
    if flanks.kind == "carried":
        return np.asarray((load - flanks.centre - state) / (2 * flanks.zone))
    x = state if flanks.kind == "dragged" else load - flanks.centre
    return np.asarray((x - _dead_zone(x, flanks.zone, flanks.corner)) / (2 * flanks.zone))


def _dead_zone(x: Array, half: float, corner: float) -> Array:
    """`x` less what lies within +-half, corners rounded over `corner` (softplus)."""
    ends = [np.logaddexp(0.0, (side - half) / corner) for side in (x, -x)]
    return np.asarray(corner * (ends[0] - ends[1]))


def _gap(bench: Bench, load: Array, span: float, most: float) -> tuple[Flanks, float]:
    y, weight = bench.response, bench.rows.weight
    rubs = load[:, None] - bench.plays(load, span * np.array(_FRICTIONS))

    def flanks(p: Array, k: int = 2) -> Flanks:
        half = span * float(np.exp(p[1]))
        return Flanks(
            "gap",
            span * float(p[0]),
            half,
            half * float(np.exp(min(p[2], 0.0))),
            span * _FRICTIONS[k],
        )

    def left(p: Array, k: int = 2) -> float:
        f = flanks(p)
        return _left([_dead_zone(load - f.centre, f.zone, f.corner), rubs[:, k]], y, weight)

    starts = _starts(load, span, _HALVES, _CORNERS)
    best, _ = _descend(left, starts, np.array([0.03, 0.3, 0.7]), most)
    each = [left(best, k) for k in range(len(_FRICTIONS))]
    k = int(np.argmin(each))
    return flanks(best, k), each[k]


def _carried(bench: Bench, load: Array, span: float, most: float) -> tuple[Flanks, float]:
    def flanks(p: Array) -> Flanks:
        half = span * float(np.exp(p[1]))
        return Flanks("carried", span * float(p[0]), half, half, span * _FRICTIONS[1])

    def left(p: Array) -> float:
        f = flanks(p)
        moved = bench.plays(load - f.centre, np.array([f.zone]))[:, 0]
        return _left([moved], bench.response, bench.rows.weight)

    start = float(load[0]) / span
    starts = [
        np.array([start + side * h, np.log(h)]) for h in (*_HALVES, *_WIDER) for side in _SIDES
    ]
    best, rest = _descend(left, starts, np.array([0.03, 0.3]), most)
    return flanks(best), rest


def _held(bench: Bench, load: Array, span: float, most: float) -> tuple[Flanks, float]:
    def flanks(p: Array) -> Flanks:
        radius = span * float(np.exp(p[1]))
        zone = radius * float(np.exp(min(p[2], 0.0)))
        return Flanks("held", span * float(p[0]), zone, zone, radius)

    return _with_friction(bench, load, span, most, flanks, _HELD, _ZONES, 0.5)


def _dragged(bench: Bench, load: Array, span: float, most: float) -> tuple[Flanks, float]:
    def flanks(p: Array) -> Flanks:
        half, radius = span * np.exp(p[1:3])
        return Flanks(
            "dragged", span * float(p[0]), float(half), _CORNERS[0] * float(half), float(radius)
        )

    return _with_friction(bench, load, span, most, flanks, _HALVES, _DRAGS, 0.3)


def _with_friction(
    bench: Bench,
    load: Array,
    span: float,
    most: float,
    flanks: Callable[[Array], Flanks],
    widths: tuple[float, ...],
    others: tuple[float, ...],
    step: float,
) -> tuple[Flanks, float]:
    """The best of flanks that friction is part of, by centre and the logarithms of a width, in
    steps of `step`, and of a second one; what they leave."""

    def left(p: Array) -> float:
        return _left([load, shapes(bench, load, flanks(p))[0]], bench.response, bench.rows.weight)

    starts = _starts(load, span, widths, others)
    best, rest = _descend(left, starts, np.array([0.03, step, 0.5]), most)
    return flanks(best), rest


def _starts(
    load: Array, span: float, widths: tuple[float, ...], others: tuple[float, ...]
) -> list[Array]:
    """Centres about the middle of the load, and logarithms of a width and of a second one."""
    middle = float(load.min() + load.max()) / (2 * span)
    each = product(_CENTRES, widths, others)
    return [np.array([middle + c, np.log(w), np.log(o)]) for c, w, o in each]


def _left(shapes: list[Array], y: Array, weight: Array) -> float:
    """Weighted rms that shapes (n,) and a constant leave of y (n,)."""
    a = np.column_stack([*shapes, y])
    a = a - weight @ a / weight.sum()
    gram = a.T @ (a * weight[:, None])
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    gram = gram / np.outer(size, size)
    k = len(shapes)
    explained = gram[:k, k] @ np.linalg.solve(gram[:k, :k] + 1e-9 * np.eye(k), gram[:k, k])
    return float(size[k] * np.sqrt(max(1.0 - float(explained), 0.0) / weight.sum()))


def _descend(
    left: Callable[[Array], float], starts: list[Array], step: Array, most: float
) -> tuple[Array, float]:
    """From the best starts, unless all leave more than `most`: along the axes and the diagonals of
    the last two, steps halved where none is better (compass search); the deepest."""
    values = np.array([left(s) for s in starts])
    if values.min() > most:
        return starts[int(values.argmin())], float(values.min())
    ways = np.diag(step)
    ways = np.vstack([ways, ways[-2] + ways[-1], ways[-2] - ways[-1]])
    found = [
        _compass(left, starts[i], float(values[i]), ways) for i in np.argsort(values)[:_DESCENTS]
    ]
    return min(found, key=lambda f: f[1])


def _compass(
    left: Callable[[Array], float], best: Array, value: float, ways: Array
) -> tuple[Array, float]:
    for _ in range(_HALVINGS):
        for _ in range(_ROUNDS):
            before = value
            for way in ways:
                best, value = _either_side(left, best, value, way)
            if value == before:
                break
        ways = ways / 2
    return best, value


def _either_side(
    left: Callable[[Array], float], best: Array, value: float, way: Array
) -> tuple[Array, float]:
    """The deepest of a point and its neighbours to either side along a way."""
    for trial in (best + way, best - way):
        found = left(trial)
        if found < value:
            best, value = trial, found
    return best, value
