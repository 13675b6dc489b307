"""One simulated rig with the emulators of a station in front of it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from drivers.emulation import Emulator
from rig.errors import InputError, did_you_mean
from rig.worlds import make_world
from rig.worlds.scene import WorldScene
from rig.worlds.world import ZERO_PLATEAU_S
from rig.yaml.yamlfile import place_in_text

if TYPE_CHECKING:
    from drivers.operator.screw import ScrewServer
    from rig.station import FaultPlan, Station

POLL_S = 0.01  # of wall time, for scheduled faults
SPARE_RANGE = 0.1  # of the laser's range is left on the near side; the rest is for the load


class EmulationHost:
    """World, scene and emulators of an emulated station, in this process.

    `poses`: joint angles (rad) and tool (m, flange frame) of each pose of the procedure, the
    first one where the arm stands; empty: the world's own. `programs`: what the robot's Dashboard
    can play; `zero_after_s`: the zero plateau after each run; `before`: how often the force was
    tared in an earlier sitting. InputError for an unknown world or a scheduled fault that no
    emulator has.
    """

    def __init__(
        self,
        station: Station,
        poses: Sequence[tuple[Sequence[float], Sequence[float]]] = (),
        programs: Mapping[str, Sequence[float]] | None = None,
        zero_after_s: float = ZERO_PLATEAU_S,
        before: int = 0,
    ) -> None:
        emulation = station.emulation
        if emulation is None:
            raise InputError(
                f"{station.path}: the station has no emulation: section, so nothing can stand in "
                "for its devices. Use the station emulated, or add the section."
            )
        self.station, self.emulation = station, emulation
        self.scene = _scene(station, poses, zero_after_s, before)
        self.emulators = _emulators(station, self.scene, programs or {}, before)
        self._check_schedule(emulation.faults)
        self._screw: ScrewServer | None = None
        self._stopping = threading.Event()
        self._scheduler: threading.Thread | None = None

    def start(self, quit_: Callable[[], None] = lambda: None) -> dict[str, str]:
        """Starts everything; returns where each device is reached, "operator" being the screw.

        `quit_` is called when somebody asks for the end at the screw's port. OSError if an
        address or a pseudo terminal can't be had; nothing is left running then.
        """
        from drivers.operator.screw import ScrewServer

        def leave(_: object) -> object:
            quit_()
            return None

        try:
            endpoints = {name: emulator.start() for name, emulator in self.emulators.items()}
            handlers = {
                "fault": self._fault_by_message,
                "amplifier": self._amplifier_by_message,
                "quit": leave,
            }
            self._screw = ScrewServer(self.scene, handlers)
            endpoints["operator"] = self._screw.start()
        except BaseException:
            self.stop()
            raise
        for fault in self.emulation.faults:
            if fault.after_s is None:
                self.inject(fault.device, fault.kind)
        self._scheduler = threading.Thread(
            target=self._show_scheduled, name="scheduled-faults", daemon=True
        )
        self._scheduler.start()
        return endpoints

    def stop(self) -> None:
        """Ends all emulators; may be called twice."""
        self._stopping.set()
        if self._scheduler is not None:
            self._scheduler.join(timeout=1.0)
        if self._screw is not None:
            self._screw.stop()
        for emulator in self.emulators.values():
            emulator.stop()

    def inject(self, device: str, kind: str) -> None:
        """The device shows the fault from now on; InputError for what nobody knows."""
        self._check(device, kind, "fault")
        self.emulators[device].inject(kind)

    def _check(self, device: str, kind: str, place: str) -> None:
        if device not in self.emulators:
            raise InputError(
                f'{place}: no emulated device "{device}".{did_you_mean(device, self.emulators)}'
            )
        known = self.emulators[device].faults
        if kind not in known:
            raise InputError(
                f'{place}: the {device} has no fault "{kind}".{did_you_mean(kind, known)}'
            )

    def _check_schedule(self, faults: Sequence[FaultPlan]) -> None:
        for number, fault in enumerate(faults):
            key = ("emulation", "faults", number, "kind")
            line = place_in_text(self.station.text, str(self.station.path), key)
            self._check(fault.device, fault.kind, f"{line}: emulation.faults[{number}]")

    def _fault_by_message(self, message: object) -> object:
        """As the screw's port wants it: a ValueError becomes the reply."""
        if not isinstance(message, Mapping):
            raise ValueError('a fault is given as {"device": ..., "kind": ...}')  # noqa: TRY004
        try:
            self.inject(str(message.get("device")), str(message.get("kind")))
        except InputError as error:
            raise ValueError(str(error)) from None
        return None

    def _amplifier_by_message(self, message: object) -> object:
        """The amplifier's switch, for a station without a Reset line."""
        from drivers.kistler.emulator import KistlerEmulator

        amplifier = self.emulators.get("dynamometer")
        if message not in ("reset", "operate") or not isinstance(amplifier, KistlerEmulator):
            raise ValueError('the amplifier is turned to "reset" or "operate", where there is one')
        amplifier.turn_switch(reset=message == "reset")
        return None

    def _show_scheduled(self) -> None:
        """Times count from the operator's first set-up or turn: before it nothing is measured."""
        waiting = sorted(
            ((f.after_s, f) for f in self.emulation.faults if f.after_s is not None),
            key=lambda pair: pair[0],
        )
        while waiting and not self._stopping.wait(POLL_S):
            first = self.scene.first_command_s
            if first is not None and self.scene.now() - first >= waiting[0][0]:
                _, fault = waiting.pop(0)
                self.inject(fault.device, fault.kind)


def _scene(
    station: Station,
    poses: Sequence[tuple[Sequence[float], Sequence[float]]],
    zero_after_s: float,
    before: int,
) -> WorldScene:
    assert station.emulation is not None
    gains: dict[str, float] = {}
    if station.dynamometer is not None:
        gains["force_gain_sd"] = station.dynamometer.gain_relative_sd
    if station.laser is not None:
        gains["displacement_gain_sd"] = station.laser.gain_relative_sd
    seed = station.emulation.seed
    world = make_world(station.emulation.world, seed, before=before, **gains)
    return WorldScene(world, station.emulation.speed, seed, poses, zero_plateau_s=zero_after_s)


def _emulators(
    station: Station, scene: WorldScene, programs: Mapping[str, Sequence[float]], before: int
) -> dict[str, Emulator]:
    """The stand-ins of the station's devices, by device; none of them started."""
    from drivers.ild2200.emulator import Ild2200Emulator
    from drivers.kistler.emulator import KistlerEmulator
    from drivers.ur10e.emulator import Ur10eEmulator

    assert station.emulation is not None
    seed = station.emulation.seed
    emulators: dict[str, Emulator] = {}
    if station.robot is not None:
        emulators["robot"] = Ur10eEmulator(
            scene, programs=programs, frequency_Hz=station.robot.frequency_Hz, seed=seed + 1
        )
    if station.dynamometer is not None:
        # Another sitting, another drift; what the laser's seed decides over belongs to the laser.
        drift = seed + 2 + 10 * before
        emulators["dynamometer"] = KistlerEmulator(scene, station.dynamometer, drift)
    if station.laser is not None:
        laser = station.laser
        near = SPARE_RANGE * laser.range_mm
        emulators["laser"] = Ild2200Emulator(
            scene,
            range_mm=laser.range_mm,
            output_rate_Hz=laser.output_rate_Hz,
            serial_number="04120815",
            seed=seed + 3,
            start_mm=near if laser.sign > 0 else laser.range_mm - near,
            sign=laser.sign,
            averaging=laser.averaging,
        )
    return emulators
