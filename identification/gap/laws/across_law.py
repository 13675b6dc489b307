"""Forces across the nominal direction: how they go with the load, and what they do."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.data import Setup
from identification.gap.laws.law import Law, Term, along, in_pose, triple
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant

USUAL = 0.1  # so that the prior of what is given is that of as stiff a rig across as along


class Shape(NamedTuple):
    """How what pulls across goes with the load: with a power of it, that of a tangent of 1 at
    at_N; where drags_N is above 0 against the way that the load goes, turning over so much of it.
    """

    power: float
    at_N: float
    drags_N: float = 0.0


def across(bench: Bench, shape: Shape) -> Array:
    """(n,) N across, of a tangent of 1."""
    load = np.sign(bench.load) * shape.at_N * np.abs(bench.load / shape.at_N) ** shape.power
    if not shape.drags_N:
        return load
    reach = np.array([shape.drags_N])  # the tip is off its pad between runs
    held = bench.load - bench.plays(bench.load, reach, bench.rows.starts)[:, 0]
    return np.abs(load) * held / shape.drags_N


def pulled(bench: Bench, load: Array, shares: Array) -> Array:
    """Stacked column of a load (n,) N that pulls along the tangents of every setup by shares
    (setups, 2)."""
    each = zip(shares, bench.data.setups, strict=True)
    lever = np.stack([share @ s.tangent_lever for share, s in each])[bench.rows.setup]
    q = lever * bench.compliance * load[:, None]
    tangential = shares[bench.rows.setup] * load[:, None]
    return bench.stacked(np.sum(bench.lever * q, axis=1), q, tangential)


def gives(bench: Bench, load: Array) -> Array:
    """Stacked column of what a rig without an arm, as stiff across as along, gives way under a load
    (n,) N across."""
    return bench.outside_column(bench.stated_slope * load)


def pulled_as_read(bench: Bench) -> Array:
    """Stacked column of the force across as it was read; of none where it was not."""
    out, read = np.zeros(bench.layout.size), bench.rows.tangential
    for load, share in zip(() if read is None else read.T, np.eye(2), strict=False):
        out += pulled(bench, load, np.tile(share, (len(bench.data.setups), 1)))
    return out


def law_of(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: shares of the load across the nominal direction, as vectors in the base frame; and
    shares reached at a load, in proportion to it or to a power of it; shares that drag; what a rig
    without an arm gives way under these; shares of single runs (numbers from 0) beyond these, with
    what it gives way under the force across as it was read."""
    if v.info.get("as_read"):
        return Law({}, (Term("as_read"),)), np.ones(1)
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
        along_it = {"along": triple(s.unit_vector)}
        given += [
            (Term("gives", along_it | _goes(how)), tangent / USUAL)
            for how, tangent in zip(shapes, read, strict=False)
        ]
    for run in v.info.get("tips", ()):
        s = bench.data.setups[bench.rows.setup[int(np.argmax(bench.rows.run == run))]]
        terms += [Term("tangent", _sideways(s, k) | {"run": int(run)}) for k in range(2)]
    if "tips" in v.info and not bench.data.arm:
        given = [(Term("gives", _sideways(s, k)), 1 / USUAL) for s in setups for k in range(2)]
    units = [1.0] * len(terms) + [unit for _, unit in given]
    return Law({}, (*terms, *(term for term, _ in given))), np.array(units, dtype=float)


def columns_of(bench: Bench, law: Law) -> list[Array]:
    """Deflections under the load across, for setups of the same direction and sense."""
    out = []
    for t in law.terms:
        if t.coefficient == "as_read":
            out.append(pulled_as_read(bench))
        elif t.coefficient == "gives" and "across" in t.shape:
            read = _read_along(bench, t.shape["across"])
            out.append(gives(bench, np.where(_acts(bench, t), read, 0.0)))
        elif t.coefficient == "gives":
            out.append(gives(bench, _load(bench, t)))
        else:
            out.append(pulled(bench, _load(bench, t), _shares(bench, t.shape["across"])))
    return out


def loads_across(bench: Bench, law: Law, values: Array) -> Array:
    """(n, 2) N along the tangents of every setup, of a load across with the law's terms (k,)."""
    out = np.zeros((bench.rows.n, 2))
    for t, value in zip(law.terms, values, strict=True):
        if t.coefficient == "as_read" and bench.rows.tangential is not None:
            out += value * bench.rows.tangential
        elif t.coefficient == "tangent":
            shares = _shares(bench, t.shape["across"])[bench.rows.setup]
            out += value * _load(bench, t)[:, None] * shares
    return out


def _acts(bench: Bench, t: Term) -> Flags:
    """(n,) rows in which a term acts."""
    there = (along(bench, t.shape["along"]) > 0) & in_pose(bench, t.shape.get("pose"))
    return np.asarray(there & (bench.rows.run == t.shape["run"]) if "run" in t.shape else there)


def _load(bench: Bench, t: Term) -> Array:
    """(n,) N across that goes with the load, of a term of 1."""
    drags, at = t.shape.get("drags_over", 0.0), t.shape.get("at_load")
    power = 1.0 if at is None else 0.0 if drags else 1 + t.shape.get("power", 1.0)
    return np.where(_acts(bench, t), across(bench, Shape(power, at or 1.0, drags)), 0.0)


def _read_along(bench: Bench, direction: tuple[float, ...]) -> Array:
    """(n,) N of the force across along a direction; 0 where it was not read."""
    if bench.rows.tangential is None:
        return np.zeros(bench.rows.n)
    shares = _shares(bench, direction)[bench.rows.setup]
    return np.asarray(np.sum(shares * bench.rows.tangential, axis=1))


def _shares(bench: Bench, direction: tuple[float, ...]) -> Array:
    """(setups, 2): a direction along the tangents of every setup."""
    return np.stack([s.tangents @ np.array(direction) for s in bench.data.setups])


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
    return {"along": triple(setup.unit_vector), "across": triple(setup.tangents[k])}
