"""What the instruments of an arm would have read of joints that turned so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Array
from identification.gap.data import GapData

LASER_M, ENCODER_RAD = 2e-6, 1e-5


def levels_of(there: GapData) -> tuple[Array, Array]:
    """Forces (n,) N as they were meant, in steps of 40 N, and levers (n, 6) m."""
    lever = np.stack([s.lever for s in there.setups])[there.setup]
    return np.round(there.force / 40.0) * 40.0, lever


def as_read(
    there: GapData,
    force: Array,
    turned: Array,
    rng: np.random.Generator,
    *,
    beside: Array | float = 0.0,
    laser_m: float = LASER_M,
) -> GapData:
    """The data with a force (n,) N, joints that turned by (n, 6) rad, and what the laser sees
    beside these (n,) m; a laser that scatters by as much as is stated of it, a force by half."""
    moved = np.sum(levels_of(there)[1] * turned, axis=1) + beside
    return replace(
        there,
        force=force + rng.normal(0, 0.05, len(force)),
        displacement=moved + rng.normal(0, laser_m, len(force)),
        q=turned + rng.normal(0, ENCODER_RAD, turned.shape),
        instruments=replace(there.instruments, force=0.1, displacement=laser_m),
        temperature=None,
    )
