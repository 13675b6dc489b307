"""Watching the limits of the protocol. Software monitoring is no safety function.

It stops the measurement and tells the operator what to do with his hands; it can't hold the arm,
and nobody's safety may depend on it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees, hypot
from typing import Literal

from drivers.interfaces import LimitLevel
from drivers.readings import RobotState
from rig.protocol import Limit, Limits

Action = Literal["stop", "pause", "warn"]

# What to do with the hands; the same for every limit that the screw can undo.
UNLOAD = "Turn the screw back until it no longer touches the arm."

# A rate is taken over at least so long, or the noise of two neighbouring values looks like motion.
RATE_SPAN_S = 1.0


@dataclass(frozen=True, slots=True)
class Breach:
    """One limit passed: `text` names quantity, value, limit and units."""

    quantity: str
    value: float
    limit: float
    action: Action
    text: str


@dataclass(frozen=True, slots=True)
class Live:
    """The newest values: time s of the clock, force vector N (base frame), displacement mm.

    Ages are wall-clock seconds.
    """

    t: float
    force_N: tuple[float, float, float]
    displacement_mm: float
    robot: RobotState
    force_age_s: float = 0.0
    displacement_age_s: float = 0.0


class Watch:
    """Compares live values with the protocol's limits; keeps what rates need.

    `levels`: how close each watched quantity was to its limit when last looked at; rates from the
    last span over which they were taken.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._earlier: Live | None = None
        self._levels: dict[str, LimitLevel] = {}

    @property
    def levels(self) -> tuple[LimitLevel, ...]:
        """In the order in which they are watched."""
        return tuple(self._levels.values())

    def restart(self) -> None:
        """Forgets the past: after taring or remounting the values jump without motion."""
        self._earlier = None
        self._levels.clear()

    def breaches(self, live: Live) -> list[Breach]:
        """Every limit that the live values pass, the most severe action first."""
        levels = list(self._watched(live))
        self._levels.update((level.quantity, level) for level in levels)
        found = [_breach(level) for level in levels if level.value > level.limit]
        order = {"stop": 0, "pause": 1, "warn": 2}
        return sorted(found, key=lambda b: order[b.action])

    def _watched(self, live: Live) -> Iterator[LimitLevel]:
        limits = self._limits
        yield from _level("force", "N", hypot(*live.force_N), limits.force_N)
        yield from _level("displacement", "mm", abs(live.displacement_mm), limits.displacement_mm)
        robot = live.robot
        deviation = max(
            degrees(abs(q - target)) for q, target in zip(robot.q, robot.q_target, strict=True)
        )
        yield from _level("joint deviation", "deg", deviation, limits.joint_deviation_deg)
        hottest = max(robot.temperatures_C)
        yield from _level("joint temperature", "deg C", hottest, limits.joint_temperature_C)
        yield from self._rates(live)

    def _rates(self, live: Live) -> Iterator[LimitLevel]:
        earlier = self._earlier
        if earlier is None:
            self._earlier = live
            return
        span = live.t - earlier.t
        if span < RATE_SPAN_S:
            return
        self._earlier = live
        change = [a - b for a, b in zip(live.force_N, earlier.force_N, strict=True)]
        yield from _level(
            "force rate", "N/s", hypot(*change) / span, self._limits.force_rate_N_per_s
        )
        moved = abs(live.displacement_mm - earlier.displacement_mm)
        yield from _level(
            "displacement rate", "mm/s", moved / span, self._limits.displacement_rate_mm_per_s
        )


def _level(quantity: str, unit: str, value: float, limit: Limit | None) -> Iterator[LimitLevel]:
    if limit is not None:
        yield LimitLevel(quantity, value, limit.max, unit, limit.at)


def _breach(level: LimitLevel) -> Breach:
    # A nan is no value within limits, and no measured breach either: it is the device's fault,
    # and the device says so itself.
    text = (
        f"{level.quantity} {level.value:.4g} {level.unit} is above the limit of "
        f"{level.limit:g} {level.unit}"
    )
    return Breach(level.quantity, level.value, level.limit, level.action, text)
