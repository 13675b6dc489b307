"""Gains that are off: what the effects of force and displacement share."""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.effects.curves import BENT_SLOPE
from identification.gap.interval import LEAST_FACTOR, Found, Parameter
from identification.gap.variants import Variant

SCALES = (0.03, 0.08, 0.2)
BENDS = np.diag([1.0, 0.08])  # at full range, of what the gain is off


def factor(bench: Bench, v: Variant, found: Found) -> dict[str, Parameter]:
    """Read over true. The columns are shares of what was read, but for an imposed displacement.
    Of a gain that bends or changes, the straight line of least squares; of one component's gain,
    with its name."""
    share = v.info.get("share")
    more = BENT_SLOPE if share is None else 1 - 1.5 * share + 0.5 * share**3
    g = found.linear(np.array([1.0, more])[: len(found.w)], "1")
    ends = [
        1 + off if bench.imposed else 1 / max(1 - off, LEAST_FACTOR)
        for off in (g.value, g.low, g.high)
    ]
    of = v.info.get("component")
    return {f"factor_{of}" if of else "factor": Parameter(ends[0], ends[1], ends[2], "1")}
