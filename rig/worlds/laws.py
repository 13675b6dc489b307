"""What a compliant element does under load: scalar laws with their own memory.

A law turns a generalised load (torque Nm, force N) into the deflection that does work with it
(rad, m). Laws of one element stand in series: they share the load and their deflections add.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol


class Law(Protocol):
    """One element's law; state advances only by `advance`.

    `dt` is the length in seconds of the step at whose end the load is `load`; infinity stands for
    "until nothing moves any more".
    """

    def respond(self, load: float, dt: float) -> float:
        """The deflection that a step would end with; changes nothing. Must not fall with load."""

    def advance(self, load: float, dt: float) -> float:
        """Does the step and returns its deflection."""

    def return_to_position(self, dt: float) -> None:
        """The controller, for `dt` seconds, brings the unloaded joint back to its position."""


@dataclass
class Spring:
    """Elastic and reversible: `load / stiffness * (1 + |load| / softening)`.

    `softening` is the load at which the deflection is twice the linear one. Of the deflection the
    share `delayed` follows with the time constant `delay_s` (one Kelvin element): the arm settles.
    """

    stiffness: float
    softening: float = math.inf
    delayed: float = 0.0
    delay_s: float = 1.0
    _late: float = field(default=0.0, init=False)

    def _settled(self, load: float) -> float:
        return load / self.stiffness * (1.0 + abs(load) / self.softening)

    def _delayed_part(self, settled: float, dt: float) -> float:
        goal = self.delayed * settled
        return goal + (self._late - goal) * math.exp(-dt / self.delay_s)

    def respond(self, load: float, dt: float) -> float:
        """Elastic at once but for the delayed share."""
        settled = self._settled(load)
        if not self.delayed:
            return settled
        return (1.0 - self.delayed) * settled + self._delayed_part(settled, dt)

    def advance(self, load: float, dt: float) -> float:
        """Remembers how far the delayed share has come."""
        settled = self._settled(load)
        self._late = self._delayed_part(settled, dt)
        return (1.0 - self.delayed) * settled + self._late

    def return_to_position(self, dt: float) -> None:
        """A spring is back by itself."""


@dataclass
class Yield:
    """Gives way above `threshold` and hardens on with `hardening` (load per deflection).

    Kinematic hardening: the elastic range of width `2 threshold` moves along with the remaining
    deflection, which unloading does not undo. Only the controller does, by `return_per_s` a second.
    """

    threshold: float
    hardening: float
    return_per_s: float = 2.0e-3
    _remaining: float = field(default=0.0, init=False)

    def respond(self, load: float, dt: float) -> float:  # noqa: ARG002 (rate does not matter)
        """The remaining deflection moves only as far as the load drives it."""
        excess = load - self.hardening * self._remaining
        if excess > self.threshold:
            return (load - self.threshold) / self.hardening
        if excess < -self.threshold:
            return (load + self.threshold) / self.hardening
        return self._remaining

    def advance(self, load: float, dt: float) -> float:
        """Remembers the remaining deflection."""
        self._remaining = self.respond(load, dt)
        return self._remaining

    def return_to_position(self, dt: float) -> None:
        """What remains shrinks at a steady rate."""
        left = max(0.0, abs(self._remaining) - self.return_per_s * dt)
        self._remaining = math.copysign(left, self._remaining)
