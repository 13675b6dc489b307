"""What a protocol will do to the arm and how long it takes, before anything moves.

Displacements are those of the robot file's joint springs: an expectation with its stated relative
standard deviation, no measurement. Torques are `J^T F` of the load and the weight of the links.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np

from identification.arm import Arm, along, tool_offset
from identification.times import MOUNT_S, SCREW_S, UNLOAD_S
from rig import schemas
from rig.arrays import Array
from rig.digits import counted
from rig.models.robot import load_robot
from rig.plan_margins import (
    MARGIN,
    beyond_joints,
    limit_warnings,
    name_of,
    shares,
    soft_warnings,
    time_warnings,
    unit_warnings,
)
from rig.protocol import MeasurementProtocol, Run
from rig.protocolfile import ProtocolFile
from rig.station import Station
from rig.units import MM_PER_M, N_PER_MM
from rig.yaml.yamlfile import read_document_text
from rig.yaml.yamlnodes import Key, Problem, refuse

# What devices take, in s; the text of the plan names every one, as what hands take.
TARE_S = 2.0
AMPLIFIER_S = 4.0  # Reset and Operate, where no station says it


@dataclass(frozen=True)
class PlannedRun:
    """One run: forces N, displacement mm at the top, stiffness N/mm, torques Nm (6,) there.

    `hold_torque_Nm`: what the joints hold at the top level, weight of the links included;
    `load_torque_Nm`: the load's part alone. `duration_s`: one repetition, mounting left out.
    """

    pose: str
    direction: str
    unit_vector: tuple[float, float, float]
    forces_N: tuple[float, ...]
    steps: int
    stiffness_N_per_mm: float
    displacement_mm: float
    load_torque_Nm: tuple[float, ...]
    hold_torque_Nm: tuple[float, ...]
    torque_limit_Nm: tuple[float, ...]
    duration_s: float

    @property
    def worst_joint(self) -> int:
        """Index of the joint that comes closest to its torque limit."""
        return int(np.argmax(np.abs(self.hold_torque_Nm) / np.asarray(self.torque_limit_Nm)))


@dataclass(frozen=True)
class Plan:
    """What will happen. `speed`: times real time, above 1 for emulated stations only."""

    title: str
    robot: str
    station: str | None
    runs: tuple[PlannedRun, ...]
    repetitions: int
    mounts: int
    samples: int
    duration_s: float
    speed: float
    stiffness_relative_sd: float
    assumptions: tuple[str, ...]
    warnings: tuple[str, ...]

    def to_text(self) -> str:
        """A table of the runs, duration with its assumptions, warnings."""
        station = f", station {self.station}" if self.station else ""
        steps = sum(run.steps for run in self.runs)
        lines = [f"Plan: {self.title}", f"Robot {self.robot}{station}", "", *_table(self.runs)]
        lines += [
            f"Directions in the base frame: {'; '.join(_vectors(self.runs))}",
            "",
            f"Together: {counted(len(self.runs), 'run')} of {counted(steps, 'step')}, "
            f"{counted(self.repetitions, 'time')}; "
            f"at least {self.samples} samples",
            f"Duration: about {_time(self.duration_s)}{self._faster()}",
        ]
        lines += [f"  {text}" for text in self.assumptions]
        lines += ["", *(f"Warning: {text}" for text in self.warnings)] if self.warnings else []
        return "\n".join(lines)

    def _faster(self) -> str:
        """The least that an emulated run takes: a busy machine falls behind."""
        if self.speed <= 1:
            return ""
        least = _time(self.duration_s / self.speed)
        return f"; at {self.speed:g} times real time at least {least}"

    def to_json(self) -> dict[str, object]:
        """The same for programs."""
        return {
            "schema": schemas.PLAN,
            "title": self.title,
            "robot": self.robot,
            "station": self.station,
            "repetitions": self.repetitions,
            "samples": self.samples,
            "duration_s": self.duration_s,
            "speed": self.speed,
            "joint_stiffness_relative_sd": self.stiffness_relative_sd,
            "runs": [
                {
                    "pose": run.pose,
                    "direction": run.direction,
                    "unit_vector": list(run.unit_vector),
                    "forces_N": list(run.forces_N),
                    "steps": run.steps,
                    "expected_stiffness_N_per_mm": run.stiffness_N_per_mm,
                    "expected_displacement_mm": run.displacement_mm,
                    "load_torque_Nm": list(run.load_torque_Nm),
                    "hold_torque_Nm": list(run.hold_torque_Nm),
                    "torque_limit_Nm": list(run.torque_limit_Nm),
                    "duration_s": run.duration_s,
                }
                for run in self.runs
            ],
            "assumptions": list(self.assumptions),
            "warnings": list(self.warnings),
        }


def plan(protocol: MeasurementProtocol, station: Station | None = None) -> Plan:
    """Works out what the protocol will do on the station.

    Raises InputError where a pose or a load is beyond what arm, laser or dynamometer can take.
    """
    arm = load_robot(protocol.robot)
    runs = tuple(_planned(protocol, run, arm, station) for run in protocol.runs)
    warnings: list[str] = []
    errors: list[tuple[Key, str]] = list(beyond_joints(protocol, arm))
    for n, run in enumerate(runs):
        for share, refused, what, remedy in shares(protocol, run, arm, station):
            if share > refused:
                errors.append((("runs", n), f"{what}. {remedy}"))
            elif share > 1 - MARGIN:
                warnings.append(f"{name_of(run)}: {what}: {_close(share, remedy)}")
        warnings += limit_warnings(protocol, run, station)
        warnings += soft_warnings(protocol, n, run, arm, station)
    _refuse(protocol, errors)
    warnings += [*unit_warnings(protocol), *time_warnings(protocol, runs)]
    pairs = [(run.pose, run.direction) for _, run, _ in protocol.sequence()]
    mounts = 1 + sum(a != b for a, b in pairwise(pairs))
    emulated = station is not None and station.emulation is not None
    duration_s = protocol.repetitions * sum(run.duration_s for run in runs)
    return Plan(
        title=protocol.title,
        robot=arm.name,
        station=station.name if station else None,
        runs=runs,
        repetitions=protocol.repetitions,
        mounts=mounts,
        samples=protocol.repetitions * sum(_samples(protocol, run) for run in protocol.runs),
        duration_s=duration_s + (0.0 if emulated else mounts * MOUNT_S),
        speed=station.emulation.speed if station and station.emulation else 1.0,
        stiffness_relative_sd=float(np.max(arm.joint_stiffness_relative_sd)),
        assumptions=tuple(_assumptions(protocol, arm, mounts, emulated)),
        warnings=tuple(warnings),
    )


def _close(share: float, remedy: str) -> str:
    """How near to what is allowed, or how far beyond where only a stiffer arm stays within."""
    if share <= 1:
        return f"{100 * (1 - share):.0f} % to spare."
    return f"{100 * (share - 1):.0f} % too much, unless the arm is stiffer. {remedy}"


# --- one run -------------------------------------------------------------------------------------


def _planned(
    protocol: MeasurementProtocol, run: Run, arm: Arm, station: Station | None
) -> PlannedRun:
    pose, vector = protocol.poses[run.pose], protocol.directions[run.direction]
    tool = tool_offset(np.asarray(pose.tcp_xyz_mm) / MM_PER_M)
    stiffness = float(along(arm.compliance(pose.q_rad, tool), vector)) * N_PER_MM  # N/mm
    top = run.forces_N[-1]
    displacement_mm = top / stiffness
    if run.stop_at_displacement_mm is not None:
        displacement_mm = min(displacement_mm, run.stop_at_displacement_mm)
    load = arm.load_torques(pose.q_rad, [*(top * np.asarray(vector)), 0.0, 0.0, 0.0], tool)
    # The joints carry the links' weight, and push back against the load.
    hold = arm.gravity_torques(pose.q_rad) - load
    return PlannedRun(
        pose=run.pose,
        direction=run.direction,
        unit_vector=vector,
        forces_N=run.forces_N,
        steps=len(protocol.steps(run)),
        stiffness_N_per_mm=stiffness,
        displacement_mm=displacement_mm,
        load_torque_Nm=_floats(load),
        hold_torque_Nm=_floats(hold),
        torque_limit_Nm=_floats(arm.torque_limit),
        duration_s=_repetition_s(protocol, run, station),
    )


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _samples(protocol: MeasurementProtocol, run: Run) -> int:
    """Of one repetition: plateaus and settled steps; those taken while settling come on top."""
    zero_s = protocol.zero.before_s + protocol.zero.after_s
    plateaus = round(zero_s * protocol.sampling.rate_Hz)
    return plateaus + len(protocol.steps(run)) * protocol.samples_of_step


def _repetition_s(protocol: MeasurementProtocol, run: Run, station: Station | None) -> float:
    sensor = station.dynamometer if station else None
    amplifier_s = sensor.reset_settle_s + sensor.operate_settle_s if sensor else AMPLIFIER_S
    sampled_s = _samples(protocol, run) / protocol.sampling.rate_Hz
    steps = len(protocol.steps(run)) * (SCREW_S + protocol.settle.window_s)
    return amplifier_s + TARE_S + sampled_s + steps + UNLOAD_S + protocol.rest_s


def _refuse(protocol: MeasurementProtocol, errors: Sequence[tuple[Key, str]]) -> None:
    if errors:
        document = read_document_text(protocol.text, str(protocol.path), ProtocolFile)
        problems: list[Problem] = [document.problem(path, what) for path, what in errors]
        refuse(str(protocol.path), problems)


# --- text ----------------------------------------------------------------------------------------


def _time(seconds: float) -> str:
    minutes = seconds / 60
    if minutes < 2:
        return f"{ceil(seconds)} s"
    return f"{ceil(minutes)} min" if minutes < 120 else f"{minutes / 60:.1f} h"


def _assumptions(
    protocol: MeasurementProtocol, arm: Arm, mounts: int, emulated: bool
) -> Iterator[str]:
    if not emulated:
        yield f"{MOUNT_S / 60:g} min to set up a pose or direction ({counted(mounts, 'time')})"
    settle = protocol.settle
    yield (
        f"{SCREW_S:g} s of turning and {settle.window_s:g} s of settling (no longer than its "
        f"window) a step, {protocol.samples_of_step} samples"
    )
    yield f"{UNLOAD_S:g} s to unload, {TARE_S:g} s to tare, Reset and Operate once a repetition"
    if np.max(arm.joint_stiffness_relative_sd) > 0:
        percent = 100 * float(np.max(arm.joint_stiffness_relative_sd))
        yield f"u and k expected from the nominal joint springs of {arm.name}, sd {percent:.0f} %"
    yield (
        "torque: of the joint (J) that comes nearest to its limit, of what is allowed, at "
        "the top force, weight of the links included"
    )


def _vectors(runs: Sequence[PlannedRun]) -> dict[str, None]:
    """Each direction once: `+x (1, 0, 0)`. In the table they would make it too wide for 80."""
    return dict.fromkeys(
        f"{run.direction} ({', '.join(f'{v:.4g}' for v in run.unit_vector)})" for run in runs
    )


def _table(runs: Sequence[PlannedRun]) -> list[str]:
    head = ("run", "pose", "direction", "steps", "force N", "k N/mm", "u mm", "torque Nm", "takes")
    rows = [head]
    for n, run in enumerate(runs, start=1):
        j = run.worst_joint
        hold, limit = abs(run.hold_torque_Nm[j]), run.torque_limit_Nm[j]
        rows.append(
            (
                f"{n}",
                run.pose,
                run.direction,
                f"{run.steps}",
                f"{run.forces_N[0]:g} to {run.forces_N[-1]:g}",
                f"{run.stiffness_N_per_mm:.1f}",
                f"{run.displacement_mm:.2f}",
                f"J{j + 1} {hold:.0f} of {limit:g}",
                _time(run.duration_s),
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    left = (1, 2, 7)
    return [
        "  ".join(
            cell.ljust(width) if i in left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
