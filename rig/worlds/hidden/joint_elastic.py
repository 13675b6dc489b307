"""Joints with curved springs, and with springs that are off."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden.effect import Drawn, draw_joint, share_of_joints
from rig.worlds.hidden.joint_path import in_joint
from rig.worlds.hidden.scene import Change, Scene

_STEEPEST = 12.0  # of a curve that may also take deflection away


def curved(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Reversible and curved; size is the extra deflection at the largest torque."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        joint = draw_joint(scene, random)
        top = float(np.abs(scene.net[:, joint]).max())
        shape, extra = _curve(law, random)
        grid = np.linspace(0.0, 1.0, 2001)
        steepest = float(np.diff(shape(grid)).max() / grid[1])
        sense = float(random.choice([-1.0, 1.0])) if steepest < _STEEPEST else 1.0
        # deflection never falls as the torque grows
        most = 0.6 if sense > 0 else min(0.6, 0.8 / steepest)
        path = scene.since_standing(sense * top * shape(scene.net[:, joint] / top))

        def parameters(size: float) -> dict[str, Any]:
            return {"extra_share_at_top": sense * size, "torque_top_Nm": top, **extra}

        return in_joint(scene, joint, path, parameters, (0.005, most))

    return draw


def _curve(law: str, random: Generator) -> tuple[Callable[[Array], Array], dict[str, Any]]:
    if law == "k1k2k3":
        a, b = np.sort(random.uniform(0.15, 0.85, 2))
        w = random.uniform(0.2, 0.8)

        def pieces(x: Array) -> Array:
            size = np.abs(x)
            bent = w * np.maximum(size - a, 0) / (1 - a)
            return np.asarray(np.sign(x) * (bent + (1 - w) * np.maximum(size - b, 0) / (1 - b)))

        return pieces, {"T1_share": a, "T2_share": b}
    if law == "cubic":
        return lambda x: x**3, {}
    if law == "tanh":
        width = random.uniform(0.1, 0.5)
        return lambda x: np.tanh(x / width) / np.tanh(1 / width), {"width_share": width}
    if law == "hertz":
        power = random.choice([random.uniform(0.5, 0.8), random.uniform(1.3, 1.8)])
        return lambda x: np.sign(x) * np.abs(x) ** power, {"power": power}
    rate = random.uniform(1.5, 5.0)
    return lambda x: np.sign(x) * np.expm1(rate * np.abs(x)) / np.expm1(rate), {"rate": rate}


def wrong_springs(which: str) -> Callable[[Scene, Generator], Drawn]:
    """Springs off by far more than stated; size is the logarithm of the factor."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        part = share_of_joints(scene)
        able = np.flatnonzero(part > 0.1)
        count = {"one_joint": 1, "two_joints": 2, "all_random": 6}[which]
        joints = np.arange(6) if count == 6 else random.permutation(able)[:count]
        pattern = np.zeros(6)
        pattern[joints] = random.choice([-1.0, -1.0, 1.0], len(joints)) * random.uniform(
            0.5, 1.0, len(joints)
        )

        def parameters(size: float) -> dict[str, Any]:
            return {f"factor_joint{j + 1}": float(np.exp(size * pattern[j])) for j in joints}

        return Drawn(
            lambda size: Change(springs=np.exp(size * pattern)),
            parameters,
            (3.0 * scene.plan.relative_sd, 1.3),
            tuple(int(j) + 1 for j in np.sort(joints)),
        )

    return draw
