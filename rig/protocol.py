"""A measurement protocol: what is measured, in which order, and within which limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, hypot
from pathlib import Path
from typing import Literal

from drivers.interfaces import Branch
from rig.models.robot import robot_names
from rig.protocolfile import (
    ForceBand,
    Limit,
    Limits,
    ProtocolFile,
    RunEntry,
    Sampling,
    Settle,
    Six,
    Triple,
    Zero,
    check,
)
from rig.yaml.yamlfile import Document, read_document, read_document_text
from rig.yaml.yamlnodes import Key

__all__ = [
    "ForceBand",
    "Limit",
    "Limits",
    "MeasurementProtocol",
    "Pose",
    "Run",
    "Sampling",
    "Settle",
    "Step",
    "Zero",
    "load_protocol",
    "parse_protocol",
]

_ROUNDING = 1e-9  # samples: 12.5 s at 4.4 Hz are 55 of them


@dataclass(frozen=True)
class Pose:
    """A reference pose: joint positions, the loaded point in the flange frame, and the program
    on the controller that ends there (None: the arm is brought there by hand)."""

    q_rad: Six
    tcp_xyz_mm: Triple
    program: str | None


@dataclass(frozen=True)
class Run:
    """Force levels along one direction in one pose. `stop_at_displacement_mm`: loading ends early
    where the displacement passes it (an arm that yields), without being an error."""

    pose: str
    direction: str
    forces_N: tuple[float, ...]
    stop_at_displacement_mm: float | None = None


@dataclass(frozen=True)
class Step:
    """One level. `number` counts the levels from 1 (0 is zero load): loading and unloading of a
    level share it."""

    number: int
    branch: Branch
    target_N: float


@dataclass(frozen=True)
class MeasurementProtocol:
    """A protocol file, checked. `text` is the file verbatim; directions have length 1."""

    title: str
    station: str
    robot: str
    poses: dict[str, Pose]
    move_arm: bool
    joint_encoder: Literal["output", "motor"]
    directions: dict[str, Triple]
    runs: tuple[Run, ...]
    repetitions: int
    branches: Literal["loading", "loading-unloading"]
    order: Literal["by_run", "by_repetition"]
    sampling: Sampling
    hold_s: float
    force_band: ForceBand
    settle: Settle
    step_deadline_s: float
    zero: Zero
    rest_s: float
    rated_load_N: float | None
    limits: Limits
    prompts: dict[str, str]
    text: str
    path: Path

    def steps(self, run: Run) -> tuple[Step, ...]:
        """The levels of one repetition, zero plateaus left out.

        Unloading goes back down the same levels; the top is not repeated.
        """
        levels = list(enumerate(run.forces_N, start=1))
        up = [Step(number, "loading", force) for number, force in levels]
        if self.branches == "loading":
            return tuple(up)
        down = [Step(number, "unloading", force) for number, force in reversed(levels[:-1])]
        return (*up, *down)

    @property
    def samples_of_step(self) -> int:
        """As many as asked for, and at least as long as the hold."""
        held = ceil(self.hold_s * self.sampling.rate_Hz - _ROUNDING)
        return max(self.sampling.samples_per_step, held)

    def sequence(self) -> tuple[tuple[int, Run, int], ...]:
        """(index of the run, run, repetition from 1) in the order of measurement."""
        repetitions = range(1, self.repetitions + 1)
        runs = list(enumerate(self.runs))
        if self.order == "by_run":
            return tuple((index, run, n) for index, run in runs for n in repetitions)
        return tuple((index, run, n) for n in repetitions for index, run in runs)


def load_protocol(path: Path) -> MeasurementProtocol:
    """Reads and checks a protocol file, whole; raises InputError with all its problems."""
    return _built(read_document(path, ProtocolFile, _check), path)


def parse_protocol(text: str, path: Path) -> MeasurementProtocol:
    """As `load_protocol`, for the text of a protocol that `path` (a data set) holds."""
    return _built(read_document_text(text, str(path), ProtocolFile, _check), path)


def _check(written: ProtocolFile) -> Iterator[tuple[Key, str]]:
    return check(written, robot_names())


def _built(document: Document[ProtocolFile], path: Path) -> MeasurementProtocol:
    written = document.value
    prompts = written.prompts.before_run
    return MeasurementProtocol(
        title=written.title,
        station=written.station,
        robot=written.robot,
        poses={
            name: Pose(pose.radians(), pose.tcp_xyz_mm, pose.program)
            for name, pose in written.poses.items()
        },
        move_arm=written.move_arm,
        joint_encoder=written.joint_encoder,
        directions={name: _normalised(v) for name, v in written.directions.items()},
        runs=tuple(_run(run, written.rated_load_N) for run in written.runs),
        repetitions=written.repetitions,
        branches=written.branches,
        order=written.order,
        sampling=written.sampling,
        hold_s=written.hold_s,
        force_band=written.force_band,
        settle=written.settle,
        step_deadline_s=written.step_deadline_s,
        zero=written.zero,
        rest_s=written.rest_s,
        rated_load_N=written.rated_load_N,
        limits=written.limits,
        prompts={} if prompts is None else {"before_run": prompts},
        text=document.text,
        path=path,
    )


def _normalised(vector: Triple) -> Triple:
    """Directions are written with a few digits; the rest of the length is rounding."""
    x, y, z = vector
    length = hypot(x, y, z)
    return x / length, y / length, z / length


def _run(entry: RunEntry, rated_load_N: float | None) -> Run:
    forces = entry.forces_N(rated_load_N)
    return Run(entry.pose, entry.direction, forces, entry.stop_at_displacement_mm)
