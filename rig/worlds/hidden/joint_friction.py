"""Friction in joints, beside the spring."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden import memory
from rig.worlds.hidden.effect import Drawn, draw_joint
from rig.worlds.hidden.joint_path import in_joint, top_of
from rig.worlds.hidden.scene import Scene

_HUNG = 0.75


def friction(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Friction beside the spring, which takes part of the torque off it."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        joint = draw_joint(scene, random)
        top = top_of(scene, joint)
        # the weight came on last, or a controller that dithers let friction settle under it
        torque = (scene.net if random.random() < _HUNG else scene.torque)[:, joint]
        fresh = scene.standing
        if law in ("dahl", "bouc_wen", "stribeck_bristles"):
            reach = top * float(np.exp(random.uniform(np.log(0.08), np.log(0.8))))
            power = 1.0 if law == "dahl" else random.uniform(0.7, 2.5)
            gamma = 1.0 if law == "dahl" else random.uniform(0.5, 1.0)
            state = memory.bristles(torque, reach, power, gamma, fresh)
            if law == "stribeck_bristles":  # standing still, the bristles grip tighter than moving
                state = state * (1.0 + random.uniform(0.1, 0.4) * _at_rest(scene))
            most = 0.3 * top
            stiffness = float(scene.plan.springs[joint])

            def parameters(size: float) -> dict[str, Any]:
                return {"friction_Nm": size * most, "reach_rad": reach / stiffness}

            # bristles and spring side by side: at most as stiff as the spring itself
            limit = min(1.0, 0.5 * reach / most)
            held = -most * scene.since_standing(state)
            return in_joint(scene, joint, held, parameters, (0.003, limit))
        path, extra = _loop_path(scene, torque, top, law, random)
        path = scene.since_standing(path)
        return in_joint(scene, joint, path, lambda size: {"share": size, **extra}, (0.005, 1.5))

    return draw


def _at_rest(scene: Scene) -> Array:
    still = np.diff(scene.history.load, prepend=0.0) == 0.0
    return np.asarray(still, dtype=float)


def _loop_path(
    scene: Scene, torque: Array, top: float, law: str, random: Generator
) -> tuple[Array, dict[str, Any]]:
    fresh = scene.standing
    if law == "iwan":
        strength = top * random.uniform(0.1, 0.9)

        def even(x: float) -> float:  # strengths evenly spread up to the largest
            return x**2 / (2 * strength) if x < strength else x - strength / 2

        return memory.loops(torque, even, fresh), {"friction_Nm": strength}
    if law == "iwan_weibull":
        shape, scale = random.uniform(0.8, 2.5), top * random.uniform(0.1, 0.6)
        grid = np.linspace(0.0, 2.5 * top, 4000)
        slip = np.concatenate([[0.0], np.cumsum(1 - np.exp(-((grid[1:] / scale) ** shape)))])
        slip *= grid[1]

        def weibull(x: float) -> float:
            at = min(int(x / grid[1]), len(grid) - 2)
            return float(slip[at] + (slip[at + 1] - slip[at]) * (x / grid[1] - at))

        return memory.loops(torque, weibull, fresh), {"friction_Nm": scale, "shape": shape}
    if law == "power":
        power = random.uniform(1.3, 2.2)
        return memory.loops(torque, lambda x: top * (x / top) ** power, fresh), {"power": power}
    count = int(random.integers(3, 7))
    widths = top * np.sort(random.uniform(0.02, 0.6, count))
    weights = random.dirichlet(np.ones(count))
    path = sum(
        (w * memory.play(torque, b, fresh) for w, b in zip(weights, widths, strict=True)),
        np.zeros(1),
    )
    return np.asarray(path), {"friction_Nm": float(weights @ widths), "elements": count}
