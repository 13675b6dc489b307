"""`rig check`: the plan, then each device's state, one line each. Moves and writes nothing."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import DeviceError
from rig import schemas
from rig.measure import SAFETY_NOTE, emulated_rig
from rig.plan import Plan, plan
from rig.procedure.devices import in_short, make_devices, station_clock
from rig.protocol import load_protocol
from rig.station import station_for


@dataclass(frozen=True)
class DeviceState:
    """One device: ready, with its identity, or the error that says why not."""

    name: str
    identity: dict[str, str]
    error: DeviceError | None = None

    def line(self) -> str:
        """One line for the operator."""
        if self.error is not None:
            return f"  {self.name:12} NOT READY  {self.error.fault}. {self.error.remedy}"
        return f"  {self.name:12} ready      {in_short(self.identity)}"


@dataclass(frozen=True)
class Check:
    """What `rig check` found."""

    plan: Plan
    station: str
    emulated: bool
    devices: tuple[DeviceState, ...]

    @property
    def failure(self) -> DeviceError | None:
        """Of all devices that are not ready; of the first one's kind, which decides over the exit
        status."""
        errors = [d.error for d in self.devices if d.error is not None]
        if not errors:
            return None
        first, *others = errors
        remedy = "\n".join([first.remedy, *map(str, others)])
        return type(first)(first.device, first.fault, remedy)

    def to_text(self) -> str:
        """Plan and devices for the terminal."""
        mark = " (EMULATED: no hardware)" if self.emulated else ""
        lines = [self.plan.to_text(), "", f"Devices of station {self.station}{mark}"]
        return "\n".join([*lines, *(d.line() for d in self.devices), "", SAFETY_NOTE])

    def to_json(self) -> dict[str, object]:
        """The same for programs."""
        devices = {
            d.name: {
                "ready": d.error is None,
                "identity": d.identity,
                "problem": None if d.error is None else str(d.error),
            }
            for d in self.devices
        }
        return {
            "schema": schemas.CHECK,
            "station": self.station,
            "emulated": self.emulated,
            "plan": self.plan.to_json(),
            "devices": devices,
        }


def check(protocol_file: Path, station_name: str | None) -> Check:
    """Validates protocol and station, then asks every device; one that fails hides no other."""
    protocol = load_protocol(protocol_file)
    station = station_for(protocol_file, protocol.station, station_name)
    the_plan = plan(protocol, station)
    name, emulated = station.name, station.emulation is not None
    states: list[DeviceState] = []
    with ExitStack() as stack:
        if emulated:
            station = stack.enter_context(emulated_rig(station, protocol))
        for device in make_devices(station, station_clock(station)).all():
            stack.callback(device.close)
            try:
                device.open()
                states.append(DeviceState(device.name, dict(device.identity())))
            except DeviceError as error:
                states.append(DeviceState(device.name, {}, error))
    return Check(the_plan, name, emulated, tuple(states))
