"""Cases for tests of the blind check, drawn by a small generator: a linear arm, jumps, scales."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.worlds.arm import place

Q = (0.2344, -1.7425, -1.8867, -1.0832, 1.5708, -1.3364)
SPRINGS = np.array([37000.0, 57000.0, 18000.0, 7100.0, 7500.0, 8000.0])
DIRECTIONS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
NOISE_MM = 0.002
EFFECTS = ("zero_shift", "force_scale")


@dataclass(frozen=True)
class FakeCase:
    name: str
    columns: dict[str, Any]
    meta: dict[str, Any]
    label: dict[str, Any]


def draw(seed: int, number: int, *, word: str | None = None) -> FakeCase:
    """word, or by number: no effect, a shifted datum."""
    random = np.random.default_rng([seed, number])
    word = word or ("none", "zero_shift")[number % 2]
    size = 0.0731 + 0.01 * random.random()
    columns = _columns(random, size if word == "zero_shift" else 0.0)
    label: dict[str, Any] = {
        "truth": [word],
        "forms": [] if word == "none" else ["one_jump"],
        "laws": [] if word == "none" else ["fitted"],
        "parameters": [] if word == "none" else [{"shift_mm": size}],
        "accept": [word],
        "accept_each": [[word]],
        "snr": 0.0 if word == "none" else 20.0,
        "snr_each": [] if word == "none" else [20.0],
        "noise_rms_mm": NOISE_MM,
        "design": "medium",
        "where": None
        if word == "none"
        else {
            "directions": ["x", "y"],
            "main_direction": "y",
            "joints": [],
            "seen_by_encoders": None,
        },
    }
    return FakeCase(f"fake{seed}-{number}", columns, _meta(), label)


def _meta() -> dict[str, Any]:
    return {
        "robot": "ur10e",
        "poses": {"P1": {"q_rad": list(Q), "tcp_xyz_mm": [0.0, 0.0, 0.0]}},
        "directions": {name: list(v) for name, v in DIRECTIONS.items()},
        "instruments": {
            "force": {"standard_uncertainty_N": 0.05},
            "displacement": {"standard_uncertainty_mm": NOISE_MM},
        },
        "simulation": {"joint_stiffness_Nm_per_rad": SPRINGS.tolist()},
    }


def _columns(random: np.random.Generator, shift_mm: float) -> dict[str, Any]:
    arm = place(np.array(Q))
    levers = arm.levers(arm.tool(np.zeros(3)))
    springs = SPRINGS * (1 + 0.05 * random.standard_normal(6))
    rows: dict[str, list[Any]] = {
        n: []
        for n in (
            "time_s",
            "direction",
            "repetition",
            "branch",
            "step",
            "force_N",
            "displacement_mm",
        )
    }
    for d, vector in DIRECTIONS.items():
        compliance = 1e3 * float(np.sum((levers @ np.array(vector)) ** 2 / springs))
        for repetition in (1, 2, 3):
            plan = [("zero", 0)] + [("loading", s) for s in range(1, 7)]
            plan += [("unloading", s) for s in range(5, 0, -1)] + [("zero", 0)]
            for i, (branch, step) in enumerate(plan):
                for k in range(4):
                    force = 15.0 * step
                    u = compliance * force + (shift_mm if repetition == 2 else 0.0)
                    row = (
                        20.0 * i + k,
                        d,
                        repetition,
                        branch,
                        step,
                        force + 0.05 * random.standard_normal(),
                        u + NOISE_MM * random.standard_normal(),
                    )
                    for name, value in zip(rows, row, strict=True):
                        rows[name].append(value)
    return {name: np.array(values) for name, values in rows.items()}
