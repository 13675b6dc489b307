"""A measuring session on an arm of MuJoCo's hinges: design, procedure, second values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.arrays import Array
from rig.blind.mujoco_arm import PATIENCE_S, RAMP_S, SETTLE_S, Hinge, MujocoArm, places
from rig.blind.mujoco_effects import Hidden, Rig, spring
from rig.worlds.arm import place


@dataclass(frozen=True)
class Design:
    """Poses (name -> q), the tool in the flange frame (m), directions with their largest force N,
    steps, samples a hold, repetitions; instruments and what is believed of the springs."""

    poses: dict[str, Array]
    tool: Array
    forces: dict[str, float]
    steps: int
    samples: int
    repetitions: int
    noise_mm: float
    noise_N: float
    stated: Array
    relative_sd: float
    rest_s: float


AXES = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, 1.0])}


def levers(design: Design, pose: str) -> Array:
    """(6, 3) m: motion of the tool per radian of every joint, without load."""
    arm = place(design.poses[pose])
    return arm.levers(arm.tool(design.tool))


def true_mm(rows: Sequence[Row]) -> Array:
    """(n,) mm: displacement along each row's direction, without any error."""
    return np.array([1e3 * float(row.moved @ AXES[row.direction]) for row in rows])


@dataclass(frozen=True)
class Row:
    """One second value without noise: clocks, place in the procedure, force N, displacement
    (3) m, what the joints turned (6) rad."""

    time_s: float
    session_s: float
    pose: str
    direction: str
    repetition: int
    branch: str
    step: int
    force: float
    moved: Array
    turned: Array


def session(design: Design, springs: Array, hidden: Hidden | None, turns: float = 1.0) -> list[Row]:
    """All runs, pose by pose and direction by direction; a new arm stands in every setup, since
    what has given way in one direction is not carried into another pose."""
    rows: list[Row] = []
    clock = 0.0
    for pose, q in design.poses.items():
        for direction in design.forces:
            hinges = _hinges(q, springs, hidden)
            arm = MujocoArm(q, place(q).tool(design.tool), hinges, turns)
            clock += 180.0
            for repetition in range(1, design.repetitions + 1):
                run = _Run(design, arm, pose, direction, repetition, clock, hidden)
                rows += run.rows()
                clock = run.clock + design.rest_s
                run.rest()
    return rows


def _hinges(q: Array, springs: Array, hidden: Hidden | None) -> list[Hinge]:
    """Six joints, changed where the effect says so, and the effect's own, moved to this pose."""
    rig = Rig(q, springs, np.zeros(6), np.zeros(3))
    out = [spring(rig, j) for j in range(6)]
    if hidden is None:
        return out
    spots = places(q)
    for j, h in hidden.replaced.items():
        out[j] = _moved(h, *spots[f"joint{j + 1}"])
    for i, h in enumerate(hidden.hinges):
        if h.place.startswith("joint"):
            out.append(_moved(h, *spots[h.place]))
        elif h.place.startswith("link"):
            out.append(_across(h, i, *spots[h.place]))
        else:
            out.append(h)
    return out


def _moved(h: Hinge, axis: Array, at: Array) -> Hinge:
    return replace(h, axis=axis, at=at)


def _across(h: Hinge, number: int, along: Array, at: Array) -> Hinge:
    """One of two axes across the segment as it lies now."""
    first = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    first /= np.linalg.norm(first)
    return _moved(h, (first, np.cross(along, first))[number % 2], at)


class _Run:
    """One repetition: zero, up, down, zero."""

    def __init__(
        self,
        design: Design,
        arm: MujocoArm,
        pose: str,
        direction: str,
        repetition: int,
        clock: float,
        hidden: Hidden | None,
    ) -> None:
        self._design, self._arm, self._hidden = design, arm, hidden
        self._place = (pose, direction, repetition)
        self._start = self.clock = clock

    def rows(self) -> list[Row]:
        top = self._design.forces[self._place[1]]
        levels = [top * k / self._design.steps for k in range(1, self._design.steps + 1)]
        out = self._hold("zero", 0, 0.0, 6)
        for step, force in enumerate(levels, start=1):
            out += self._hold("loading", step, force, self._design.samples)
        for step in range(self._design.steps - 1, 0, -1):
            out += self._hold("unloading", step, levels[step - 1], self._design.samples)
        return out + self._hold("zero", 0, 0.0, 6)

    def rest(self) -> None:
        """Unloaded until the next run; the controller takes back what it can."""
        hidden = self._hidden
        if hidden is None:
            return
        if hidden.creeps:
            self._arm.hold(self._design.rest_s)
        if hidden.returned:
            for i in range(6, len(self._arm.hinges)):
                self._arm.give_back(i)

    def _hold(self, branch: str, step: int, force: float, samples: int) -> list[Row]:
        pose, direction, repetition = self._place
        creeps = self._hidden is not None and self._hidden.creeps
        self._arm.load(force * AXES[direction], SETTLE_S if creeps else PATIENCE_S)
        self.clock += RAMP_S + SETTLE_S
        out = []
        for _ in range(samples):
            self.clock += 1.0
            if creeps:
                self._arm.hold(1.0)
            row = Row(
                self.clock - self._start,
                self.clock,
                pose,
                direction,
                repetition,
                branch,
                step,
                force,
                self._arm.displacement(),
                self._joints(),
            )
            out.append(row)
        return out

    def _joints(self) -> Array:
        """(6,) rad that output encoders see: every hinge about a joint's axis counts."""
        out = np.zeros(6)
        for hinge, angle in zip(self._arm.hinges, self._arm.turned(), strict=True):
            if hinge.place.startswith("joint"):
                out[int(hinge.place[-1]) - 1] += angle
        return out
