"""Whether an explanation asks for what its own priors exclude.

The stated uncertainties of the rig (springs, tares, gains, cross-talk, scatter of runs) and the
coefficients of effects are standard normal in their own coordinates (`Fit.pulls`). One that has to
be many standard deviations off says that the data and what was stated contradict each other under
this explanation, however well it fits: a tare that jumps by ten of them is no tare (prior-data
conflict; Evans and Moshonov, Bayesian Analysis 1 (2006) 893-914).
"""

from __future__ import annotations

import numpy as np

from identification.gap.evidence import RUN_PART, Engine
from identification.gap.explanation import REMAINDER
from identification.gap.fit import Fit

# Standard deviations: of 200 known effects of the blind check three had a coordinate beyond 4.5.
LIMIT = 5.0


def strain(engine: Engine, fitted: Fit, eta: float) -> float:
    """The largest coordinate of base and effects, or the sum of all squares against what is
    expected of it, in standard deviations. Springs that are said to be off may be off; a run may be
    off by its own part of an imperfection of eta m as well; a tare counts as far as it moves a
    share of the gap that an explanation may not leave."""
    pulls, base = np.abs(fitted.pulls), engine.base
    if any(p.word == "joint_stiffness_error" for p in fitted.parts):
        pulls[base.index("spring")] = 0.0
    runs, tares = base.index("scatter run"), base.index("tare")
    pulls[runs] *= base.sd[runs] / np.hypot(base.sd[runs], RUN_PART * eta)
    n, weight = engine.bench.rows.n, engine.bench.rows.weight
    square = (base.columns[:n, tares] * fitted.base[tares]) ** 2
    moved = np.sqrt(weight @ square / weight.sum())
    pulls[tares] *= np.minimum(moved / (REMAINDER * engine.structural), 1.0)
    count = len(pulls)  # a chi square of so many degrees of freedom, at most
    together = float(pulls @ pulls - count) / float(np.sqrt(2 * count))
    return max(float(pulls.max(initial=0.0)), together)
