"""From an arm and its changes to the table that is measured, and its META."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Array
from rig.worlds.hidden import gap
from rig.worlds.hidden.noise import Noise, q_digits, to_digits
from rig.worlds.hidden.scene import BRANCHES, Change, Scene, observe


def columns_of(
    scene: Scene, changes: Sequence[Change], noise: Noise, warmth: Array
) -> dict[str, NDArray[Any]]:
    """Columns by their contracted names, one row per sample, in the order of measurement."""
    plan, history = scene.plan, scene.history
    reading = observe(scene, changes)
    setup = history.setup[history.sample]
    names = [s.pose for s in plan.setups], [s.direction for s in plan.setups]
    columns: dict[str, NDArray[Any]] = {"time_s": history.run_time}
    if plan.recorded.session:
        columns["session_s"] = history.time[history.sample]
    columns["pose"] = np.array(names[0])[setup]
    columns["direction"] = np.array(names[1])[setup]
    columns["repetition"] = history.repetition
    columns["branch"] = np.array(BRANCHES)[history.branch]
    columns["step"] = history.step
    force = noise.force_gain * reading.force_N @ noise.crosstalk.T + noise.force_N
    force = gap.tared(scene, force)
    # along the direction the gain alone counts
    digit = plan.instruments.force_digit_N
    columns["force_N"] = to_digits(gap.along(scene, force), digit)
    if plan.recorded.components:
        for k, axis in enumerate("xyz"):
            columns[f"force_{axis}_N"] = to_digits(force[:, k], digit)
    moved = noise.displacement_gain * reading.displacement_mm + noise.displacement_mm
    moved = gap.zeroed(scene, moved, plan.recorded.datum == "repetition")
    columns["displacement_mm"] = to_digits(moved, plan.instruments.displacement_digit_mm)
    if plan.recorded.q:
        q = q_digits(reading.q + noise.q)
        columns |= {f"q{j + 1}_rad": q[:, j] for j in range(6)}
    if plan.recorded.temperature:
        columns |= {f"temperature{j + 1}_C": warmth[:, j] for j in range(6)}
    return columns


def meta_of(scene: Scene) -> dict[str, Any]:
    """What META.yaml holds."""
    plan, recorded, instruments = scene.plan, scene.plan.recorded, scene.plan.instruments
    meta: dict[str, Any] = {
        "robot": "ur10e",
        "poses": {
            name: {"q_rad": q.tolist(), "tcp_xyz_mm": plan.tcp_mm.tolist()}
            for name, q in plan.poses.items()
        },
        "directions": {s.direction: list(s.unit) for s in plan.setups},
        "joint_encoder": recorded.encoder,
        "datum": recorded.datum,
        "tare": recorded.tare,
        "instruments": {
            "force": {
                "standard_uncertainty_N": instruments.force_N,
                "gain_relative_sd": instruments.force_gain,
            },
            "displacement": {
                "standard_uncertainty_mm": instruments.displacement_mm,
                "gain_relative_sd": instruments.displacement_gain,
            },
        },
        "simulation": {
            "joint_stiffness_Nm_per_rad": plan.believed.tolist(),
            "joint_stiffness_relative_sd": plan.relative_sd,
        },
    }
    return meta
