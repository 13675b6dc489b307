"""What the laser's client says when something is wrong, and what to do about it."""

from __future__ import annotations

import errno
import os
import re
import sys
from collections import Counter

from drivers.errors import BadReply, CannotConnect, DeviceError, OutOfRange, ReadTimeout
from drivers.ild2200 import frames
from drivers.ild2200.commands import NoReply, SensorSettings
from drivers.ild2200.settings import Ild2200Settings

DEVICE = "laser"
_CABLE = "Check the sensor's power, its cable and the adapter, then "
CABLE = f"{_CABLE}start again."
_ON = "Switch the laser on (key or external input of the controller)"
_OUTSIDE = {65522, 65524, 65526}
_REMEDIES = {
    65522: "Put the target into the beam, remove what hides it, and check the laser's alignment.",
    65524: "Move the laser away from the target until the distance lies in the measuring range.",
    65526: "Move the laser towards the target until the distance lies in the measuring range.",
    65528: "Clean the target or give it a matt, light surface, and check the angle of the beam.",
    65530: f"{_ON}, then go on with --resume.",
}
# Of what pyserial raises on Linux, macOS and Windows, where a port in use is a forbidden one.
_HIDDEN = re.compile(r"(?:\[Errno |Error\(|port: \()(\d+)")
_RATE = re.compile(r"baud", re.IGNORECASE)
_BUSY = {errno.EWOULDBLOCK, errno.EBUSY} | ({errno.EACCES} if sys.platform == "win32" else set())
_MISSING = {errno.ENOENT, errno.ENODEV, errno.ENXIO}
_NO_PORT = {errno.ENOTTY, errno.EISDIR, errno.ENOTDIR}
_FORBIDDEN = {errno.EACCES, errno.EPERM}


def no_port(port: str, baud: int, error: Exception) -> CannotConnect:
    """The serial port cannot be opened: missing, busy, not allowed, or no port of that rate."""
    number = _number(error)
    if number in _BUSY:
        reason = "another program has it open"
        remedy = "End the other program, a running `rig measure` or `rig check` perhaps."
    elif number in _MISSING:
        reason = "there is no such port"
        remedy = f"Plug the adapter in, or correct `port` in the station file. {_ports()}"
    elif number in _NO_PORT:
        reason = "that is no serial port"
        remedy = f"Correct `port` in the station file. {_ports()}"
    elif number in _FORBIDDEN:
        reason = "you may not use it"
        remedy = "Join the group that owns it (on Linux: dialout), and sign in again."
    elif number not in (None, errno.EINVAL) or (number is None and not _RATE.search(str(error))):
        reason = os.strerror(number) if number else str(error)
        remedy = f"Check the adapter and its cable, and `port` in the station file. {_ports()}"
    else:
        reason = "the adapter does not take this rate"
        remedy = (
            f"Take an adapter that can do {baud} baud, or set another rate at the sensor and as "
            "`baud` in the station file."
        )
    fault = f"cannot open the serial port {port} at {baud} baud ({reason})"
    return CannotConnect(DEVICE, fault, remedy)


def _number(error: Exception) -> int | None:
    """The system's number of what went wrong, which pyserial often has in its text only."""
    number = getattr(error, "errno", None)
    hidden = _HIDDEN.search(str(error))
    return number or (int(hidden.group(1)) if hidden else None)


def _ports() -> str:
    """Those of this computer, in a sentence."""
    from serial.tools import list_ports

    names = sorted(port.device for port in list_ports.comports())
    return f"Ports of this computer: {', '.join(names) or 'none'}."


def unplugged(port: str, error: OSError, *, connecting: bool) -> ReadTimeout:
    """The port vanished, under way or before there was anything to resume."""
    then = "start again" if connecting else "go on with --resume"
    reason = f" ({os.strerror(error.errno)})" if error.errno else ""
    return ReadTimeout(
        DEVICE,
        f"the serial port {port} has gone{reason}",
        f"Plug the adapter in again, check the cable, then {then}.",
    )


def silent(port: str, silent_s: float, *, connecting: bool) -> ReadTimeout:
    """Values came, and come no more; or none has come since the port was opened."""
    remedy = CABLE if connecting else f"{_CABLE}go on with --resume."
    fault = f"the sensor on {port} has sent nothing for {silent_s:.1f} s"
    return ReadTimeout(DEVICE, fault, remedy)


def no_reply(error: NoReply, settings: Ild2200Settings) -> CannotConnect:
    """The sensor did not identify itself: silent, at another baud rate, or the line is dead."""
    within = f"within {settings.connect_deadline_s:g} s"
    asked = f"no answer to {error.command.name} on {settings.port} {within}"
    if not error.received:
        return CannotConnect(DEVICE, f"{asked}, and no values either", CABLE)
    raw, _ = frames.FrameDecoder().feed(error.received)
    if 6 * len(raw) < len(error.received):
        return CannotConnect(
            DEVICE,
            f"{asked}; the bytes that come are no values",
            f"Check that the sensor sends at `baud` {settings.baud}, 8 data bits, no parity, one "
            "stop bit, and that the port is the laser's.",
        )
    return CannotConnect(
        DEVICE,
        f"{asked}, although values come",
        "Check the lines from the computer to the sensor (the RS422 pair that carries commands).",
    )


def check(
    sensor: SensorSettings,
    settings: Ild2200Settings,
    stated_range_mm: float | None = None,
    *,
    under_way: bool = False,
) -> None:
    """Compares the sensor with the station file; raises BadReply for the first difference.

    `stated_range_mm`: the range that INFO gives, if it does. `under_way`: values have come already.
    """
    again = "then go on with --resume" if under_way else "then start again"
    ranges = {float(sensor.range_mm), stated_range_mm or float(sensor.range_mm)}
    if ranges != {settings.range_mm}:
        shown = " and ".join(f"{value:g} mm" for value in sorted(ranges))
        _refuse(
            f"the sensor has a range of {shown}, the station file says {settings.range_mm:g} mm",
            "Connect the sensor that the station file describes, or correct `range_mm` there.",
        )
    if sensor.rate_Hz != settings.output_rate_Hz:
        rate = "an unknown number of" if sensor.rate_Hz is None else str(sensor.rate_Hz)
        _refuse(
            f"the sensor sends {rate} values/s, the station file says {settings.output_rate_Hz}",
            "Set the measuring rate at the sensor's controller, or correct `output_rate_Hz` in "
            "the station file.",
        )
    if sensor.averaging != settings.averaging:
        _refuse(
            f"the sensor averages over {sensor.averaging} values ({sensor.averaging_type}), the "
            f"station file says {settings.averaging}",
            "Set the averaging at the sensor's controller, or correct `averaging` in the station "
            "file.",
        )
    if sensor.relative_zero:
        _refuse(
            "the sensor counts from a relative zero, so its place in the range is unknown",
            f"Clear it with the zero key of the sensor's controller, {again}.",
        )
    if not sensor.laser_on:
        _refuse("the laser is switched off", f"{_ON}, {again}.")


def _refuse(fault: str, remedy: str) -> None:
    raise BadReply(DEVICE, fault, remedy)


def invalid(causes: Counter[str], settings: Ild2200Settings) -> DeviceError:
    """No valid value for too long: the commonest cause decides over the kind of error."""
    cause, _ = causes.most_common(1)[0]
    fault = f"no valid value for more than {settings.stale_after_s:g} s: {cause}"
    for raw, remedy in _REMEDIES.items():
        if cause == frames.error_name(raw):
            kind = OutOfRange if raw in _OUTSIDE else BadReply
            return kind(DEVICE, fault, remedy)
    if "error value" in cause:
        return BadReply(
            DEVICE, fault, "Look the number up in the sensor's manual, and check the target."
        )
    return BadReply(
        DEVICE,
        fault,
        f"Check cable, shielding and the sensor's baud rate (the station file says "
        f"{settings.baud}).",
    )
