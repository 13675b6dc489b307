"""Friction beside a joint's spring in absolute torques, and what its laws are called."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Array
from identification.gap.laws.interval import Coefficients, Parameter, normal
from identification.gap.laws.law import (
    ACROSS,
    ANEW,
    HUNG,
    KEPT,
    LOST,
    WORKED,
    Law,
    Term,
    fresh_after,
)
from identification.gap.model.bench import TOOL_KG, Bench
from identification.gap.model.path import Path, with_loads, worked_in
from identification.gap.model.variants import LASTING, RESET_PER_SETUP, UNDER_WEIGHT, Variant

SLIP_AT_A_STRENGTH = ("Iwan", "Prandtl")
EXPONENTIAL = ("Dahl", "Bouc-Wen")
# Leaves, belts, cables and wedges are pressed by what they carry: friction in proportion to that.
BY_LOAD = tuple(f"{law} by load" for law in EXPONENTIAL)
# Where the stated spring is that of small loads, what slips comes on top.
THAT_SLIPS = " that slips"
SLIPPING = tuple(law + THAT_SLIPS for law in EXPONENTIAL)
LAWS = (*EXPONENTIAL, *BY_LOAD, *SLIPPING)
ON_TOP = ("Prandtl", *SLIPPING)
FRICTION_LAWS = (*SLIP_AT_A_STRENGTH, *LAWS)
# Of what slips at all of the load, at half of it: a spectrum as strong everywhere slips a quarter,
# one strength of 0.4 of the load, or strengths from a fifth to 0.7 of it, a sixth.
_AT_HALF, _AT_HALF_OF_AN_ARM = 0.18, 0.16
_AT_ONCE = 0.05  # of the largest load
_TURNED = 0.01  # of the largest product of both
_HARDLY = 0.2  # of the largest load: what slips beyond the rest of it shows less
_TINY = 1e-300
_MEMORY = {
    "": KEPT,
    "worked in": WORKED,
    "rested": LOST,
    UNDER_WEIGHT.strip(): HUNG,
    RESET_PER_SETUP.strip(): ANEW,
    LASTING.strip(): ACROSS,
}


def describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """The law, and scales (k,) of its terms: friction elements, with their strength in Nm where the
    law has one (of what comes through of a load that saturates), else with the reach (Nm) over
    which they bend; of elements that slacken with what they bear until they give way."""
    joint, law = int(v.info["joint"]), str(v.info["law"])
    key = "strength" if law in SLIP_AT_A_STRENGTH else "reach"
    constants = {"joint": joint, "law": law, "memory": _MEMORY[v.info["memory"]]}
    if "tool_kg" in v.info:
        constants["tool"] = float(v.info["tool_kg"])
    if "saturates" in v.info:
        constants["saturates"] = float(v.info["saturates"])
    if law in BY_LOAD:
        constants["measured_to"] = bench.reach_of(bench.true_torque[:, joint])
    worn = int(v.info.get("slackens", 0))
    keys = ["slackens"] * worn + [key] * (len(v.info["radius"]) - worn)
    terms = tuple(
        Term("compliance", {k: float(r)}) for k, r in zip(keys, v.info["radius"], strict=True)
    )
    if grown := {key: v.info[key] for key in GROWS if key in v.info}:  # every other one
        terms = tuple(
            replace(t, shape={**t.shape, **grown}) if i % 2 else t for i, t in enumerate(terms)
        )
    terms += (Term("compliance"),) if v.other_springs else ()
    return Law(constants, terms), np.full(len(terms), float(bench.compliance[joint]))


def columns(bench: Bench, law: Law) -> list[Array]:
    """Column of every term, in their order: what the friction holds back, `S_r(tau)` (stop
    operator), or reach, or load, times bristle state; of laws that slip what that leaves of the
    load, as `P_r(tau)` does of Prandtl's; of a term without a strength its own spring's line, of
    one that slackens what it bears where it was last pushed to. Of a load that saturates, tau is
    what comes through."""
    c = law.constants
    joint, at_strength = c["joint"], c["law"] in SLIP_AT_A_STRENGTH
    torque, fresh = bench.true_torque[:, joint], fresh_after(bench, c["memory"])
    size = np.array([_size_of(t) for t in law.terms if t.shape])
    weight = bench.weight(joint, c.get("tool", TOOL_KG)) if c["memory"] == HUNG else None
    path = bench.path(torque, fresh, weight)
    path = worked_in(path) if c["memory"] == WORKED else path
    if "saturates" in c:
        path = with_loads(path, saturating(path.load, c["saturates"]))
    if at_strength:
        worn = np.array(["slackens" in t.shape for t in law.terms if t.shape], dtype=bool)
        plays = path.plays(size[~worn])
        held = np.empty((bench.rows.n, len(size)))
        held[:, ~worn] = -plays if c["law"] == "Prandtl" else torque[:, None] - plays
        if worn.any():
            held[:, worn] = path.slacks(size[worn])
    else:
        by_load = c["law"] in BY_LOAD
        span = c.get("measured_to", bench.reach_of(torque))  # a file may lack it
        way = with_loads(path, by_ratio(path.load, span)) if by_load else path
        z = way.bristles(size, c["law"].startswith("Bouc-Wen"))
        held = z * (np.abs(torque)[:, None] if by_load else size)
        grown = np.array([_grown(bench, law, t) for t in law.terms if t.shape])
        held = held * grown.reshape(len(size), bench.rows.n).T
        held -= torque[:, None] if c["law"] in SLIPPING else 0.0
    each = iter(held.T)
    return [
        bench.joint_column(joint, -bench.sense * next(each) if t.shape else torque)
        for t in law.terms
    ]


def _size_of(term: Term) -> float:
    """Strength or reach of an element, Nm."""
    return float(next(term.shape[k] for k in ("strength", "reach", "slackens") if k in term.shape))


def _grown(bench: Bench, law: Law, term: Term) -> Array:
    """(n,) 1, or what a joint carries over that to which the friction grows."""
    key = next((key for key in GROWS if key in term.shape), None)
    if key is None:
        return np.ones(bench.rows.n)
    return np.asarray(carried(bench, law.constants["joint"])[key] / term.shape[key])


GROWS = ("grows_to", "grows_with_push_to")  # Nm carried at which what grows is as strong as stated


def carried(bench: Bench, joint: int) -> dict[str, Array]:
    """(n,) Nm that a joint carries: push and weights together, and the push alone."""
    push = bench.true_torque[:, joint]
    return dict(zip(GROWS, (np.abs(push + bench.weight(joint)), np.abs(push)), strict=True))


def by_ratio(load: Array, span: float) -> Array:
    """Loads (n,) stretched so that a friction in proportion to them turns over a share of them: as
    they are at the span, ever longer towards none."""
    whole = (1 + _NONE) * span * np.log1p(np.abs(load) / (_NONE * span))
    return np.asarray(np.sign(load) * whole)


def saturating(load: Array, most: float) -> Array:
    """Loads (n,) of which ever less comes through towards `most`, Nm."""
    return np.asarray(most * np.tanh(load / most))


_NONE = 0.05  # of the range: loads below that are as good as none


def no_knee(
    bench: Bench, torque: Array, radius: Array, path: Path, saturates: float | None = None
) -> Array | None:
    """(1, k): that what slips at strengths radius (k,) has slipped by a good part where the load is
    first half of its largest, of what it has at the largest torque (n,). Friction acts from the
    first load on; what holds half the load and then gives way has yielded. What slips at once does
    not count, as springs do that too. Only where the load stays on one side: to and fro, strokes
    far beyond the first slip show friction of one strength. Of a specimen what was cycled before
    goes all the way back first. path: with the weights that hang on it. saturates: of a load that
    does, most of what comes through, Nm."""
    size, top = np.abs(torque), int(np.abs(torque).argmax())
    if bench.data.arm:
        run = bench.rows.run == bench.rows.run[top]
        half = 0.5 * float(size[top])
        if float((np.sign(torque[top]) * torque[run]).min()) < -half:
            return None
    elif bench.load_history.one_sided:
        force = np.abs(bench.rows.measured_force)
        half = float(size[int(np.argmax(force >= 0.5 * force.max()))])
    else:
        return None
    slips = (2.0 if path.worked_in and not bench.data.arm else 1.0) * radius
    if path.weight is not None:  # what that pushes the same way has slipped already
        hung = float(np.sign(torque[top]) * path.at_rows(path.weight)[top])
        slips = np.maximum(radius - max(hung, 0.0), 0.0)
    loads = np.array([[half], [size[top]]])
    loads = loads if saturates is None else saturating(loads, saturates)
    early, late = np.maximum(loads - slips, 0.0) * (slips > _AT_ONCE * loads[1])
    least = _AT_HALF_OF_AN_ARM if bench.data.arm else _AT_HALF
    return np.asarray(early - least * late)[None, :] / max(float(late.max(initial=0.0)), _TINY)


def exponential_laws(bench: Bench) -> tuple[str, ...]:
    """Of an arm in both conventions, as spectra are; a specimen's friction brings a spring of its
    own. Friction in proportion to the load can't turn a specimen's answer against its load."""
    if bench.data.arm:
        return (*EXPONENTIAL, *SLIPPING)
    with_load = bench.load * bench.response
    keeps = with_load.min() >= -_TURNED * with_load.max(initial=0.0)
    return (*EXPONENTIAL, *BY_LOAD) if keeps else EXPONENTIAL


def parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """Of the strengths that slip, which takes a load beyond them, and of those near the largest one
    the less the less they do; of friction in proportion to the load, at the largest one. Of those
    that slip before the first reading after a turn no reading tells how far they give way before:
    they may be as strong as that turn shows, and so much stiffer."""
    radius, joint = np.asarray(v.info["radius"]), int(v.info["joint"])
    if v.other_springs:
        found = found.without_line(joint)
    largest = float(np.abs(bench.torque[:, joint]).max())
    if "saturates" in v.info:  # strengths are those of what comes through
        largest = float(saturating(np.array(largest), v.info["saturates"]))
    law = str(v.info["law"])
    slips = np.clip((1 - radius / max(largest, _TINY)) / _HARDLY, 0.0, 1.0)
    if law in EXPONENTIAL or law in SLIPPING:  # bends from the first load on
        slips = np.maximum(slips, -np.expm1(-largest / radius))
    if law in BY_LOAD:
        radius = np.full(len(radius), largest)
    if law == "Iwan":  # what never slips is a spring like the joint's own, beside it
        stiffens = bench.imposed and not bench.data.arm
        found = found.on_spring(1 - slips if stiffens else slips - 1, joint)
    if law in ON_TOP:  # of all that gives way at large loads, as of the other convention
        found = found.on_spring(slips, joint)
    beside = bench.imposed and not bench.data.arm  # of the spring: a force, as it is
    most, unit = np.inf if beside else 1.0, bench.torque_unit
    hidden = slips * np.clip(1 - radius / max(_seen_from(bench, joint), _TINY), 0.0, 1.0)
    share = _bounded(
        found.per_spring(slips, joint), found.per_spring(slips - hidden, joint).value, most
    )
    if beside:
        friction = found.linear(slips * radius, unit)
    else:
        friction = found.per_spring(slips * radius, joint, unit)
    return {"friction": friction, "share_through_friction": share}


def _bounded(share: Parameter, least: float, most: float) -> Parameter:
    """A share that may be as small as `least`, no larger than `most`: what was found, or, where it
    can't be that and may be less, anywhere between (GUM 4.3.7)."""
    if share.value <= most or least >= most:
        down = float(np.hypot(share.value - share.low, max(share.value - least, 0.0)))
        return replace(share, low=share.value - down, most=most)
    found = normal((least + most) / 2, share.sd**2 + (most - least) ** 2 / 12, share.unit)
    return replace(found, most=most)


def _seen_from(bench: Bench, joint: int) -> float:
    """Nm: strength that slips by the first reading after a turn of the load, where that is nearest
    to the turn: half of what the load has changed by then. 0 where it never turns."""
    rows = bench.rows
    load, run = bench.true_torque[rows.edges, joint], rows.run[rows.edges]
    step, within = np.diff(load), np.diff(run) == 0
    turns = (step[1:] * step[:-1] < 0) & within[1:] & within[:-1]
    return float(np.abs(step[1:][turns]).min(initial=np.inf)) / 2 if turns.any() else 0.0
