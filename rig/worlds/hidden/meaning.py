"""What a law's parameter means where the law's own constants mean nothing outside of it.

A rounded knee, a spectrum of times, a bent gain have constants that only their own formula knows: a
power law's reference torque and its size are one number, not two. The answers therefore give
what anybody could read off the true curve: the threshold of the sharp knee of equal work, the creep
after a stated time, the depth at the largest load, the gain of the straight line.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rig.arrays import Array
from rig.worlds.hidden.scene import Scene

_RAMP = 2001  # points of a first, slow loading


def equal_work_threshold(path: Callable[[Array], Array], top: float) -> float:
    """Threshold T of the sharp knee `w (x - T)` that, loaded once from 0 to `top`, ends where
    `path` (n) ends and takes the same work: `T = top - 2 A / path(top)`, A the integral of path.

    The idealisation by a bilinear curve of equal area (as FEMA 356 does with push-over curves), of
    what goes beyond the elastic line. A sharp knee gives its own threshold.
    """
    x = np.linspace(0.0, top, _RAMP)
    y = path(x)
    area = float(np.sum((y[1:] + y[:-1]) / 2) * x[1])
    return top - 2.0 * area / float(y[-1])


def run_seconds(scene: Scene) -> float:
    """s from the first sample of a run to its last, mean over runs: for so long creep is seen."""
    history = scene.history
    run, time = history.run[history.sample], history.time[history.sample]
    first = np.flatnonzero(np.diff(run, prepend=-1))
    last = np.append(first[1:], len(run)) - 1
    return float(np.mean(time[last] - time[first]))


def straight_factor(read: Callable[[Array], Array]) -> float:
    """Slope of the line through zero that fits readings of an even range best, `read` of shares
    (n) of full range."""
    share = np.linspace(0.0, 1.0, _RAMP)
    return float(share @ read(share) / (share @ share))
