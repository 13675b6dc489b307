"""How well laws meet real mechanisms: the prior of the size of an explanation's imperfection.

A family of shapes meets a mechanism to a few percent of its size (`IMPERFECTION`, log-normal, by a
factor of 2.5 from case to case), none closer than a hundredth. In the evidence the size eta is on a
grid of levels (`identification.gap.evidence.engine.eta_levels`).
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array, Ints

IMPERFECTION = 0.04  # of an effect's size: how well a family of shapes meets a real mechanism
# Elasticity, gains and leverage are laws, not families, and as exact as the springs of the base,
# which count as exact: to a thousandth of their size.
LAW_IMPERFECTION = 0.002
LEAST_IMPERFECTION = 0.01
# Of what a lag does at a reading of a hold: it repeats a path between levels that hands took and
# nobody saw. Who turns a third of a step in a fifth of the time, in several strokes, is so far off.
PATH = 0.4
STEP = 2.5  # of the grid: from one level to the next
LOG_STEP = float(np.log(STEP))
_SPREAD = np.log(2.5)  # by which factor that varies from case to case (one sd)


def level_priors(etas: Array, energy: Array | float) -> Array:
    """log prior (l,) of every level; energy: mean square (m^2) of the explanation, or (l,) at
    each."""
    return log_level(etas, np.arange(len(etas)), np.asarray(energy))


def log_level(etas: Array, i: int | Ints, energy: Array) -> Array:
    """log prior (...) of level i of the sizes `etas` (l,) m, or of levels (...), for explanations
    of mean squares (...) m^2. Levels are bins of log eta; the lowest takes all below."""
    from scipy.special import ndtr

    centre = _centre(energy)
    edges = _edges(etas)
    lower, upper = edges[i], edges[i + 1]
    p = ndtr((upper - centre) / _SPREAD) - ndtr((lower - centre) / _SPREAD)
    # no mechanism of a real rig follows a formula closer than that
    short = centre + _FLOOR - np.minimum(upper, 1e9)
    return np.asarray(np.log(np.maximum(p, _LEAST_SHARE)) - 300.0 * np.maximum(short, 0.0))


def log_share(etas: Array, edges: Array, energy: float) -> Array:
    """log prior (n,) of sizes between neighbouring edges (n + 1,) of log eta, for an explanation of
    that mean square (m^2)."""
    from scipy.special import ndtr

    centre, least = _centre(np.array(energy)), least_size(etas, energy)
    p = np.diff(ndtr((np.maximum(edges, least) - centre) / _SPREAD))
    return np.asarray(np.log(np.maximum(p, np.where(edges[1:] > least, 1e-15, 1e-300))))


def least_size(etas: Array, energy: float) -> float:
    """log of the least size that counts: the lower edge of the level that has the least
    imperfection in it. Explanations of about the same size are held to the same."""
    floor = float(_centre(np.array(energy))) + _FLOOR
    edges = _edges(etas)
    return float(edges[np.searchsorted(edges[1:], floor)])


def _centre(energy: Array) -> Array:
    return np.asarray(0.5 * np.log(IMPERFECTION**2 * np.maximum(energy, 0.0) + 1e-300))


_LEAST_SHARE = 1e-12
_FLOOR = float(np.log(LEAST_IMPERFECTION / IMPERFECTION))


def _edges(etas: Array) -> Array:
    """log of the edges (l + 1,) of levels (l,): midway between two. Below the least size, which
    follows 0, half a step of the grid, which may be of every other level only."""
    step = etas[2] / etas[1] if len(etas) > 2 else STEP
    below = np.append(etas[1:2] / step, etas[1:-1])
    return np.concatenate([[-np.inf], 0.5 * np.log(below * etas[1:]), [np.inf]])
