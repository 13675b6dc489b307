"""Measurements in which one effect acts, by formulas of their own.

The generator shares only the arm's Jacobian with the library; its laws are other members of the
families (sharp, exponential, power laws) than those the library is built from.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.arm import tool_offset
from rig.dataset import Dataset
from rig.models.robot import load_robot
from rig.tables import import_table

Q = {
    "P1": [0.256, -1.664, -1.684, -1.365, 1.571, -1.336],
    "P2": [0.054, -1.480, -1.948, -1.284, 1.571, -1.336],
}
STIFFNESS = np.array([36000.0, 57000, 18500, 7300, 7400, 8000])
TOP = {"x": 200.0, "y": 90.0}
META = """robot: ur10e
poses:
  P1: {{q_rad: {P1}, tcp_xyz_mm: [0, 0, 100]}}
  P2: {{q_rad: {P2}, tcp_xyz_mm: [0, 0, 100]}}
directions: {{x: [1, 0, 0], y: [0, 1, 0]}}
instruments:
  force: {{standard_uncertainty_N: 0.05, gain_relative_sd: 0.005}}
  displacement: {{standard_uncertainty_mm: 0.002, gain_relative_sd: 0.003}}
simulation:
  joint_stiffness_Nm_per_rad: [37000, 56000, 18000, 7100, 7500, 8000]
  joint_stiffness_relative_sd: 0.1
"""


@dataclass
class Sample:
    """One row before noise: where it belongs, torques of the joints, deflection of the joints."""

    pose: str
    direction: str
    repetition: int
    branch: str
    step: int
    time: float
    session: float
    force: float
    first: bool


Law = Callable[[list[Sample], np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def walk(poses: tuple[str, ...], hold: int = 4, steps: int = 8) -> list[Sample]:
    """Loading and unloading in steps, zero before, three times each."""
    out, session = [], 0.0
    for pose in poses:
        for direction in ("x", "y"):
            for repetition in (1, 2, 3):
                time = 0.0
                levels = [("zero", 0)] + [("loading", s) for s in range(1, steps + 1)]
                levels += [("unloading", s) for s in range(steps - 1, 0, -1)]
                for branch, step in levels:
                    time += 7.0
                    for i in range(hold):
                        time += 1.0
                        force = TOP[direction] * step / steps
                        out.append(
                            Sample(
                                pose,
                                direction,
                                repetition,
                                branch,
                                step,
                                time,
                                session + time,
                                force,
                                i == 0,
                            )
                        )
                session += time + 200.0
    return out


def measure(
    tmp: Path,
    law: Law,
    poses: tuple[str, ...] = ("P1",),
    seed: int = 0,
    drop: tuple[str, ...] = (),
    noise: float = 1.0,
) -> Dataset:
    """A data set in which `law` acts: (samples, torques, levers) -> (joint deflections, more m)."""
    rng = np.random.default_rng(seed)
    arm, samples = load_robot("ur10e"), walk(poses)
    lever = np.empty((len(samples), 6))
    for pose in poses:
        J = arm.jacobian(np.array(Q[pose]), tool_offset(np.array([0, 0, 0.1])))[:3]
        for k, d in enumerate(("x", "y")):
            mine = [s.pose == pose and s.direction == d for s in samples]
            lever[mine] = J[k]
    force = np.array([s.force for s in samples])
    torque = lever * force[:, None]
    joints, more = law(samples, torque, lever)
    u = (np.sum(lever * (torque / STIFFNESS + joints), axis=1) + more) * 1e3
    u += rng.normal(0, 0.0015 * noise, len(u))
    q = torque / STIFFNESS + joints + rng.normal(0, 1e-5 * noise, joints.shape)
    f = force + rng.normal(0, 0.05 * noise, len(u))
    lines = [
        "time_s,session_s,pose,direction,repetition,branch,step,force_N,displacement_mm,"
        + ",".join(f"q{j}_rad" for j in range(1, 7))
    ]
    datum: dict[tuple[str, str], float] = {}
    for i, s in enumerate(samples):
        zero = datum.setdefault((s.pose, s.direction), u[i])
        angles = np.array(Q[s.pose]) + q[i]
        values = [
            s.time,
            s.session,
            s.pose,
            s.direction,
            s.repetition,
            s.branch,
            s.step,
            f[i],
            u[i] - zero,
            *angles,
        ]
        lines.append(",".join(str(v) for v in values))
    if "q" in drop:
        lines = [",".join(line.split(",")[:9]) for line in lines]
    if "unloading" in drop:
        lines = [lines[0], *(x for x in lines[1:] if "unloading" not in x)]
    (tmp / "samples.csv").write_text("\n".join(lines) + "\n")
    (tmp / "meta.yaml").write_text(META.format(**Q))
    return import_table(tmp / "samples.csv", tmp / "meta.yaml")


def nothing(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    return np.zeros_like(torque), np.zeros(len(samples))


def yields(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """Joint 1 flows above 45 Nm, a fifth as stiff; what has flowed stays."""
    joints, flowed = np.zeros_like(torque), 0.0
    for i, s in enumerate(samples):
        if i and samples[i - 1].pose != s.pose:
            flowed = 0.0
        flowed = max(flowed, max(abs(torque[i, 0]) - 45.0, 0.0) * 4 / STIFFNESS[0])
        joints[i, 0] = np.sign(lever[i, 0]) * flowed
    return joints, np.zeros(len(samples))


def creeps(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """Joint 3: a fifth of its deflection comes late, with 20 s."""
    joints, z = np.zeros_like(torque), 0.0
    for i, s in enumerate(samples):
        before = samples[i - 1].session if i else 0.0
        z += (torque[i, 2] - z) * (1 - np.exp(-(s.session - before) / 20.0))
        joints[i, 2] = 0.2 * z / STIFFNESS[2]
    return joints, np.zeros(len(samples))


def creep_at_once(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """Joints 1 and 3: each a fifth of its deflection late, with 8 s and with 40 s."""
    joints, more = creeps(samples, torque, lever)
    for joint, late_s in ((0, 8.0), (2, 40.0)):
        z, before = 0.0, 0.0
        for i, s in enumerate(samples):
            z += (torque[i, joint] - z) * (1 - np.exp(-(s.session - before) / late_s))
            joints[i, joint], before = 0.2 * z / STIFFNESS[joint], s.session
    return joints, more


def hardens(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """Joint 3 grows stiffer smoothly: a cubic part of a tenth at the largest torque."""
    joints = np.zeros_like(torque)
    top = np.abs(torque[:, 2]).max()
    joints[:, 2] = -0.1 * torque[:, 2] ** 3 / top**2 / STIFFNESS[2]
    return joints, np.zeros(len(samples))


def drifts(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """The target walks away by 40 um, as warm-up does."""
    t = np.array([s.session for s in samples])
    return np.zeros_like(torque), 4e-5 * (1 - np.exp(-t / (0.4 * t.max())))


def jumps(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """The datum of x jumps by 30 um before its second repetition."""
    return np.zeros_like(torque), np.array(
        [3e-5 if s.direction == "x" and s.repetition > 1 else 0.0 for s in samples]
    )


def seats(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """40 um of seating, arctangent of the force."""
    f = np.array([s.force for s in samples])
    return np.zeros_like(torque), 4e-5 * 2 / np.pi * np.arctan(f / 10.0)


def slips(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """As `yields`, about the base's vertical axis, unseen by the encoders."""
    joints, _ = yields(samples, torque, lever)
    return np.zeros_like(torque), lever[:, 0] * joints[:, 0]


def ripples(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """What no word stands for: the room breathes every 47 s."""
    t = np.array([s.session for s in samples])
    return np.zeros_like(torque), 3e-5 * np.sin(2 * np.pi * t / 47.0)


def wanders(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """The target follows the room: up and down in a fifth of the session, never twice alike."""
    t = np.array([s.session for s in samples]) / samples[-1].session
    return np.zeros_like(torque), 4e-5 * (np.sin(31 * t**0.8) - 0.6 * np.sin(19 * t**1.3 + 1))


def bends(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """The laser reads a tenth low, and at full range a hundredth lower."""
    u = np.sum(lever * torque / STIFFNESS, axis=1)
    return np.zeros_like(torque), -0.1 * u * (1 + 0.08 * np.abs(u) / np.abs(u).max())


def lags(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """The laser is 1.5 s late: at the first sample of a hold it still shows the turning screw,
    which takes 7 s and stops half a second before."""
    u = np.sum(lever * torque / STIFFNESS, axis=1)
    late = np.zeros(len(samples))
    for i, s in enumerate(samples):
        if s.first and i and s.step:
            late[i] = (u[i - 1] - u[i]) * (1.5 - 0.5) / 7.0
    return np.zeros_like(torque), late
