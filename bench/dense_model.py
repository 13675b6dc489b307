"""The diagnosis's likelihood built anew: nuisances (springs, gains, datum, scatter of runs, tare,
offsets of the readings) and the imperfection of laws as one dense covariance matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from identification.gap.data import UNLOADING
from identification.gap.evidence import alike, engine
from identification.gap.model.base import HALF, compliance_found, prediction
from identification.gap.model.bench import Bench
from identification.gap.model.encoders import ENCODER_OFFSET_RAD

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Dense:
    """`y ~ N(X w, A + eta^2 B)`, taken to the axes in which A is 1 and B diagonal.

    turn (N, N); values (N,) of B; target (N,) there; constant: log of the rest of the density.
    """

    bench: Bench
    turn: Array
    values: Array
    target: Array
    constant: float

    def log_density(self, mean: Array, eta: float) -> float:
        """Of the data, for a mean (N,) in the turned axes."""
        spread = 1 + eta**2 * self.values
        left = self.target - mean
        return self.constant - 0.5 * float(np.sum(left**2 / spread) + np.sum(np.log(spread)))


def dense(bench: Bench, drop: tuple[str, ...] = ()) -> Dense:
    """All nuisances but those dropped, marginalised."""
    size, sigma = bench.layout.size, bench.sigma
    A, B = np.diag(sigma**2), np.zeros((size, size))
    n, rows = bench.rows.n, bench.rows
    for h in np.unique(rows.hold):
        mine = np.flatnonzero(rows.hold == h)
        common = np.ix_(mine, mine)
        A[common] += np.outer(bench.noise.hold[mine], bench.noise.hold[mine])
        B[common] += engine.HOLD_PART**2
        within = np.eye(len(mine)) - np.full((len(mine), len(mine)), 1 / len(mine))
        B[common] += engine.ROW_PART**2 * within
    B[:n, :n] += _repeatable(bench) + _of_runs(bench)
    q = np.arange(bench.layout.q.start, bench.layout.q.stop)
    B[q, q] += engine.LEVER_M**-2.0
    for name, column, sd in nuisances(bench):
        if not name.startswith(drop) or not drop:
            A += sd**2 * np.outer(column, column)
    scale = float(np.sqrt(np.mean(sigma**2)))  # eigh likes numbers near one
    values, turn = eigh(B, A / scale**2)
    turn, values = turn / scale, np.maximum(values, 0.0) / scale**2
    log_det = np.linalg.slogdet(A / scale**2)[1] + 2 * size * np.log(scale)
    target = bench.observed - prediction(bench)
    constant = -0.5 * float(log_det) - 0.5 * size * np.log(2 * np.pi)
    return Dense(bench, turn, values, turn.T @ target, constant)


def _repeatable(bench: Bench) -> Array:
    """Alike for neighbouring forces of the same setup, half so between branches; per level."""
    rows, n = bench.rows, bench.rows.n
    mean = {k: float(rows.force[rows.level == k].mean()) for k in np.unique(rows.level)}
    force = np.array([mean[k] for k in rows.level])
    near = np.exp(-np.abs(force[:, None] - force) / (0.25 * np.ptp(rows.force)))
    near *= rows.setup[:, None] == rows.setup
    near *= np.where(rows.branch[:, None] == rows.branch, 1.0, 0.5)
    assert near.shape == (n, n)
    return np.asarray(near)


def _of_runs(bench: Bench) -> Array:
    """Every run's own broken line over its load, for loading and unloading."""
    rows, out = bench.rows, np.zeros((bench.rows.n, bench.rows.n))
    for run in np.unique(rows.run):
        force = rows.force[rows.run == run]
        knots = np.linspace(force.min(), force.max(), alike.HATS)
        for back in (False, True):
            mine = (rows.run == run) & ((rows.branch == UNLOADING) == back)
            for k in range(len(knots)):
                hat = np.interp(rows.force, knots, np.eye(len(knots))[k]) * mine
                out += engine.RUN_PART**2 * np.outer(hat, hat)
    return out


def nuisances(bench: Bench) -> list[tuple[str, Array, float]]:
    """Name, stacked column and standard deviation of what is uncertain in every hypothesis."""
    data, rows, meter = bench.data, bench.rows, bench.data.instruments
    lever = np.array([data.setups[s].lever for s in rows.setup])
    pull = lever * data.compliance  # joints per newton
    slope, force, m = np.sum(lever * pull, axis=1), rows.force, data.joints
    out = []
    for j in range(m):
        only = np.zeros((rows.n, m))
        only[:, j] = pull[:, j] * force
        sd = float(data.compliance_relative_sd[j])
        out.append((f"spring {j}", stacked(bench, lever[:, j] * only[:, j], only), sd))
    less = stacked(bench, -slope * force, -pull * force[:, None])
    out.append(("gain of force", less, meter.force_gain))
    out.append(("gain of laser", stacked(bench, _read(bench)), meter.displacement_gain))
    ends = [np.ptp(slope * force), np.ptp(rows.displacement), np.abs(rows.displacement).max()]
    wide = float(max(*ends, np.abs(slope * force).max()))
    for s in range(len(data.setups)):
        out.append((f"datum {s}", stacked(bench, (rows.setup == s) * 1.0), wide))
    for r in np.unique(rows.run):
        out.append((f"scatter {r}", stacked(bench, (rows.run == r) * 1.0), bench.noise.run))
    for axis in range(3):
        share = np.array([data.setups[s].unit_vector[axis] for s in rows.setup])
        zero = stacked(bench, -slope * share, -pull * share[:, None])
        zero[bench.layout.zero_force] = share[rows.zero]
        if np.any(share):
            out.append((f"tare {'xyz'[axis]}", zero, bench.noise.force))
    out.append(("geometry", stacked(bench, *_turning(bench, lever)), HALF))
    for j in range(m if bench.has_q else 0):
        off = stacked(bench, None, np.tile(np.eye(m)[j], (rows.n, 1)))
        out.append((f"offset {j}", off, ENCODER_OFFSET_RAD))
        for name, group, sd in (
            ("run", rows.run, bench.noise.q_run),
            ("setup", rows.setup, bench.noise.q_setup),
        ):
            for g in np.unique(group) if sd > 0 else ():
                mine = np.where((group == g)[:, None], np.eye(m)[j], 0.0)
                out.append((f"offset of {name} {g} {j}", stacked(bench, None, mine), sd))
    return out


def _read(bench: Bench) -> Array:
    """The straight line of what the laser read over the force, in every setup."""
    rows, out = bench.rows, np.zeros(bench.rows.n)
    for k in range(len(bench.data.setups)):
        mine = rows.setup == k
        slope = np.polyfit(rows.force[mine], rows.displacement[mine], 1, w=rows.weight[mine] ** 0.5)
        out[mine] = slope[0] * rows.force[mine]
    return out


def _turning(bench: Bench, lever: Array) -> tuple[Array, Array]:
    """Response and joints when the levers turn with the joints, by what these were found to give:
    second order in the force."""
    rows, data = bench.rows, bench.data
    compliance = compliance_found(bench)
    pull = lever * compliance
    response, joints = np.zeros(rows.n), np.zeros((rows.n, data.joints))
    for i in range(rows.n):
        turned = data.setups[rows.setup[i]].turned_lever @ pull[i]
        joints[i] = turned * compliance * rows.force[i] ** 2
        response[i] = 1.5 * rows.force[i] ** 2 * float(pull[i] @ turned)
    return response, joints


def stacked(bench: Bench, response: Array | None, joints: Array | None = None) -> Array:
    """Response row by row; joint readings hold by hold, one joint after the other."""
    out, rows = np.zeros(bench.layout.size), bench.rows
    if response is not None:
        out[: rows.n] = response
    if joints is not None and bench.has_q:
        holds = np.unique(rows.hold)
        for j in range(bench.data.joints):
            for i, h in enumerate(holds):
                mine = rows.hold == h
                mean = np.average(joints[mine, j], weights=rows.weight[mine])
                out[bench.layout.q.start + j * len(holds) + i] = mean
    return out
