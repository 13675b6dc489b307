"""The mounting slips above a threshold moment: knee and remaining displacement that the encoders
do not see. The same knees as `joint_yield`, on the moment about yaw or tilt axes: a stand tips over
an edge, along an axis of the base or between two of them; or it slides, which is to turn about an
axis far below.

Size: slope beyond the threshold, a compliance, on a lever of 0.75 m 5e-7 to 4e-4 rad/Nm.
Prior: as joint_yield, per axis and depth.
Source: Coulomb friction in the bolted joint of the mounting, effective radius about 0.25 m.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.effects.base_compliance import moments, moments_of_load
from identification.gap.laws import knees_closer
from identification.gap.laws.effect import Effect
from identification.gap.laws.flows import Flow
from identification.gap.laws.interval import Parameter
from identification.gap.laws.knees import knee_at, knee_variants
from identification.gap.laws.knees_law import flow_of, law_of_knee, states_of
from identification.gap.laws.lasting import GIVES_LEAST
from identification.gap.laws.law import Law, Laws
from identification.gap.laws.thresholds import moved, of_knee, over
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant
from identification.uncertainty import TWO_SIDED

WORD = "base_slip"
_HALF = 0.5**0.5
AXES: dict[str, tuple[float, float, float]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "x+y": (_HALF, _HALF, 0.0),
    "x-y": (_HALF, -_HALF, 0.0),
}
# Coarser than elastic ones: a knee is told by where it bends, and looked at between them where one
# is found.
DEPTHS_M = (0.0, 0.7)
BETWEEN_M = (0.175, 0.35, 0.525)
# An axis so far below that the stand slides rather than tips: to a hundredth the moment about it is
# the force across, times this.
SLIDES_M, ACROSS = 20.0, {"y": "x", "x": "y"}  # axis: the way it slides
# m/N at the target beyond the threshold, which the scales of the knees (0.07 to 56) multiply: on a
# lever of 0.75 m 0.5e-6 to 4e-4 rad/Nm. Said of the target, not of the moment: axes at several
# depths whose moments run in proportion have the same knees then, and need not be told apart.
_BEYOND = 0.75**2 / 1.5e5
_LEAST = 0.05  # of that: a stand that gives way by less hardly does
_SHORTEST = 0.02  # m: levers


def places() -> Iterator[tuple[str, float]]:
    """Axes (of `AXES`) and their depths in m; the yaw axis knows none."""
    for axis in AXES:
        for depth in (0.0,) if axis == "z" else DEPTHS_M:
            yield axis, depth
    for axis in ACROSS:
        yield axis, SLIDES_M


def slides(v: Variant) -> bool:
    """Whether a shape of this word is of a stand that slides."""
    return float(v.info.get("depth_m", 0.0)) >= SLIDES_M


def lever_of(bench: Bench, axis: str, depth: float) -> Array:
    """(n,) m: moment per newton about an axis so far below the base."""
    return np.asarray(moments(bench, depth) @ np.array(AXES[axis]))


def moment_of(bench: Bench, axis: str, depth: float) -> Array:
    """(n,) Nm of the load about an axis so far below the base."""
    return np.asarray(moments_of_load(bench, depth, bench.true_load) @ np.array(AXES[axis]))


def variants(bench: Bench) -> list[Variant]:
    """Per axis and depth of the axis."""
    out = []
    for axis, depth in places():
        load, column, info = _about(bench, axis, depth)
        if np.abs(load).max() > 0:
            out += knee_variants(bench, load, column, WORD, _name(info), info)
    return out


def between(bench: Bench, found: Variant) -> list[tuple[str, dict[str, Any]]]:
    """A lying axis about which it slips, between the depths of the grid: name, and what
    `knees_closer.elsewhere` wants to know of a place."""
    axis = str(found.info["axis"])
    out = []
    for depth in BETWEEN_M if axis != "z" else ():
        load, column, info = _about(bench, axis, depth)
        at = knee_at(bench, load, column, found.info["memory"])
        out.append((_name(info) + found.info["memory"], info | at))
    return out


def _about(
    bench: Bench, axis: str, depth: float
) -> tuple[Array, Callable[[Array], int], dict[str, Any]]:
    """Moment (n,) Nm about an axis, zero where hardly any lever is left; pool index of what a state
    (n,) of it does; and its place."""
    lever = lever_of(bench, axis, depth)
    longest = float(np.abs(lever).max())
    natural = _BEYOND / max(longest, _SHORTEST) ** 2  # rad/Nm

    def column(state: Array) -> int:
        return bench.add(bench.outside_column(natural * lever * state))

    load = moment_of(bench, axis, depth) * (longest >= _SHORTEST)
    info = {"axis": axis, "depth_m": depth, "natural": natural, GIVES_LEAST: _LEAST}
    return load, column, info


def _name(info: dict[str, Any]) -> str:
    return f"axis {info['axis']} {info['depth_m']:g} m below"


def _named(bench: Bench, v: Variant, threshold: Parameter) -> dict[str, Parameter]:
    """Of a stand that slides the force across at which it does; of a slip about a lying axis, with
    what is not known of its depth."""
    if slides(v):
        return {"threshold_of_force": over(threshold, SLIDES_M)}
    if v.info["axis"] == "z":
        return {"threshold": threshold}
    half = TWO_SIDED * abs(threshold.value) * _depth_sd(bench, np.asarray(v.info["load"]))
    return {"threshold": moved(threshold, 0.0, half)}


def _depth_sd(bench: Bench, moment: Array) -> float:
    """Relative sd of a moment (n,) about a lying axis whose depth is known to a step of those that
    are looked at: the moment is the force times height over the axis."""
    loaded = np.abs(bench.load) > 0.5 * np.abs(bench.load).max()
    lever = float(np.median(np.abs(moment[loaded] / bench.load[loaded])))
    step = BETWEEN_M[1] - BETWEEN_M[0]
    return step / 12**0.5 / max(lever, step)


def _describe(_: Bench, v: Variant) -> tuple[Law, Array]:
    place = {"axis": v.info["axis"], "depth": float(v.info["depth_m"])}
    return law_of_knee(v, place, float(v.info["natural"]))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Column of every term, in their order: state of radius `threshold` on the moment, lagging."""
    lever = lever_of(bench, law.constants["axis"], law.constants["depth"])
    moment = moment_of(bench, law.constants["axis"], law.constants["depth"])
    states = states_of(bench, law, moment)
    return [bench.outside_column(lever * states[i]) for i in range(len(law.terms))]


def _flow(bench: Bench, law: Law) -> Flow:
    moment = moment_of(bench, law.constants["axis"], law.constants["depth"])
    return flow_of(bench, law, moment)


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=partial(of_knee, named=_named),
    laws=Laws(_describe, _columns, flow=_flow),
    lengths=("slope_beyond_over_elastic",),
    finer=partial(knees_closer.finer, between=between),
    beside=True,
    not_negative=("threshold", "threshold_of_force", "onset", "slope_beyond_over_elastic"),
)
