"""`joint_hysteresis` and `joint_backlash`: friction and lost motion in absolute torques."""

from __future__ import annotations

import numpy as np

from identification.gap.bench import TOOL_KG, Bench
from identification.gap.data import Array, Flags
from identification.gap.effects import joint_backlash, joint_hysteresis
from identification.gap.effects.lost_motion import Play
from identification.gap.flanks import Flanks, shapes
from identification.gap.forms.law import (
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
from identification.gap.history import bristles, play, worked_in
from identification.gap.variants import LASTING, SET_UP_ANEW, UNDER_WEIGHT, Variant

_MEMORY = {"": KEPT, "worked in": WORKED, "rested": LOST, UNDER_WEIGHT.strip(): HUNG,
           SET_UP_ANEW.strip(): ANEW, LASTING.strip(): ACROSS}  # fmt: skip
SLIP_AT_A_STRENGTH = ("Iwan", "Prandtl")
FRICTION_LAWS = (*SLIP_AT_A_STRENGTH, *joint_hysteresis.LAWS)


def describe_hysteresis(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: friction elements; of Iwan's law with their strength, else with their reach."""
    joint, law = int(v.info["joint"]), str(v.info["law"])
    key = "strength" if law in SLIP_AT_A_STRENGTH else "reach"
    constants = {"joint": joint, "law": law, "memory": _MEMORY[v.info["memory"]]}
    if "tool_kg" in v.info:
        constants["tool"] = float(v.info["tool_kg"])
    if law in joint_hysteresis.BY_LOAD:
        constants["measured_to"] = bench.reach_of(bench.true_torque[:, joint])
    terms = tuple(Term("compliance", {key: float(r)}) for r in v.info["radius"])
    if "grows_to" in v.info:
        terms = terms[0], Term("compliance", {**terms[1].shape, "grows_to": v.info["grows_to"]})
    terms += (Term("compliance"),) if v.info.get("other_springs") else ()
    return Law(constants, terms), np.full(len(terms), float(bench.compliance[joint]))


def hysteresis(bench: Bench, law: Law) -> list[Array]:
    """Column of every term, in their order: what the friction holds back, `S_r(tau)` (stop
    operator), or reach, or load, times bristle state; what slips beside it (Prandtl's law):
    `P_r(tau)`; of a term without a strength the line of its own spring."""
    c = law.constants
    joint, iwan = c["joint"], c["law"] in SLIP_AT_A_STRENGTH
    torque, fresh = bench.true_torque[:, joint], fresh_after(bench, c["memory"])
    size = np.array([t.shape["strength" if iwan else "reach"] for t in law.terms if t.shape])
    load, kept = torque, np.ones(len(torque), dtype=bool)
    rest, weight = bench.rest, None
    if c["memory"] == HUNG:
        weight = bench.weight(joint, c.get("tool", TOOL_KG))
    if c["memory"] == WORKED:
        path = worked_in(torque, fresh)
        load, fresh, kept, rest = path.load, path.fresh, path.kept, path.fresh
    if iwan:
        tiled = np.tile(load[:, None], (1, len(size)))
        state = play(tiled, size, rest, fresh, 0.0 if weight is None else weight[:, None])
        held = (-state if c["law"] == "Prandtl" else load[:, None] - state)[kept]
    else:
        by_load = c["law"] in joint_hysteresis.BY_LOAD
        span = c.get("measured_to", bench.reach_of(torque))  # a file may lack it
        way = joint_hysteresis.by_ratio(load, span) if by_load else load
        z = bristles(way, size, fresh, c["law"].startswith("Bouc-Wen"), weight)
        held = (z * (np.abs(load)[:, None] if by_load else size))[kept]
        grown = np.array([_grown(bench, law, t) for t in law.terms if t.shape])
        held = held * grown.reshape(len(size), bench.rows.n).T
    each = iter(held.T)
    return [
        bench.joint_column(joint, -bench.sense * next(each) if t.shape else torque)
        for t in law.terms
    ]


def _grown(bench: Bench, law: Law, term: Term) -> Array:
    """(n,) 1, or the net torque that a joint carries over that to which the friction grows."""
    if "grows_to" not in term.shape:
        return np.ones(bench.rows.n)
    joint = law.constants["joint"]
    net = bench.true_torque[:, joint] + bench.weight(joint)
    return np.asarray(np.abs(net) / term.shape["grows_to"])


def describe_backlash(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: width of the play, friction beside it, and where the joint lay while unloaded."""
    info = v.info
    constants = {
        "joint": int(info["joint"]),
        "zone": float(info["zone_Nm"]),
        "crossing": str(info["crossing"]),
        "kind": str(info["kind"]),
        "tool": float(info["tool_kg"]),
        "preload": float(info["preload_Nm"]),
    }
    if info["kind"] in joint_backlash.PLACED:
        flanks = info["flanks"]
        constants |= {"centre": flanks.centre, "corner": flanks.corner, "friction": flanks.friction}
        terms, unit = [Term("width"), Term("rub"), Term("compliance")], 1 / float(info["span"])
        count = len(v.columns)
        return Law(constants, tuple(terms[:count])), np.array([1.0, 1.0, unit])[:count]
    terms = [Term("width"), Term("rub")]
    law = Law(constants, ())
    for s, first in _places(bench, law) if info["kind"] not in joint_backlash.HELD else []:
        setup = bench.data.setups[s]
        terms.append(
            Term("place", {"pose": setup.pose, "direction": setup.direction, "first": first})
        )
    if info["rests"]:
        poses = joint_backlash.resting_columns(bench, int(info["joint"]))
        terms += [Term("rest", {"pose": pose}) for pose in poses]
    return Law(constants, tuple(terms)), np.ones(len(terms))


def backlash(bench: Bench, law: Law) -> list[Array]:
    """Deflections of the library's shapes, in rad per unit."""
    c = law.constants
    joint, x = c["joint"], _net(bench, law)
    if c["kind"] in joint_backlash.PLACED:
        places = Flanks(c["kind"], c["centre"], c["zone"], c["corner"], c["friction"])
        shape = list(shapes(bench, x, places))
    else:
        play = Play(bench, x, c["zone"])
        shape = [play.place(c["kind"]), play.rub(c["kind"])]
    parts = {"width": bench.sense * shape[0], "rub": bench.sense * shape[1], "compliance": x}
    rests = joint_backlash.resting_columns(bench, joint)
    names = [(s.pose, s.direction) for s in bench.data.setups]
    loose = np.abs(x) < c["zone"]
    out = []
    for t in law.terms:
        if t.coefficient in parts:
            out.append(bench.joint_column(joint, parts[t.coefficient]))
            continue
        if t.coefficient == "rest":
            out.append(rests.get(t.shape["pose"], np.zeros(bench.layout.size)))
            continue
        key = (t.shape["pose"], t.shape["direction"])
        place = np.zeros(bench.rows.n)
        if key in names:
            place = _place(bench, names.index(key), t.shape["first"], loose).astype(float)
        out.append(bench.joint_column(joint, place))
    return out


def _net(bench: Bench, law: Law) -> Array:
    c = law.constants
    tool, preload = c.get("tool", TOOL_KG), c.get("preload", 0.0)  # a file may lack them
    return joint_backlash.net(bench, c["joint"], c["crossing"], tool, preload)


def _places(bench: Bench, law: Law) -> list[tuple[int, bool]]:
    """(setup, whether in its first run) of every place that the library leaves free."""
    loose = np.abs(_net(bench, law)) < law.constants["zone"]
    out = []
    for s in range(len(bench.data.setups)):
        held = not np.all(loose[bench.rows.setup == s])
        for first in (True, False):
            if held and _place(bench, s, first, loose).any():
                out.append((s, first))
    return out


def _place(bench: Bench, s: int, first: bool, loose: Flags) -> Flags:
    rows = bench.rows
    mine = rows.setup == s
    in_first = rows.run == rows.run[mine].min()
    return np.asarray(mine & loose & (in_first if first else ~in_first))
