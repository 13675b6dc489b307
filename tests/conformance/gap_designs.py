"""Designs of measurements for tests of the diagnosis: arm and bench, force or displacement imposed.

A noisy, linear rig whose springs are a little off, as data of the diagnosis; further displacement
and joint deflection can be added to it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.arm import tool_offset
from identification.gap.data import GapData
from rig.dataset import Dataset
from rig.diagnosis.gap_data import gap_data
from rig.models.robot import load_robot
from rig.tables import import_table

Array = NDArray[np.float64]
Q = {
    "P1": [0.256, -1.664, -1.684, -1.365, 1.571, -1.336],
    "P2": [0.054, -1.480, -1.948, -1.284, 1.571, -1.336],
}
TCP_MM = [0.0, 0.0, 100.0]
STATED = np.array([37000.0, 56000, 18000, 7100, 7500, 8000])
TRUE = STATED * np.array([0.97, 1.02, 1.03, 1.03, 0.99, 1.0])
TOP_N = {"x": 200.0, "y": 90.0}
REST_S = 200.0


@dataclass(frozen=True)
class Design:
    """What is measured, and how."""

    poses: tuple[str, ...] = ("P1",)
    directions: tuple[str, ...] = ("x", "y")
    repetitions: int = 3
    steps: int = 8
    hold: int = 4
    unload: bool = True
    readings: bool = True
    components: bool = False
    clock: bool = True
    arm: bool = True
    imposed: str = "force"
    continuous: bool = False


DESIGNS = {
    "rich": Design(("P1", "P2"), repetitions=2, steps=5, hold=8, components=True),
    "medium": Design(),
    "paper": Design(steps=10, hold=1, unload=False, readings=False, clock=False),
    # read at rest, an arm answers the force that was read
    "arm imposed": Design(steps=6, imposed="displacement", continuous=True),
    "bench": Design(directions=("x",), arm=False, hold=3, components=True),
    "bench levels imposed": Design(directions=("x",), arm=False, hold=3, imposed="displacement"),
    "bench imposed": Design(directions=("x",), arm=False, imposed="displacement", continuous=True),
}
ARMS = tuple(name for name, d in DESIGNS.items() if d.arm)
# Further displacement (n,) m and joint deflection (n, 6) rad, from the table without noise.
Law = Callable[[pd.DataFrame, Array], tuple[Array, Array]]


def table(design: Design) -> pd.DataFrame:
    """Rows in the order of measurement: where they belong, clocks, force of the nominal path."""
    rows: list[dict[str, object]] = []
    session = 0.0
    for pose in design.poses:
        for direction in design.directions:
            for repetition in range(1, design.repetitions + 1):
                time = 0.0
                for branch, step, hold, share in _path(design):
                    time += 0.0 if design.continuous else 7.0
                    for _ in range(hold):
                        time += 1.0
                        rows.append(
                            {
                                "time_s": time,
                                "session_s": session + time,
                                "pose": pose,
                                "direction": direction,
                                "repetition": repetition,
                                "branch": branch,
                                "step": step,
                                "force_N": TOP_N[direction] * share,
                            }
                        )
                session += time + REST_S
    return pd.DataFrame(rows)


def _path(design: Design) -> list[tuple[str, int, int, float]]:
    """Branch, step, samples and share of the largest force, of one run."""
    if design.continuous:
        t = np.linspace(0, 2, 140)
        wave = np.where(t < 1, 0.6, 1.0) * np.sin(2 * np.pi * t)
        return [("cycle", -1, 1, float(x)) for x in wave]
    out = [("zero", 0, design.hold, 0.0)]
    n = design.steps
    out += [("loading", s, design.hold, s / n) for s in range(1, n + 1)]
    if design.unload:
        out += [("unloading", s, design.hold, s / n) for s in range(n - 1, 0, -1)]
    return out


def levers(rows: pd.DataFrame) -> Array:
    """(n, 6) m: torque of each joint per newton."""
    arm, out = load_robot("ur10e"), np.zeros((len(rows), 6))
    for pose, angles in Q.items():
        J = arm.jacobian(np.array(angles), tool_offset(np.array(TCP_MM) * 1e-3))[:3]
        for k, direction in enumerate("xyz"):
            out[((rows.pose == pose) & (rows.direction == direction)).to_numpy()] = J[k]
    return out


def noisy(
    design: Design, law: Law | None = None, seed: int = 0, noise: float = 1.0
) -> pd.DataFrame:
    """The table as measured, for `rig import`: laser zeroed at the first sample of a setup."""
    rng, rows = np.random.default_rng(seed), table(design)
    n, force = len(rows), rows["force_N"].to_numpy(float).copy()
    lever = levers(rows) if design.arm else np.zeros((n, 6))
    joints = lever * force[:, None] / TRUE
    u = np.sum(lever * joints, axis=1) if design.arm else force / 9.3e4
    if law is not None:
        more, deflection = law(rows, lever)
        u, joints = u + more + np.sum(lever * deflection, axis=1), joints + deflection
    u = u * 1e3 + rng.normal(0, 0.0015 * noise, n)
    for _, mine in rows.groupby(["pose", "direction"]).indices.items():
        u[mine] -= u[mine[0]]
    rows["displacement_mm"] = u
    rows["force_N"] = force + rng.normal(0, 0.05 * noise, n)
    if design.components:
        for axis in "xyz":
            along = (rows.direction == axis).to_numpy(float)
            rows[f"force_{axis}_N"] = force * along + rng.normal(0, 0.05 * noise, n)
    if design.readings and design.arm:
        q = np.array([Q[p] for p in rows.pose]) + joints + rng.normal(0, 1e-5 * noise, joints.shape)
        for j in range(6):
            rows[f"q{j + 1}_rad"] = q[:, j]
    return rows if design.clock else rows.drop(columns="session_s")


def meta(design: Design) -> str:
    """META.yaml of a design."""
    poses = "".join(f"  {p}: {{q_rad: {Q[p]}, tcp_xyz_mm: {TCP_MM}}}\n" for p in design.poses)
    vectors = {"x": [1, 0, 0], "y": [0, 1, 0]}
    directions = ", ".join(f"{d}: {vectors[d]}" for d in design.directions)
    springs = (
        f"  joint_stiffness_Nm_per_rad: {STATED.tolist()}\n  joint_stiffness_relative_sd: 0.1\n"
        if design.arm
        else "  stiffness_N_per_mm: {x: 95.0}\n  stiffness_relative_sd: 0.1\n"
    )
    return (
        f"robot: {'ur10e' if design.arm else 'none'}\n"
        + (f"poses:\n{poses}" if design.arm else "")
        + f"directions: {{{directions}}}\nimposed: {design.imposed}\n"
        "instruments:\n"
        "  force: {standard_uncertainty_N: 0.05, gain_relative_sd: 0.005}\n"
        "  displacement: {standard_uncertainty_mm: 0.002, gain_relative_sd: 0.003}\n"
        f"simulation:\n{springs}"
    )


def imported(rows: pd.DataFrame, meta_text: str) -> Dataset:
    """The data set that `rig import` makes of a table."""
    if "robot: none" in meta_text:
        rows = rows.drop(columns="pose", errors="ignore")
    with tempfile.TemporaryDirectory() as folder:
        csv, yaml = Path(folder) / "samples.csv", Path(folder) / "meta.yaml"
        rows.to_csv(csv, index=False)
        yaml.write_text(meta_text)
        return import_table(csv, yaml)


@cache
def linear(name: str) -> GapData:
    """The linear rig of a design."""
    return gap_data(imported(noisy(DESIGNS[name]), meta(DESIGNS[name])))
