"""Figures of merit of a campaign: rates with intervals, calibration, ranking."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.uncertainty import TWO_SIDED

BINS = 10


def wilson(hits: int, n: int) -> tuple[float, float]:
    """95 % interval of a rate (Wilson 1927); (0, 1) where there is nothing to judge by."""
    if n == 0:
        return 0.0, 1.0
    p, z2 = hits / n, TWO_SIDED**2
    centre = (p + z2 / (2 * n)) / (1 + z2 / n)
    half = TWO_SIDED / (1 + z2 / n) * np.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
    return max(0.0, float(centre - half)), min(1.0, float(centre + half))


def rate(flags: Iterable[bool]) -> dict[str, Any]:
    """Share of true ones: value (None of nothing), ci95, hits, n."""
    all_ = list(flags)
    hits = sum(all_)
    low, high = wilson(hits, len(all_))
    return {
        "value": hits / len(all_) if all_ else None,
        "ci95": [low, high],
        "hits": hits,
        "n": len(all_),
    }


def quantiles(values: Iterable[float], *shares: float) -> list[float | None]:
    """Quantiles; None of nothing."""
    all_ = [v for v in values if np.isfinite(v)]
    if not all_:
        return [None] * len(shares)
    return [float(q) for q in np.quantile(all_, shares)]


def auroc(positive: Sequence[float], negative: Sequence[float]) -> float | None:
    """Probability that a positive ranks above a negative, ties half (Mann-Whitney)."""
    if not positive or not negative:
        return None
    p, n = np.asarray(positive)[:, None], np.asarray(negative)[None, :]
    return float(np.mean((p > n) + 0.5 * (p == n)))


def reliability(confidence: Sequence[float], right: Sequence[bool]) -> list[dict[str, Any]]:
    """Ten bins of equal width over 0..1: n, mean confidence, share right; empty ones left out."""
    c, r = np.asarray(confidence, dtype=float), np.asarray(right, dtype=float)
    number = _bin(c)
    out = []
    for b in range(BINS):
        mine = number == b
        if mine.any():
            hits, n = int(r[mine].sum()), int(mine.sum())
            out.append(
                {
                    "from": b / BINS,
                    "to": (b + 1) / BINS,
                    "n": n,
                    "confidence": float(c[mine].mean()),
                    "right": hits / n,
                    "ci95": list(wilson(hits, n)),
                }
            )
    return out


def _bin(confidence: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.minimum((confidence * BINS).astype(np.int64), BINS - 1)


def ece(confidence: Sequence[float], right: Sequence[bool]) -> float | None:
    """Expected calibration error: mean over the cases of |confidence - share right| of the bin."""
    table = reliability(confidence, right)
    total = sum(row["n"] for row in table)
    if not total:
        return None
    return float(sum(row["n"] * abs(row["confidence"] - row["right"]) for row in table) / total)


def ece_by_chance(confidence: Sequence[float]) -> list[float | None]:
    """Mean and 95th percentile of the calibration error that as many cases show when every one of
    these probabilities is right: bins of a few cases are off by chance."""
    if not len(confidence):
        return [None, None]
    c = np.asarray(confidence, dtype=float)
    number = _bin(c)
    right = np.random.default_rng(0).random((_DRAWS, len(c))) < c
    off = [np.abs((right[:, number == b] - c[number == b]).sum(axis=1)) for b in range(BINS)]
    found = np.sum(off, axis=0) / len(c)
    return [float(found.mean()), float(np.quantile(found, 0.95))]


_DRAWS = 4000
