"""What a measurement is to the diagnosis: samples, springs and levers, all SI.

An arm and a bench without an arm look alike: elastic elements ("joints": six of the arm, or one
spring a direction) that a unit force loads with `lever` and whose deflection moves the target by
the same `lever` (virtual work). For an arm `lever = J^T n`; for a bench it is 1 for the direction's
own spring, 0 for the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification.arrays import Array, Flags, Ints

ZERO, LOADING, UNLOADING, CYCLE = 0, 1, 2, 3
BRANCH_NAMES = ("zero", "loading", "unloading", "cycle")


@dataclass(frozen=True, eq=False)
class Setup:
    """One pose and direction. Per newton along the direction, m = number of joints:

    lever (m,) m (1 for a bench): torque of each joint, and motion of the target per its deflection.
    tangents (2, 3): unit vectors across the direction; tangent_lever (2, m): torques of a newton
    along them. offset_lever (m, 3): change of lever per metre of tool offset in the flange frame.
    turned_lever (m, m): change of lever i per radian of joint j. moment (3,) m: moment about the
    base origin of a newton along the direction. point (3,) m: of load, over the base; shifted_point
    (3, 3): its change per metre of tool offset in the flange frame; turned_point (3, m): per radian
    of every joint. links (2, l, 4) m/N: compliance along the
    direction of each nominal link by bending at its start, in its middle, at its end, and by twist,
    placed as the model has it, and from joint to joint. gravity (m,) Nm: torques of the arm's own
    weight; tool_gravity (m,) Nm/kg: of a mass at the point of load. outside m/N: compliance along
    the direction of what the simulation has beside the springs (segments, mounting), which no joint
    reading sees.
    Second order, 0 where there is none: bent_lever (m, m, m), change of turned_lever per radian;
    turned_offset (m, m, 3), change of offset_lever i per radian of joint j.
    """

    pose: str
    direction: str
    unit_vector: Array
    lever: Array
    tangents: Array
    tangent_lever: Array
    offset_lever: Array
    turned_lever: Array
    moment: Array
    links: Array
    gravity: Array
    tool_gravity: Array | float = 0.0
    bent_lever: Array | float = 0.0
    turned_offset: Array | float = 0.0
    outside: float = 0.0
    point: Array | float = 0.0
    shifted_point: Array | float = 0.0
    turned_point: Array | float = 0.0

    @property
    def loads(self) -> Flags:
        """(3,) axes of the base frame along which the force acts; what a direction cosine of a
        hundredth puts there is rounding, or how squarely a plate was bolted down."""
        return np.asarray(np.abs(self.unit_vector) > _LITTLE)


_LITTLE = 0.02


@dataclass(frozen=True, eq=False)
class Instruments:
    """Standard uncertainties of one sample, N and m, and relative ones of the gains."""

    force: float
    displacement: float
    force_gain: float
    displacement_gain: float


@dataclass(frozen=True, eq=False)
class Curve:
    """Forces (k,) N, ascending and distinct, at least two, and displacements (k,) m there; straight
    between these points, and straight on beyond the ends."""

    force: Array
    displacement: Array

    def at(self, force: Array) -> Array:
        """(n,) m at forces (n,) N."""
        return _along(force, self.force, self.displacement)

    def carried(self, displacement: Array) -> Array:
        """(n,) N at displacements (n,) m. Where the curve goes back as the force grows, several
        forces belong to one displacement: the largest before it does."""
        way = -1.0 if self.displacement[-1] < self.displacement[0] else 1.0
        out = np.maximum.accumulate(way * self.displacement)
        new = np.append(True, np.diff(out) > 0)
        if new.sum() < 2:
            return np.full(len(displacement), np.nan)
        return _along(way * displacement, out[new], self.force[new])


def _along(x: Array, at: Array, values: Array) -> Array:
    """Values (k,), known at ascending places (k,), at x (n,)."""
    inner = np.interp(x, at, values)
    below = values[0] + (x - at[0]) * (values[1] - values[0]) / (at[1] - at[0])
    above = values[-1] + (x - at[-1]) * (values[-1] - values[-2]) / (at[-1] - at[-2])
    return np.where(x < at[0], below, np.where(x > at[-1], above, inner))


@dataclass(frozen=True, eq=False)
class GapData:
    """A measurement: n samples in the order in which they were taken, with the simulation that
    was believed. m joints, or the one spring of a rig without an arm."""

    arm: bool  # a robot arm; else a rig with one compliance
    setups: tuple[Setup, ...]  # poses and directions
    time: Array  # (n,) s within the run; counts samples where `timed` is false
    session: Array | None  # (n,) s on the clock of the session
    run: Ints  # (n,) a repetition of a setup
    setup: Ints  # (n,) index of `setups`
    repetition: Ints  # (n,) from 1
    branch: Ints  # (n,) zero, loading, unloading, cycle (`BRANCH_NAMES`)
    step: Ints  # (n,) number of the load step; -1: none
    force: Array  # (n,) N along the direction
    displacement: Array  # (n,) m along the direction
    compliance: Array  # (m,) rad/Nm as simulated; m/N without an arm
    compliance_relative_sd: Array  # (m,)
    instruments: Instruments
    tangential: Array | None = None  # (n, 2) N across the direction
    q: Array | None = None  # (n, m) rad: joint readings minus the commanded pose
    temperature: Array | None = None  # (n, t) degC of the joints, or what was read of a rig
    # joints are read on the output side of their gears, not at the motor
    output_encoder: bool = True
    datum: Literal["setup", "repetition"] = "setup"  # when the displacement is zeroed
    tare: Literal["session", "run"] = "session"  # when the force is zeroed
    # channel that the rig drives; None: to be found
    imposed: Literal["force", "displacement"] | None = None
    # for every setup what another simulator predicts; None: the springs do
    curves: tuple[Curve, ...] | None = None
    timed: bool = True  # the time was recorded
    # readings were left out after a part had let go of the stroke (lost_contact.py)
    lets_go: bool = False
    # (n,) samples of a ramp, under the number of the level that it leads to (ramps.py)
    in_ramp: Flags | None = None
    # (n,) overshoot that is known but not recorded: after sample i - 1 and before sample i
    # the load went beyond its value at i - 1 by the share onward[i] of it
    onward: Array | None = None
    force_scatters: float = 1.0  # times that the force scatters more than stated
    aside: tuple[str, ...] = ()  # sentences on samples that were set aside
    notes: tuple[str, ...] = ()  # sentences on other samples

    @property
    def ways(self) -> Flags:
        """(n,) samples on the way, none where no ramp was told."""
        return np.zeros(len(self.run), bool) if self.in_ramp is None else self.in_ramp

    def outside_of(self, setup: Ints) -> Array:
        """(n,) m/N: compliance outside the springs, of the setups of rows (n,)."""
        return np.array([s.outside for s in self.setups])[setup]

    def time_label(self, i: int) -> str:
        """When reading i was taken; which one it is, without a clock."""
        return f"at {self.time[i]:.4g} s" if self.timed else f"at reading {i + 1}"

    @property
    def joints(self) -> int:
        """Number of elastic elements."""
        return len(self.compliance)

    def spring_name(self, j: int) -> str:
        """`joint1`; without an arm, the direction in which the spring gives way."""
        if self.arm:
            return f"joint{j + 1}"
        return next(s.direction for s in self.setups if s.lever[j])
