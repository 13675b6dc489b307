"""Straight lines through what was measured: response over load, and the force without load."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array, Ints
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


def force_without_load(rows: Rows, noise: float, *, tared: bool) -> Array:
    """(n,) N: what the force shows at zero load, straight from plateau to plateau of a setup, and
    on beyond the last one as from the first to there; their mean where it stands still within its
    noise N, 0 where that is no more than noise, or was read once. tared: before every run, each of
    which then tells of itself alone."""
    out = np.zeros(rows.n)
    each = rows.run if tared else rows.setup
    for part in np.unique(each):
        mine = np.flatnonzero(each == part)
        plateaus = _plateaus(rows, mine)
        if len(plateaus) < 2 or rows.zero[mine].all():
            continue
        time, force, weight = (np.array(v) for v in zip(*plateaus, strict=True))
        sd = noise * float(np.sqrt(1 / weight[force.argmin()] + 1 / weight[force.argmax()]))
        if np.ptp(force) <= _DRIFTS * sd:
            mean, total = float(np.average(force, weights=weight)), float(weight.sum())
            out[mine] = mean if abs(mean) > _DRIFTS * noise / total**0.5 else 0.0
            continue
        if (end := float(rows.session[mine].max())) > time[-1] > time[0]:
            rate = (force[-1] - force[0]) / (time[-1] - time[0])
            time, force = (
                np.append(time, end),
                np.append(force, force[-1] + rate * (end - time[-1])),
            )
        out[mine] = np.interp(rows.session[mine], time, force)
    return out


def _plateaus(rows: Rows, mine: Ints) -> list[tuple[float, float, float]]:
    """Time s, force N and weight of every plateau without load in rows that follow each other."""
    zero = mine[rows.zero[mine]]
    apart = np.flatnonzero((np.diff(zero) > 1) | np.diff(rows.run[zero]).astype(bool)) + 1
    out = []
    for rest in np.split(zero, apart):
        if rest.size and rows.weight[rest].sum() > 0:
            w = rows.weight[rest]
            time, force = (
                float(w @ v[rest] / w.sum()) for v in (rows.session, rows.measured_force)
            )
            out.append((time, force, float(w.sum())))
    return out
