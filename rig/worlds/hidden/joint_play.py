"""Lost motion in joints."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden import memory
from rig.worlds.hidden.effect import Drawn, Unsuited, one_joint, share_of_joints
from rig.worlds.hidden.scene import Change, Scene


def lost_motion(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Play of width `size` (rad) taken up where the joint's net torque passes zero; of one that
    hoses and cables preload, wherever the load overcomes them."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        net, top = scene.net, np.abs(scene.torque).max(axis=0)
        crosses = (net.min(axis=0) < 0.03 * top) & (net.max(axis=0) > -0.03 * top)
        if law == "preloaded":
            crosses[:] = True
        able = np.flatnonzero(crosses & (share_of_joints(scene) > 0.05))
        if not len(able):
            raise Unsuited
        joint = int(random.choice(able))
        zone = float(top[joint] * np.exp(random.uniform(np.log(0.004), np.log(0.06))))
        x, preload = net[:, joint], 0.0
        if law == "preloaded":
            preload = -float(x.min() + random.uniform(0.15, 0.85) * np.ptp(x))
        place = _taken_up(law, x + preload, zone, scene, random)
        rad = one_joint(joint, place)

        def parameters(size: float) -> dict[str, Any]:
            crossing = _crossing(scene, joint, preload)
            return {"width_rad": size, "zone_Nm": zone, "crossing_N": crossing}

        return Drawn(
            lambda size: Change(joints=size * rad), parameters, (4e-6, 1.5e-3), (joint + 1,)
        )

    return draw


def _taken_up(law: str, x: Array, zone: float, scene: Scene, random: Generator) -> Array:
    """(n) place in the play, -1/2 to 1/2."""
    if law in ("smooth", "preloaded"):
        return np.asarray(np.tanh(x / zone) / 2)
    if law == "gap_with_friction":
        return np.asarray(np.clip(memory.play(x, zone, scene.standing) / zone, -1, 1) / 2)
    if law == "soft_flanks":  # two flanks of unequal softness
        other = zone * random.uniform(1.5, 4.0)
        return np.asarray(np.where(x > 0, 1 - np.exp(-x / zone), np.expm1(x / other)) / 2)
    return np.asarray(np.arctan(x / zone) / np.pi)


def _crossing(scene: Scene, joint: int, preload: float) -> dict[str, float]:
    lever = np.einsum("sj,sj->s", scene.levers[:, joint], scene.unit)
    return {
        setup.direction: float(-(scene.weight[s, joint] + preload) / lever[s])
        for s, setup in enumerate(scene.plan.setups)
        if abs(lever[s]) > 1e-3
    }
