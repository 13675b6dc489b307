"""Exact evidence of linear Gaussian models, for a whole library at once.

Data whitened by their noise, `y = B beta + E w + imperfection + noise`, all Gaussian. The
imperfection of a model (no formula is the rig) has a size eta on a grid of levels:
- repeatable: an unknown smooth function of setup, branch and force step, standard deviation eta;
- per hold: each hold off by 0.6 eta; within holds: every row off by 0.3 eta more than its noise;
- joint readings: each hold off by eta over the joint's lever.
For every level the base (with the repeatable part) is integrated out of the Gram matrices of the
pool; then the evidence of any set of columns with prior covariance `s^2 T T^T` costs one small
eigendecomposition: `base + 1/2 b' (G + S^-1)^-1 b - 1/2 log|I + S G|`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.gap.base import Base
from identification.gap.bench import Bench
from identification.gap.data import Array

HOLD_PART, ROW_PART = 0.6, 0.3
CONTINUOUS_ROW_PART = 0.3  # neighbouring rows of a running recording err alike
_NEIGHBOUR = 0.25  # share of the force range over which the imperfection stays alike
_LEVER_M = 0.3  # an imperfection of the arm's joints sits at about this lever


@dataclass(frozen=True, eq=False)
class Level:
    """Pool and data with the base integrated out, for one size of imperfection eta (m).

    gram (p, p), moment (p,): of the pool; log_base: evidence of the base alone, nats.
    taken (r, p): what effects that were integrated out as well take from the Gram matrix,
    `gram - taken' taken`; no full matrix is made for a candidate that is looked at once.
    """

    eta: float
    gram: Array
    moment: Array
    log_base: float
    taken: Array


class Engine:
    """Evidence for the pool of one bench; `levels[i].eta` ascending, the first is 0."""

    def __init__(self, bench: Bench, base: Base, target: Array, etas: Array) -> None:
        """target: stacked observation minus the simulation's prediction."""
        self.bench, self.base, self.target = bench, base, target
        self.pool = (
            np.column_stack(bench.columns) if bench.columns else np.zeros((bench.layout.size, 0))
        )
        self.sigma = row_noise(bench)
        self.cache: dict[object, Array] = {}
        self.structural = structural_rms(bench, base, target)
        self.level_columns = _level_columns(bench)
        self._split()
        self.levels = [self._level(float(eta)) for eta in etas]

    def _split(self) -> None:
        """Whitens [target, base, levels, pool] and separates hold means from contrasts."""
        bench, n = self.bench, self.bench.rows.n
        everything = np.column_stack(
            [self.target, self.base.columns, self.level_columns, self.pool]
        )
        white = everything / self.sigma[:, None]
        edges = np.flatnonzero(bench.rows.hold_starts)
        response, inverse = white[:n], 1 / self.sigma[:n]
        lengths = np.sqrt(np.add.reduceat(inverse**2, edges))
        means = np.add.reduceat(response * inverse[:, None], edges, axis=0) / lengths[:, None]
        self._mean_u, self._length_u = means, lengths
        q = bench.layout.q
        self._length_q = 1 / self.sigma[q]
        self._readings = list(_per_joint(white[q], len(edges)))
        rest = white[q.stop :]
        self._fixed = rest.T @ rest
        hold = np.repeat(np.arange(len(edges)), np.diff(np.append(edges, n)))
        direction = inverse / lengths[hold]
        contrast = response - direction[:, None] * means[hold]
        alone = np.diff(np.append(edges, n))[hold] == 1
        contrast = contrast[~alone]
        # most columns stand still within a hold: only the others need the product
        size = np.abs(contrast).max(axis=0) if len(contrast) else np.zeros(contrast.shape[1])
        self._varying = np.flatnonzero(size > 1e-9 * (1 + np.abs(response).max(axis=0)))
        self._contrast = contrast[:, self._varying]
        self._contrast_noise = self.sigma[:n][~alone]
        self._freedom = n - len(edges)

    def _level(self, eta: float) -> Level:
        noise = self.bench.noise
        edges = np.flatnonzero(self.bench.rows.hold_starts)
        hold = noise.hold[edges] ** 2 + (HOLD_PART * eta) ** 2
        extra_u = 1 + hold * self._length_u**2
        extra_q = 1 + (eta / _LEVER_M) ** 2 * self._length_q**2 if self.bench.data.arm else 1.0
        row_part = ROW_PART if not self.bench.rows.continuous else CONTINUOUS_ROW_PART
        factor = 1 + (row_part * eta / self._contrast_noise) ** 2
        gram = self._fixed + self._mean_u.T @ (self._mean_u / extra_u[:, None])
        if self._length_q.size:
            for rows, columns, values in self._readings:
                gram[np.ix_(columns, columns)] += values.T @ (
                    values / np.asarray(extra_q)[rows, None]
                )
        weighted = self._contrast / factor[:, None]
        gram[np.ix_(self._varying, self._varying)] += self._contrast.T @ weighted
        share = self._freedom / max(len(factor), 1)
        log_noise = 0.5 * (
            np.log(extra_u).sum() + np.log(extra_q).sum() * bool(self._length_q.size)
        )
        log_noise += 0.5 * share * np.log(factor).sum()
        return self._integrate(eta, gram, float(log_noise))

    def _integrate(self, eta: float, gram: Array, log_noise: float) -> Level:
        """Takes base and repeatable imperfection out of [target, base, levels, pool]."""
        kb = self.base.columns.shape[1]
        covariance, count = level_covariance(self.bench), 0
        sd = self.base.sd
        if eta > 0:
            count = covariance.shape[0]
        total = covariance.shape[0]
        b = np.arange(1, 1 + kb + count)
        p = np.arange(1 + kb + total, gram.shape[0])
        root = np.zeros((kb + count, kb + count))
        root[:kb, :kb] = np.diag(sd)
        if count:
            root[kb:, kb:] = eta * np.linalg.cholesky(covariance)
        inner = np.eye(kb + count) + root.T @ gram[np.ix_(b, b)] @ root
        factor = np.linalg.cholesky(inner)
        cross = np.linalg.solve(factor, root.T @ gram[np.ix_(b, np.append(0, p))])
        left, pool = cross[:, 0], cross[:, 1:]
        log_base = -0.5 * (gram[0, 0] - left @ left) - np.log(np.diag(factor)).sum() - log_noise
        return Level(
            eta,
            gram[np.ix_(p, p)] - pool.T @ pool,
            gram[p, 0] - pool.T @ left,
            float(log_base),
            np.zeros((0, len(p))),
        )


def _per_joint(q: Array, holds: int) -> Iterator[tuple[slice, NDArray[np.intp], Array]]:
    """Rows, columns and values of each joint's readings; a column touches few joints."""
    for start in range(0, len(q), holds):
        part = q[start : start + holds]
        columns = np.flatnonzero(np.any(part != 0, axis=0))
        yield slice(start, start + holds), columns, part[:, columns]


def eta_levels(bench: Bench, base: Base, target: Array) -> Array:
    """0, then sizes of imperfection by factors of about 2.5, from half the stated uncertainty to
    the size of what the base leaves."""
    start = 0.5 * bench.noise.stated
    left = structural_rms(bench, base, target)
    count = max(3, int(np.ceil(np.log(max(1.5 * left / start, 1.0)) / np.log(2.5))) + 1)
    return np.concatenate([[0.0], start * 2.5 ** np.arange(count)])


def structural_rms(bench: Bench, base: Base, target: Array) -> float:
    """rms (m) of the response that the base alone leaves at its best."""
    n, sigma = bench.rows.n, row_noise(bench)
    A = np.vstack([base.columns / sigma[:, None], np.diag(1 / base.sd)])
    b = np.concatenate([target / sigma, np.zeros(len(base.sd))])
    beta = np.linalg.lstsq(A, b, rcond=None)[0]
    weight = bench.rows.weight
    left = (target - base.columns @ beta)[:n]
    return float(np.sqrt(weight @ left**2 / weight.sum()))


def row_noise(bench: Bench) -> Array:
    """Standard deviation of every stacked row."""
    noise, rows, layout = bench.noise, bench.rows, bench.layout
    out = np.empty(layout.size)
    root = np.sqrt(rows.weight) if not rows.continuous else np.ones(rows.n)
    out[: layout.n] = noise.response
    total = np.sqrt(np.add.reduceat(rows.weight, np.flatnonzero(rows.hold_starts)))
    if layout.q.stop > layout.q.start:
        out[layout.q] = np.concatenate([s / total for s in noise.q])
    if rows.tangential is not None:
        out[layout.tangential] = np.tile(noise.force / total, 2)
    out[layout.zero_force] = noise.force / root[rows.zero]
    return out


def _level_columns(bench: Bench) -> Array:
    """Indicator of every level, response only, (size, levels)."""
    rows = bench.rows
    out = np.zeros((bench.layout.size, int(rows.level.max()) + 1))
    out[np.arange(rows.n), rows.level] = 1.0
    return out


def level_covariance(bench: Bench) -> Array:
    """Imperfection of levels of one setup: alike for neighbouring forces, half so between branches.

    Unit variance; `exp(-|dF| / a quarter of the range)`, a path that may have corners.
    """
    rows = bench.rows
    count = int(rows.level.max()) + 1
    sums = np.bincount(rows.level, minlength=count)
    load = np.bincount(rows.level, weights=bench.load, minlength=count) / sums
    first = np.unique(rows.level, return_index=True)[1]
    setup, branch = rows.setup[first], rows.branch[first]
    if rows.continuous:
        branch = np.searchsorted(np.unique(rows.level), rows.level[first]) * 0 + (
            np.gradient(bench.load)[first] >= 0
        )
    span = np.ptp(bench.load) or 1.0
    near = np.exp(-np.abs(load[:, None] - load) / (_NEIGHBOUR * span))
    same = setup[:, None] == setup
    alike = np.where(branch[:, None] == branch, 1.0, 0.5)
    return np.asarray(near * same * alike + 1e-9 * np.eye(count))
