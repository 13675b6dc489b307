"""What the controller's numbers mean, and which of them end a measurement.

Source: tables of Universal Robots' RTDE guide and client library; `runtime_state` as reported in
Universal Robots' forum (the guide names the variable only).
"""

from __future__ import annotations

from typing import NamedTuple

ROBOT_MODES = {
    -1: "no controller",
    0: "disconnected",
    1: "safety to be confirmed",
    2: "booting",
    3: "power off",
    4: "power on, joints not yet started",
    5: "idle, brakes engaged",
    6: "free drive, the arm gives way",
    7: "running",
    8: "updating firmware",
}
RUNNING = 7

SAFETY_MODES = {
    1: "normal",
    2: "reduced",
    3: "protective stop",
    4: "recovery",
    5: "safeguard stop",
    6: "system emergency stop",
    7: "robot emergency stop",
    8: "safety violation",
    9: "safety fault",
    10: "joint ID to be validated",
    11: "undefined safety mode",
    12: "automatic mode safeguard stop",
    13: "three-position enabling stop",
}
NORMAL, REDUCED, PROTECTIVE_STOP, ROBOT_EMERGENCY_STOP = 1, 2, 3, 7

SAFETY_BITS = (
    "normal mode",
    "reduced mode",
    "protective stop",
    "recovery mode",
    "safeguard stop",
    "system emergency stop",
    "robot emergency stop",
    "emergency stop",
    "safety violation",
    "safety fault",
    "stopped due to safety",
)
# Bits 0 and 1 say that all is well (reduced: lower limits, the arm is held all the same); bits
# beyond these, such as a pressed enabling switch, stop nothing by themselves.
_STOPPING_BITS = sum(1 << bit for bit in range(2, len(SAFETY_BITS)))

RUNTIME_STATES = {
    0: "stopping",
    1: "stopped",
    2: "playing",
    3: "pausing",
    4: "paused",
    5: "resuming",
}
STOPPED, PLAYING, PAUSED = 1, 2, 4


class Modes(NamedTuple):
    """The four discrete variables of one data package."""

    robot_mode: int
    safety_mode: int
    safety_status_bits: int
    runtime_state: int


def named(table: dict[int, str], value: int) -> str:
    """`power off (3)`, or `unknown (42)`."""
    return f"{table.get(value, 'unknown')} ({value})"


def unsafe(modes: Modes) -> tuple[str, str] | None:
    """Fault and remedy if the arm is not held in a normal safety state; None if it is.

    Normal and reduced are normal states: the controller holds the arm in both. Everything else
    stops the measurement, and so does every robot mode but running: with brakes engaged or in
    free drive another stiffness than the controlled arm's would be measured.
    """
    if modes.safety_mode not in (NORMAL, REDUCED) or modes.safety_status_bits & _STOPPING_BITS:
        bits = [
            name
            for bit, name in enumerate(SAFETY_BITS)
            if modes.safety_status_bits & _STOPPING_BITS & 1 << bit
        ]
        fault = f"the controller's safety mode is {named(SAFETY_MODES, modes.safety_mode)}"
        if bits:
            fault += f", status bits: {', '.join(bits)}"
        return fault, (
            "Keep clear of the arm, loosen the screw by hand until it no longer touches, "
            "then look at the pendant; a stop is released there and never from here."
        )
    if modes.robot_mode != RUNNING:
        return f"the robot mode is {named(ROBOT_MODES, modes.robot_mode)} instead of running", (
            "Loosen the screw by hand until it no longer touches, then switch the arm on and "
            "release its brakes at the pendant."
        )
    return None


def program_changed(before: int, now: int) -> tuple[str, str]:
    """Fault and remedy of a program state that is no longer what it was."""
    fault = (
        f"the program state changed from {named(RUNTIME_STATES, before)} "
        f"to {named(RUNTIME_STATES, now)} during the measurement"
    )
    return fault, (
        "Loosen the screw by hand until it no longer touches, look at the pendant who started or "
        "stopped the program, and check that the arm still stands in its pose."
    )
