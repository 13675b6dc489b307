"""Joints of another simulator, of which only curves are known: how its arm gives way along each
direction, not which joint turns by how much."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.data import Curve, GapData

_EXACT = 1e-3  # of a slope: as closely as springs have to give those of the curves
_SOFTEST = 5.0  # times: what is not in the joints at all makes no joint softer or stiffer than that


def springs_behind(data: GapData) -> Array:
    """(m,) rad/Nm: the compliances nearest to those stated, by their own standard deviations, with
    which springs give way as the curves do, by the slope (m/N) of each over the forces that were
    measured: least squares of relative changes x under `each @ x = missing`. Those stated where no
    curves are given."""
    stated, sd = data.compliance, data.compliance_relative_sd
    if data.curves is None or not data.arm or not np.any(sd):
        return stated
    slopes = [_slope(c, data.force[data.setup == s]) for s, c in enumerate(data.curves)]
    known = [s for s, slope in enumerate(slopes) if slope > 0]
    asked = np.array([slopes[s] for s in known])
    lever = np.stack([s.lever for s in data.setups])[known]
    each = lever**2 * stated / asked[:, None]
    missing = 1 - data.outside_of(np.array(known, dtype=int)) / asked - each.sum(axis=1)
    scaled = each * sd
    dual = np.linalg.solve(scaled @ scaled.T + _EXACT**2 * np.eye(len(known)), missing)
    return np.asarray(stated * np.clip(1 + sd * (scaled.T @ dual), 1 / _SOFTEST, _SOFTEST))


def _slope(curve: Curve, measured: Array) -> float:
    """m/N: of the line through a curve, over forces (n,) N; 0 where these stand still."""
    force, does = measured - measured.mean(), curve.at(measured)
    square = float(force @ force)
    return float(force @ (does - does.mean())) / square if square > 0 else 0.0


def doubt(data: GapData, springs: Array) -> float:
    """Relative sd of how much each joint of another simulator turns: as much as its springs (m,)
    had to be changed on the whole, for any of them may have been, or none."""
    return float(np.sqrt(np.mean((springs / data.compliance - 1) ** 2)))
