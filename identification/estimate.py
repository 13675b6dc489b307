"""One stiffness from levels, under a stated choice of weights and origin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification.arrays import Array
from identification.fit import LineFit, weighted_line, york_line
from identification.levels import LevelTable

Weighting = Literal["proportional", "1/s^2", "none", "errors-in-variables"]
WEIGHTINGS: tuple[Weighting, ...] = ("proportional", "1/s^2", "none", "errors-in-variables")

MANY = 200  # levels

_WORDS = {
    "proportional": "proportional (s grows with displacement)",
    "1/s^2": "1/s^2 (scatter of the repetitions and stated uncertainty)",
    "none": "none (every level counts alike)",
    "errors-in-variables": "errors in variables (force and displacement uncertain)",
}


@dataclass(frozen=True)
class Choice:
    """How the line u = u0 + F / k is drawn through the levels."""

    weighting: Weighting = "proportional"
    intercept: bool = False

    @property
    def label(self) -> str:
        """The choice in words, as it stands beside every k."""
        place = "with intercept" if self.intercept else "through the origin"
        return f"{_WORDS[self.weighting]}, {place}"


def line(table: LevelTable, choice: Choice) -> LineFit:
    """The line u = u0 + c F through n levels; slope c in m/N, k = 1 / c.

    Displacement is regressed on force, with s_i of the displacement:

    - "proportional": s_i in proportion to u_i. Through the origin the least squares are
      sum((1 - c F_i / u_i)^2), so k = sum(r_i^2) / sum(r_i) with the secants r_i = F_i / u_i. This
      is the convention under which the published curves give the published values. The level's own
      uncertainty is added to s_i in quadrature, and through the origin its noise is kept out of its
      own weight (`_without_noise`): far below u_i neither changes anything.
    - "1/s^2": s_i^2 = scatter of the repetitions squared + stated uncertainty squared (of the
      displacement, and of the force through the compliance).
    - "none": equal s_i.
    - "errors-in-variables": York's line with the stated uncertainties of force and displacement,
      the scatter of the repetitions added to the latter.

    Raises ValueError when the levels determine no line.
    """
    force, displacement = table.force, table.displacement
    s = _deviations(table, choice)
    if choice.weighting == "errors-in-variables":
        return york_line(force, displacement, table.u_force, s, intercept=choice.intercept)
    return weighted_line(force, displacement, s, intercept=choice.intercept)


def _deviations(table: LevelTable, choice: Choice) -> Array:
    """(n,) m: standard deviations of the displacement that the weighting gives the levels."""
    if choice.weighting == "errors-in-variables":
        return _with_scatter(table)
    if choice.weighting == "proportional":
        u = table.displacement if choice.intercept else _without_noise(table)
        return np.hypot(u, table.u_displacement)
    ones = np.ones(table.size)
    if choice.weighting == "none":
        return ones
    plain = weighted_line(table.force, table.displacement, ones, intercept=choice.intercept)
    return np.hypot(_with_scatter(table), plain.slope * table.u_force)


def _without_noise(table: LevelTable) -> Array:
    """(n,) m: displacements as weights may use them.

    A level that noise moved too little would weigh too much, and k come out too high: by 0.3, 6 and
    14 % where the noise is 0.1, 0.5 and 1 of the first of eleven steps. So the secants u_i / F_i
    are drawn towards a straight line over the force, each as far as its own uncertainty is more
    than what else keeps them off it (the moment estimate of DerSimonian and Laird, Control. Clin.
    Trials 7 (1986) 177, with a slope). Where u_i is far above its uncertainty they stay.
    """
    force, displacement, u = table.force, table.displacement, table.u_displacement
    if table.size < 4 or not (np.ptp(force) > 0 and np.all(force != 0) and np.all(u > 0)):
        return displacement
    design = np.column_stack([np.ones(table.size), force / np.abs(force).max()])
    secant, variance = displacement / force, (u / force) ** 2
    weighted = design / variance[:, None]
    inverse = np.linalg.pinv(design.T @ weighted, hermitian=True)
    drawn = design @ (inverse @ (weighted.T @ secant))
    beyond = float(np.sum((secant - drawn) ** 2 / variance)) - (table.size - 2)
    each = float(np.sum(1 / variance) - np.trace(inverse @ weighted.T @ weighted))
    apart = max(0.0, beyond / each) if each > 0 else 0.0
    own = apart / (apart + variance)
    return np.asarray(force * (own * secant + (1 - own) * drawn))


def stiffness(table: LevelTable, choice: Choice) -> float:
    """k in N/m of `line`; ValueError where the displacement does not change with the force."""
    slope = line(table, choice).slope
    if slope == 0.0 or not np.isfinite(slope):
        raise ValueError("the displacement does not change with the force")
    return 1.0 / slope


def stated_uncertainty(table: LevelTable, choice: Choice) -> float:
    """Standard uncertainty of k (N/m) from the stated uncertainties of the levels alone.

    The larger of two readings of the stated uncertainty, which does not say how much of it the
    levels share: every level errs by itself (effects added in quadrature), or all levels err by
    the same amount, a wrong zero. Derivatives by central differences over one standard
    uncertainty; beyond `MANY` levels those of single levels with the weights held, in closed form.
    """
    if table.size > MANY:
        alone = _alone_with_weights_held(table, choice)
    else:
        alone = sum(_effect(table, choice, step) for step in np.eye(table.size))
    together = _effect(table, choice, np.ones(table.size))
    return float(np.sqrt(max(alone, together)))


def _alone_with_weights_held(table: LevelTable, choice: Choice) -> float:
    """Variance of k from independent errors of the levels: k^4 sum(g_i^2 (u_u^2 + c^2 u_F^2)),
    g the weights of the displacements in the slope c."""
    w = _deviations(table, choice) ** -2.0
    x = table.force - (w @ table.force / w.sum() if choice.intercept else 0.0)
    g = w * x / (w @ x**2)
    c = 1.0 / stiffness(table, choice)
    variance = np.sum(g**2 * (table.u_displacement**2 + (c * table.u_force) ** 2))
    return float(variance / c**4)


def gain_effect(table: LevelTable, choice: Choice, gain_sd: float) -> float:
    """Standard uncertainty of k (N/m) from the gain of the force.

    Where the force reads g times too high, u at the stated force is off by F du/dF (g - 1): on a
    straight line k changes by the factor g, on a softening one by more, because the levels moved
    too. The slope du/dF comes from a parabola through the levels.
    """
    degrees = [1] if table.size < 3 else [1, 2]
    if choice.intercept and table.size > 3:
        degrees = [0, *degrees]
    scale = float(np.max(np.abs(table.force)))
    x = table.force / scale
    design = np.column_stack([x**d for d in degrees])
    parameters = np.linalg.lstsq(design, table.displacement, rcond=None)[0]
    run = design @ (parameters * np.array(degrees))  # F du/dF
    up = stiffness(table.shifted(0.0, 0.5 * gain_sd * run), choice)
    down = stiffness(table.shifted(0.0, -0.5 * gain_sd * run), choice)
    return abs(up - down)


def _effect(table: LevelTable, choice: Choice, step: Array) -> float:
    """Squared change of k when the levels err by `step` (n,) standard uncertainties."""
    total = 0.0
    for force, displacement in ((table.u_force, 0.0), (0.0, table.u_displacement)):
        df, du = 0.5 * step * force, 0.5 * step * displacement
        up = stiffness(table.shifted(df, du), choice)
        down = stiffness(table.shifted(-df, -du), choice)
        total += (up - down) ** 2
    return total


def _with_scatter(table: LevelTable) -> Array:
    return np.hypot(np.nan_to_num(table.scatter), table.u_displacement)
