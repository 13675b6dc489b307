"""Straight lines through points that are uncertain in one or in both coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.arrays import Array

MAX_ITERATIONS = 200
RELATIVE_CHANGE = 1e-13


@dataclass(frozen=True)
class LineFit:
    """y = intercept + slope x.

    covariance: (2, 2), of (intercept, slope), from the stated standard uncertainties alone; zero
    row and column for an intercept that was held at zero. chi2: sum of squared weighted residuals;
    dof: points minus parameters; residuals: (n,) y - intercept - slope x. converged: False only
    when an iterative fit did not settle.
    """

    slope: float
    intercept: float
    covariance: Array
    chi2: float
    dof: int
    residuals: Array
    converged: bool = True

    @property
    def u_slope(self) -> float:
        """Standard uncertainty of the slope from the stated ones."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def u_intercept(self) -> float:
        """Standard uncertainty of the intercept from the stated ones."""
        return float(np.sqrt(self.covariance[0, 0]))


def weighted_line(x: Array, y: Array, s: Array, *, intercept: bool) -> LineFit:
    """Minimises sum(((y - a - b x) / s)^2); a = 0 without intercept.

    x, y, s: (n,), s > 0 the standard uncertainties of y; x is taken as exact. Moments are centred
    on the weighted means, so that a line far from the origin loses no digits.
    Raises ValueError for fewer than 2 points (1 without intercept), no spread in x, or s <= 0.
    """
    _check(x, y, s, 2 if intercept else 1)
    w = (s.min() / s) ** 2
    x0 = float(w @ x / w.sum()) if intercept else 0.0
    y0 = float(w @ y / w.sum()) if intercept else 0.0
    xx = float(w @ (x - x0) ** 2)
    if not xx > 0:
        raise ValueError("a line needs points at different x; all of them lie at one")
    slope = float(w @ ((x - x0) * (y - y0))) / xx
    offset = y0 - slope * x0
    scale = float(s.min()) ** 2
    covariance = np.zeros((2, 2))
    covariance[1, 1] = scale / xx
    if intercept:
        covariance[0, 0] = scale / w.sum() + x0 * x0 * scale / xx
        covariance[0, 1] = covariance[1, 0] = -x0 * scale / xx
    residuals = y - offset - slope * x
    chi2 = float(np.sum((residuals / s) ** 2))
    return LineFit(slope, offset, covariance, chi2, x.size - 1 - int(intercept), residuals)


def york_line(x: Array, y: Array, sx: Array, sy: Array, *, intercept: bool = True) -> LineFit:
    """Line through points uncertain in both coordinates; the generalised least-squares estimate.

    The unified equations of York, Evensen, Martinez, Delgado, Am. J. Phys. 72 (2004) 367, eqs. 13,
    for errors of a point in x and in y that are independent of each other. Without intercept the
    same equations hold with the weighted means replaced by the origin.
    x, y, sx, sy: (n,), sx > 0 and sy > 0 standard uncertainties. A fit that does not settle is
    returned with `converged` False.
    Raises ValueError as `weighted_line` does.
    """
    _check(x, y, sx, 2)
    _check(x, y, sy, 2)
    wx, wy = sx**-2.0, sy**-2.0
    slope = weighted_line(x, y, sy, intercept=intercept).slope
    converged = False
    for _ in range(MAX_ITERATIONS):
        w, beta, x0, y0 = _york_terms(x, y, wx, wy, slope, intercept)
        previous, slope = slope, float((w * beta) @ (y - y0) / ((w * beta) @ (x - x0)))
        if abs(slope - previous) <= RELATIVE_CHANGE * abs(slope):
            converged = True
            break
    w, beta, x0, y0 = _york_terms(x, y, wx, wy, slope, intercept)
    offset = y0 - slope * x0
    adjusted = x0 + beta
    centre = float(w @ adjusted / w.sum()) if intercept else 0.0
    var_slope = 1.0 / float(w @ (adjusted - centre) ** 2)
    covariance = np.zeros((2, 2))
    covariance[1, 1] = var_slope
    if intercept:
        covariance[0, 0] = 1.0 / float(w.sum()) + centre**2 * var_slope
        covariance[0, 1] = covariance[1, 0] = -centre * var_slope
    residuals = y - offset - slope * x
    chi2 = float(w @ residuals**2)
    dof = x.size - 1 - int(intercept)
    return LineFit(slope, offset, covariance, chi2, dof, residuals, converged)


def _york_terms(
    x: Array, y: Array, wx: Array, wy: Array, slope: float, intercept: bool
) -> tuple[Array, Array, float, float]:
    """Weights, adjusted x about the centre, and the centre, at a given slope (York eqs. 13b, c)."""
    w = wx * wy / (wx + slope**2 * wy)
    x0 = float(w @ x / w.sum()) if intercept else 0.0
    y0 = float(w @ y / w.sum()) if intercept else 0.0
    dx, dy = x - x0, y - y0
    beta = w * (dx / wy + slope * dy / wx)
    return w, beta, x0, y0


def _check(x: Array, y: Array, s: Array, least: int) -> None:
    if not (x.shape == y.shape == s.shape and x.ndim == 1):
        raise ValueError(f"x, y and s must be of one length; got {x.shape}, {y.shape}, {s.shape}")
    if x.size < least:
        raise ValueError(f"a line needs at least {least} points; got {x.size}")
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        raise ValueError("x and y must be finite numbers")
    if not (np.all(s > 0) and np.all(np.isfinite(s))):
        raise ValueError("standard uncertainties must be finite and above 0")
