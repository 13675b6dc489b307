"""Joints that give way above a threshold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden import memory
from rig.worlds.hidden.effect import Drawn, draw_joint
from rig.worlds.hidden.joint_path import in_joint, onset, reached
from rig.worlds.hidden.meaning import equal_work_threshold
from rig.worlds.hidden.scene import Index, Scene


def yields(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Gives way above a threshold; size is plastic over elastic compliance beyond it."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        joint = draw_joint(scene, random)
        limit = reached(scene, joint, random.uniform(0.4, 0.88))
        path, extra = knee_path(scene, scene.net[:, joint], limit, law, random)
        path = scene.since_standing(path)

        def parameters(size: float) -> dict[str, Any]:
            return {"hardening_ratio": 1.0 / (1.0 + size), **extra}

        return in_joint(scene, joint, path, parameters, (0.02, 40.0), onset(scene, joint, limit))

    return draw


def knee_path(
    scene: Scene, load: Array, limit: float, law: str, random: Generator
) -> tuple[Array, dict[str, Any]]:
    """(n) plastic path in units of the load; the threshold as a sharp knee of equal work has it,
    the limit as the law has it, and the law's further parameters."""
    fresh, time = scene.standing, scene.history.time
    if law == "perzyna":  # loaded slowly, it gives way at the limit, all at once
        power, time_s = random.choice([1.0, 1.5, 2.0]), random.uniform(1.5, 15.0)
        path = memory.flow(time, load, limit, time_s, power, fresh)
        return path, {"threshold_Nm": limit, "flow_time_s": time_s, "power": power}
    follow, extra = _knee_law(limit, law, random)
    if law == "taken_back":
        fresh = scene.history.run
    threshold = equal_work_threshold(
        lambda x: follow(x, np.zeros(len(x), dtype=np.int64)), float(np.abs(load).max())
    )
    return follow(load, fresh), {"threshold_Nm": threshold, "law_limit_Nm": limit, **extra}


def _knee_law(
    limit: float, law: str, random: Generator
) -> tuple[Callable[[Array, Index], Array], dict[str, Any]]:
    """A law that knows no time: path (n) of a load (n) that starts anew with `fresh` (n)."""
    if law == "sharp":
        return lambda x, fresh: memory.play(x, limit, fresh), {}
    if law == "taken_back":
        return lambda x, fresh: memory.play(x, limit, fresh), {"returns": "between runs"}
    if law == "menegotto_pinto":
        sharp = random.uniform(3.0, 15.0)
        ratio = random.uniform(0.1, 0.6)
        part = ratio / (1.0 - ratio)
        return lambda x, fresh: part * memory.rounded_knee(x, limit, ratio, sharp, fresh), {
            "Steel02_R0": sharp
        }
    if law == "ramberg_osgood":
        power = random.uniform(4.0, 12.0)
        return lambda x, fresh: memory.loops(x, lambda s: limit * (s / limit) ** power, fresh), {
            "power": power
        }
    first, recall = random.uniform(0.2, 1.0), random.uniform(1.0, 6.0) / limit
    second = random.uniform(0.5, 1.5)
    return lambda x, fresh: memory.backstress(x, limit, first, recall, second, fresh), {
        "backstress_ratio": first,
        "recall_per_Nm": recall,
    }
