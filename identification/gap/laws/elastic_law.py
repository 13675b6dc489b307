"""A curved spring in absolute torques."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.laws.curves import above, beyond, hinge
from identification.gap.laws.law import Law, Term
from identification.gap.model.bench import TOOL_KG, Bench
from identification.gap.model.variants import Variant

_POWERS = {"quadratic": 2, "cubic": 3, "even": 2}


def describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: a line, hinges `beyond` a torque or above a net one, powers; `measured_to`: where they
    were seen."""
    joint, top = int(v.info["joint"]), float(v.info["torque"])
    c = float(bench.compliance[joint])
    terms, unit = [], []
    for kind in v.info["kinds"]:
        if kind == "line":
            terms.append(Term("compliance"))
        elif isinstance(kind, tuple):
            terms.append(Term("compliance", {f"net_{kind[0]}": kind[1]}))
        elif isinstance(kind, float):
            terms.append(Term("compliance", {"beyond": kind * top}))
        else:
            terms.append(Term(f"compliance_{kind}"))
        unit.append(c / top ** (_POWERS.get(kind, 1) - 1))
    constants = {"joint": joint, "measured_to": top}
    if "tool_kg" in v.info:
        constants["tool"] = float(v.info["tool_kg"])
    return Law(constants, tuple(terms)), np.array(unit, dtype=float)


def columns(bench: Bench, law: Law) -> list[Array]:
    """Deflection of the joint over its torque."""
    joint = law.constants["joint"]
    x, weight = bench.true_torque[:, joint], bench.weight(joint, law.constants.get("tool", TOOL_KG))
    shapes = {
        "compliance_quadratic": x * np.abs(x),
        "compliance_cubic": x**3,
        "compliance_even": x**2,
    }
    out = []
    for t in law.terms:
        bent = hinge(x, t.shape.get("beyond", 0.0))
        for key, bend in (("net_above", above), ("net_beyond", beyond)):
            if key in t.shape:
                bent = bend(x, weight, t.shape[key])
        out.append(bench.joint_column(joint, shapes.get(t.coefficient, bent)))
    return out
