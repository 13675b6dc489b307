"""Lost motion in absolute torques: the law of a joint's play."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.laws.flanks import Flanks, shapes
from identification.gap.laws.law import Law, Term
from identification.gap.laws.lost_motion import (
    HELD,
    PLACED,
    Play,
    free_places,
    loose_in,
    net,
    resting_columns,
)
from identification.gap.model.bench import TOOL_KG, Bench
from identification.gap.model.variants import Variant


def describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """The law, and scales (k,) of its terms: width of the play (rad), friction beside it, and where
    the joint lay while unloaded. zone, preload: Nm; tool: kg."""
    info = v.info
    constants = {
        "joint": int(info["joint"]),
        "zone": float(info["zone_Nm"]),
        "crossing": str(info["crossing"]),
        "kind": str(info["kind"]),
        "tool": float(info["tool_kg"]),
        "preload": float(info["preload_Nm"]),
    }
    if info["kind"] in PLACED:
        flanks = info["flanks"]
        constants |= {"centre": flanks.centre, "corner": flanks.corner, "friction": flanks.friction}
        terms, unit = [Term("width"), Term("rub"), Term("compliance")], 1 / float(info["span"])
        count = len(v.columns)
        return Law(constants, tuple(terms[:count])), np.array([1.0, 1.0, unit])[:count]
    terms = [Term("width"), Term("rub")]
    loose = np.abs(net_of(bench, Law(constants, ()))) < constants["zone"]
    for s, first, _ in free_places(bench, loose) if info["kind"] not in HELD else ():
        setup = bench.data.setups[s]
        terms.append(
            Term("place", {"pose": setup.pose, "direction": setup.direction, "first": first})
        )
    if info["rests"]:
        poses = resting_columns(bench, int(info["joint"]))
        terms += [Term("rest", {"pose": pose}) for pose in poses]
    return Law(constants, tuple(terms)), np.ones(len(terms))


def columns(bench: Bench, law: Law) -> list[Array]:
    """Deflections of the library's shapes, in rad per unit."""
    c = law.constants
    joint, x = c["joint"], net_of(bench, law)
    if c["kind"] in PLACED:
        places = Flanks(c["kind"], c["centre"], c["zone"], c["corner"], c["friction"])
        shape = list(shapes(bench, x, places))
    else:
        play = Play(bench, x, c["zone"])
        shape = [play.place(c["kind"]), play.rub(c["kind"])]
    parts = {"width": bench.sense * shape[0], "rub": bench.sense * shape[1], "compliance": x}
    rests = resting_columns(bench, joint)
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
            place = loose_in(bench, names.index(key), t.shape["first"], loose).astype(float)
        out.append(bench.joint_column(joint, place))
    return out


def net_of(bench: Bench, law: Law) -> Array:
    """(n,) Nm whose zero the play is passed at."""
    c = law.constants
    tool, preload = c.get("tool", TOOL_KG), c.get("preload", 0.0)  # a file may lack them
    return net(bench, c["joint"], c["crossing"], tool, preload)
