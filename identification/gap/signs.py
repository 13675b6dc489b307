"""What it costs that coefficients keep the signs physics wants: log of the share of the posterior
that does, over that of the prior.

A sum of coefficients is wanted above a limit, some coefficients each above zero. Sum and
coefficients alone have exact shares of the normal distribution; together they count as independent,
but never for more than the half-space nearest to the mean that holds the quadrant of the sum and
one coefficient (a convex set at Mahalanobis distance d has at most the share Phi(-d)): where only
the sum of two is known, one may not turn negative to pay for the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.gap.data import Array, Flags

_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Signs:
    """Of v variants with k coefficients: sums (v, k), weights of the sum that is wanted above least
    (v,) where wanted (v,); each (v, k): coefficients that are wanted above zero."""

    sums: Array
    least: Array
    wanted: Flags
    each: Flags


def log_odds(signs: Signs, before: Array, mean: Array, roots: Array) -> Array:
    """(v, s) for coefficients of mean (v, s, k) and covariance `roots' roots`, roots (v, s, r, k);
    before (v, s): standard deviation of the sum in the prior."""
    from scipy.special import log_ndtr

    along = (roots @ signs.sums[:, None, :, None])[..., 0]  # (v, s, r)
    total = (mean @ signs.sums[:, :, None])[..., 0] - signs.least[:, None]
    after = np.sqrt(np.sum(along**2, axis=2)) + _TINY
    share = log_ndtr(-signs.least[:, None] / (before + _TINY))
    out = np.where(signs.wanted[:, None], log_ndtr(total / after) - share, 0.0)
    some = signs.each.any(axis=1) & signs.wanted
    if some.any():
        each = np.broadcast_to(signs.each[some][:, None, :], mean[some].shape)
        z, away = _apart(mean[some], roots[some], total[some], along[some])
        alone = np.zeros(z.shape)
        wrong = each & (z < 0)  # the right sign costs nothing
        alone[wrong] = log_ndtr(z[wrong]) - np.log(0.5)
        nearest = np.max(away, axis=2, where=each, initial=0.0)
        bound = np.where(nearest > 0, log_ndtr(-nearest) - share[some], np.inf)
        out[some] = np.minimum(out[some] + alone.sum(axis=2), bound)
    return np.asarray(out)


def _apart(mean: Array, roots: Array, total: Array, along: Array) -> tuple[Array, Array]:
    """(v, s, k) of every coefficient: mean over standard deviation, and the Mahalanobis distance of
    it and the sum from where both are positive."""
    a, b = mean, total[..., None]
    aa = np.sum(roots**2, axis=2) + _TINY
    bb = np.sum(along**2, axis=2)[..., None] + _TINY
    ab = np.minimum(np.maximum((along[..., None, :] @ roots)[..., 0, :], -_NEAR * np.sqrt(aa * bb)),
                    _NEAR * np.sqrt(aa * bb))  # fmt: skip
    corner = (a**2 * bb - 2 * a * b * ab + b**2 * aa) / (aa * bb - ab**2)
    square = np.where((a < 0) & (b - ab / aa * a >= 0), a**2 / aa, corner)
    square = np.where((b < 0) & (a - ab / bb * b >= 0), b**2 / bb, square)
    square = np.where((a >= 0) & (b >= 0), 0.0, square)
    return a / np.sqrt(aa), np.sqrt(np.maximum(square, 0.0))


_NEAR = 1 - 1e-9  # as correlated as two may be
