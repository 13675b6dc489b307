"""Most probable coefficients of base and chosen effects, with covariance; on some rows or all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.gap.data import Array, Flags
from identification.gap.evidence import HOLD_PART, ROW_PART, Engine
from identification.gap.parts import Part, block
from identification.gap.search import Explanation

_LEVER_M = 0.3
_WIDER = 3.0


@dataclass(frozen=True, eq=False)
class Fit:
    """effects: coefficients (k,) and covariance (k, k) of the parts' columns, one after the other.

    base (b,): of the base's columns; joint_covariance (b + k, b + k): of base and effects together.
    response (n,): fitted response beyond the prior simulation; effect (n,): the effects' part.
    """

    parts: tuple[Part, ...]
    base: Array
    joint_covariance: Array
    coefficients: Array
    covariance: Array
    response: Array
    effect: Array

    def of(self, index: int) -> tuple[Array, Array]:
        """Coefficients and covariance of one part."""
        start = sum(len(p.variant.columns) for p in self.parts[:index])
        s = slice(start, start + len(self.parts[index].variant.columns))
        return self.coefficients[s], self.covariance[s, s]

    def contribution(self, engine: Engine, index: int) -> Array:
        """(size,) stacked contribution of one part."""
        w, _ = self.of(index)
        columns = list(self.parts[index].variant.columns)
        return np.asarray(engine.pool[:, columns] @ w)


def fit(engine: Engine, explanation: Explanation, keep: Flags | None = None) -> Fit:
    """Posterior mean under the explanation's imperfection. keep (size,): rows to fit on."""
    bench, n = engine.bench, engine.bench.rows.n
    keep = np.ones(bench.layout.size, dtype=bool) if keep is None else keep
    columns = [c for p in explanation.parts for c in p.variant.columns]
    E = engine.pool[:, columns]
    # The imperfection counts as noise here and may not take over what the effects can give;
    # priors are widened, since this is a fit and no comparison any more.
    roots = [np.diag(engine.base.sd), *[_WIDER * p.root for p in explanation.parts]]
    X = np.column_stack([engine.base.columns, E])
    root = block(roots)
    gram, moment = _normal(engine, X @ root, explanation.eta, keep)
    precision = gram + np.eye(len(gram))
    covariance = root @ np.linalg.solve(precision, root.T)
    beta = root @ np.linalg.solve(precision, moment)
    kb = engine.base.columns.shape[1]
    w = beta[kb:]
    effect = (E @ w)[:n]
    return Fit(
        parts=explanation.parts,
        base=beta[:kb],
        joint_covariance=covariance,
        coefficients=w,
        covariance=covariance[kb:, kb:],
        response=(engine.base.columns @ beta[:kb])[:n] + effect,
        effect=effect,
    )


def _normal(engine: Engine, X: Array, eta: float, keep: Flags) -> tuple[Array, Array]:
    """`X' V^-1 X` and `X' V^-1 y` over the rows kept; V: noise of rows, and common to holds."""
    key, common = _holds(engine, eta)
    sigma2 = engine.sigma**2
    n = engine.bench.rows.n
    sigma2[:n] += (ROW_PART * eta) ** 2 / np.maximum(engine.bench.rows.weight, 1.0)
    p = np.where(keep, 1 / sigma2, 0.0)
    y = engine.target
    held = np.flatnonzero((common > 0) & keep)
    order = held[np.argsort(key[held], kind="stable")]
    gram, moment = (X * p[:, None]).T @ X, X.T @ (p * y)
    if not order.size:
        return gram, moment
    edges = np.flatnonzero(np.concatenate([[True], np.diff(key[order]) != 0]))
    weight = np.add.reduceat(p[order], edges)
    sums = np.add.reduceat(X[order] * p[order, None], edges, axis=0)
    target = np.add.reduceat(p[order] * y[order], edges)
    h2 = common[order][edges] ** 2
    shrink = h2 / (1 + h2 * weight)
    return gram - (sums * shrink[:, None]).T @ sums, moment - sums.T @ (shrink * target)


def _holds(engine: Engine, eta: float) -> tuple[Array, Array]:
    """Per stacked row: number of its hold (per channel), standard deviation common to the hold."""
    bench, n = engine.bench, engine.bench.rows.n
    size = bench.layout.size
    key, common = np.arange(size) + float(n), np.zeros(size)
    key[:n] = bench.rows.hold
    common[bench.layout.q] = eta / _LEVER_M
    common[:n] = np.hypot(bench.noise.hold, HOLD_PART * eta)
    return np.asarray(key, dtype=float), common
