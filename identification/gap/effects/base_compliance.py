"""The mounting tilts or turns elastically: rotations about axes through, or below, the base.

A moment about axis a gives a rotation `c_a M_a`, and the target moves by the same lever: along the
direction `c_a (r x n)_a^2` per newton. Rubber feet give less under a large moment; a plate that
its bolts no longer hold down gives more: the rotation is a curve of the moment, in straight pieces.
Unseen by encoders. 5e5 to 2e6 Nm/rad.

Size: 5e-7 to 2e-6 rad/Nm; tables and stands up to ten times softer.
Prior: compliances positive, sd out of SCALES, equally likely; turned axes at 0.5, single ones at
0.3, feet that bend at 0.3: by BENDS at each of BENDS_AT, STIFFEST of the slope left throughout.
Source: stiffness of bolted mountings of arms, 5e5 to 2e6 Nm/rad.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws.curves import hinge
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Law, Laws, Term
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant

WORD = "base_compliance"
DEPTHS_M = (0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0)  # of tilt axes: flange, table, floor
COUPLED = 0.6  # sd of what couples two axes, against that of their own compliances
SCALES = (3e-7, 1e-6, 3e-6, 1e-5)  # rad/Nm
# Of the largest moment: where feet stiffen, or bolts let go.
BENDS_AT = (0.1, 0.2, 0.3, 0.42, 0.55, 0.7)
BENDS = 0.6  # of the compliance without a moment: what it changes by there
# Of that compliance so much is left at least: feet bear the arm's weight before they are pushed.
# What hardly gives any more is a seat.
STIFFEST = 0.5


def moments(bench: Bench, depth: float) -> Array:
    """Moment (n, 3) m per newton about axes `depth` m below the base."""
    arm = []
    for s in bench.data.setups:
        below = np.array([0.0, 0.0, depth])
        arm.append(s.moment + np.cross(below, s.unit_vector))
    simulated = np.stack(arm)[bench.rows.setup]
    return simulated if bench.arm_state is None else simulated + bench.arm_state.moment


def moments_of_load(bench: Bench, depth: float, load: Array) -> Array:
    """(n, 3) Nm about these axes under a load (n,) N along the direction, and what pulls across."""
    along, there = moments(bench, depth) * load[:, None], bench.arm_state
    if there is None:
        return along
    return np.asarray(along + there.twist + np.cross([0.0, 0.0, depth], there.force))


def _carried(bench: Bench, depth: float) -> Array:
    """(n, 3) Nm of the load, as it acts."""
    ahead = 0.0 if bench.arm_state is None else bench.arm_state.ahead
    return moments_of_load(bench, depth, bench.load + ahead)


def variants(bench: Bench) -> list[Variant]:
    """Per depth of the axes: all three, along the base's or turned, and each alone (yaw knows no
    depth)."""
    out = []
    for depth in DEPTHS_M:
        m, carried = moments(bench, depth), _carried(bench, depth)
        columns = [bench.add(bench.outside_column(m[:, a] * carried[:, a])) for a in range(3)]
        both = 2 * m[:, 0] * m[:, 1]  # of loads that turn it about both
        info: dict[str, Any] = {"depth_m": depth, "turned": False}
        seen = [a for a in range(3) if np.abs(m[:, a]).max() > 1e-3]
        if not seen:
            continue  # every push goes through the axes
        out.append(
            variant(
                WORD,
                f"axes {depth:g} m below",
                [columns[a] for a in seen],
                SCALES,
                each=True,
                axes=seen,
                **info,
            )
        )
        if {0, 1} <= set(seen) and np.abs(both).max() > 1e-3:
            crossed = m[:, 0] * carried[:, 1] + m[:, 1] * carried[:, 0]
            coupling = bench.add(bench.outside_column(crossed))
            stand = _turned(depth, [*(columns[a] for a in seen), coupling], seen)
            out.append(stand)
        if bench.has_q and any(a < 2 for a in seen):  # else any joint's curve
            out.append(_on_feet(bench, out[-1], m, carried))
        for a in seen:
            if a < 2 or depth == 0:
                out.append(
                    variant(
                        WORD,
                        f"axis {'xyz'[a]} {depth:g} m below",
                        [columns[a]],
                        SCALES,
                        prior=0.3,
                        axes=[a],
                        **info,
                    )
                )
    return out


def _turned(depth: float, columns: list[int], axes: list[int]) -> Variant:
    """Of a stand whose soft axes lie between x and y, the moment about one turns it about the other
    too. An axis half between them, either way, has a positive compliance as well. axes: x and y
    first."""
    root = np.diag([*np.ones(len(axes)), COUPLED])
    total = np.append(np.ones(len(axes)), 0.0)
    between = np.zeros((2, len(columns)))
    between[:, :2], between[:, -1] = 1.0, (2.0, -2.0)
    return variant(
        WORD,
        f"turned axes {depth:g} m below",
        columns,
        SCALES,
        root=root,
        positive=total,
        prior=0.5,
        each=(True,) * len(axes),
        within=between,
        axes=axes,
        depth_m=depth,
        turned=True,
    )


def _on_feet(bench: Bench, stand: Variant, m: Array, carried: Array) -> Variant:
    """The same with compliances that change with the moment about a lying axis, by which feet are
    pressed, or bolts let go of a plate; m (n, 3) m, carried (n, 3) Nm."""
    axes, k = [a for a in stand.info["axes"] if a < 2], len(stand.columns)
    bends = [
        (a, share * (float(np.abs(carried[:, a]).max()) or 1.0)) for a in axes for share in BENDS_AT
    ]
    bent = [bench.add(bent_column(bench, m[:, a], carried[:, a], at)) for a, at in bends]
    root = np.zeros((k + len(bent), k + len(bent)))
    root[:k, :k] = stand.root
    root[k:, k:] = BENDS * np.eye(len(bent))
    # what a large moment presses, or lets go of, still gives
    within = np.zeros((len(stand.within) + len(bent), len(root)))
    within[: len(stand.within), :k] = stand.within
    for i, (axis, at) in enumerate(bends):
        row = within[len(stand.within) + i]
        row[stand.info["axes"].index(axis)] = 1.0 - STIFFEST
        row[k:] = [float(a == axis and b <= at) for a, b in bends]
    positive = None if stand.positive is None else np.append(stand.positive, np.zeros(len(bent)))
    return variant(
        WORD,
        f"{stand.label}, on feet",
        [*stand.columns, *bent],
        SCALES,
        root=root,
        positive=False if positive is None else positive,
        prior=0.3,
        each=stand.each,
        within=within,
        floor=np.append(stand.floor, np.zeros(len(bent))),
        **{**stand.info, "bends_Nm": bends},
    )


def bent_column(bench: Bench, m: Array, moment: Array, beyond: float) -> Array:
    """Stacked column of a rotation by what a moment (n,) Nm exceeds `beyond` Nm, either way, about
    an axis of lever m (n,) m."""
    return bench.outside_column(m * hinge(moment, beyond))


def _parameters(_: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    return {
        f"compliance_about_{'xyz'[a]}": found.one(i, "rad/Nm") for i, a in enumerate(v.info["axes"])
    }


def _describe(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: axes through a point `depth` below the base, what couples two that lie turned, and
    what a moment adds."""
    terms = [Term("compliance", {"axis": "xyz"[a]}) for a in v.info["axes"]]
    terms += [Term("compliance_xy")] if v.info["turned"] else []
    bends = v.info.get("bends_Nm", ())
    terms += [Term("compliance", {"axis": "xyz"[a], "beyond": at}) for a, at in bends]
    return Law({"depth": float(v.info["depth_m"])}, tuple(terms)), np.ones(len(terms))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """`(r x n)_a` times the moment of the load about a, of a coupling x times y and y times x; of
    what is added beyond a moment times what goes beyond it."""
    depth, out = law.constants["depth"], []
    lever = dict(zip("xyz", moments(bench, depth).T, strict=True))
    moment = dict(zip("xyz", _carried(bench, depth).T, strict=True))
    for t in law.terms:
        axis = str(t.shape.get("axis", "xy"))
        if "beyond" in t.shape:
            out.append(bent_column(bench, lever[axis], moment[axis], t.shape["beyond"]))
            continue
        turns = ((axis, axis),) if axis in lever else (("x", "y"), ("y", "x"))
        moved = np.sum([lever[a] * moment[b] for a, b in turns], axis=0)
        out.append(bench.outside_column(moved))
    return out


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(_describe, _columns),
    lengths=(),
    finer=None,
    not_negative=("compliance_about",),
)
