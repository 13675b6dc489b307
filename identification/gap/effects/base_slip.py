"""The mounting slips above a threshold moment: knee and remaining displacement that the encoders
do not see. The same knees as `joint_yield`, on the moment about yaw or tilt axes: a stand tips over
an edge, along an axis of the base or between two of them.

The slope beyond the threshold is a compliance of 1e-6 to 1e-3 rad/Nm.

Size: slope beyond the threshold 1e-6 to 1e-3 rad/Nm.
Prior: as joint_yield, per axis and depth.
Source: Coulomb friction in the bolted joint of the mounting, effective radius about 0.25 m.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.effects.base_compliance import moments
from identification.gap.effects.joint_yield import knee_variants
from identification.gap.variants import Variant

WORD = "base_slip"
_HALF = 0.5**0.5
AXES: dict[str, tuple[float, float, float]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "x+y": (_HALF, _HALF, 0.0),
    "x-y": (_HALF, -_HALF, 0.0),
}
DEPTHS_M = (0.0, 0.35, 0.7)  # coarser than elastic ones: a knee is told by where it bends
# m/N at the target beyond the threshold, which the scales of the knees (0.07 to 56) multiply: on a
# lever of 0.75 m 0.5e-6 to 4e-4 rad/Nm. Said of the target, not of the moment: axes at several
# depths whose moments run in proportion have the same knees then, and need not be told apart.
_BEYOND = 0.75**2 / 1.5e5


def places() -> Iterator[tuple[str, float]]:
    """Axes (of `AXES`) and their depths in m; the yaw axis knows none."""
    for axis in AXES:
        for depth in (0.0,) if axis == "z" else DEPTHS_M:
            yield axis, depth


def lever_of(bench: Bench, axis: str, depth: float) -> Array:
    """(n,) m: moment per newton about an axis so far below the base."""
    return np.asarray(moments(bench, depth) @ np.array(AXES[axis]))


def variants(bench: Bench) -> list[Variant]:
    """Per axis and depth of the axis."""
    out = []
    for axis, depth in places():
        lever = lever_of(bench, axis, depth)
        if np.abs(lever).max() < 0.02:
            continue

        natural = float(_BEYOND / np.abs(lever).max() ** 2)  # rad/Nm

        def column(state: Array, lever: Array = natural * lever) -> int:
            return bench.add(bench.outside_column(lever * state))

        name = f"axis {axis} {depth:g} m below"
        info = {"axis": axis, "depth_m": depth, "natural": natural}
        out += knee_variants(bench, lever * bench.true_load, column, WORD, name, info)
    return out
