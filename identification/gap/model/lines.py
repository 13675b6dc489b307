"""Straight lines through what was measured: response over load, and the force without load."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.recording.rows import Rows

_DRIFTS = 5.0  # standard deviations by which the force at zero load must have moved


def measured_slope(rows: Rows, load: Array, response: Array) -> Array:
    """(n,) m/N: slope of the response (n,) m over the load (n,) N, in each setup; none below 0."""
    out = np.zeros(rows.n)
    for s in np.unique(rows.setup):
        mine = rows.setup == s
        weight = rows.weight[mine]
        x = load[mine] - np.average(load[mine], weights=weight)
        power = float(weight @ x**2)
        if power > 0:
            out[mine] = max(float(weight @ (x * response[mine])) / power, 0.0)
    return out


def means_move(rows: Rows, load: Array, left: Array, least: float) -> bool:
    """Whether the means of what is left (n,) m differ by more than `least` from one run of a setup
    to the next, where a load (n,) N was changed."""
    for s in np.unique(rows.setup):
        mine = rows.setup == s
        if np.ptp(load[mine]) > 0:
            means = [left[mine & (rows.run == r)].mean() for r in np.unique(rows.run[mine])]
            if np.abs(np.diff(means)).max(initial=0.0) > least:
                return True
    return False


def force_without_load(rows: Rows, noise: float) -> Array:
    """(n,) N: what the force shows at zero load before and after a run, straight in between; 0
    where it stands still within its noise N, or was not read at both ends."""
    out = np.zeros(rows.n)
    for run in np.unique(rows.run):
        mine = np.flatnonzero(rows.run == run)
        pushed = mine[~rows.zero[mine]]
        if not pushed.size:
            continue
        zero = mine[rows.zero[mine]]
        ends = zero[zero < pushed[0]], zero[zero > pushed[-1]]
        if not all(e.size for e in ends):
            continue
        weight = [rows.weight[e] for e in ends]
        both = list(zip(ends, weight, strict=True))
        force = [np.average(rows.measured_force[e], weights=w) for e, w in both]
        time = [np.average(rows.session[e], weights=w) for e, w in both]
        sd = noise * float(np.sqrt(sum(1 / w.sum() for w in weight)))
        if abs(force[1] - force[0]) > _DRIFTS * sd:
            out[mine] = np.interp(rows.session[mine], time, force)
    return out
