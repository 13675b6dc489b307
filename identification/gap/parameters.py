"""Parameters of an effect in words and units, from coefficients and their covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.effects.link_flexibility import STRAINS
from identification.gap.parts import Part


@dataclass(frozen=True)
class Parameter:
    """value with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str


def parameters(bench: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    """Named parameters of one part; units are written out in the result."""
    return _TABLE[part.word](bench, part, w, cov)


def _linear(functional: Array, w: Array, cov: Array, unit: str, scale: float = 1.0) -> Parameter:
    value = float(functional @ w) * scale
    half = 1.96 * max(float(functional @ cov @ functional), 0.0) ** 0.5 * abs(scale)
    return Parameter(value, value - half, value + half, unit)


def _one(w: Array, cov: Array, index: int, unit: str, scale: float = 1.0) -> Parameter:
    return _linear(np.eye(len(w))[index], w, cov, unit, scale)


def _torque_unit(bench: Bench) -> str:
    return "Nm" if bench.data.arm else "N"


def _knee(bench: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    info = part.variant.info
    radius = np.asarray(info["radius"])
    w, cov = w[: len(radius)], cov[: len(radius), : len(radius)]  # the rest flows back
    power = np.maximum(w, 0.0)
    total = float(power.sum())
    centre = float(power @ radius / total) if total > 0 else float(info["centre"])
    near = np.sort(np.abs(radius - centre))
    # the grid's neighbours bound it; of the fine grid, one step
    half = float(near[1]) if len(near) > 1 else 0.017 * centre
    slope = _linear(np.ones(len(w)), w, cov, "1")
    least = part.variant.least  # what bends less does not give way
    value, low, high = (max(v, least) for v in (slope.value, slope.low, slope.high))
    out = {
        "threshold": Parameter(centre, centre - half, centre + half, _torque_unit(bench)),
        "slope_beyond_over_elastic": Parameter(value, low, high, "1"),
    }
    if info["flow_s"]:
        flow = float(info["flow_s"])
        out["flow_time"] = Parameter(flow, flow / 3, flow * 3, "s")
    return out


def _hysteresis(bench: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    """Of the strengths that slip within the range."""
    radius = np.asarray(part.variant.info["radius"])
    load = bench.torque[:, int(part.variant.info["joint"])]
    slips = (radius < float(np.ptp(np.append(load, 0.0)))).astype(float)
    return {
        "friction": _linear(slips * radius, w, cov, _torque_unit(bench)),
        "share_through_friction": _linear(slips, w, cov, "1"),
    }


def _backlash(bench: Bench, _: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    return {
        "width": _one(w, cov, 0, "rad" if bench.data.arm else "mm", 1.0 if bench.data.arm else 1e3)
    }


def _curve(bench: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    """What the compliance at the largest torque has more than at none: a hinge adds itself, a
    power its exponent, a line nothing."""
    grows = {"line": 0.0, "quadratic": 2.0, "even": 2.0, "cubic": 3.0}
    change = np.array([grows.get(kind, 1.0) for kind in part.variant.info["kinds"]])
    out = _linear(change, w, cov, "1", bench.sense)
    return {"change_of_compliance_over_range": out}


def _creep(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    times = np.asarray(part.variant.info["times_s"])
    power = np.maximum(w, 0.0)
    mean = (
        float(np.exp(power @ np.log(times) / power.sum())) if power.sum() > 0 else float(times[0])
    )
    return {
        "creep_fraction": _linear(np.ones(len(w)), w, cov, "1"),
        "retardation_time": Parameter(mean, mean / 3, mean * 3, "s"),
    }


def _stiffness(bench: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    """Factor on the simulated stiffness: of compliance where force is imposed, else of force."""
    out = {}
    for i, j in enumerate(part.variant.info["joints"]):
        c = _one(w, cov, i, "1")
        ends = [1 / max(1 + v, 0.02) for v in (c.value, c.high, c.low)]
        if bench.imposed:
            ends = [max(1 + v, 0.0) for v in (c.value, c.low, c.high)]
        out[f"factor_joint{j + 1}"] = Parameter(ends[0], ends[1], ends[2], "1")
    return out


def _gain(bench: Bench, _: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    """Read over true. The columns are shares of what was read, but for an imposed displacement."""
    g = _one(w, cov, 0, "1")
    ends = [1 + v if bench.imposed else 1 / max(1 - v, 0.02) for v in (g.value, g.low, g.high)]
    return {"factor": Parameter(ends[0], ends[1], ends[2], "1")}


def _links(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    return {
        f"{strain}_compliance_over_nominal_segment{k + 1}": _one(w, cov, 2 * i + s, "1")
        for i, k in enumerate(part.variant.info["segments"])
        for s, strain in enumerate(STRAINS)
    }


def _base(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    return {
        f"compliance_about_{'xyz'[a]}": _one(w, cov, i, "rad/Nm")
        for i, a in enumerate(part.variant.info["axes"])
    }


def _seating(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    f0 = float(part.variant.info["force_N"])
    return {
        "depth": _linear(np.ones(len(w)), w, cov, "mm", 1e3),
        "force_scale": Parameter(f0, f0 / 2, f0 * 2, "N"),
    }


def _misalignment(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    """Tangents at the largest load."""
    names, turns = part.variant.info["directions"], part.variant.info["at_N"] is not None
    per = 4 if turns else 2
    rows = np.eye(len(w))
    return {
        f"tangent_{name}_{k + 1}": _linear(
            rows[per * i + k] + (rows[per * i + k + 2] if turns else 0.0), w, cov, "1"
        )
        for i, name in enumerate(names)
        for k in range(2)
    }


def _drift(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    """Change from start to end of the session, per direction where it has its own."""
    unit, scale = ("N", 1.0) if part.word == "force_drift" else ("mm", 1e3)
    names, path = part.variant.info["names"], part.variant.info["path"]
    per = len(w) // len(names)
    out = {}
    for i, name in enumerate(names):
        f = np.zeros(len(w))
        mine = slice(i * per, (i + 1) * per)
        if path == "free":
            f[mine.start], f[mine.stop - 1] = -1.0, 1.0
        else:
            f[mine] = 1.0
        over = "drift" if path == "each run" else "drift_over_session"
        key = over + (f"_{name}" if name else "")
        out[key] = _linear(f, w, cov, unit, scale)
    return out


def _shift(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    if len(w) == 1:
        run = part.variant.info["runs"][0] + 1
        return {f"shift_before_run{run}": _one(w, cov, 0, "mm", 1e3)}
    return {f"shift{i + 1}": _one(w, cov, i, "mm", 1e3) for i in range(len(w))}


def _lag(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    lag = float(part.variant.info["lag_s"])
    return {"lag": _one(w, cov, 0, "s", lag)}


def _pose(_: Bench, part: Part, w: Array, cov: Array) -> dict[str, Parameter]:
    """Tool offset and angles of the joints."""
    kind = part.variant.info["kind"]
    out: dict[str, Parameter] = {}
    if kind in ("tool", "both"):
        out |= {f"offset_{a}": _one(w, cov, i, "mm", 1e3) for i, a in enumerate("xyz")}
    if kind in ("joints", "both"):
        first = 3 if kind == "both" else 0
        out |= {f"angle_joint{i - first + 1}": _one(w, cov, i, "rad") for i in range(first, len(w))}
    return out


_TABLE: dict[str, Callable[[Bench, Part, Array, Array], dict[str, Parameter]]] = {
    "joint_yield": _knee,
    "base_slip": _knee,
    "joint_hysteresis": _hysteresis,
    "joint_backlash": _backlash,
    "joint_nonlinear_stiffness": _curve,
    "joint_creep": _creep,
    "joint_stiffness_error": _stiffness,
    "force_scale": _gain,
    "displacement_scale": _gain,
    "link_flexibility": _links,
    "base_compliance": _base,
    "contact_seating": _seating,
    "load_misalignment": _misalignment,
    "force_drift": _drift,
    "thermal_drift": _drift,
    "zero_shift": _shift,
    "time_lag": _lag,
    "pose_error": _pose,
}
