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
    """n samples in the order of measurement.

    time s within the run; session s, or None; run, setup, repetition, branch, step (n,) ints
    (step -1: none). force N, displacement m along the direction. tangential (n, 2) N or None: force
    across it. q (n, m) rad or None: joint readings minus commanded pose. temperature (n, t) degC or
    None: of the joints, or what was read of a rig.
    compliance (m,) rad/Nm (m/N for a bench) as simulated; compliance_relative_sd (m,).
    curves: what another simulator predicts, a curve for every setup; None: the springs do.
    lets_go: whether readings were left out after a part had let go of the stroke (slack.py).
    timed: whether `time` was recorded; it counts samples otherwise. on_the_way (n,) or None:
    samples of ramps under the name of the level they lead to (ramps.py). onward (n,) or None: share
    of its load by which the sample before was followed by more that no sample shows, 0 where it was
    not. aside, notes: what is to be said of samples that were set aside, and of others.
    """

    arm: bool
    setups: tuple[Setup, ...]
    time: Array
    session: Array | None
    run: Ints
    setup: Ints
    repetition: Ints
    branch: Ints
    step: Ints
    force: Array
    displacement: Array
    compliance: Array
    compliance_relative_sd: Array
    instruments: Instruments
    tangential: Array | None = None
    q: Array | None = None
    temperature: Array | None = None
    output_encoder: bool = True
    datum: Literal["setup", "repetition"] = "setup"
    tare: Literal["session", "run"] = "session"
    imposed: Literal["force", "displacement"] | None = None
    curves: tuple[Curve, ...] | None = None
    timed: bool = True
    lets_go: bool = False
    on_the_way: Flags | None = None
    onward: Array | None = None
    force_scatters: float = 1.0
    aside: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def ways(self) -> Flags:
        """(n,) samples on the way, none where no ramp was told."""
        return np.zeros(len(self.run), bool) if self.on_the_way is None else self.on_the_way

    def outside_of(self, setup: Ints) -> Array:
        """(n,) m/N: compliance outside the springs, of the setups of rows (n,)."""
        return np.array([s.outside for s in self.setups])[setup]

    def moment(self, i: int) -> str:
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
