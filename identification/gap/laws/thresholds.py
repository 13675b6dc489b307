"""Thresholds: what a knee's coefficients say of where it gives way, and how soft it is beyond.

The threshold is that of the sharp knee that, loaded once up to the largest load, comes out at the
same end with the same work: the bilinear curve of equal area, as with push-over curves (FEMA 356).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws.interval import Coefficients, Parameter, factors, normal
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant
from identification.uncertainty import TWO_SIDED

_GRID_STEP = 0.03  # between finely spaced thresholds, as their share


def of_knee(
    bench: Bench,
    v: Variant,
    found: Coefficients,
    named: Callable[[Bench, Variant, Parameter], dict[str, Parameter]],
) -> dict[str, Parameter]:
    """Threshold, of an arm the push where it is met, slope beyond and flow time. named: what the
    threshold is called at its place, with what is not known of that."""
    info = v.info
    if info.get("other_springs"):
        found = found.without_line(int(info["joint"]))
    knee = found.first(len(info["radius"]))  # the rest flows back
    # of the sharp knee that ends where the curve ends: a radius that the load hardly passed, or
    # never, says nothing of the slope
    threshold = _threshold(bench, v, knee)
    slope = knee.per_spring(_slope(info, knee, threshold.value), info.get("joint"))
    least = v.least  # what bends less does not give way
    value, low, high = (max(s, least) for s in (slope.value, slope.low, slope.high))
    if bench.imposed and not bench.data.arm:
        most = float(np.ptp(np.append(bench.rows.measured_force, 0.0)))
        threshold = _carried(threshold, *found.of_spring(int(info["joint"])), most)
    out = named(bench, v, threshold)
    if bench.data.arm:
        met = out.get("threshold_of_load", threshold)
        out |= _onsets(bench, np.asarray(info["load"]), met)
    out["slope_beyond_over_elastic"] = Parameter(value, low, high, "1")
    if info["flow_s"]:
        out["flow_time"] = factors(float(info["flow_s"]), 3.0, "s")
    return out


def _threshold(bench: Bench, v: Variant, knee: Coefficients) -> Parameter:
    """`top - sum w (top - r)^2 / sum w (top - r)` of plays of radii r, by its derivatives; one
    alone is known to the step of its grid. The gain of the force acts on every threshold. One above
    the largest load can't be seen."""
    info = v.info
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
    found = normal(value, max(variance, 0.0) + (shared * value) ** 2, bench.torque_unit)
    return replace(found, most=top)


def _slope(info: Mapping[str, Any], knee: Coefficients, threshold: float) -> Array:
    """(k,) derivatives of the slope beyond, `sum w (top - r) / (top - threshold)`; their product
    with w is the slope itself. fixed: those at a threshold that stands still; it moves with w
    unless it is held at an end of the radii."""
    top, radius = _top(info), np.asarray(info["radius"])
    fixed = np.maximum(top - radius, 0.0) / max(top - threshold, 1e-9 * top)
    moves = radius.min() < threshold < min(float(radius.max()), top) and knee.w @ fixed > 0
    return fixed * (2 - fixed) if moves else fixed


def _carried(way: Parameter, stiffer: float, variance: float, most: float) -> Parameter:
    """What the spring really carries where a stroke reaches what the simulated one would carry;
    most: the largest force, N."""
    about = float(abs(way.value) * TWO_SIDED * variance**0.5)
    low, high = (stiffer * abs(end - way.value) for end in (way.low, way.high))
    value = stiffer * way.value
    ends = value - float(np.hypot(low, about)), value + float(np.hypot(high, about))
    return Parameter(value, *ends, way.unit, most=most)


def _top(info: Mapping[str, Any]) -> float:
    """Largest size of what a knee's radii are compared with: load, or net torque."""
    return float(np.abs(np.asarray(info["load"]) + info.get("weight", 0.0)).max())


def moved(p: Parameter, shift: float, half: float) -> Parameter:
    """Shifted, its interval wider by what is independent of it."""
    low, high = np.hypot(p.value - p.low, half), np.hypot(p.high - p.value, half)
    value = p.value + shift
    most = p.most + shift + half
    return Parameter(value, value - float(low), value + float(high), p.unit, most=most)


def _onsets(bench: Bench, load: Array, threshold: Parameter) -> dict[str, Parameter]:
    """onset_D: the push along direction D that brings a threshold of the load (n,) there, in the
    pose where that is the smallest; no direction whose pushes stay below it."""
    out = dict[str, Parameter]()
    for number, setup in enumerate(bench.data.setups):
        mine, name = bench.rows.setup == number, f"onset_{setup.direction}"
        push = bench.true_load[mine]
        power = float(push @ push)
        lever = abs(float(push @ load[mine])) / power if power > 0 else 0.0
        if not lever * float(np.abs(push).max(initial=0.0)) > threshold.value > 0:
            continue
        onset = over(threshold, lever)
        if name not in out or onset.value < out[name].value:
            out[name] = onset
    return out


def over(threshold: Parameter, lever: float) -> Parameter:
    """The force that makes the threshold at a lever, m."""
    t = threshold
    value, low, high, most = (v / lever for v in (t.value, t.low, t.high, t.most))
    return Parameter(value, low, high, "N", most=most)
