"""Where an arm gives way: a kink of the loading curve, told from smooth softening.

The curve is described as force over displacement, because a screw imposes the displacement and the
force may stall. Rivals are compared by the Bayesian information criterion: straight and curved
lines that have no kink (polynomials either way round, two saturating laws) against a straight or
curved line that goes on straight, with another slope, behind a kink. A kink is a knee only when
the slope falls to half or less, and only when the best kinked line beats the best smooth one by
`EVIDENCE`: softening by a factor of three without a kink is no knee.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array

EVIDENCE = 10.0  # difference of BIC: odds of about 150 to 1 at equal priors
SLOPE_RATIO = 0.5
# Residuals about a curve within a session fall below the stated uncertainty, which also holds what
# is common to a run; a fit that is better than this share of it is not believed to be better.
NOISE_FLOOR = 0.25
MIN_LEVELS = 6  # the origin included
MIN_BEFORE, MIN_AFTER = 3, 2


@dataclass(frozen=True)
class Samples:
    """Loading levels in order: force N and displacement m, positive, (n,) each, with their standard
    uncertainties. origin: the curve passes through (0, 0), which was measured."""

    force: Array
    displacement: Array
    u_force: Array
    u_displacement: Array
    origin: bool


@dataclass(frozen=True)
class Kink:
    """A fitted kinked line, straight behind the kink. force N, displacement m of the kink; slopes
    N/m just before and behind; u_force, u_displacement: standard uncertainties from the samples'
    stated ones; order: degree of the part before the kink; evidence: BIC of the best smooth rival
    minus its own."""

    force: float
    displacement: float
    k_before: float
    k_after: float
    u_force: float
    u_displacement: float
    order: int
    evidence: float = 0.0


def find_knee(samples: Samples) -> Kink | None:
    """The knee of a loading curve, or None where a smooth line does as well or data are too few."""
    n = samples.force.size
    if n + samples.origin < MIN_LEVELS or not np.all(np.diff(samples.displacement) > 0):
        return None
    sigma = _sigma(samples)
    kinks = [k for order in (1, 2) if (k := _best_kink(samples, sigma, order)) is not None]
    if not kinks:
        return None
    smooth = min(_smooth_bics(samples, sigma))
    # a bend before the kink can swallow the first level behind it: only when the data ask for one
    bic, kink = min(kinks, key=lambda pair: pair[0] + EVIDENCE * (pair[1].order - 1))
    if smooth - bic < EVIDENCE or not kink.k_after <= SLOPE_RATIO * kink.k_before:
        return None
    return Kink(**{**vars(kink), "evidence": smooth - bic})


def locate(samples: Samples, near: Kink) -> Kink | None:
    """The kink of another run of the same curve, of the same form, looked for around `near`."""
    u = samples.displacement
    if u.size + samples.origin < MIN_LEVELS or not np.all(np.diff(u) > 0):
        return None
    span = (0.5 * near.displacement, 2.0 * near.displacement)
    found = _best_kink(samples, _sigma(samples), near.order, span)
    return found[1] if found else None


def _sigma(samples: Samples) -> Array:
    """Standard uncertainty in the force direction, (n,): sqrt(u_F^2 + (slope u_u)^2)."""
    f, u = samples.force, samples.displacement
    secants = np.abs(np.divide(f, u, out=np.zeros_like(f), where=u != 0))
    slope = np.clip(np.abs(np.gradient(f, u)), 0.0, np.max(secants))
    tiny = 1e-6 * np.ptp(np.append(f, 0.0))
    sigma: Array = np.maximum(np.hypot(samples.u_force, slope * samples.u_displacement), tiny)
    return sigma


def _fit(design: Array, target: Array, sigma: Array) -> tuple[Array, float]:
    """Weighted least squares: parameters and sum of squared weighted residuals."""
    a, b = design / sigma[:, None], target / sigma
    parameters = np.asarray(np.linalg.lstsq(a, b, rcond=None)[0], dtype=np.float64)
    return parameters, float(np.sum((b - a @ parameters) ** 2))


def _bic(chi2: float, n: int, parameters: int) -> float:
    variance = max(chi2 / n, NOISE_FLOOR**2)
    return float(n * np.log(variance) + chi2 / variance + parameters * np.log(n))


def _powers(x: Array, degree: int, origin: bool) -> list[Array]:
    return [x**i for i in range(1 if origin else 0, degree + 1)]


def _smooth_bics(samples: Samples, sigma: Array) -> Iterator[float]:
    """BIC of every curve without a kink."""
    f, u, n = samples.force, samples.displacement / samples.displacement[-1], samples.force.size
    free = int(not samples.origin)
    for degree in (1, 2, 3, 4):
        if degree + free <= n // 2:
            chi2 = _fit(np.column_stack(_powers(u, degree, samples.origin)), f, sigma)[1]
            yield _bic(chi2, n, degree + free)
    for degree in (2, 3):
        if degree + free <= n // 2:
            chi2 = _inverse_chi2(f / f[-1], u, sigma / f[-1], degree, samples.origin)
            yield _bic(chi2, n, degree + free)
    for shape in (_hyperbola, _relaxation):
        chi2 = min(
            _fit(np.column_stack([*_powers(u, 1, samples.origin), shape(u, c)]), f, sigma)[1]
            for c in np.geomspace(0.03, 10.0, 16)
        )
        yield _bic(chi2, n, 3 + free)


def _inverse_chi2(f: Array, u: Array, sigma: Array, degree: int, origin: bool) -> float:
    """Misfit of a polynomial u(F), judged in the force direction like all the others.

    The fit is made in the displacement direction; its weights follow the slope of the fit.
    """
    line = np.linspace(0.0, 3.0, 601)
    slope = np.full(f.size, 1.0)
    parameters = np.zeros(degree + int(not origin))
    for _ in range(3):
        design = np.column_stack(_powers(f, degree, origin))
        parameters = _fit(design, u, sigma / slope)[0]
        path = np.column_stack(_powers(line, degree, origin)) @ parameters
        slope = 1.0 / np.maximum(np.interp(f, line, np.gradient(path, line)), 1e-3)
    rising = np.maximum.accumulate(path) + 1e-12 * line
    return float(np.sum(((f - np.interp(u, rising, line)) / sigma) ** 2))


def _hyperbola(u: Array, c: float) -> Array:
    return u / (u + c)


def _relaxation(u: Array, c: float) -> Array:
    return np.asarray(-np.expm1(-u / c))


def _best_kink(
    samples: Samples, sigma: Array, order: int, span: tuple[float, float] | None = None
) -> tuple[float, Kink] | None:
    """The best kinked line of an order and its BIC; None where there is no room for a kink."""
    f, u = samples.force, samples.displacement
    free = int(not samples.origin)
    first = u[MIN_BEFORE - 1 - int(samples.origin)]
    low, high = float(first), float(u[-MIN_AFTER])
    if span:
        low, high = max(low, span[0]), min(high, span[1])
    parameters = order + 2 + free
    if not low < high or parameters >= f.size:
        return None

    def design(at: float) -> Array:
        before = _powers(np.minimum(u, at), order, samples.origin)
        return np.column_stack([*before, np.maximum(u - at, 0.0)])

    at = _minimum(lambda x: _fit(design(x), f, sigma)[1], low, high)
    p, chi2 = _fit(design(at), f, sigma)
    curve = np.concatenate([np.zeros(1 - free), p[:-1]])[::-1]  # of u^order, ..., u^0
    before, after = float(np.polyval(np.polyder(curve), at)), float(p[-1])
    force = float(np.polyval(curve, at))
    # derivatives by the parameters and, last, by the place of the kink
    jacobian = np.column_stack([design(at), (before - after) * (u > at)]) / sigma[:, None]
    covariance = np.linalg.pinv(jacobian.T @ jacobian)
    by_parameter = np.concatenate([[at**i for i in range(1 - free, order + 1)], [0.0, before]])
    u_force = float(np.sqrt(max(0.0, by_parameter @ covariance @ by_parameter)))
    u_at = float(np.sqrt(max(0.0, covariance[-1, -1])))
    kink = Kink(force, at, before, after, u_force, u_at, order)
    return _bic(chi2, f.size, parameters), kink


def _minimum(cost: Callable[[float], float], low: float, high: float) -> float:
    """Where a cost with several dips is least: a grid, then twice a finer one about its best."""
    best = low
    for points in (61, 21, 21):
        grid = np.linspace(low, high, points)
        best = float(grid[int(np.argmin([cost(float(x)) for x in grid]))])
        step = float(grid[1] - grid[0])
        low, high = max(low, best - step), min(high, best + step)
    return best
