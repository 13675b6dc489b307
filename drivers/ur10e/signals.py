"""The columns that the controller delivers, and where their values lie in its data."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.readings import Signal
from drivers.ur10e.reduce import PLACES


def _joints(name: str, unit: str, long_name: str) -> list[Signal]:
    return [Signal(name.format(n), unit, f"{long_name} {n}") for n in range(1, 7)]


def _pose() -> list[Signal]:
    place = [Signal(f"tcp_{a}_m", "m", f"TCP position {a}, base frame") for a in "xyz"]
    turn = [Signal(f"tcp_r{a}_rad", "rad", f"TCP rotation vector {a}, base frame") for a in "xyz"]
    return place + turn


# In this order; the joint velocities are read too, but serve the watch over standing still only.
_COLUMNS: dict[str, list[Signal]] = {
    "timestamp": [Signal("controller_time_s", "s", "timestamp of the controller")],
    "actual_q": _joints("q{}_rad", "rad", "actual position of joint"),
    "target_q": _joints("target_q{}_rad", "rad", "commanded position of joint"),
    "actual_TCP_pose": _pose(),
    "actual_current": _joints("current{}_A", "A", "actual current of joint"),
    "target_current": _joints("target_current{}_A", "A", "commanded current of joint"),
    "joint_temperatures": _joints("temperature{}_C", "degC", "temperature of joint"),
    "robot_mode": [Signal("robot_mode", "1", "robot mode of the controller")],
    "safety_mode": [Signal("safety_mode", "1", "safety mode of the controller")],
    "safety_status_bits": [Signal("safety_status_bits", "1", "safety status bits")],
    "runtime_state": [Signal("runtime_state", "1", "program state of the controller")],
}

SIGNALS: tuple[Signal, ...] = tuple(s for signals in _COLUMNS.values() for s in signals)


def from_row(row: Sequence[float]) -> tuple[float, ...]:
    """The values of SIGNALS out of a row of all variables."""
    return tuple(value for name in _COLUMNS for value in row[PLACES[name]])
