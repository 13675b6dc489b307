"""Evidence between the levels of imperfection.

The levels are coarse steps (`imperfection.STEP`); where thousands of readings are far above the
noise, the evidence peaks more sharply than that. For explanations that matter it is integrated over
the size of the imperfection about its peak.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.compare import logsumexp
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.imperfection import LOG_STEP, level_priors, log_share
from identification.gap.evidence.parts import Part, log_joint_between, log_joints

PARTS = 3  # of a step between levels
BELOW = 2  # steps below the least level, from which on it is looked at
_POINTS = 25  # of the integral, per part of a step


def gained(engine: Engine, parts: tuple[Part, ...], energy: float) -> float:
    """Log evidence (nats) integrated over the size of the imperfection, minus what the levels of
    the grid give for it. energy: mean square (m^2) of what the parts do."""
    etas = engine.etas
    joint = log_joints(engine, parts)
    coarse = joint + level_priors(etas, energy)
    best = int(coarse.argmax())
    last = min(max(best, 1) + 1, len(etas) - 1)
    lowest = np.log(etas[1]) - BELOW * LOG_STEP if best <= 1 else np.log(etas[best - 1])
    # a parabola takes three points, however near the levels lie
    parts_between = max(2, round((np.log(etas[last]) - lowest) / LOG_STEP * PARTS))
    x = np.linspace(lowest, np.log(etas[last]), parts_between + 1)
    known = {round(float(v), 6): j for v, j in zip(np.log(etas[1:]), joint[1:], strict=True)}
    missing = [v for v in x.tolist() if round(v, 6) not in known]
    known |= {round(v, 6): log_joint_between(engine, parts, float(np.exp(v))) for v in missing}
    y = np.array([known[round(v, 6)] for v in x.tolist()])
    total = [_integral(etas, x, y, energy), *coarse[last + 1 :]]
    if best <= 1:
        total.append(joint[0] + float(log_share(etas, np.array([-np.inf, lowest]), energy)[0]))
    else:
        total += list(coarse[: best - 1])
    return float(logsumexp(np.array(total)) - logsumexp(coarse))


def _integral(etas: Array, x: Array, y: Array, energy: float) -> float:
    """log of the integral of `exp(y(x))` under the prior of log sizes x."""
    edges = np.linspace(x[0], x[-1], (len(x) - 1) * _POINTS + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    return float(logsumexp(_cubics(x, y, middle) + log_share(etas, edges, energy)))


def _cubics(x: Array, y: Array, at: Array) -> Array:
    """Cubics between points with the slopes of their neighbours (Catmull and Rom 1974, uneven
    ends by parabolas). scipy.interpolate would do it, too, but its import takes 0.2 s, a tenth of a
    diagnosis."""
    slope = np.gradient(y, x, edge_order=2)
    k = np.clip(np.searchsorted(x, at) - 1, 0, len(x) - 2)
    step = x[k + 1] - x[k]
    t = (at - x[k]) / step
    rise = y[k + 1] - y[k]
    bend = (1 - t) * (slope[k] * step - rise) - t * (slope[k + 1] * step - rise)
    return np.asarray(y[k] + t * rise + t * (1 - t) * bend)
