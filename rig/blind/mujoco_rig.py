"""Cases for the blind check from MuJoCo: design, session, instruments and answers.

Every case is of the `rich` kind (two poses, loading and unloading, joint readings, components of
the force), so that an effect can be told from the others: what is tested is the law, not the
design. Mixtures and effects of the instruments are not drawn. `accept` holds the true word, and
linear words that these data, without noise, can't tell from a linear truth.

The engine turns hinges by finite angles: the lever changes as the arm gives way, which bends every
curve by a few micrometres. No word stands for that, so a case with nothing else in it is `none`;
`draw_small_turns` leaves it out, to judge the laws alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.blind.mujoco_effects import EFFECTS, Hidden, Random, Rig, draw_effect
from rig.blind.mujoco_label import answers, structural_mm
from rig.blind.mujoco_session import AXES, Design, Row, levers, session, true_mm
from rig.errors import InputError
from rig.worlds.arm import place

__all__ = ["EFFECTS", "MujocoCase", "draw_case", "draw_small_turns"]

STATED = np.array([36000.0, 57000.0, 18000.0, 7200.0, 7500.0, 8000.0])  # Nm/rad, then varied
START = np.deg2rad([13.4, -99.8, -108.1, -62.1, 90.0, -76.6])
SNR = (1.5, 60.0)
SMALL = 0.01
_ATTEMPTS = 40
_SHARE_NONE = 0.1


@dataclass(frozen=True)
class MujocoCase:
    """As `rig.blind.case.Case`."""

    name: str
    columns: dict[str, Any]
    meta: dict[str, Any]
    label: dict[str, Any]


def draw_case(seed: int, number: int, *, word: str | None = None, turns: float = 1.0) -> MujocoCase:
    """Case `number` of a seed: one effect of the word, or one of any word or none (one in ten).

    The effect is drawn anew until its gap is 1.5 to 60 times the noise. InputError if that does
    not happen. turns: of `MujocoArm`.
    """
    random = np.random.default_rng([seed, number, 4])
    if word is None:
        word = "none" if random.random() < _SHARE_NONE else str(random.choice(EFFECTS))
    for _ in range(_ATTEMPTS):
        design = _design(random)
        springs = design.stated * np.exp(design.relative_sd * random.standard_normal(6))
        hidden = None if word == "none" else _effect(word, design, springs, random)
        rows = session(design, springs, hidden, turns)
        columns, noise_mm = _instruments(rows, design, random)
        snr = float(np.sqrt(np.mean(structural_mm(rows, design) ** 2))) / noise_mm
        if hidden is None or SNR[0] <= snr <= SNR[1]:
            label = answers(hidden, rows, design, noise_mm)
            return MujocoCase(f"m{seed}-{number:04d}", columns, _meta(design), label)
    raise InputError(
        f"{word}: no gap of {SNR[0]:g} to {SNR[1]:g} times the noise in {_ATTEMPTS} draws "
        f"(seed {seed}, number {number}). Take another seed."
    )


def draw_small_turns(seed: int, number: int, *, word: str | None = None) -> MujocoCase:
    """As `draw_case`, with turns so small that the arm's levers stay what they are."""
    return draw_case(seed, number, word=word, turns=SMALL)


def _design(random: Random) -> Design:
    turn = np.deg2rad([25.0, 12.0, 12.0, 12.0, 5.0, 10.0])
    poses = {f"P{i + 1}": START + turn * random.uniform(-1, 1, 6) for i in range(2)}
    names = [("x", "y"), ("x", "z"), ("x", "y", "z")][int(random.integers(3))]
    most = {"x": (150.0, 210.0), "y": (80.0, 100.0), "z": (70.0, 100.0)}
    return Design(
        poses={name: np.round(q, 6) for name, q in poses.items()},
        tool=np.array([0.0, 0.0, round(float(random.uniform(0.0, 0.15)), 3)]),
        forces={d: float(random.uniform(*most[d])) for d in names},
        steps=int(random.integers(6, 10)),
        samples=int(random.integers(4, 9)),
        repetitions=3,
        noise_mm=round(float(random.uniform(0.001, 0.003)), 4),
        noise_N=round(float(random.uniform(0.04, 0.12)), 3),
        stated=np.round(STATED * np.exp(0.06 * random.standard_normal(6)), -2),
        relative_sd=float(random.choice([0.05, 0.08, 0.1, 0.15])),
        rest_s=float(random.uniform(60.0, 150.0)),
    )


def _effect(word: str, design: Design, springs: Array, random: Random) -> Hidden:
    """Sized by the largest loads of the first pose."""
    q = design.poses["P1"]
    at = place(q).tool(design.tool)
    loads = [f * AXES[d] for d, f in design.forces.items()]
    torque = np.max([np.abs(levers(design, "P1") @ load) for load in loads], axis=0)
    moment = np.max([np.abs(np.cross(at, load)) for load in loads], axis=0)
    return draw_effect(word, Rig(q, springs, torque, moment), random)


# --------------------------------------------------------------------------------- instruments

GAIN_FORCE, GAIN_LASER, CROSS_TALK = 0.005, 0.003, 0.002
NOISE_Q_RAD = 1e-5


def _instruments(
    rows: Sequence[Row], design: Design, random: Random
) -> tuple[dict[str, Any], float]:
    """Columns as the instruments give them, and the rms in mm of what is random in them."""
    n, u = len(rows), true_mm(rows)
    force = np.array([row.force * AXES[row.direction] for row in rows])
    setups = [(row.pose, row.direction) for row in rows]
    runs = [(*s, row.repetition) for s, row in zip(setups, rows, strict=True)]
    scatter = {run: 0.5 * design.noise_mm * random.standard_normal() for run in dict.fromkeys(runs)}
    laser = u * (1 + GAIN_LASER * random.standard_normal())
    laser = laser + design.noise_mm * random.standard_normal(n)
    laser = np.round(laser + [scatter[run] for run in runs], 4)
    force_noise = design.noise_N * random.standard_normal((n, 3))
    measured = force * (1 + GAIN_FORCE * random.standard_normal()) + force_noise
    # Into the other two components only: along its axis it would be a gain.
    cross = CROSS_TALK * random.standard_normal((3, 3)) * (1 - np.eye(3))
    measured += force @ cross
    first = {setup: laser[setups.index(setup)] for setup in dict.fromkeys(setups)}
    columns: dict[str, Any] = {
        "time_s": np.round([row.time_s for row in rows], 3),
        "session_s": np.round([row.session_s for row in rows], 3),
        "pose": np.array([row.pose for row in rows]),
        "direction": np.array([row.direction for row in rows]),
        "repetition": np.array([row.repetition for row in rows]),
        "branch": np.array([row.branch for row in rows]),
        "step": np.array([row.step for row in rows]),
        "force_N": np.round(
            [f @ AXES[row.direction] for f, row in zip(measured, rows, strict=True)], 3
        ),
        **{f"force_{a}_N": np.round(measured[:, i], 3) for i, a in enumerate("xyz")},
        "displacement_mm": np.round(laser - [first[setup] for setup in setups], 4),
    }
    offset = 5e-6 * random.standard_normal(6)
    stands = np.array([design.poses[row.pose] + row.turned for row in rows])
    readings = np.round(stands + offset + NOISE_Q_RAD * random.standard_normal((n, 6)), 6)
    columns |= {f"q{j + 1}_rad": readings[:, j] for j in range(6)}
    along = np.array([f @ AXES[row.direction] for f, row in zip(force_noise, rows, strict=True)])
    each = {
        (p, d): 1e3 * float(np.sum((levers(design, p) @ AXES[d]) ** 2 / design.stated))
        for p, d in dict.fromkeys(setups)
    }
    compliance = np.array([each[setup] for setup in setups])
    random_part = design.noise_mm**2 * 1.25 + float(np.mean((compliance * along) ** 2))
    return columns, float(np.sqrt(random_part))


def _meta(design: Design) -> dict[str, Any]:
    return {
        "robot": "ur10e",
        "poses": {
            name: {"q_rad": q.tolist(), "tcp_xyz_mm": (1e3 * design.tool).tolist()}
            for name, q in design.poses.items()
        },
        "directions": {d: AXES[d].tolist() for d in design.forces},
        "joint_encoder": "output",
        "instruments": {
            "force": {"standard_uncertainty_N": design.noise_N, "gain_relative_sd": GAIN_FORCE},
            "displacement": {
                "standard_uncertainty_mm": float(np.round(1.12 * design.noise_mm, 5)),
                "gain_relative_sd": GAIN_LASER,
            },
        },
        "simulation": {
            "joint_stiffness_Nm_per_rad": design.stated.tolist(),
            "joint_stiffness_relative_sd": design.relative_sd,
        },
    }
