"""The mounting slips above a threshold moment: knee and remaining displacement that the encoders
do not see. The same knees as `joint_yield`, on the moment about yaw or tilt axes.

The slope beyond the threshold is a compliance of 1e-6 to 1e-3 rad/Nm.

Size: slope beyond the threshold 1e-6 to 1e-3 rad/Nm.
Prior: as joint_yield, per axis and depth.
Source: Coulomb friction in the bolted joint of the mounting, effective radius about 0.25 m.
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.effects.base_compliance import moments
from identification.gap.effects.joint_yield import knee_variants
from identification.gap.variants import Variant

WORD = "base_slip"
DEPTHS_M = (0.0, 0.35, 0.7)  # coarser than elastic ones: a knee is told by where it bends
_NATURAL = 1 / 1.5e5  # rad/Nm, so that the scales of the knees (0.3 to 20) span 2e-6 to 1.3e-4


def variants(bench: Bench) -> list[Variant]:
    """Per axis and depth of the axis."""
    out = []
    for axis in range(3):
        for depth in DEPTHS_M if axis < 2 else (0.0,):
            lever = moments(bench, depth)[:, axis]
            if np.abs(lever).max() < 0.02:
                continue

            def column(state: Array, lever: Array = lever) -> int:
                return bench.add(bench.outside_column(_NATURAL * lever * state))

            name = f"axis {'xyz'[axis]} {depth:g} m below"
            info = {"axis": axis, "depth_m": depth}
            out += knee_variants(bench, lever * bench.true_load, column, WORD, name, info)
    return out
