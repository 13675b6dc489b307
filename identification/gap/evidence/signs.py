"""What it costs that coefficients keep the limits physics sets: log of the share of the posterior
that does, over that of the prior.

The first limit, on a sum of coefficients, has its exact share of the normal distribution. Further
ones (single coefficients above zero, a place within its play, a stiffness that is left) count as
independent, but together with the first never for more than the half-space nearest to the mean that
holds both: a convex set at Mahalanobis distance d has at most the share Phi(-d). Where only the sum
of two is known, one may not turn negative to pay for the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, Flags, Ints
from identification.gap.model.variants import Variant

_TINY = 1e-300
_NONE, _NOWHERE = 1e-14, 1e9  # below it that is rounding: no mean keeps all limits; so far then
_KEPT = 6.0  # standard deviations: so far on its right side none costs anything
_NEAR = 1 - 1e-9  # as correlated as two may be


@dataclass(frozen=True, eq=False)
class Limits:
    """Of v variants with k coefficients w: rows (v, m, k), `rows w > floor` (v, m) where asked
    (v, m)."""

    rows: Array
    floor: Array
    asked: Flags

    @classmethod
    def of(cls, variants: Sequence[Variant], k: int | None = None) -> Limits:
        """k: coefficients, where that is more than any of them has."""
        k = k or max(len(v.columns) for v in variants)
        most = max(sum(v.each) + len(v.within) for v in variants)
        rows = np.zeros((len(variants), 1 + most, k))
        floor = np.zeros(rows.shape[:2])
        asked = np.zeros(rows.shape[:2], dtype=bool)
        for i, v in enumerate(variants):
            own, alone = len(v.columns), [k for k, each in enumerate(v.each) if each]
            if v.positive is not None:
                rows[i, 0, :own], floor[i, 0], asked[i, 0] = v.positive, v.least, True
            rows[i, range(1, 1 + len(alone)), alone] = 1.0
            sums = slice(1 + len(alone), 1 + len(alone) + len(v.within))
            if len(v.within):
                rows[i, sums, :own], floor[i, sums] = v.within, v.floor
            asked[i, 1 : sums.stop] = True
        return cls(rows, floor, asked)

    @classmethod
    def joined(cls, parts: Sequence[Limits]) -> Limits:
        """The variants of all parts, one after the other."""
        return cls(
            padded([part.rows for part in parts]),
            padded([part.floor for part in parts]),
            padded([part.asked for part in parts]),
        )


def padded(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """(v, m, ...) of all parts (v_i, m_i, ...), one after the other; zero where a part is narrower
    than the widest. np.pad would take five times as long."""
    most = max(part.shape[1] for part in parts)
    first = parts[0]
    out = np.zeros((sum(map(len, parts)), most, *first.shape[2:]), dtype=first.dtype)
    at = 0
    for part in parts:
        out[at : at + len(part), : part.shape[1]] = part
        at += len(part)
    return out


def log_odds(limits: Limits, which: Ints, before: Array, sums: Array, roots: Array) -> Array:
    """(n,) for variants which (n,): sums (n, m), what `rows w` is at the mean of the coefficients,
    of covariance `roots roots'`, roots (n, m, r); before (n, m): standard deviations of the sums in
    the prior."""
    from scipy.special import log_ndtr

    asked, centre = limits.asked[which], sums - limits.floor[which]
    variance = np.where(asked, np.einsum("nmr,nmr->nm", roots, roots) + _TINY, 1.0)
    z = centre / np.sqrt(variance)
    shares = log_shares(limits, which, before)
    share = shares[:, 0]
    out = np.where(asked[:, 0], log_ndtr(z[:, 0]) - share, 0.0)
    near = (z[:, 1:] < _KEPT) & asked[:, 1:]
    alone = np.zeros(near.shape)  # a limit that is kept earns nothing
    alone[near] = np.minimum(log_ndtr(z[:, 1:][near]) - shares[:, 1:][near], 0.0)
    out += alone.sum(axis=1)
    wrong = np.any((z < 0) & asked, axis=1)
    far = np.flatnonzero(wrong & asked[:, 0])
    if far.size and len(asked.T) > 1:
        first, more = (centre[far, :1], variance[far, :1]), (centre[far, 1:], variance[far, 1:])
        common = np.einsum("nr,nmr->nm", roots[far, 0], roots[far, 1:])
        apart = np.where(asked[far, 1:], _distance(*more, *first, common), 0.0).max(axis=1)
        bound = np.where(apart > 0, log_ndtr(-apart) - share[far], np.inf)
        out[far] = np.minimum(out[far], bound)
    return np.asarray(out)


def log_odds_together(
    limits: Limits, which: Ints, before: Array, sums: Array, roots: Array
) -> Array:
    """(n,) what the same can't exceed by all limits at once; inf where it is not worth a look: one
    that is wrong may be set right by others that are then far off."""
    from scipy.special import log_ndtr

    asked, centre = limits.asked[which], sums - limits.floor[which]
    size = np.where(asked, np.linalg.norm(roots, axis=2) + _TINY, 1.0)
    z, unit = centre / size, roots / size[:, :, None]
    out = np.full(len(z), np.inf)
    some = np.flatnonzero(np.any((z < 0) & asked, axis=1) & (asked.sum(axis=1) > 1))
    if some.size:
        far = _distances(np.where(asked[some], z[some], np.inf), unit[some])
        out[some] = log_ndtr(-far) - log_shares(limits, which[some], before[some]).sum(axis=1)
    return out


def log_shares(limits: Limits, which: Ints, before: Array) -> Array:
    """(n, m) log of the share of the prior that keeps each limit; 0 where none is asked."""
    from scipy.special import log_ndtr

    share = log_ndtr(-limits.floor[which] / (before + _TINY))
    return np.where(limits.asked[which], share, 0.0)


class Kept(NamedTuple):
    """Limits (m,) of one part: sums, by how much each is kept at the mean; roots (m, r) of their
    covariance; log_shares of the prior that keep them."""

    sums: Array
    roots: Array
    log_shares: Array


def all_kept(limits: Sequence[Kept]) -> float:
    """log of the largest share that several parts' limits may have together, over the least that
    they had in the prior, where all were independent."""
    from scipy.special import log_ndtr

    sums, roots, shares = (np.concatenate(each) for each in zip(*limits, strict=True))
    size = np.linalg.norm(roots, axis=1) + _TINY
    far = distance(sums / size, roots / size[:, None])
    return float(log_ndtr(-far) - shares.sum())


def distance(z: Array, unit: Array) -> float:
    """Mahalanobis distance of a mean from where all its sums z (m,) are positive."""
    return float(np.linalg.norm(nearest(z, unit)))


def nearest(z: Array, unit: Array) -> Array:
    """(r,) shortest way from a mean to where all its sums are positive, z (m,), which grow along
    it by unit (m, r). The least-distance problem of Lawson and Hanson (Solving Least Squares
    Problems, 1974, chapter 23)."""
    from scipy.optimize import lsq_linear, nnls

    m, r = unit.shape
    both, last = np.empty((r + 1, m)), np.zeros(r + 1)
    both[:-1], both[-1], last[-1] = unit.T, -z, 1.0
    try:  # three turns a limit, after which it gives up by itself, are too few now and then
        pushes = nnls(both, last, maxiter=_TURNS * m)[0]
    except RuntimeError:
        pushes = lsq_linear(both, last, (0.0, np.inf), "bvls", max_iter=_TURNS * m).x
    left = both @ pushes - last
    near = float(-left[-1])  # 1 over 1 and the square of the distance
    return np.asarray(left[:-1] / near) if near > _NONE else np.full(r, _NOWHERE)


_TURNS = 100


def _distances(z: Array, unit: Array) -> Array:
    """(n,) the same of many means, z (n, m), inf for a sum that is free, unit (n, m, r): few sums
    are in the way of most, those that the way to the others meets first. What these do not settle
    is left to `distance`, of which a call takes ten times as long."""
    out, left = np.full(len(z), np.nan), z
    todo, on = np.arange(len(z)), np.empty((len(z), 0), dtype=np.intp)
    for held in range(1, _HELD + 1):
        on = np.column_stack([on, left.argmin(axis=1)])
        rows = np.take_along_axis(unit[todo], on[:, :, None], axis=1)
        gram = rows @ np.swapaxes(rows, 1, 2) + _ROUNDING * np.eye(held)
        pushes = np.linalg.solve(gram, -np.take_along_axis(z[todo], on, axis=1)[:, :, None])
        way = np.sum(pushes * rows, axis=1)
        left = z[todo] + np.einsum("nmr,nr->nm", unit[todo], way)
        pushed = np.all(pushes[:, :, 0] >= 0, axis=1)
        there = pushed & np.all(left >= -_REACHED, axis=1)
        out[todo[there]] = np.linalg.norm(way[there], axis=1)
        further = pushed & ~there
        todo, on, left = todo[further], on[further], left[further]
        if not todo.size:
            break
    for i in np.flatnonzero(np.isnan(out)):
        asked = z[i] < np.inf
        out[i] = distance(z[i, asked], unit[i, asked])
    return out


_HELD = 5  # sums that are held at zero, one more at a time: these settle nineteen in twenty
_ROUNDING, _REACHED = 1e-12, 1e-9  # two may be one and the same; standard deviations


def _distance(a: Array, aa: Array, b: Array, bb: Array, ab: Array) -> Array:
    """Mahalanobis distance of means a, b with variances aa, bb and covariance ab from where both
    are positive."""
    most = _NEAR * np.sqrt(aa * bb)
    ab = np.clip(ab, -most, most)
    corner = (a**2 * bb - 2 * a * b * ab + b**2 * aa) / (aa * bb - ab**2)
    square = np.where((a < 0) & (b - ab / aa * a >= 0), a**2 / aa, corner)
    square = np.where((b < 0) & (a - ab / bb * b >= 0), b**2 / bb, square)
    square = np.where((a >= 0) & (b >= 0), 0.0, square)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))
