"""Factors of matrices whose rounding is larger than 1."""

from __future__ import annotations

import numpy as np

from identification.gap.evidence.factor import factor_of


def test_a_sound_matrix_has_its_own_factor() -> None:
    inner = np.eye(3) + np.outer([1.0, 2.0, -1.0], [1.0, 2.0, -1.0])
    np.testing.assert_array_equal(factor_of(inner), np.linalg.cholesky(inner))


def test_what_rounding_took_is_put_back() -> None:
    """Two columns that are the same, a thousand million times the noise, beside a plain one."""
    one = np.full((2, 2), 1e18)
    one[0, 1] = one[1, 0] = 1e18 + 1024.0  # which no sum of squares gives
    factor = factor_of(np.stack([one, np.eye(2)]))
    np.testing.assert_allclose(factor[0] @ factor[0].T, one, rtol=1e-9)
    assert factor[0, 1, 1] ** 2 > 1e4  # what a number of that size can tell from nothing
    np.testing.assert_allclose(factor[1], np.eye(2), atol=1e-12)
