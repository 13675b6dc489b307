"""Factors of what an evidence is made of, and what columns span."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array


def factor_of(inner: Array) -> Array:
    """Lower factors (..., k, k) of matrices `1 + A` in which no A takes anything away. Where a gap
    is ten thousands of times the noise, rounding brings eigenvalues below 1: they are put back."""
    try:
        return np.asarray(np.linalg.cholesky(inner))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh((inner + np.swapaxes(inner, -1, -2)) / 2)
        least = np.maximum(1.0, _ROUNDING * values[..., -1:])
        mended = (vectors * np.maximum(values, least)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
        return np.asarray(np.linalg.cholesky(mended))


_ROUNDING = 1e-13  # of the largest eigenvalue: what is below that a factor can't tell from nothing


def span_of(columns: Array) -> Array:
    """(n, r) orthonormal basis of what columns (n, k) span: some say the same, and what rounding
    leaves of those is no direction."""
    size = np.linalg.norm(columns, axis=0)
    basis, values, _ = np.linalg.svd(columns / np.where(size > 0, size, 1.0), full_matrices=False)
    return basis[:, values > _SAME * values.max(initial=0.0)]


_SAME = 1e-9  # of the largest singular value: what adds less to a span is there already
