"""Joints that follow late."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden import memory
from rig.worlds.hidden.effect import Drawn, draw_joint
from rig.worlds.hidden.joint_path import in_joint, top_of
from rig.worlds.hidden.meaning import run_seconds, straight_factor
from rig.worlds.hidden.scene import Scene

_NEVER_S = 1e9


def creep(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Deflection that follows late; size is the late share of the elastic deflection."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        joint = draw_joint(scene, random)
        times, weights, extra = _spectrum(law, random)
        load, part = scene.torque[:, joint], 1.0
        if law == "stress_dependent":  # grows faster than the load
            load = load * np.abs(load) / top_of(scene, joint)
            part = straight_factor(lambda x: x**2)
        path = memory.retarded(scene.history.time, load, times, weights)
        seconds = run_seconds(scene)
        after = part * float(weights @ -np.expm1(-seconds / times))  # of a load that stands so long
        ends = law not in ("power", "logarithmic", "burgers")

        def parameters(size: float) -> dict[str, Any]:
            found = {"creep_fraction_of_run": size * after, "run_s": seconds, "law_size": size}
            if ends:
                found["creep_fraction"] = size * part * float(weights.sum())
            return found | (extra or {"times_s": times, "weights": weights})

        return in_joint(scene, joint, path, parameters, (0.003, 0.8))

    return draw


def _spectrum(law: str, random: Generator) -> tuple[Array, Array, dict[str, Any]]:
    """Retardation times s, weights, and what the law is named by."""
    if law in ("standard_solid", "stress_dependent"):
        times = np.exp(random.uniform(np.log(3.0), np.log(120.0), 1))
        extra = {} if law == "standard_solid" else {"time_s": float(times[0])}
        return times, np.ones(1), extra
    if law in ("two_term_prony", "three_term_prony"):
        count = 2 if law.startswith("two") else 3
        edges = np.log(np.array([2.0, 8.0, 60.0, 400.0])[[0, 1, 3] if count == 2 else slice(None)])
        times = np.exp(random.uniform(edges[:-1], edges[1:]))
        return times, random.dirichlet(np.full(count, 3.0)), {}
    if law == "burgers":  # a Kelvin element, and a dashpot that never comes back
        time, viscous = np.exp(random.uniform(np.log([3.0, 300.0]), np.log([60.0, 3000.0])))
        share = {"time_s": float(time), "viscous_s": float(viscous)}
        return np.array([time, _NEVER_S]), np.array([1.0, _NEVER_S / viscous]), share
    times = np.geomspace(0.1, 3e4, 30)
    if law == "power":  # J = (t / 100 s)^n has a spectrum that grows as T^n
        power = random.uniform(0.1, 0.5)
        weights = times**power * np.log(times[1] / times[0]) / math.gamma(1 - power) * power
        return times, weights / 100.0**power, {"power": power}
    start = random.uniform(0.5, 10.0)  # J = log(1 + t / start): even from `start` on
    return times, 0.2 * np.exp(-start / times) * np.log(times[1] / times[0]), {"start_s": start}
