"""The mounting tilts or turns elastically: rotations about axes through, or below, the base.

A moment about axis a gives a rotation `c_a M_a`, and the target moves by the same lever: along the
direction `c_a (r x n)_a^2` per newton. Unseen by encoders. 5e5 to 2e6 Nm/rad.

Size: 5e-7 to 2e-6 rad/Nm; tables and stands up to ten times softer.
Prior: compliances positive in sum, sd out of SCALES, equally likely; single axes at 0.3.
Source: stiffness of bolted mountings of arms, 5e5 to 2e6 Nm/rad.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.variants import Variant, variant

WORD = "base_compliance"
DEPTHS_M = (
    0.0,
    0.15,
    0.3,
    0.45,
    0.6,
    0.8,
    1.0,
)  # of tilt axes below the base: flange, table, floor
SCALES = (3e-7, 1e-6, 3e-6)  # rad/Nm


def moments(bench: Bench, depth: float) -> Array:
    """Moment (n, 3) m per newton about axes `depth` m below the base."""
    arm = []
    for s in bench.data.setups:
        below = np.array([0.0, 0.0, depth])
        arm.append(s.moment + np.cross(below, s.unit_vector))
    return np.stack(arm)[bench.rows.setup]


def variants(bench: Bench) -> list[Variant]:
    """Per depth of the axes: all three, and each alone (yaw knows no depth)."""
    out = []
    for depth in DEPTHS_M:
        m = moments(bench, depth)
        columns = [bench.add(bench.outside_column(m[:, a] ** 2 * bench.load)) for a in range(3)]
        info: dict[str, Any] = {"depth_m": depth}
        seen = [a for a in range(3) if np.abs(m[:, a]).max() > 1e-3]
        out.append(
            variant(WORD, f"axes {depth:g} m below", [columns[a] for a in seen], SCALES, axes=seen,
                    **info)
        )  # fmt: skip
        for a in seen:
            if a < 2 or depth == 0:
                out.append(
                    variant(WORD, f"axis {'xyz'[a]} {depth:g} m below", [columns[a]], SCALES,
                            prior=0.3, axes=[a], **info)
                )  # fmt: skip
    return out
