"""Parameters of an effect in words and units, from coefficients and their covariance.

What they mean, whatever shape was fitted, so that shapes can be compared and mixed:

- threshold: of the sharp knee that, loaded once up to the largest load, comes out at the same
  end with the same work (the bilinear curve of equal area, as with push-over curves in FEMA 356);
  of a joint, the net torque there: weights count, and nobody states the tool's. threshold_of_load:
  what the push alone brings then; threshold_of_force: of a stand that slides, the force across;
- slope beyond, creep: against the elastic compliance as it was found, not as it was simulated;
- creep_fraction: late share of the elastic deflection in the end, as far as the times of the law
  reach, and of what flows after one session; creep_fraction_of_run: when a load has stood as long
  as a run lasts;
- width: of the whole play, in whose middle the joint rests when its weights are balanced;
- depth (of a seat): at the largest load;
- lag: mean delay; factor: read over true along the straight line through zero.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.effects.contact_seating import LAWS
from identification.gap.effects.joint_backlash import unreached
from identification.gap.effects.joint_creep import in_session
from identification.gap.effects.joint_hysteresis import BY_LOAD
from identification.gap.effects.link_flexibility import BENDING, STRAINS
from identification.gap.effects.time_lag import KINDS
from identification.gap.history import half_sample, settling_share, standing_on
from identification.gap.interval import NOMINAL, Found, Parameter, Softer, normal
from identification.gap.lags import closest_lag
from identification.gap.parts import Part
from identification.gap.thresholds import of_knee, torque_unit
from identification.uncertainty import TWO_SIDED


def parameters(
    bench: Bench, part: Part, w: Array, cov: Array, softer: Softer = NOMINAL
) -> dict[str, Parameter]:
    """Named parameters of one part; units are written out in the result. w (k,), cov (k, k): its
    coefficients and their covariance; softer: what the springs turned out to be."""
    return _TABLE[part.word](bench, part, Found(w, cov, softer))


# No interval of these reaches below zero.
NOT_NEGATIVE = frozenset(
    {"friction", "lag", "threshold", "threshold_of_force", "threshold_of_load", "width"}
)


def _hysteresis(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Of the strengths that slip, which takes a load beyond them; of friction in proportion to the
    load, at the largest one."""
    radius, joint = np.asarray(part.variant.info["radius"]), int(part.variant.info["joint"])
    if part.variant.info.get("other_springs"):
        found = found.without_line(joint)
    largest = float(np.abs(bench.torque[:, joint]).max())
    slips = (radius < _SLIPS * largest).astype(float)
    if part.variant.info["law"] in BY_LOAD:
        radius = np.full(len(radius), largest)
    if part.variant.info["law"] == "Iwan":  # what never slips is a spring like the joint's own
        found = found.on_spring(slips - 1, joint)
    return {
        "friction": from_zero(found.linear(slips * radius, torque_unit(bench))),
        "share_through_friction": found.per_spring(slips, joint),
    }


_SLIPS = 0.98  # of the largest load: what slips beyond that only hardly shows


def from_zero(p: Parameter) -> Parameter:
    """Of what is not below zero, however little the data tell of it."""
    if p.low >= 0:
        return p
    value, low, high, *inner = (max(v, 0.0) for v in (p.value, p.low, p.high, *p.ci90))
    return Parameter(value, low, high, p.unit, (inner[0], inner[1]))


def _backlash(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """What nobody reached of a play was taken to be as the shape has it: a rectangular
    distribution, from nothing to twice that (GUM 4.3.7)."""
    arm = bench.data.arm
    seen = found.one(0, "rad" if arm else "mm", 1.0 if arm else 1e3)
    sd = float(np.hypot(seen.sd, unreached(bench, part.variant) * seen.value / 3**0.5))
    return {"width": normal(seen.value, sd**2, seen.unit)}


def _curve(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """What the compliance at the largest torque has more than at none: a hinge adds itself, a
    power its exponent, a line nothing."""
    grows = {"line": 0.0, "quadratic": 2.0, "even": 2.0, "cubic": 3.0}
    change = np.array([grows.get(kind, 1.0) for kind in part.variant.info["kinds"]])
    return {"change_of_compliance_over_range": found.linear(change, "1", bench.sense)}


def _creep(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    times, seconds = np.asarray(part.variant.info["times_s"]), run_seconds(bench)
    whole = in_session(bench, times)
    power = np.maximum(found.w, 0.0)
    mean = (
        float(np.exp(power @ np.log(times) / power.sum())) if power.sum() > 0 else float(times[0])
    )
    joint = part.variant.info.get("joint")
    line = _BENT if part.variant.info.get("bent") else 1.0
    return {
        "creep_fraction": found.per_spring(np.full(len(times), line), joint),
        "creep_fraction_of_run": found.per_spring(
            -line * whole * np.expm1(-seconds / times), joint
        ),
        "run": Parameter(seconds, seconds, seconds, "s"),
        "retardation_time": Parameter(mean, mean / 3, mean * 3, "s"),
    }


def run_seconds(bench: Bench) -> float:
    """s from the first sample of a run to its last, mean over runs."""
    data = bench.data
    number = np.unique(data.run, return_inverse=True)[1]
    first = np.full(number.max() + 1, np.inf)
    last = np.full(number.max() + 1, -np.inf)
    np.minimum.at(first, number, data.time)
    np.maximum.at(last, number, data.time)
    return float(np.mean(last - first))


def _stiffness(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Factor on the stiffness: of compliance where force is imposed, else of force. The spring it
    acts on is known to its stated relative sd only, by which the factor can be told no better."""
    out = {}
    for i, j in enumerate(part.variant.info["joints"]):
        change, variance = float(found.w[i]), float(found.cov[i, i])
        stated = 0.0
        if j in found.softer.value:  # what the spring itself was given belongs to the whole
            change += found.softer.value[j]
            variance += found.softer.variance[j] + 2 * float(found.softer.cross[j][i])
            stated = float(bench.data.compliance_relative_sd[j])
        whole = max(1 + change, _LEAST)
        nats = TWO_SIDED * float(np.hypot(max(variance, 0.0) ** 0.5 / whole, stated))
        spread = np.exp(min(nats, -np.log(_LEAST)))
        value = whole if bench.imposed else 1 / whole
        name = bench.data.spring_name(j)
        out[f"factor_{name}"] = Parameter(value, value / spread, value * spread, "1")
    return out


_LEAST = 1e-6  # of what is simulated: less is not told from nothing
_BENT = 0.75  # slope of the straight line of least squares through zero of x |x|, 0 to 1


def _gain(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Read over true. The columns are shares of what was read, but for an imposed displacement.
    Of a gain that bends or changes, the straight line of least squares; of one component's gain,
    with its name."""
    share = part.variant.info.get("share")
    more = _BENT if share is None else 1 - 1.5 * share + 0.5 * share**3
    g = found.linear(np.array([1.0, more])[: len(found.w)], "1")
    ends = [1 + v if bench.imposed else 1 / max(1 - v, _LEAST) for v in (g.value, g.low, g.high)]
    of = part.variant.info.get("component")
    return {f"factor_{of}" if of else "factor": Parameter(ends[0], ends[1], ends[2], "1")}


def _links(_: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Of bending the mean along the segment, as an even tube has it."""
    shares = {"bending": [*BENDING.values(), 0.0], "twist": [*np.zeros(len(BENDING)), 1.0]}
    out, segments = {}, part.variant.info["segments"]
    for i, k in enumerate(segments):
        for strain, share in shares.items():
            f = np.zeros((len(segments), len(STRAINS)))
            f[i] = share
            key = f"{strain}_compliance_over_nominal_segment{k + 1}"
            out[key] = found.linear(f.ravel(), "1")
    return out


def _base(_: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    return {
        f"compliance_about_{'xyz'[a]}": found.one(i, "rad/Nm")
        for i, a in enumerate(part.variant.info["axes"])
    }


def _seating(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    f0, top = float(part.variant.info["force_N"]), float(np.abs(bench.load).max())
    scales = part.variant.info["laws"]
    at_top = np.array([LAWS[law](np.array(top / scale)) for law, scale in scales])
    return {
        "depth": found.linear(at_top, "mm", 1e3),
        "force_scale": Parameter(f0, f0 / 2, f0 * 2, "N"),
    }


def _misalignment(_: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Tangents at the largest load, as it was come to; of single runs their mean."""
    info = part.variant.info
    names, count = list(info["directions"]), len(info["shapes"][0])
    if "poses" in info:
        names = [f"{name}_{pose}" for name, pose in zip(names, info["poses"], strict=True)]
    common = np.eye(2 * len(names) * count, len(found.w))
    rows = common.reshape(len(names), count, 2, -1).sum(axis=1)
    return {
        f"tangent_{name}_{k + 1}": found.linear(rows[i, k], "1")
        for i, name in enumerate(names)
        for k in range(2)
    }


def _drift(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Change from start to end of the session, per direction where it has its own."""
    unit, scale = ("N", 1.0) if part.word == "force_drift" else ("mm", 1e3)
    names, path = part.variant.info["names"], part.variant.info["path"]
    per = len(found.w) // len(names)
    out = {}
    for i, name in enumerate(names):
        f = np.zeros(len(found.w))
        mine = slice(i * per, (i + 1) * per)
        if path == "free":
            f[mine.start], f[mine.stop - 1] = -1.0, 1.0
        else:
            f[mine] = _end(bench, str(path))
        over = "drift" if path == "each run" else "drift_over_session"
        key = over + (f"_{name}" if name else "")
        out[key] = found.linear(f, unit, scale)
    return out


def _end(bench: Bench, path: str) -> float:
    """Where a path is at the end of the session: 1, but temperatures may have come back."""
    temperature = bench.rows.temperature
    if temperature is None or "temperature" not in path:
        return 1.0
    number = path.removeprefix("temperature ")
    v = temperature[:, int(number) - 1] if number.isdigit() else temperature.mean(axis=1)
    return float((v[-1] - v[0]) / np.ptp(v))


def _shift(_: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    if len(found.w) == 1:
        run = part.variant.info["runs"][0] + 1
        return {f"shift_before_run{run}": found.one(0, "mm", 1e3)}
    return {f"shift{i + 1}": found.one(i, "mm", 1e3) for i in range(len(found.w))}


def _lag(bench: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Mean delay. Readings do not change in proportion to a lag (one shorter than the wait before
    a sample is not seen at all), and no coefficient tells what kind it is: the effect as fitted
    is read as the lag of every kind that does the same, each the more the closer it comes."""
    n, info = bench.rows.n, part.variant.info
    w = found.w
    does = sum((v * bench.columns[c][:n] for v, c in zip(w, part.variant.columns, strict=True)),
               np.zeros(n))  # fmt: skip
    total = found.linear(np.ones(len(w)), "1")
    relative = total.sd / max(abs(total.value), 1e-6)
    lags, misses, spread = np.zeros((3, len(KINDS)))
    for k, kind in enumerate(KINDS):
        lags[k], misses[k] = closest_lag(bench, info["channel"], kind, does)
        more, _ = closest_lag(bench, info["channel"], kind, does * (1 + min(relative, 0.5)))
        spread[k] = more - lags[k]
    # what the noise hides of a miss tells no kind from another
    hidden = 1 / max(float(np.linalg.norm(does / bench.noise.response)), 1.0)
    share = 1 / (misses**2 + hidden**2)
    share /= share.sum()
    value = float(share @ lags)
    variance = float(share @ (spread**2 + (lags - value) ** 2))
    return {"lag": normal(value, variance + _turning_sd(bench, value) ** 2, "s")}


def _turning_sd(bench: Bench, lag: float) -> float:
    """s by which a lag is uncertain because nobody recorded when the load began to move: between
    two samples, so that it took half a sample more or less. What a lag shows at the first sample of
    a hold is the share of that way which it is late."""
    rows = bench.rows
    begins = rows.hold_starts & ~rows.starts
    if rows.continuous or not begins.any():
        return 0.0
    half = half_sample(rows)
    gaps = np.diff(rows.session, prepend=rows.session[0])
    way = float(np.median((gaps - settling_share(rows) - standing_on(rows))[begins]))
    return 0.5 * half / max(way, half) * max(lag - half, 0.0)


def _pose(_: Bench, part: Part, found: Found) -> dict[str, Parameter]:
    """Tool offset, angles of the joints, turn of the base."""
    kind = part.variant.info["kind"]
    out: dict[str, Parameter] = {}
    if kind == "base":
        return {f"base_turned_about_{a}": found.one(i, "rad") for i, a in enumerate("xyz")}
    if kind in ("tool", "both"):
        out |= {f"offset_{a}": found.one(i, "mm", 1e3) for i, a in enumerate("xyz")}
    if kind in ("joints", "both"):
        first = 3 if kind == "both" else 0
        out |= {
            f"angle_joint{i - first + 1}": found.one(i, "rad") for i in range(first, len(found.w))
        }
    return out


_TABLE: dict[str, Callable[[Bench, Part, Found], dict[str, Parameter]]] = {
    "joint_yield": of_knee,
    "base_slip": of_knee,
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
