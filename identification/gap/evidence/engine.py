"""Exact evidence of linear Gaussian models, for a whole library at once.

Data whitened by their noise, `y = B beta + E w + imperfection + noise`, all Gaussian. The
imperfection of a model (no formula is the rig) has a size eta on a grid of levels:
- repeatable: an unknown smooth function of setup, branch and force step, standard deviation eta;
- per run: a smooth function of branch and force of each run's own, 0.6 eta (memory makes a law's
  mistakes differ from run to run, but alike along one);
- per hold: each hold off by 0.3 eta, where it runs on each stretch by 0.6 eta; within holds: every
  row off by 0.3 eta more than its noise;
- joint readings of an arm: each hold off by eta over one usual lever, 0.3 m, whichever joint.
For every level the base (with the repeatable part) is integrated out of the products of the pool
(`products`); then the evidence of any set of columns with prior covariance `s^2 T T^T` costs one
small eigendecomposition: `base + 1/2 b' (G + S^-1)^-1 b - 1/2 log|I + S G|`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.gap.evidence.alike import level_columns, level_covariance, run_columns
from identification.gap.evidence.factor import factor_of
from identification.gap.evidence.imperfection import LOG_STEP, STEP
from identification.gap.evidence.products import Gathered, SparseColumns, Weights, WhitenedColumns
from identification.gap.model.base import Base
from identification.gap.model.bench import Bench
from identification.gap.model.growing import Growing
from identification.gap.recording.rows import Rows
from identification.running import first_rows, stretches

RUN_PART, HOLD_PART, ROW_PART = 0.6, 0.3, 0.3
_CONTINUOUS_HOLD_PART = 0.6  # no runs that repeat
_AT_ONCE = 500_000  # numbers: what they take stays near the processor
LEVER_M = 0.3  # an imperfection of the arm's joints sits at about this lever


@dataclass(frozen=True, eq=False)
class NoiseLevel:
    """Pool and data with the base integrated out, for one size of imperfection eta (m), the
    `number`th of its engine.

    moment (p,): of the pool; log_base: evidence of the base alone, nats; misfit: square of what is
    left of the target, in units of the noise. taken (r, p): what effects that were integrated out
    as well take from the Gram matrix, `gram - taken' taken`; no full matrix is ever made.
    """

    engine: Engine
    number: int
    eta: float
    moment: Array
    log_base: float
    misfit: float
    taken: Array

    def square(self, columns: Sequence[int]) -> Array:
        """(k, k) part of the pool's Gram matrix of columns (k,), but for what was taken."""
        return np.asarray(self.engine.square(tuple(columns))[self.number])

    def beside(self, columns: Sequence[int]) -> Array:
        """(k, p) rows of the pool's Gram matrix of columns (k,), but for what was taken."""
        return self.engine.beside(tuple(columns), self.number + 1)[self.number]


class Engine:
    """Evidence for the pool of one bench; `levels[i].eta` ascending, the first is 0. level_root
    (levels, levels): Cholesky factor of `level_covariance`."""

    def __init__(self, bench: Bench, base: Base, target: Array, etas: Array) -> None:
        """target: stacked observation minus the simulation's prediction."""
        self.bench, self.base, self.target, self.etas = bench, base, target, etas
        self.sigma = bench.sigma
        self.cache: dict[object, Any] = {}
        self.stacks: dict[object, Any] = {}  # of variants that are compared again and again
        self.arranged: dict[object, Any] = {}  # by shape and size
        self.limits: dict[object, Any] = {}
        self.structural = structural_rms(bench, base, target)
        self.most = _variance(bench)
        n = bench.rows.n
        self._edges = bench.rows.edges
        self._inverse = 1 / self.sigma[:n]
        self._length_u = np.sqrt(np.add.reduceat(self._inverse**2, self._edges))
        self._length_q = 1 / self.sigma[bench.layout.q]
        run = bench.rows.run[self._edges]
        self._runs = first_rows(run)
        self._run = stretches(run)
        self._along = self._of_mean()
        self._hold = bench.rows.hold
        inside = np.flatnonzero(np.bincount(self._hold)[self._hold] > 1)
        self._inside = inside[np.argsort(self.sigma[inside], kind="stable")]
        self._groups = _groups(self.sigma[self._inside])
        self._freedom = n - len(self._edges)
        self._squares: dict[tuple[int, ...], Array] = {}
        self._rows: dict[tuple[int, ...], list[Array]] = {}
        self._weights = [self._left(float(eta)) for eta in etas]
        self._first = self._whiten(np.column_stack([target, base.columns]))
        self._second = self._whiten(np.column_stack([level_columns(bench), run_columns(bench)]))
        self.level_root = np.linalg.cholesky(level_covariance(bench))
        self._bases = self._integrated(etas, self._weights)
        self._finer: dict[float, tuple[Weights, _Integrated]] = {}
        self._taken = Gathered(self._whiten(self.columns([])))
        none = np.zeros(0)
        self._levels = [
            NoiseLevel(self, i, float(eta), none, b.log_base, b.misfit, np.zeros((0, 0)))
            for i, (eta, b) in enumerate(zip(etas, self._bases, strict=True))
        ]

    @contextmanager
    def on(self, bench: Bench) -> Iterator[None]:
        """Within it, effects are looked for on another bench of the same rows and pool; what is
        kept of variants is of one bench."""
        kept = self.bench, self.cache, self.stacks, self.arranged
        self.bench, self.cache, self.stacks, self.arranged = bench, {}, {}, {}
        try:
            yield
        finally:
            self.bench, self.cache, self.stacks, self.arranged = kept

    @property
    def levels(self) -> list[NoiseLevel]:
        """All sizes of the imperfection, with all columns of the bench's pool."""
        self._take_in()
        return self._levels

    @property
    def _gathered(self) -> Gathered:
        """What the evidence needs of all columns of the bench's pool."""
        self._take_in()
        return self._taken

    def _take_in(self) -> None:
        """Takes in the columns that were put into the bench's pool since."""
        added = range(len(self._taken.white), len(self.bench.columns))
        if not added:
            return
        step = max(1, _AT_ONCE // self.bench.layout.size)
        blocks = [added[i : i + step] for i in range(0, len(added), step)]
        parts = [self._whiten(self.columns(block)) for block in blocks]
        beside = zip(*(self._common(p, self._weights) for p in parts), strict=True)
        self._levels = [self._grown(*each) for each in zip(self._levels, beside, strict=True)]
        self._taken.put(parts)

    def columns(self, numbers: Iterable[int]) -> Array:
        """(size, k) stacked columns of the pool."""
        wanted = [self.bench.columns[i] for i in numbers]
        return np.array(wanted).reshape(len(wanted), self.bench.layout.size).T

    def responses(self, numbers: Iterable[int]) -> Array:
        """(n, k) what columns of the pool do to the response."""
        n, wanted = self.bench.rows.n, [self.bench.columns[i] for i in numbers]
        return np.array([column[:n] for column in wanted]).reshape(len(wanted), n).T

    def unweighed(self, columns: NDArray[np.intp]) -> Array:
        """(g, v, k, k): what `squares` of the columns (v, k) has in common at all levels."""
        return self._gathered.white.unweighed(columns)

    def squares(self, columns: NDArray[np.intp], number: int, unweighed: Array) -> Array:
        """(v, k, k): parts of a level's Gram matrix of the columns (v, k) of every variant."""
        made = self._gathered.white.squares(columns, self._weights[number], unweighed)
        shared = self._bases[number].pool.values[columns]
        return np.asarray(made - shared @ np.swapaxes(shared, 1, 2))

    def square(self, columns: tuple[int, ...]) -> Array:
        """(l, k, k): per level the part of the Gram matrix of some columns, kept for the next
        time."""
        if columns not in self._squares:
            at = np.array(columns, dtype=np.intp)
            white = self._gathered.white.picked(at)
            made = np.array(white.between(white, self._weights))
            for k, base in enumerate(self._bases):
                shared = base.pool.values[at]
                made[k] -= shared @ shared.T
            self._squares[columns] = made
        return self._squares[columns]

    def beside(self, columns: tuple[int, ...], number: int) -> list[Array]:
        """Per level, of the first `number` at least, (k, p): rows of the Gram matrix, kept for the
        next time; of a pool that has grown only what is new. Those of many levels at once take
        little longer than of one."""
        known = self._rows.setdefault(columns, [])
        if known and len(known[0].T) < len(self._gathered.white):
            fresh = self._products(columns, slice(len(known)), len(known[0].T))
            known[:] = [np.hstack(both) for both in zip(known, fresh, strict=True)]
        if len(known) < number:
            known += self._products(columns, slice(len(known), number), 0)
        return known

    def _products(self, columns: tuple[int, ...], levels: slice, start: int) -> list[Array]:
        """Per level (k, p - start): products of columns (k,) with those of the pool from one on."""
        at, white = np.array(columns, dtype=np.intp), self._gathered.white
        others = white.picked(np.arange(start, len(white))) if start else white
        made = white.picked(at).between(others, self._weights[levels])
        for base, rows in zip(self._bases[levels], made, strict=True):
            np.subtract(rows, base.pool.values[at] @ base.pool.values[start:].T, out=rows)
        return made

    def between(self, eta: float, columns: Sequence[int]) -> tuple[Array, Array, float]:
        """For an imperfection that is none of the levels: Gram matrix (k, k) and moment (k,) of
        columns of the pool, and the evidence of the base alone."""
        if eta not in self._finer:
            w = self._left(eta)
            self._finer[eta] = w, self._integrated([eta], [w])[0]
        w, base = self._finer[eta]
        if not columns:
            return np.zeros((0, 0)), np.zeros(0), base.log_base
        white = self._gathered.white.picked(np.array(columns, dtype=np.intp))
        (beside,) = self._common(white, [w])
        shared = base.turn @ beside[1 : 1 + base.turn.shape[1]]
        square = white.between(white, [w])[0] - shared.T @ shared
        return square, beside[0] - shared.T @ base.left, base.log_base

    def of_base(
        self, which: Sequence[int], columns: Sequence[int], root: Array, number: int
    ) -> tuple[Array, Array]:
        """Posterior mean (m,) and covariance (m, m) of coefficients of the base, beside columns
        (k,) of the pool with the root (k, r) of their prior covariance, at a level."""
        base = self._bases[number]
        mean, covariance = base.of(which)
        if not columns:
            return mean, covariance
        turn = base.turn[:, list(which)]
        inner = np.eye(root.shape[1]) + root.T @ self.square(tuple(columns))[number] @ root
        turned = np.linalg.solve(factor_of(inner), root.T)  # of the covariance beside the base
        w = turned.T @ (turned @ self.levels[number].moment[list(columns)])
        shared = base.pool.values[list(columns)]
        beside = turned @ shared @ turn
        return mean - turn.T @ (shared.T @ w), covariance + beside.T @ beside

    def of_base_between(self, which: Sequence[int], eta: float) -> tuple[Array, Array]:
        """The same without effects, for an imperfection that is none of the levels."""
        self.between(eta, ())
        return self._finer[eta][1].of(which)

    def _of_mean(self) -> Array:
        """(m holds,) direction of the mean of a joint's readings in a run, of length 1."""
        length = self._length_q.reshape(-1, len(self._edges))
        square = np.add.reduceat(length**2, self._runs, axis=1)
        return np.asarray(length / np.sqrt(square[:, self._run])).ravel()

    def _whiten(self, columns: Array) -> WhitenedColumns:
        n, q = self.bench.rows.n, self.bench.layout.q
        white = np.ascontiguousarray(columns.T) / self.sigma
        response, inverse = white[:, :n], self._inverse
        means = np.add.reduceat(response * inverse, self._edges, axis=1) / self._length_u
        direction = inverse / self._length_u[self._hold]
        contrast = (response - direction * means[:, self._hold])[:, self._inside]
        # most columns stand still within a hold
        size = np.abs(contrast).max(axis=1, initial=0.0)
        top = np.abs(response).max(axis=1, initial=0.0)
        contrast[size <= 1e-9 * (1 + top)] = 0.0
        holds = len(self._edges)
        joints = [slice(k, k + holds) for k in range(0, q.stop - q.start, holds)]
        readings = tuple(SparseColumns.of(self._apart(white[:, q], joint)) for joint in joints)
        even = np.hstack([means, white[:, q.stop :]])
        return WhitenedColumns(even, readings, SparseColumns.of(contrast), holds, self._groups)

    def _apart(self, white: Array, joint: slice) -> Array:
        """(c, holds) readings of a joint in units of noise; where those of a run have something in
        common, (c, holds + runs): what differs within runs, and the mean of each."""
        readings = white[:, joint]
        if not self.bench.noise.q_run > 0:
            return readings
        along = np.add.reduceat(readings * self._along[joint], self._runs, axis=1)
        return np.hstack([readings - self._along[joint] * along[:, self._run], along])

    def _left(self, eta: float) -> Weights:
        """What an imperfection leaves of the precision."""
        hold = self.bench.noise.hold[self._edges] ** 2 + (hold_part(self.bench.rows) * eta) ** 2
        lever = (eta / LEVER_M) ** 2 if self.bench.data.arm else 0.0
        return Weights(
            1 / (1 + hold * self._length_u**2),
            *self._left_of_readings(lever),
            1 / (1 + (ROW_PART * eta / self.sigma[self._inside]) ** 2),
        )

    def _left_of_readings(self, off: float) -> tuple[Array, float]:
        """Of joint readings, each off by a variance (rad^2) more, and log of the determinant of
        that. Exact where the readings of a run are equally precise."""
        each = 1 / (1 + off * self._length_q**2)
        if not each.size or not self.bench.noise.q_run > 0:
            return each, float(np.log(each).sum())
        each = each.reshape(self.bench.data.joints, -1)
        along, length = (v.reshape(each.shape) for v in (self._along, self._length_q))
        more = off * np.add.reduceat((along * length) ** 2, self._runs, axis=1)
        common = self.bench.noise.q_run**2 * np.add.reduceat(length**2, self._runs, axis=1)
        means = 1 / (1 + common + more)
        log = np.log(each).sum() + np.log1p(more).sum() + np.log(means).sum()
        return np.hstack([each, means]).ravel(), float(log)

    def _common(self, white: WhitenedColumns, weights: list[Weights]) -> list[Array]:
        """Per set of weights (c, p): products with target, base and repeatable imperfection."""
        first, second = self._first.between(white, weights), self._second.sparsely(white, weights)
        return [np.vstack(both) for both in zip(first, second, strict=True)]

    def _integrated(self, etas: Iterable[float], weights: list[Weights]) -> list[_Integrated]:
        """Base and repeatable imperfection, integrated out of target and, later, of the pool."""
        first, second = (self._common(white, weights) for white in (self._first, self._second))
        return [
            self._integrate(eta, w, np.hstack(both))
            for eta, w, *both in zip(etas, weights, first, second, strict=True)
        ]

    def _integrate(self, eta: float, w: Weights, gram: Array) -> _Integrated:
        """gram: products of target, base and imperfection with each other."""
        from scipy.linalg import solve_triangular

        kb = self.base.columns.shape[1]
        levels = len(self.level_root)
        count = gram.shape[0] - 1 - kb if eta > 0 else 0
        root = np.zeros((kb + count, kb + count))
        root[:kb, :kb] = np.diag(self.base.sd)
        if count:
            root[kb : kb + levels, kb : kb + levels] = eta * self.level_root
            root[kb + levels :, kb + levels :] = RUN_PART * eta * np.eye(count - levels)
        b = slice(1, 1 + kb + count)
        factor = factor_of(np.eye(kb + count) + root.T @ gram[b, b] @ root)
        turn = np.asarray(solve_triangular(factor, root.T, lower=True, check_finite=False))
        left = turn @ gram[b, 0]
        share = self._freedom / max(len(w.contrast), 1)
        log_noise = -0.5 * (np.log(w.hold).sum() + w.log_q)
        log_noise -= 0.5 * share * np.log(w.contrast).sum()
        misfit = float(gram[0, 0] - left @ left)
        log_base = float(-0.5 * misfit - np.log(np.diag(factor)).sum() - log_noise)
        none = Growing(np.zeros((0, kb + count)))
        return _Integrated(turn, left, log_base, misfit, none)

    def _grown(self, level: NoiseLevel, beside: Sequence[Array]) -> NoiseLevel:
        """A level with further columns, block by block, of which the products (c, p) with its base
        are known."""
        base = self._bases[level.number]
        rows = slice(1, 1 + base.turn.shape[1])
        fresh = [products[rows].T @ base.turn.T for products in beside]  # as the pool keeps them
        moments = [b[0] - own @ base.left for b, own in zip(beside, fresh, strict=True)]
        base.pool.put(fresh)
        both = np.concatenate([level.moment, *moments])
        return replace(level, moment=both, taken=np.zeros((0, len(both))))


_FEW = 8  # kinds of rows


def hold_part(rows: Rows) -> float:
    """Share of an imperfection that a hold, or a stretch of a running recording, has to itself."""
    return _CONTINUOUS_HOLD_PART if rows.continuous else HOLD_PART


def _groups(noise: Array) -> tuple[slice, ...]:
    """Rows in ascending order of their noise whose noise is the same; none where hardly any is."""
    edges = np.flatnonzero(np.diff(noise) > 1e-12 * noise[1:]) + 1
    if len(edges) >= _FEW:
        return ()
    return tuple(slice(a, b) for a, b in pairwise([0, *edges.tolist(), len(noise)]) if a < b)


@dataclass(frozen=True, eq=False)
class _Integrated:
    """Turn (k, k): the prior root of base and imperfection over the Cholesky factor of their
    precision, `L^-1 root^T`; what the target (k,) and the pool (p, k) share with them, evidence of
    the base alone, and its misfit (as of a `NoiseLevel`)."""

    turn: Array
    left: Array
    log_base: float
    misfit: float
    pool: Growing

    def of(self, which: Sequence[int]) -> tuple[Array, Array]:
        """Posterior mean (m,) and covariance (m, m) of coefficients of the base alone."""
        turn = self.turn[:, list(which)]
        return turn.T @ self.left, turn.T @ turn


def eta_levels(bench: Bench, base: Base, target: Array) -> Array:
    """(l,) m: sizes of the imperfection on which evidence is computed. 0, then by factors of `STEP`
    from half the stated uncertainty of a sample to what the base alone leaves of the target
    (size,)."""
    start = 0.5 * bench.noise.stated
    left = structural_rms(bench, base, target)
    count = max(3, int(np.ceil(np.log(max(1.5 * left / start, 1.0)) / LOG_STEP)) + 1)
    return np.concatenate([[0.0], start * STEP ** np.arange(count)])


def structural_rms(bench: Bench, base: Base, target: Array) -> float:
    """rms (m) of the response that the base alone leaves at its best."""
    n, sigma = bench.rows.n, bench.sigma
    A = base.columns * base.sd / sigma[:, None]
    beta = base.sd * np.linalg.solve(A.T @ A + np.eye(len(base.sd)), A.T @ (target / sigma))
    return bench.rows.rms((target - base.columns @ beta)[:n])


def _variance(bench: Bench) -> float:
    """Mean square (m^2) of the response about its mean per setup: a law that does more, as what
    yields far beyond its threshold on an imposed path, is no further off for that."""
    return bench.rows.rms_about_means(bench.response) ** 2
