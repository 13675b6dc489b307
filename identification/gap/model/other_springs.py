"""Springs of another simulator, of which only curves are known: how its rig gives way along each
direction; of an arm not which joint turns by how much."""

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


def springs_along(data: GapData) -> Array:
    """(m,) m/N: of a rig without an arm, whose springs are what its curves say, those that give way
    as they do on the whole, each along its own direction; as stated where a curve says nothing."""
    slopes = [_slope(c, data.force[data.setup == s]) for s, c in enumerate(data.curves or ())]
    out = data.compliance.copy()
    for j in range(data.joints):
        mine = [k for k, s in zip(slopes, data.setups, strict=True) if k > 0 and s.lever[j] != 0]
        out[j] = np.mean(mine) if mine else out[j]
    return out


def _slope(curve: Curve, measured: Array) -> float:
    """m/N: of the line through a curve, over forces (n,) N; 0 where these stand still."""
    force, does = measured - measured.mean(), curve.at(measured)
    square = float(force @ force)
    return float(force @ (does - does.mean())) / square if square > 0 else 0.0


def doubt(data: GapData, springs: Array) -> float:
    """Relative sd of how much each joint of another simulator turns: as much as its springs (m,)
    had to be changed on the whole, for any of them may have been, or none."""
    return float(np.sqrt(np.mean((springs / data.compliance - 1) ** 2)))
