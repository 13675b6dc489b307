"""Thresholds: what a knee's coefficients say of where it gives way, and how soft it is beyond.

The threshold is that of the sharp knee that, loaded once up to the largest load, comes out at the
same end with the same work: the bilinear curve of equal area, as with push-over curves (FEMA 356).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from identification.gap.bench import TOOL_SD_KG, Bench
from identification.gap.data import Array
from identification.gap.effects.base_slip import BETWEEN_M, SLIDES_M, slides
from identification.gap.interval import Found, Parameter, normal
from identification.gap.parts import Part
from identification.uncertainty import TWO_SIDED

_GRID_STEP = 0.03  # between finely spaced thresholds, as their share


def torque_unit(bench: Bench) -> str:
    """Of thresholds and friction."""
    return "Nm" if bench.data.arm else "N"


def of_knee(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Threshold, of an arm the push where it is met, slope beyond and flow time of `joint_yield`
    and `base_slip`; of a stand that slides the force across at which it does."""
    info = part.variant.info
    if info.get("other_springs"):
        found = found.without_line(int(info["joint"]))
    knee = found.first(len(info["radius"]))  # the rest flows back
    # of the sharp knee that ends where the curve ends: a radius that the load hardly passed, or
    # never, says nothing of the slope
    threshold, top = _threshold(bench, part, knee), _top(info)
    beyond = np.maximum(top - np.asarray(info["radius"]), 0.0)
    slope = knee.per_spring(beyond / max(top - threshold.value, 1e-9 * top), info.get("joint"))
    least = part.variant.least  # what bends less does not give way
    value, low, high = (max(v, least) for v in (slope.value, slope.low, slope.high))
    if bench.imposed and not bench.data.arm:
        threshold = _carried(threshold, *found.of_spring(int(info["joint"])))
    if slides(info):
        out = {"threshold_of_force": _over(threshold, SLIDES_M)}
    else:
        out = _with_weight(bench, part, _about_an_axis(bench, part, threshold))
    if bench.data.arm:
        met = out.get("threshold_of_load", threshold)
        out |= _onsets(bench, np.asarray(info["load"]), met)
    out["slope_beyond_over_elastic"] = Parameter(value, low, high, "1")
    if info["flow_s"]:
        flow = float(info["flow_s"])
        out["flow_time"] = Parameter(flow, flow / 3, flow * 3, "s")
    return out


def _threshold(bench: Bench, part: Part, knee: Found) -> Parameter:
    """`top - sum w (top - r)^2 / sum w (top - r)` of plays of radii r, by its derivatives; one
    alone is known to the step of its grid. The gain of the force acts on every threshold."""
    info = part.variant.info
    radius = np.asarray(info["radius"])
    top = _top(info)
    beyond = np.maximum(top - radius, 0.0)
    path, work = float(knee.w @ beyond), float(knee.w @ beyond**2)
    value, variance = float(info["centre"]), (_GRID_STEP * float(info["centre"])) ** 2 / 12
    if len(radius) > 1 and path > 0:
        mean = work / path
        slope = (mean - beyond) * beyond / path
        value = float(np.clip(top - mean, radius.min(), min(float(radius.max()), top)))
        variance = float(slope @ knee.cov @ slope)
    shared = bench.data.instruments.force_gain if not bench.imposed else 0.0
    return normal(value, max(variance, 0.0) + (shared * value) ** 2, torque_unit(bench))


def _about_an_axis(bench: Bench, part: Part, threshold: Parameter) -> Parameter:
    """Of a slip about a lying axis, with what is not known of its depth."""
    info = part.variant.info
    if part.word != "base_slip" or info["axis"] == "z":
        return threshold
    half = TWO_SIDED * abs(threshold.value) * _depth_sd(bench, np.asarray(info["load"]))
    return _moved(threshold, 0.0, half)


def _carried(way: Parameter, stiffer: float, variance: float) -> Parameter:
    """What the spring really carries where a stroke reaches what the simulated one would carry."""
    about = float(abs(way.value) * TWO_SIDED * variance**0.5)
    low, high = (stiffer * abs(end - way.value) for end in (way.low, way.high))
    value = stiffer * way.value
    ends = value - float(np.hypot(low, about)), value + float(np.hypot(high, about))
    return Parameter(value, *ends, way.unit)


def _top(info: Mapping[str, Any]) -> float:
    """Largest size of what a knee's radii are compared with: load, or net torque."""
    return float(np.abs(np.asarray(info["load"]) + info.get("weight", 0.0)).max())


def _with_weight(bench: Bench, part: Part, found: Parameter) -> dict[str, Parameter]:
    """The threshold as net torque and as what the push brings, where weights make them two: for
    the sense, and in the setups, of the largest push."""
    info = part.variant.info
    joint = info.get("joint")
    if joint is None or not bench.data.arm or not bench.feels_weight(joint):
        return {"threshold": found}
    load, weight = np.asarray(info["load"]), bench.weight(joint)
    net = load + weight if "weight" in info else load
    sense = float(np.sign(net[int(np.abs(net).argmax())]))
    hangs = float(np.mean(weight[sense * load > 0.5 * (sense * load).max()]))
    per_kg = float(np.abs(bench.weight_per_kg(joint)).max())
    half = TWO_SIDED * TOOL_SD_KG * per_kg
    if "weight" in info:  # both are near: what of the tool is wrong in one is wrong in the other
        push = _moved(found, -sense * hangs, 0.0)
        return {"threshold": _moved(found, 0.0, half), "threshold_of_load": push}
    value = abs(found.value + sense * hangs)
    low, high = value - (found.value - found.low), value + (found.high - found.value)
    net_of = _moved(Parameter(value, low, high, found.unit), 0.0, half)
    return {"threshold": net_of, "threshold_of_load": found}


def _moved(p: Parameter, shift: float, half: float) -> Parameter:
    """Shifted, its interval wider by what is independent of it."""
    low, high = np.hypot(p.value - p.low, half), np.hypot(p.high - p.value, half)
    value = p.value + shift
    return Parameter(value, value - float(low), value + float(high), p.unit)


def _onsets(bench: Bench, load: Array, threshold: Parameter) -> dict[str, Parameter]:
    """onset_D: the push along direction D that brings a threshold of the load (n,) there, in the
    pose where that is the smallest; no direction whose pushes stay below it."""
    out = dict[str, Parameter]()
    for number, setup in enumerate(bench.data.setups):
        mine, name = bench.rows.setup == number, f"onset_{setup.direction}"
        push = bench.load[mine]
        power = float(push @ push)
        lever = abs(float(push @ load[mine])) / power if power > 0 else 0.0
        if not lever * float(np.abs(push).max(initial=0.0)) > threshold.value > 0:
            continue
        onset = _over(threshold, lever)
        if name not in out or onset.value < out[name].value:
            out[name] = onset
    return out


def _over(threshold: Parameter, lever: float) -> Parameter:
    """The force that makes the threshold at a lever, m."""
    value, low, high = (v / lever for v in (threshold.value, threshold.low, threshold.high))
    return Parameter(value, low, high, "N")


def _depth_sd(bench: Bench, moment: Array) -> float:
    """Relative sd of a moment (n,) about a lying axis whose depth is known to a step of those that
    are looked at: the moment is the force times height over the axis."""
    loaded = np.abs(bench.load) > 0.5 * np.abs(bench.load).max()
    lever = float(np.median(np.abs(moment[loaded] / bench.load[loaded])))
    step = BETWEEN_M[1] - BETWEEN_M[0]
    return step / 12**0.5 / max(lever, step)
