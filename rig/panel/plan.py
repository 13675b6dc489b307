"""What the page is told before the run: levels, the arm's shape, what the simulation expects."""

from __future__ import annotations

import numpy as np

from identification.arm import Arm, along, tool_offset
from rig.models.robot import load_robot
from rig.panel.state import Plan, PlannedRun
from rig.protocol import MeasurementProtocol, Pose
from rig.units import MM_PER_M, N_PER_MM

Point = tuple[float, float, float]


def plan_of(protocol: MeasurementProtocol, screw_pitch_mm: float) -> Plan:
    """The protocol in short, and the arm in each of its poses."""
    arm = load_robot(protocol.robot)
    return Plan(
        title=protocol.title,
        robot=protocol.robot,
        repetitions=protocol.repetitions,
        screw_pitch_mm=screw_pitch_mm,
        rate_Hz=protocol.sampling.rate_Hz,
        runs=tuple(
            PlannedRun(
                run.pose, run.direction, protocol.directions[run.direction], tuple(run.forces_N)
            )
            for run in protocol.runs
        ),
        arms={name: _outline(arm, pose) for name, pose in protocol.poses.items()},
    )


def prediction_of(protocol: MeasurementProtocol) -> dict[str, list[tuple[float, float]]]:
    """By "pose|direction": (force N, displacement mm) from zero load to every level.

    Stiff links and the six linear springs of the robot's model file: u = F / k along the direction,
    what the data set's META calls the simulation.
    """
    arm = load_robot(protocol.robot)
    curves: dict[str, list[tuple[float, float]]] = {}
    for run in protocol.runs:
        pose = protocol.poses[run.pose]
        C = arm.compliance(np.array(pose.q_rad), _tool(pose))
        stiffness_N_per_mm = N_PER_MM * float(
            along(C, np.array(protocol.directions[run.direction]))
        )
        levels = {0.0, *run.forces_N}
        curve = curves.setdefault(f"{run.pose}|{run.direction}", [])
        merged = levels | {force for force, _ in curve}
        curve[:] = [(force, force / stiffness_N_per_mm) for force in sorted(merged)]
    return curves


def _outline(arm: Arm, pose: Pose) -> tuple[Point, ...]:
    frames = arm.frames(np.array(pose.q_rad))
    tool = arm.fk(np.array(pose.q_rad), _tool(pose))
    points = MM_PER_M * np.vstack([frames[:, :3, 3], tool[None, :3, 3]])
    return tuple((float(x), float(y), float(z)) for x, y, z in points)


def _tool(pose: Pose) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return tool_offset(np.array(pose.tcp_xyz_mm) / MM_PER_M)
