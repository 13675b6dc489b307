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

from collections.abc import Callable
from functools import partial

import numpy as np

from identification.arrays import Array
from identification.gap.laws import knees_closer
from identification.gap.laws.bauschinger import flowing_back
from identification.gap.laws.effect import Effect
from identification.gap.laws.flows import Flow
from identification.gap.laws.interval import Parameter
from identification.gap.laws.knees import THRESHOLDS, knee_variants, knees
from identification.gap.laws.knees_law import flow_of, law_of_knee, states_of
from identification.gap.laws.lasting import SCALES
from identification.gap.laws.law import Law, Laws
from identification.gap.laws.memories import fresh_of, memories
from identification.gap.laws.specimens import OWN, off, own_stiffness, with_other_springs
from identification.gap.laws.thresholds import moved, of_knee
from identification.gap.model.bench import TOOL_SD_KG, Bench
from identification.gap.model.variants import (
    BACK_UNDER_WEIGHT,
    RESET_PER_RUN,
    UNDER_WEIGHT,
    Variant,
)
from identification.uncertainty import TWO_SIDED

WORD = "joint_yield"


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
    taken_back = [BACK_UNDER_WEIGHT] if RESET_PER_RUN in memories(bench) else []
    for memory in (UNDER_WEIGHT, *taken_back):
        fresh = fresh_of(bench, memory)
        # what a controller takes back it had clamped: no metal that flows back
        kept = flowing_back(bench, load, column, top, fresh) if memory == UNDER_WEIGHT else {}
        info = {
            "joint": joint,
            "memory": memory,
            "flow_s": 0.0,
            "load": load,
            "column": column,
            "top": top,
            "back": kept,
            "weight": weight,
        }
        states = bench.plays(load, radius, fresh, weight)
        label = f"joint {joint + 1}{memory}"
        out += knees(bench, WORD, label, [column(s) for s in states.T], radius, info)
    return out


_PUSHED = 0.2  # of the joint's largest torque: so far beyond its weight some push must go


def _named(bench: Bench, v: Variant, found: Parameter) -> dict[str, Parameter]:
    """The threshold as net torque and as what the push brings, where weights make them two: for
    the sense, and in the setups, of the largest push."""
    info = v.info
    joint = int(info["joint"])
    if not bench.data.arm or not bench.feels_weight(joint):
        return {"threshold": found}
    load, weight = np.asarray(info["load"]), bench.weight(joint)
    net = load + weight if "weight" in info else load
    sense = float(np.sign(net[int(np.abs(net).argmax())]))
    hangs = float(np.mean(weight[sense * load > 0.5 * (sense * load).max()]))
    per_kg = float(np.abs(bench.weight_per_kg(joint)).max())
    half = TWO_SIDED * TOOL_SD_KG * per_kg
    if "weight" in info:  # both are near: what of the tool is wrong in one is wrong in the other
        push = moved(found, -sense * hangs, 0.0)
        return {"threshold": moved(found, 0.0, half), "threshold_of_load": push}
    carried = found.value + sense * hangs
    below, above = found.value - found.low, found.high - found.value
    if carried < 0:  # the weights still carry the push: the less of them the larger it is
        below, above = above, below
    value = abs(carried)
    low, high = value - below, value + above
    most = max(abs(hangs), abs(found.most + sense * hangs))  # without the push, or at the largest
    net_of = moved(Parameter(value, low, high, found.unit, most=most), 0.0, half)
    return {"threshold": net_of, "threshold_of_load": found}


def _describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    joint = int(v.info["joint"])
    return law_of_knee(v, {"joint": joint}, float(bench.compliance[joint]))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Column of every term, in their order: state of radius `threshold` on the torque, lagging; of
    a term without one the line of its own spring."""
    joint = law.constants["joint"]
    torque = bench.true_torque[:, joint]
    states = states_of(bench, law, torque)
    return [
        bench.joint_column(joint, bench.sense * states[i] if i in states else torque)
        for i in range(len(law.terms))
    ]


def _flow(bench: Bench, law: Law) -> Flow:
    return flow_of(bench, law, bench.true_torque[:, law.constants["joint"]])


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=partial(of_knee, named=_named),
    laws=Laws(_describe, _columns, flow=_flow),
    lengths=("slope_beyond_over_elastic",),
    finer=knees_closer.finer,
    beside=True,
    not_negative=("threshold", "threshold_of_load", "onset", "slope_beyond_over_elastic"),
)
