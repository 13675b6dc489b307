"""What laws of joints share.

Every law turns the torque of one joint into a path of its own beside the linear spring; the size
is that path's share of the spring's compliance where nothing else is said.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.worlds.hidden.effect import Drawn, Unsuited, one_joint
from rig.worlds.hidden.scene import Change, Scene

_PUSHED = 0.2  # of a joint's torque: less beyond its weight shows nothing

Parameters = Callable[[float], dict[str, Any]]


def top_of(scene: Scene, joint: int) -> float:
    """The largest torque that the load brings to a joint, Nm."""
    return float(np.abs(scene.torque[:, joint]).max())


def in_joint(
    scene: Scene,
    joint: int,
    path_Nm: Array,
    parameters: Parameters,
    sizes: tuple[float, float],
    onset_N: dict[str, float] | None = None,
) -> Drawn:
    """An effect whose path is given in units of torque, of which size over stiffness is seen."""
    rad = one_joint(joint, path_Nm / scene.plan.springs[joint])
    return Drawn(lambda size: Change(joints=size * rad), parameters, sizes, (joint + 1,), onset_N)


def onset(scene: Scene, joint: int, threshold: float) -> dict[str, float]:
    """Force per direction at which the joint's net torque comes to the threshold, where it does."""
    lever = np.einsum("sj,sj->s", scene.levers[:, joint], scene.unit)
    out: dict[str, float] = {}
    for setup, arm, weight in zip(scene.plan.setups, lever, scene.weight[:, joint], strict=True):
        left = threshold - math.copysign(weight, arm * weight)  # what the push must bring
        if abs(arm) * setup.top_N > left:
            out[setup.direction] = min(left / abs(arm), out.get(setup.direction, math.inf))
    return out


def reached(scene: Scene, joint: int, share: float) -> float:
    """A net torque of that share of the way from what weights do alone to the largest one."""
    alone = float(np.abs(scene.weight[:, joint]).max())
    most = float(np.abs(scene.net[:, joint]).max())
    if most < alone + _PUSHED * top_of(scene, joint):
        raise Unsuited  # every push takes load off the joint
    return alone + share * (most - alone)
