"""The devices of a station; the only place that knows the drivers' names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.errors import DeviceError, SafetyStop
from drivers.interfaces import Device, DisplacementSensor, Dynamometer, Loader, Robot
from rig.errors import InputError
from rig.procedure.limits import UNLOAD
from rig.station import Station, incomplete
from rig.storage.columns import unit_of


@dataclass(frozen=True)
class Devices:
    """The three devices of a station."""

    robot: Robot
    dynamometer: Dynamometer
    laser: DisplacementSensor

    def all(self) -> tuple[Device, ...]:
        """In the order in which they are opened."""
        return (self.robot, self.dynamometer, self.laser)


def open_devices(
    devices: Devices,
    stack: ExitStack,
    say: Callable[[str], None],
    opened: Callable[[str], None] = lambda _name: None,
) -> None:
    """Opens every device; whatever happens later, `stack` closes those that were opened.

    `opened` is told the name of each one that is ready.
    """
    for device in devices.all():
        stack.callback(device.close)
        device.open()
        opened(device.name)
        say(f"{device.name}: ready ({in_short(device.identity())})")


# Where a device says what it is; its address may be called anything.
_NAMING = ("model", "device", "serial_number", "daq_product_type", "info")


def refuse_emulators(station: Station, devices: Devices) -> None:
    """InputError where a device of a station that is no emulated one calls itself an emulator: its
    data would bear the origin of measured ones."""
    if station.emulation is not None:
        return
    for device in devices.all():
        identity = device.identity()
        for key in _NAMING:
            if "emulat" in identity.get(key, "").lower():
                name = key.replace("_", " ")
                raise InputError(
                    f"{station.path}: the {device.name} calls itself emulated ({name} "
                    f'"{identity[key]}"), and the station has no emulation: section, so its data '
                    "would be marked as measured. Give the address of the real device, or take "
                    "--station emulated."
                )


# What an operator wants to see of a device on one line; the data set keeps everything.
_TELLING = (
    "model",
    "device",
    "serial_number",
    "controller_version",
    "robot_mode",
    "safety_status",
    "daq_product_type",
    "range_mm",
    "output_rate_Hz",
    "averaging",
    "channels",
    "source",
)


def in_short(identity: Mapping[str, str]) -> str:
    """One line about a device: which one it is, and in which state."""
    return ", ".join(_told(key, identity[key]) for key in _TELLING if key in identity)


def _told(key: str, value: str) -> str:
    """`range 10 mm` for `range_mm`."""
    unit = unit_of(key)
    name = key.removesuffix(f"_{unit}").replace("_", " ")
    return f"{name} {value} {unit}".rstrip()


def failed(error: DeviceError) -> str:
    """What is said at once; fault and remedy follow as the command's last word, once the data are
    safe."""
    what = "stopped for safety" if isinstance(error, SafetyStop) else "failed"
    return f"The {error.device} has {what}. {UNLOAD}"


def station_clock(station: Station) -> Clock:
    """Real time with hardware; emulated stations may run faster."""
    return Clock(station.emulation.speed if station.emulation else 1.0)


def make_devices(station: Station, clock: Clock) -> Devices:
    """The three devices, not yet opened."""
    from drivers.ild2200.client import Ild2200
    from drivers.kistler.client import Kistler9257B
    from drivers.ur10e.client import Ur10e

    if station.robot is None or station.dynamometer is None or station.laser is None:
        raise incomplete(station)
    emulated = station.emulation is not None
    return Devices(
        robot=Ur10e(station.robot, clock, emulated),
        dynamometer=Kistler9257B(station.dynamometer, clock, emulated),
        laser=Ild2200(station.laser, clock, emulated),
    )


def make_loader(station: Station, clock: Clock) -> Loader:
    """The person at the screw, or the scripted stand-in of an emulated station."""
    if station.operator.driver == "console":
        from drivers.operator.console import ConsoleOperator

        return ConsoleOperator(station.operator, clock, emulated=station.emulation is not None)
    from drivers.operator.scripted import ScriptedOperator

    return ScriptedOperator(station.operator, clock)
