"""Frozen readings: what passes from a device to the procedure."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Signal:
    """One column that a device delivers; `name` carries the unit where it is not SI."""

    name: str
    unit: str
    long_name: str


@dataclass(frozen=True, slots=True)
class Reading:
    """What one device measured in a span of time, reduced.

    `values` and `sd` run over the device's `signals`: mean and standard deviation (n - 1) of the
    `count` valid single values that arrived between `start` and `end` (seconds of the clock).
    With `count` 0 values are nan. `invalid` single values were discarded; `problems` names them.
    `lost` single values came before these and were pushed out, because nobody collected them.
    `age_s` is the wall-clock age of the newest single value: nothing old may look live.
    `source` begins with "emulated" for every stand-in.
    """

    start: float
    end: float
    values: tuple[float, ...]
    sd: tuple[float, ...]
    count: int
    invalid: int
    age_s: float
    source: str
    problems: tuple[str, ...] = ()
    lost: int = 0


@dataclass(frozen=True, slots=True)
class RobotState:
    """The controller's view of the arm now. Angles rad (6), temperatures deg C (6)."""

    q: tuple[float, ...]
    q_target: tuple[float, ...]
    temperatures_C: tuple[float, ...]
    robot_mode: int
    safety_mode: int
    safety_status_bits: int
    runtime_state: int
    speed_rad_per_s: float
    age_s: float
    problems: tuple[str, ...] = field(default=())
