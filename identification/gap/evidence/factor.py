"""Cholesky factors of what an evidence is made of."""

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
