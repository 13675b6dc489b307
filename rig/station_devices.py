"""From the settings of a station to its devices; the only place that knows the drivers' names."""

from __future__ import annotations

from drivers.clock import Clock
from drivers.interfaces import Loader
from rig.acquisition import Devices
from rig.errors import InputError
from rig.station import Station


def station_clock(station: Station) -> Clock:
    """Real time with hardware; emulated stations may run faster."""
    return Clock(station.emulation.speed if station.emulation else 1.0)


def make_devices(station: Station, clock: Clock) -> Devices:
    """The three devices, not yet opened."""
    from drivers.ild2200.client import Ild2200
    from drivers.kistler.client import Kistler9257B
    from drivers.ur10e.client import Ur10e

    if station.robot is None or station.dynamometer is None or station.laser is None:
        names = [n for n in ("robot", "dynamometer", "laser") if getattr(station, n) is None]
        raise InputError(
            f"{station.path}: the station has no {', '.join(names)}; "
            "measuring needs robot, dynamometer and laser. Add the section to the file."
        )
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

        return ConsoleOperator(station.operator, clock)
    from drivers.operator.scripted import ScriptedOperator

    return ScriptedOperator(station.operator, clock)
