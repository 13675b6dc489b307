"""What an emulator needs to know of the world it stands in; `rig.worlds` provides it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.arrays import Array


@dataclass(frozen=True, slots=True)
class ArmSignals:
    """True joint signals at n instants: angles rad (n, 6), currents A (n, 6), deg C (n, 6)."""

    q: Array
    q_target: Array
    tcp_pose: Array  # (n, 6): position m, rotation vector rad
    current: Array
    target_current: Array
    temperatures_C: Array


class Scene(Protocol):
    """A rig that goes on in its own time (seconds of its clock); thread-safe.

    Past instants of the last seconds may be asked for; future ones may not. Values are the physics
    at the sensor, before the sensor's own noise, digits and drift.
    """

    speed: float

    def now(self) -> float:
        """Seconds of the scene."""

    def force_N(self, t: Array) -> Array:
        """(n, 3) force on the robot in the base frame."""

    def displacement_m(self, t: Array) -> Array:
        """(n,) displacement of the laser's target along the mounted direction."""

    def arm(self, t: Array) -> ArmSignals:
        """The robot's signals at the instants t (n,)."""

    def turn(self, advance_m: float) -> None:
        """Turns the screw by so much advance (negative loosens), at the hand's speed."""

    def mount(self, direction: Sequence[float]) -> None:
        """Sets up screw, dynamometer and laser along a unit vector in the base frame, unloaded."""

    def move(self, q_rad: Sequence[float]) -> None:
        """The arm is brought to another pose (by the pendant or by a program), unloaded."""
