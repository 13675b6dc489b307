"""Springs and what stands in for them: curved, creeping, wrong ones; links, base, seating, pose."""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.gap.bench import TOOL_KG, Bench
from identification.gap.data import Array, Setup
from identification.gap.effects import pose_error
from identification.gap.effects.base_compliance import bent_column, moments
from identification.gap.effects.contact_seating import lost
from identification.gap.effects.curves import above, beyond, hinge
from identification.gap.effects.joint_creep import in_session
from identification.gap.effects.link_flexibility import PLACED, STRAINS
from identification.gap.effects.load_misalignment import (
    USUAL,
    Shape,
    across,
    gives,
    pulled,
)
from identification.gap.forms.law import ANEW, Law, Term, along, in_pose
from identification.gap.history import retarded
from identification.gap.variants import Variant

_POWERS = {"quadratic": 2, "cubic": 3, "even": 2}


def describe_curve(bench: Bench, v: Variant) -> tuple[Law, Array]:
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


def curve(bench: Bench, law: Law) -> list[Array]:
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


def describe_creep(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: Kelvin-Voigt elements with their retardation time."""
    joint, unit = int(v.info["joint"]), float(bench.compliance[int(v.info["joint"])])
    name = "compliance"
    if v.info.get("bent"):
        name, unit = "compliance_quadratic", unit / float(np.abs(bench.true_torque[:, joint]).max())
    times = np.asarray(v.info["times_s"])
    terms = tuple(Term(name, {"retardation_time": float(t)}) for t in times)
    forgets = {"forgets": ANEW} if v.info["memory"] else {}
    return Law({"joint": joint} | forgets, terms), unit * in_session(bench, times)


def creep(bench: Bench, law: Law) -> list[Array]:
    """Retarded torques, or their squares, on the session clock."""
    joint = law.constants["joint"]
    times = np.array([t.shape["retardation_time"] for t in law.terms])
    bent = np.array([t.coefficient == "compliance_quadratic" for t in law.terms])
    torque = bench.true_torque[:, joint][:, None]
    load = np.where(bent, torque * np.abs(torque), torque)
    fresh = bench.rebuilt if law.constants.get("forgets") == ANEW else None
    z = retarded(load, times, bench.rows, bench.rest, fresh)
    return [bench.joint_column(joint, bench.sense * column) for column in z.T]


def describe_springs(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: joints whose compliance is another."""
    joints = [int(j) for j in v.info["joints"]]
    terms = tuple(Term("compliance", {"joint": j}) for j in joints)
    return Law({}, terms), np.asarray(bench.compliance[joints])


def springs(bench: Bench, law: Law) -> list[Array]:
    """Deflection of the joint per unit of compliance: its torque."""
    joints = [t.shape["joint"] for t in law.terms]
    return [bench.joint_column(j, bench.torque[:, j]) for j in joints]


def describe_links(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: segments, how they strain, as multiples of the nominal tube of the robot file."""
    terms = tuple(
        Term("over_nominal", {"segment": int(k), "strain": strain})
        for k in v.info["segments"]
        for strain in STRAINS
    )
    return Law({"placed": v.info["placed"]}, terms), np.ones(len(terms))


def links(bench: Bench, law: Law) -> list[Array]:
    """Compliance of the segment along the direction times the load."""
    place = PLACED.index(law.constants.get("placed", PLACED[0]))
    each = np.stack([s.links[place] for s in bench.data.setups])[bench.rows.setup]
    most = max(t.shape["segment"] for t in law.terms)
    if most >= each.shape[1]:
        raise ValueError(
            f"link_flexibility of segment {most + 1}: the robot has {each.shape[1]} of them"
        )
    return [
        bench.outside_column(
            each[:, t.shape["segment"], STRAINS.index(t.shape["strain"])] * bench.load
        )
        for t in law.terms
    ]


def describe_base(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: axes through a point `depth` below the base, what couples two that lie turned, and
    what a moment adds."""
    terms = [Term("compliance", {"axis": "xyz"[a]}) for a in v.info["axes"]]
    terms += [Term("compliance_xy")] if v.info["turned"] else []
    bends = v.info.get("bends_Nm", ())
    terms += [Term("compliance", {"axis": "xyz"[a], "beyond": at}) for a, at in bends]
    return Law({"depth": float(v.info["depth_m"])}, tuple(terms)), np.ones(len(terms))


def base(bench: Bench, law: Law) -> list[Array]:
    """`(r x n)_a^2` times the load, of a coupling `2 (r x n)_x (r x n)_y`; of what is added
    beyond a moment times what goes beyond it."""
    m, out = moments(bench, law.constants["depth"]), []
    lever = dict(zip("xyz", m.T, strict=True))
    for t in law.terms:
        axis = str(t.shape.get("axis", "xy"))
        if "beyond" in t.shape:
            out.append(bent_column(bench, lever[axis], t.shape["beyond"]))
            continue
        square = lever[axis] ** 2 if axis in lever else 2 * lever["x"] * lever["y"]
        out.append(bench.outside_column(square * bench.load))
    return out


def describe_seating(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: saturating curves of the force."""
    terms = tuple(
        Term("depth", {"law": law, "force_scale": float(f0)}) for law, f0 in v.info["laws"]
    )
    return Law({}, terms), np.ones(len(terms))


def seating(bench: Bench, law: Law) -> list[Array]:
    """The saturating curves of `LAWS`, of the force on the seat."""
    each = [(str(t.shape["law"]), float(t.shape["force_scale"])) for t in law.terms]
    return [bench.outside_column(lost(bench, *one)) for one in each]


def describe_misalignment(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: shares of the load across the nominal direction, as vectors in the base frame; and
    shares reached at a load, in proportion to it or to a power of it; shares that drag; what a rig
    without an arm gives way under these; shares of single runs (numbers from 0) beyond these."""
    names = v.info["directions"]
    of_pose = v.info.get("poses", [""] * len(names))
    setups = [
        next(s for s in bench.data.setups if s.direction == d and p in ("", s.pose))
        for d, p in zip(names, of_pose, strict=True)
    ]
    poses = [{"pose": p} if p else {} for p in of_pose]
    terms, given = [], []
    for s, pose, shapes in zip(setups, poses, v.info["shapes"], strict=True):
        terms += [
            Term("tangent", _sideways(s, k) | _goes(how) | pose) for how in shapes for k in range(2)
        ]
    for s, shapes, read in zip(setups, v.info["shapes"], v.info["read"], strict=True):
        along_it = {"along": _triple(s.unit_vector)}
        given += [
            (Term("gives", along_it | _goes(how)), tangent / USUAL)
            for how, tangent in zip(shapes, read, strict=False)
        ]
    for run in v.info.get("runs", ()):
        s = bench.data.setups[bench.rows.setup[int(np.argmax(bench.rows.run == run))]]
        terms += [Term("tangent", _sideways(s, k) | {"run": int(run)}) for k in range(2)]
    units = [1.0] * len(terms) + [unit for _, unit in given]
    return Law({}, (*terms, *(term for term, _ in given))), np.array(units, dtype=float)


def _goes(how: Shape) -> dict[str, Any]:
    shape: dict[str, Any] = {}
    if how.power != 1:
        shape["at_load"] = how.at_N
    if how.power > 2:
        shape["power"] = float(how.power - 1)
    if how.drags_N:
        shape["drags_over"] = how.drags_N
    return shape


def _sideways(setup: Setup, k: int) -> dict[str, Any]:
    return {"along": _triple(setup.unit_vector), "across": _triple(setup.tangents[k])}


def misalignment(bench: Bench, law: Law) -> list[Array]:
    """Deflections under the load across, for setups of the same direction and sense."""
    out = []
    for t in law.terms:
        drags, at = t.shape.get("drags_over", 0.0), t.shape.get("at_load")
        power = 1.0 if at is None else 0.0 if drags else 1 + t.shape.get("power", 1.0)
        how = Shape(power, at or 1.0, drags)
        there = (along(bench, t.shape["along"]) > 0) & in_pose(bench, t.shape.get("pose"))
        if "run" in t.shape:
            there &= bench.rows.run == t.shape["run"]
        load = np.where(there, across(bench, how), 0.0)
        if t.coefficient == "gives":
            out.append(gives(bench, load))
            continue
        shares = np.stack([s.tangents @ np.array(t.shape["across"]) for s in bench.data.setups])
        out.append(pulled(bench, load, shares))
    return out


def describe_pose(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: offset of the tool in the flange frame, angles of the joints, turn of the base; about
    where they are."""
    terms = []
    if v.info["kind"] in ("tool", "both"):
        terms += [Term("offset", {"axis": a}) for a in "xyz"]
    if v.info["kind"] in ("joints", "both"):
        terms += [Term("angle", {"joint": j}) for j in range(bench.data.joints)]
    if v.info["kind"] == "base":
        terms = [Term("turn", {"axis": a}) for a in "xyz"]
    about: dict[str, Any] = {
        "about_offset": _triple(v.info["offset_m"]),
        "about_angles": tuple(float(a) for a in v.info["angles_rad"]),
        "about_turn": _triple(v.info["turn_rad"]),
        "reads": float(v.info["reads"]),
    }
    if v.info["pose"]:
        about["only_in"] = str(v.info["pose"])
    if not v.info["read"]:
        about["unread"] = True
    return Law(about, tuple(terms)), np.ones(len(terms))


def pose(bench: Bench, law: Law) -> list[Array]:
    """Change of the levers, by the secants of the library."""
    at = np.array(law.constants["about_offset"]), np.array(law.constants["about_angles"])
    reads = float(law.constants["reads"])
    pose = str(law.constants.get("only_in", ""))
    read = not law.constants.get("unread", False)
    moved = pose_error.secants(bench, *at, bench.compliance, reads, pose, read)
    about = np.array(law.constants.get("about_turn", (0.0, 0.0, 0.0)))
    turned = pose_error.turned(bench, about, bench.compliance, reads)
    columns = {"offset": moved[:3], "angle": moved[3:], "turn": turned}
    return [
        columns[t.coefficient][
            t.shape["joint"] if "joint" in t.shape else "xyz".index(t.shape["axis"])
        ]
        for t in law.terms
    ]


def _triple(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in vector)
    return x, y, z
