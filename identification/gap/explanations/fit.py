"""Most probable coefficients of base and chosen effects, with covariance; on some rows or all."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.evidence.alike import level_columns, run_columns
from identification.gap.evidence.engine import LEVER_M, ROW_PART, RUN_PART, Engine, hold_part
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.model.variants import block
from identification.gap.recording.turns import rises

_LATER = 3  # rows of a hold from here on count as one


@dataclass(frozen=True, eq=False)
class Fit:
    """coefficients (k,), covariance (k, k): of the parts' columns, one after the other.

    base (b,): of the base's columns; joint_covariance (b + k, b + k): of base and effects together.
    pulls (b + k,): all of them in the coordinates in which their prior is standard normal.
    response (n,): fitted response beyond the prior simulation; effect (n,): the effects' part.
    """

    parts: tuple[Part, ...]
    base: Array
    pulls: Array
    joint_covariance: Array
    coefficients: Array
    covariance: Array
    response: Array
    effect: Array

    def of(self, index: int) -> tuple[Array, Array]:
        """Coefficients and covariance of one part."""
        s = self._where(index)
        return self.coefficients[s], self.covariance[s, s]

    def pulls_of(self, index: int) -> Array:
        """`pulls` of one part."""
        return self.pulls[self.among_all(index)]

    def moved(self, engine: Engine, index: int, by: Array) -> Array:
        """(n,) m by which the fitted response moves where the coefficients of one part move by (k,)
        and all others follow as the data let them."""
        start, mine = len(self.base), self.among_all(index)
        pulled = np.linalg.pinv(self.joint_covariance[mine, mine], hermitian=True) @ by
        every = self.joint_covariance[:, mine] @ pulled
        columns = engine.columns(c for p in self.parts for c in p.variant.columns)
        moves = engine.base.columns @ every[:start] + columns @ every[start:]
        return np.asarray(moves[: engine.bench.rows.n])

    def among_all(self, index: int) -> slice:
        """Where the coefficients of one part are among those of base and effects."""
        start, mine = len(self.base), self._where(index)
        return slice(start + mine.start, start + mine.stop)

    def _where(self, index: int) -> slice:
        start = sum(len(p.variant.columns) for p in self.parts[:index])
        return slice(start, start + len(self.parts[index].variant.columns))

    def whole(self, engine: Engine) -> Array:
        """(n,) m: the response that simulation, base and effects give together."""
        bench = engine.bench
        return np.asarray(bench.response - engine.target[: bench.rows.n] + self.response)

    def beyond_known(self, engine: Engine) -> Array:
        """(n,) m: what `whole` has beside the effects, as large as stated, that the simulation has
        beside its springs."""
        bench, whole = engine.bench, self.whole(engine)
        return whole if bench.known is None else whole - bench.known.does[: bench.rows.n]

    def missed_readings(self, engine: Engine) -> tuple[Array, Array]:
        """(m, holds) rad by which it misses the joint readings, and (m, holds) rad their noise; of
        no holds without readings."""
        bench, q = engine.bench, engine.bench.layout.q
        missed = self._missed(engine)[q].reshape(bench.data.joints, -1)
        noise = engine.sigma[q].reshape(missed.shape)
        return missed, np.hypot(noise, bench.noise.q_run)

    def missed_responses(self, engine: Engine) -> Array:
        """(n,) by how many standard deviations it misses the response, of noise of rows and of what
        holds and runs have in common."""
        noise, n = engine.bench.noise, engine.bench.rows.n
        sd = np.sqrt(engine.sigma[:n] ** 2 + noise.hold**2 + noise.run**2)
        return np.asarray(self._missed(engine)[:n] / sd)

    def missed_zeros(self, engine: Engine) -> Array:
        """(z,) by how many standard deviations it misses the force that was read without load; of
        none where that is no channel."""
        zero = engine.bench.layout.zero_force
        return np.asarray((self._missed(engine) / engine.sigma)[zero])

    def _missed(self, engine: Engine) -> Array:
        """(size,) of all channels, what it leaves."""
        columns = engine.columns(c for p in self.parts for c in p.variant.columns)
        gives = engine.base.columns @ self.base + columns @ self.coefficients
        return np.asarray(engine.target - gives)

    def together(self, engine: Engine, words: Collection[str]) -> Array:
        """(n,) m what the effects of these words do to the response."""
        n = engine.bench.rows.n
        mine = [i for i, p in enumerate(self.parts) if p.word in words]
        return sum((self.contribution(engine, i)[:n] for i in mine), np.zeros(n))

    def contribution(self, engine: Engine, index: int) -> Array:
        """(size,) stacked contribution of one part."""
        w, _ = self.of(index)
        return np.asarray(engine.columns(self.parts[index].variant.columns) @ w)


def fit(
    engine: Engine, explanation: Explanation, keep: Flags | None = None, *, alike: bool = False
) -> Fit:
    """Posterior mean under the explanation's imperfection. keep (size,): rows to fit on.

    alike: the covariance also counts that a law errs alike along a run and from run to run: the
    same estimate `b = H^-1 X' V^-1 y`, under noise `V + C C'` instead of V, scatters by
    `H^-1 X' V^-1 C C' V^-1 X H^-1` more.
    """
    bench, n = engine.bench, engine.bench.rows.n
    keep = np.ones(bench.layout.size, dtype=bool) if keep is None else keep
    columns = [c for p in explanation.parts for c in p.variant.columns]
    E = engine.columns(columns)
    # The imperfection counts as noise here and may not take over what the effects can give.
    effects = block([p.root for p in explanation.parts])
    root = block([np.diag(engine.base.sd), effects])
    X = np.hstack([engine.base.columns * engine.base.sd, E @ effects])
    precise = weighed(engine, X, explanation.eta, keep)
    moment = precise.T @ engine.target
    both = np.linalg.solve(precise.T @ X + np.eye(len(root)), np.column_stack([root.T, moment]))
    solved, pulls = both[:, :-1], both[:, -1]  # H^-1 root'
    covariance = root @ solved
    beta = root @ pulls
    kb = engine.base.columns.shape[1]
    w = beta[kb:]
    if alike and explanation.eta > 0:
        errs = _imperfection_columns(engine, explanation.parts, w, explanation.eta)
        moves = solved.T @ (precise.T @ errs)
        covariance = covariance + moves @ moves.T
    effect = (E @ w)[:n]
    return Fit(
        parts=explanation.parts,
        base=beta[:kb],
        pulls=np.asarray(pulls),
        joint_covariance=covariance,
        coefficients=w,
        covariance=covariance[kb:, kb:],
        response=(engine.base.columns @ beta[:kb])[:n] + effect,
        effect=effect,
    )


def _imperfection_columns(engine: Engine, parts: tuple[Part, ...], w: Array, eta: float) -> Array:
    """(size, c) columns with independent unit coefficients: what an imperfection of eta m does that
    repeats from run to run, that a run has to itself (`engine`), and that all
    holds have in common: in their first rows and in later ones, after rises and falls of the load,
    the same everywhere and a share of what the law itself does there."""
    if "imperfection" not in engine.cache:
        levels = level_columns(engine.bench) @ engine.level_root
        runs = RUN_PART * run_columns(engine.bench)
        begin = [engine.bench.stacked(m.astype(float)) for m in _phases(engine)]
        engine.cache["imperfection"] = np.column_stack([levels, runs, *begin])
    rows = engine.bench.rows
    columns = engine.columns(c for p in parts for c in p.variant.columns)
    moved = rows.about_means(columns[: rows.n] @ w)
    size = rows.rms(moved)
    own = [engine.bench.stacked(moved * m / size) for m in _phases(engine) if size > 0]
    return eta * np.column_stack([engine.cache["imperfection"], *own])


def _phases(engine: Engine) -> list[Flags]:
    """Rows (n,) by their place in the hold and by whether the load rose or fell before it."""
    bench, rows = engine.bench, engine.bench.rows
    if rows.continuous:
        up = rises(np.abs(bench.load))
        return [up, ~up]
    first = rows.edges[rows.hold]
    place = np.minimum(np.arange(rows.n) - first, _LATER)
    up = np.abs(bench.load[first]) >= np.abs(bench.load[np.maximum(first - 1, 0)])
    masks = [(place == k) & way for k in range(_LATER + 1) for way in (up, ~up)]
    return [m for m in masks if m.any()]


def weighed(engine: Engine, X: Array, eta: float, keep: Flags | None = None) -> Array:
    """`V^-1 X` (size, k), zero in rows that are not kept (size,), by default none; V: noise of
    rows, and common to holds, with an imperfection of eta m."""
    keep = np.ones(engine.bench.layout.size, dtype=bool) if keep is None else keep
    key, common = _holds(engine, eta)
    sigma2 = engine.sigma**2
    n = engine.bench.rows.n
    sigma2[:n] += (ROW_PART * eta) ** 2  # more samples of the same row are as far off
    sigma2[engine.bench.layout.q] += (eta / LEVER_M) ** 2
    p = np.where(keep, 1 / sigma2, 0.0)
    out = X * p[:, None]
    held = np.flatnonzero((common > 0) & keep)
    order = held[np.argsort(key[held], kind="stable")]
    if not order.size:
        return out
    starts = np.concatenate([[True], np.diff(key[order]) != 0])
    edges = np.flatnonzero(starts)
    h2 = common[order][edges] ** 2
    shrink = h2 / (1 + h2 * np.add.reduceat(p[order], edges))
    sums = np.add.reduceat(out[order], edges, axis=0) * shrink[:, None]
    out[order] -= p[order, None] * sums[np.cumsum(starts) - 1]
    return out


def _holds(engine: Engine, eta: float) -> tuple[Array, Array]:
    """Per stacked row: number of its hold (of readings of a joint: of its run), and standard
    deviation common to it."""
    bench, n = engine.bench, engine.bench.rows.n
    size = bench.layout.size
    key, common = np.arange(size) + float(n), np.zeros(size)
    key[:n] = bench.rows.hold
    q, joints = bench.layout.q, bench.data.joints
    if q.stop > q.start:
        run = bench.rows.run[bench.rows.edges]
        key[q] = n + size + (np.arange(joints)[:, None] * (run.max() + 1) + run).ravel()
        common[q] = bench.noise.q_run
    common[:n] = np.hypot(bench.noise.hold, hold_part(bench.rows) * eta)
    return np.asarray(key, dtype=float), common
