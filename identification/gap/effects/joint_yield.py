"""A joint gives way above a threshold torque: clamp of the controller, clutch, plastic flow.

Beyond the elastic deflection it moves by `w P_r(tau)`, P play of radius r = threshold (kinematic
hardening, Prandtl 1928): stiff below, knee, the rest stays after unloading. Rounded knees are
several radii from the threshold on; slow flow is the same state reached with a lag, in proportion
to the overstress or with its square; a controller that takes the joint back resets it between
runs. w in units of the joint's elastic compliance: 1/w is the ratio of hardening to spring, so 0.3
(little) to 100 (a clamp that hardly holds; plastics that draw out under a weight).

Size: slope beyond the knee 0.3 to 100 times the joint's compliance; thresholds anywhere in the
range of load.
A specimen that is pulled once may soften for a while beyond its knee (polymers, Lueders): it is
never stiffer than at first, that is all.
Prior: sum of coefficients positive, sd out of SCALES, equally likely; rounded, lasting and flowing
forms weighted as below.
Source: Prandtl 1928, Perzyna 1966 (laws); torque limits of joints in arms' manuals (thresholds).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array, Flags
from identification.gap.effects import flows
from identification.gap.effects.flow_back import flowing_back, yielded_from
from identification.gap.effects.flows import Flow
from identification.gap.effects.specimens import (
    OWN,
    off,
    own_stiffness,
    softening,
    with_other_springs,
)
from identification.gap.turns import way_back
from identification.gap.variants import (
    BACK_UNDER_WEIGHT,
    LASTING,
    SET_UP_ANEW,
    TAKEN_BACK,
    UNDER_WEIGHT,
    Variant,
    block,
    smooth_root,
    variant,
)

WORD = "joint_yield"
THRESHOLDS = (0.18, 0.24, 0.3, 0.4, 0.5, 0.6, 0.68, 0.75, 0.81, 0.86, 0.9, 0.94, 0.97)
# A joint that is taken back leaves nothing behind: then a curved spring is the simpler reading.
_LIKELY = {"": 1.0, LASTING: 0.5, SET_UP_ANEW: 0.5, TAKEN_BACK: 0.3, UNDER_WEIGHT: 1.0,
           BACK_UNDER_WEIGHT: 0.3}  # fmt: skip
_HARDENS = 0.3  # plastic paths far beyond the knee harden or soften on
_FIRST = 2  # lower ones only round off the knees above them
# Prior weights of a rounded knee: radii by the steps they lie from its centre. The lower ones are
# Bauschinger's effect: after a reversal metal yields earlier than at first.
_SHARP = {0: 1.0, 1: 0.5}
_ROUND = {-6: 0.1, -4: 0.15, -2: 0.25, -1: 0.5, 0: 1.0, 1: 0.5, 2: 0.25}
_SLOW = 0.25  # prior of what gives way more and more, of no one knee
SCALES = (0.07, 0.25, 0.9, 3.5, 14.0, 56.0)


def variants(bench: Bench) -> list[Variant]:
    """Per joint, threshold, knee (sharp, rounded), memory between runs, and flow time."""
    out = []
    for j in bench.moving_joints():
        c = bench.compliance[j]

        def column(state: Array, j: int = j, c: float = float(c)) -> int:
            return bench.add_joint(j, bench.sense * c * state)

        load = bench.true_torque[:, j]
        out += knee_variants(bench, load, column, WORD, f"joint {j + 1}", {"joint": j})
        out += _of_own_spring(bench, load, column, j)
        if bench.feels_weight(j):
            out += _under_weight(bench, load, column, j)
    return out


def _of_own_spring(
    bench: Bench, load: Array, column: Callable[[Array], int], joint: int
) -> list[Variant]:
    """Of a specimen that is far stiffer, or softer, than simulated: thresholds where its own spring
    carries what those of the others are of the largest force."""
    stiffness = own_stiffness(bench)
    if not off(stiffness):
        return []
    carried = float(np.ptp(np.append(bench.rows.measured_force, 0.0)))
    top = min(float(np.abs(load).max()), carried / stiffness)
    found = knee_variants(bench, load, column, WORD, f"joint {joint + 1}", {"joint": joint}, top)
    return with_other_springs(bench, joint, found, SCALES, OWN)


def _under_weight(
    bench: Bench, load: Array, column: Callable[[Array], int], joint: int
) -> list[Variant]:
    """Thresholds on the net torque: the push that reaches them differs between poses, and between
    pushes with the weight and against it. Pushed to one side in one pose, there is no difference:
    then none."""
    weight = bench.weight(joint)
    top, alone = float(np.abs(load).max()), float(np.abs(weight).max())
    most = float(np.abs(load + weight).max())
    if most - alone < _PUSHED * top or not bench.meets_weight_unlike(joint):
        return []
    radius, out = alone + (most - alone) * np.array(THRESHOLDS), []
    taken_back = [BACK_UNDER_WEIGHT] if TAKEN_BACK in _memories(bench) else []
    for memory in (UNDER_WEIGHT, *taken_back):
        fresh = _fresh(bench, memory)
        # what a controller takes back it had clamped: no metal that flows back
        kept = flowing_back(bench, load, column, top, fresh) if memory == UNDER_WEIGHT else {}
        info = {"joint": joint, "memory": memory, "flow_s": 0.0, "load": load, "column": column,
                "top": top, "back": kept, "weight": weight}  # fmt: skip
        states = bench.plays(load, radius, fresh, weight)
        label = f"joint {joint + 1}{memory}"
        out += _knees(bench, WORD, label, [column(s) for s in states.T], radius, info)
    return out


_PUSHED = 0.2  # of the joint's largest torque: so far beyond its weight some push must go


def knee_variants(
    bench: Bench,
    load: Array,
    column: Callable[[Array], int],
    word: str,
    name: str,
    info: dict[str, Any],
    top: float | None = None,
) -> list[Variant]:
    """Variants of a threshold on `load` (n,); `column` turns a state (n,) into a pool index. top:
    what the thresholds are shares of; left out: the largest load."""
    top = _range(bench, load) if top is None else top
    if not top > 0:
        return []
    radius = bench.radii(load, top * np.array(THRESHOLDS))
    out = _hardened(bench, load, radius, column, word, name, info)
    for memory, fresh in _memories(bench).items():
        columns = [column(s) for s in bench.plays(load, radius, fresh).T]
        exact = {**info, **knee_at(bench, load, column, memory, top), "flow_s": 0.0}
        out += _knees(bench, word, f"{name}{memory}", columns, radius, exact)
    return out


def knee_at(
    bench: Bench, load: Array, column: Callable[[Array], int], memory: str, top: float | None = None
) -> dict[str, Any]:
    """What knees on a load (n,) have in common at a place: memory, load, column, `top` of what
    flows back, and `back`, its columns by the share of `top` beyond which it has yielded."""
    top = _range(bench, load) if top is None else top
    # what a controller takes back it had clamped: no metal that flows back
    metal = memory != TAKEN_BACK
    back = flowing_back(bench, load, column, top, _fresh(bench, memory)) if metal else {}
    return {"memory": memory, "load": load, "column": column, "top": top, "back": back}


def _range(bench: Bench, load: Array) -> float:
    """Largest size of a load (n,), as far as data reach."""
    top = float(np.abs(load).max())
    return top * bench.reach_of(load) / float(np.ptp(np.append(load, 0.0))) if top > 0 else 0.0


def _knees(
    bench: Bench, word: str, label: str, columns: list[int], radius: Array, info: dict[str, Any]
) -> list[Variant]:
    """Sharp and rounded knees at the radii of THRESHOLDS; further radii belong to all of them. What
    begins to give way bit by bit and flows back is friction, of an arm: `joint_hysteresis`; what
    holds small loads firmly, and then more and more gives way, is not (Ramberg and Osgood 1943).
    What is pulled once, without an arm, may soften."""
    arm, share = bench.data.arm, 0.7 / len(radius) * _LIKELY[info["memory"]]
    softens = not arm and not bench.course.unloads
    extra, out = list(range(len(THRESHOLDS), len(radius))), []
    for k in range(_FIRST, len(THRESHOLDS)):
        for knee, steps in (("sharp", _SHARP), ("round", _ROUND)):
            inside = {k + d: w for d, w in steps.items() if 0 <= k + d < len(THRESHOLDS)}
            place = [*inside, *extra]
            kept = [*inside.values(), *[_HARDENS] * len(extra)]
            exact = {**info, "radius": radius[place], "centre": radius[k],
                     "back": {} if knee == "round" and arm else info["back"], "knee": knee,
                     "softens": softens}  # fmt: skip
            at, chosen = f"{label} at {THRESHOLDS[k]:g} {knee}", [columns[i] for i in place]
            out += _with_back(word, at, chosen, np.diag(kept), share / 4, exact)
    if arm and bench.course.unloads:
        exact = {**info, "radius": radius, "centre": radius[0], "back": {},
                 "knee": "slow", "softens": False}  # fmt: skip
        at, likely = f"{label} at {THRESHOLDS[0]:g} and on", _SLOW * _LIKELY[info["memory"]]
        root = smooth_root(len(radius), 0.6, 0.3)
        out += _with_back(word, at, columns, root, likely, exact)
    return out


HARDENED = " hardened"
UNDER_A_TIP, _CAME_BACK = (0.01, 0.04, 0.1), 0.2  # of the range
_LEFT = 0.2  # of the largest response: as much as friction seldom holds


def _hardened(
    bench: Bench, load: Array, radius: Array, column: Callable[[Array], int], word: str, name: str,
    info: dict[str, Any],
) -> list[Variant]:  # fmt: skip
    """What hardens alike in both senses (Voce 1948) and is loaded again and again: it yields on
    only beyond the largest load it has borne. Specimens from one side, under a tip from the first
    load on (said of loads that come back before they grow, and of what is not taken back by a long
    way: a single loop may be friction); joints of an arm, whichever way they are pushed next."""
    top = float(np.abs(load).max())
    course, arm = bench.course, bench.data.arm
    told = word == WORD and course.unloads if arm else course.lets_go and course.one_sided
    if not told:
        return []
    size = np.abs(load)
    if not arm and (
        way_back(size[: int(size.argmax()) + 1]) > _CAME_BACK * top
        or bench.course.left_behind > _LEFT
    ):
        radius = np.concatenate([top * np.array(UNDER_A_TIP), radius])
    columns = [column(s) for s in grown(load, radius, bench.moved).T]
    out = []
    for k in range(len(radius)):
        root = np.diag([1.0, *[_HARDENS] * (len(radius) - k - 1)])
        exact = {**info, "memory": HARDENED, "flow_s": 0.0, "radius": radius[k:],
                 "centre": radius[k], "load": load, "column": column, "back": {},
                 "knee": "hardened"}  # fmt: skip
        label = f"{name}{HARDENED} beyond {radius[k] / top:.3g}"
        out.append(
            variant(word, label, columns[k:], SCALES, root, np.ones(len(root)),
                    0.7 / len(radius), LEAST, **exact)
        )  # fmt: skip
    return out


def grown(load: Array, radius: Array, fresh: Flags) -> Array:
    """(n, k): by how much the size of the load (n,) has ever been beyond the radii (k,) since the
    memory was fresh; each time with the sign that the load then had."""
    out = np.empty((len(load), len(radius)))
    edges = np.append(np.flatnonzero(fresh | (np.arange(len(load)) == 0)), len(load))
    for a, b in pairwise(edges):
        largest = np.maximum.accumulate(np.abs(load[a:b]))
        beyond = np.maximum(largest[:, None] - radius, 0.0)
        grows = np.diff(beyond, axis=0, prepend=0.0)
        out[a:b] = np.cumsum(np.sign(load[a:b])[:, None] * grows, axis=0)
    return out


def _with_back(
    word: str, label: str, columns: list[int], root: Array, prior: float, info: dict[str, Any]
) -> list[Variant]:
    """A knee as it is, and with Bauschinger's effect: once it has yielded, metal flows back early
    when unloaded."""
    out, share = [], yielded_from(info)
    back, info = info["back"].get(share, []), {**info, "back_from": share}
    for more, name in ([], ""), *([(back, ", flows back")] if back else []):
        k, n = len(columns), len(columns) + len(more)
        each, within = softening(np.asarray(info["radius"]), n) if info["softens"] else (True, None)
        out.append(
            variant(word, label + name, [*columns, *more], SCALES,
                    block([root, _RETURNS * np.eye(len(more))]), np.repeat([1.0, 0.0], [k, n - k]),
                    prior, LEAST, each, within, **info)
        )  # fmt: skip
    return out


LEAST = 0.15  # of the elastic compliance: what bends less does not give way
FINE = 13  # radii about a threshold that was found on the grid, from 0.84 to 1.2 of it
FLOWS_S = (1.2, 2.5, 5.0, 10.0, 25.0)  # in proportion to the overstress,
SQUARE_S = (2.5, 6.0, 15.0)  # or with its square


def is_sharp(v: Variant) -> bool:
    """Whether the threshold is one of the grid, without rounding: about such it is refined."""
    return bool(v.info["knee"] == "sharp")


def refined(bench: Bench, found: Variant, close: float = 1.0) -> list[Variant]:
    """Finely spaced thresholds and flow times about a variant that was found. close: share of the
    steps; below 1 only of what flows, between the times that were looked at."""
    info, ways = dict(found.info), _ways(bench, str(found.info["memory"]))
    if close < 1:
        flow, square = float(info["flow_s"]), bool(info.get("square"))
        ways = [(flow * 2.0**step, square) for step in _BETWEEN if flow > 0]
    weight = info.get("weight")
    alone = 0.0 if weight is None else float(np.abs(weight).max())
    radius = alone + (float(info["centre"]) - alone) * (1 + close * np.linspace(-0.16, 0.2, FINE))
    fresh = _fresh(bench, info["memory"])
    name, out = place_in(found.label), []
    at = Flow(info["load"], radius, 0.0, fresh, weight)
    for (flow, square), states in flows.each_way(bench, ways, at):
        columns = [info["column"](s) for s in states.T]
        share = 0.25 / FINE / (1 if flow == 0 else len(FLOWS_S) + len(SQUARE_S))
        how = f" flow {flow:.3g} s{' squared' if square else ''}" if flow else ""
        for k in range(FINE):
            exact = {**info, "centre": radius[k], "flow_s": flow, "square": square}
            label = f"{name}{how} at {radius[k]:.4g} fine"
            kinds = {"": slice(k, k + 1), " rounded": slice(max(k - 2, 0), k + 3)}
            for kind, place in kinds.items():
                exact["radius"] = radius[place]
                root = np.eye(len(radius[place]))
                out += _with_back(found.word, label + kind, columns[place], root, share, exact)
    if info.get("other_springs"):
        return with_other_springs(bench, int(info["joint"]), out, SCALES, OWN)
    return out


Place = tuple[str, Mapping[str, Any]]  # with which a knee's label begins; its `knee_at`


def elsewhere(bench: Bench, found: Sequence[tuple[Variant, Place]]) -> list[Variant]:
    """Knees that were found, at other places (joint, or axis) of the same memory, where they begin
    at the same load of the rig: thresholds in proportion to what loads the two places. Without
    those that nothing loads there then, or where nothing flows back."""
    moved = [(v, place, _factor(v.info, place[1])) for v, place in found]
    moved = [(v, place, factor) for v, place, factor in moved if factor > 0]
    flows.make(bench, [_followed(bench, *one) for one in moved])
    out = [_moved(bench, *one) for one in moved]
    return [v for v in out if v is not None]


def _factor(here: Mapping[str, Any], there: Mapping[str, Any]) -> float:
    """What loads one place over what loads another, where the load is largest here."""
    most = int(np.abs(here["load"]).argmax())
    return float(np.abs(there["load"][most]) / np.abs(here["load"][most]))


def _followed(bench: Bench, found: Variant, place: Place, factor: float) -> Flow:
    """Its states at another place."""
    info = found.info
    radius, fresh = factor * np.asarray(info["radius"]), _fresh(bench, info["memory"])
    square = bool(info.get("square"))
    return Flow(place[1]["load"], radius, float(info["flow_s"]), fresh, square=square)


def _moved(bench: Bench, found: Variant, place: Place, factor: float) -> Variant | None:
    info, (name, other) = found.info, place
    flow = _followed(bench, found, place, factor)
    columns = [other["column"](s) for s in flows.states(bench, flow).T]
    if len(found.columns) > len(flow.radius):
        columns += other["back"].get(info["back_from"], [])
    if len(columns) != len(found.columns):
        return None
    exact = {**other, "back_from": info["back_from"], "radius": flow.radius, "flow_s": flow.time,
             "centre": factor * float(info["centre"]), "square": flow.square,
             "knee": info["knee"]}  # fmt: skip
    start, end = found.label.rsplit(" at ", 1)
    how = start.removeprefix(place_in(found.label)) + f" at {exact['centre']:.4g}"
    label = " ".join([name + how, *end.split(" ")[1:]])
    return replace(found, label=label, columns=tuple(columns), info=exact)


def place_in(label: str) -> str:
    """Joint or axis, and memory, with which a knee's label begins."""
    return re.split(" at | flow", label, maxsplit=1)[0]


_RETURNS = 0.4  # coefficients of what flows back, against those of the knee


def _memories(bench: Bench) -> dict[str, Flags]:
    """When the joint gets back to where it was: never, when the arm moves, when the rig is turned
    to another direction (the arm may be sent away meanwhile), before every run."""
    moved, first = bench.moved, np.zeros(bench.rows.n, dtype=bool)
    out = {"": moved}
    if np.sum(moved) > 1:
        out[LASTING] = first
    if np.sum(bench.rebuilt) > np.sum(moved):
        out[SET_UP_ANEW] = bench.rebuilt
    if np.sum(bench.rest) > np.sum(moved):
        out[TAKEN_BACK] = moved | bench.rest
    return out


def _fresh(bench: Bench, memory: str) -> Flags:
    """(n,) rows before which a joint of that memory is where it was."""
    lost = TAKEN_BACK if memory == BACK_UNDER_WEIGHT else memory
    return _memories(bench).get(lost, bench.moved)


CLOSE = (0.4,)  # of a closer look
_BETWEEN = (-0.5, -0.25, 0.25, 0.5)  # powers of two of a flow time


def _ways(bench: Bench, memory: str) -> list[flows.Way]:
    """What flows at once, and in all times that are looked for. A controller gives way at once."""
    clamped = memory in (TAKEN_BACK, BACK_UNDER_WEIGHT)
    if clamped or bench.rows.continuous or bench.course.timeless:
        return [(0.0, False)]
    # what slows down so under a load that stands, a single spring can't tell from creep
    squared = SQUARE_S if bench.data.arm else ()
    return [(0.0, False), *((t, False) for t in FLOWS_S), *((t, True) for t in squared)]
