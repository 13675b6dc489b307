"""What a world's arm does by itself: no gains, no scatter, no noise, no waiting."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rig.arrays import Array
from rig.worlds.world import World


def true_curve(world: World, direction: Sequence[float], forces_N: Sequence[float]) -> Array:
    """(n,) m: the tool's displacement along `direction` in the present pose, first loading
    through `forces_N` in this order, each settled for ever."""
    fresh = World(world.design, 0, 0.0, 0.0)
    fresh.move(tuple(world.q), tuple(world.tcp_m))
    fresh.mount(direction)
    return np.array([fresh._take(float(f), math.inf).displacement_m for f in forces_N])
