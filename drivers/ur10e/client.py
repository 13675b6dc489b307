"""The UR10e as a device: reads, watches, and moves only for `go_to_reference`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from threading import Lock, Thread
from typing import Any

from drivers.clock import Clock
from drivers.errors import (
    BadReply,
    CannotConnect,
    DeviceError,
    NotWanted,
    ReadTimeout,
    SafetyStop,
)
from drivers.readings import Reading, RobotState, Signal
from drivers.stream import Block, Stream
from drivers.ur10e.arrival import Arrival
from drivers.ur10e.dashboard import Dashboard
from drivers.ur10e.probe import probe
from drivers.ur10e.process import ReceiveProcess
from drivers.ur10e.reduce import PLACES
from drivers.ur10e.settings import Ur10eSettings
from drivers.ur10e.signals import SIGNALS, from_row
from drivers.ur10e.words import REDUCED, Modes, program_changed, unsafe

_UNPLUGGED = (
    "Loosen the screw by hand until it no longer touches, then check the controller, the network "
    "cable, and that the pendant shows the robot running."
)


class Ur10e:
    """Meets `drivers.interfaces.Robot`.

    The real client library receives in a child process; a reading is current only if the
    controller's timestamp has moved on within `stale_after_s` wall-clock seconds. A safety mode
    that is neither normal nor reduced, a robot mode other than running, or a changed program state
    raises SafetyStop, which stays until `accept_present_state`, `go_to_reference` or `open`.
    This watching is software and no safety function.
    """

    name = "robot"
    signals: Sequence[Signal] = SIGNALS

    def __init__(self, settings: Ur10eSettings, clock: Clock, emulated: bool = False) -> None:
        self._settings = settings
        self._clock = clock
        self._source = "emulated+ur10e" if emulated else "ur10e"
        self._stream = Stream(len(SIGNALS), clock, self._source)
        self._process: ReceiveProcess | None = None
        self._controller_version = "not connected"
        self._facts: dict[str, str] = {}
        self._lock = Lock()
        self._last: tuple[float, ...] = ()
        self._baseline: int | None = None  # program state to be kept; None: whichever
        self._alarm: SafetyStop | None = None
        self._status: dict[str, Any] = {}
        self._heard = 0.0  # when the child last said anything, time.monotonic()
        self._refused = ""

    # -- opening and closing

    def open(self) -> None:
        """Probe, Dashboard, child process, first values: all within `connect_deadline_s`.

        Raises CannotConnect, BadReply, or SafetyStop when the arm is not in a normal state.
        """
        self.close()
        deadline = time.monotonic() + self._settings.connect_deadline_s
        try:
            self._controller_version = probe(
                self.name, self._settings.host, self._settings.frequency_Hz, deadline
            )
            if self._settings.dashboard:
                self._facts = self._ask_dashboard(deadline)
            self._start(deadline)
            self._await_first(deadline)
            self.accept_present_state()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Ends the child process; may be called at any time, and twice."""
        process, self._process = self._process, None
        if process is not None:
            process.stop()

    def identity(self) -> Mapping[str, str]:
        """What controller, Dashboard and station file say: who was measured, and through what."""
        return {
            "source": self._source,
            "host": self._settings.host,
            "frequency_Hz": f"{self._settings.frequency_Hz:g}",
            "controller_version": self._controller_version,
            **self._facts,
        }

    def _ask_dashboard(self, deadline: float) -> dict[str, str]:
        with Dashboard(self.name, self._settings.host, deadline) as dashboard:
            return {
                "model": dashboard.ask("get robot model"),
                "serial_number": dashboard.ask("get serial number"),
                "polyscope_version": dashboard.ask("PolyscopeVersion"),
                "robot_mode": dashboard.ask("robotmode"),
                "safety_status": dashboard.ask("safetystatus"),
                "loaded_program": dashboard.ask("get loaded program"),
            }

    def _start(self, deadline: float) -> None:
        frequency = self._settings.frequency_Hz
        self._stream = Stream(len(SIGNALS), self._clock, self._source)
        self._last, self._status, self._refused = (), {}, ""
        self._alarm = self._baseline = None
        options = {
            "host": self._settings.host,
            "frequency_Hz": frequency,
            "connect_s": max(0.1, deadline - time.monotonic()),
            "block_s": max(0.02, 0.1 / self._clock.speed),
            "poll_s": max(0.002, 0.5 / frequency),
        }
        self._process = ReceiveProcess(options, self._on_message, self._on_end)

    def _await_first(self, deadline: float) -> None:
        while self._stream.latest() is None:
            if time.monotonic() > deadline:
                fault = (
                    f"the client library delivered no values from {self._settings.host} "
                    f"within {self._settings.connect_deadline_s:g} s, although the handshake worked"
                )
                raise CannotConnect(
                    self.name, fault, "Try again; restart the controller if it stays."
                )
            time.sleep(0.005)

    # -- what the child says (its thread)

    def _on_message(self, message: dict[str, Any]) -> None:
        self._heard = time.monotonic()
        if "block" in message:
            self._on_block(message["block"])
        elif "status" in message:
            self._status = message["status"]
            if self._last and not self._status["connected"]:
                self._stream.fail(self._silent("closed the connection"))
        else:
            self._refused = str(message["error"])

    def _on_block(self, block: dict[str, Any]) -> None:
        modes = [Modes(*m) for m in block["modes"]]
        problems = ("reduced mode",) if any(m.safety_mode == REDUCED for m in modes) else ()
        with self._lock:
            self._last = tuple(block["last"])
            for mode in modes:
                if self._alarm is None:
                    self._alarm = self._judge(mode)
        self._stream.put(
            Block(
                start=self._clock_time(block["start"]),
                end=self._clock_time(block["end"]),
                count=block["count"],
                mean=from_row(block["mean"]),
                m2=from_row(block["m2"]),
                problems=problems,
            )
        )

    def _on_end(self, process: ReceiveProcess) -> None:
        reason = f": {self._refused}" if self._refused else ""
        fault = f"the process of the client library {process.ending()}{reason}"
        if self._last:
            self._stream.fail(ReadTimeout(self.name, fault, _UNPLUGGED))
        else:
            remedy = "Check the controller and the network, then try again."
            self._stream.fail(CannotConnect(self.name, fault, remedy))

    def _judge(self, modes: Modes) -> SafetyStop | None:
        found = unsafe(modes)
        if found is None and self._baseline not in (None, modes.runtime_state):
            found = program_changed(self._baseline or 0, modes.runtime_state)
        return None if found is None else SafetyStop(self.name, *found)

    def _clock_time(self, monotonic: float) -> float:
        """Seconds of the clock for an instant of time.monotonic(), which processes share."""
        return self._clock.now() - (time.monotonic() - monotonic) * self._clock.speed

    # -- reading

    def collect(self, since: float = -math.inf) -> Reading:
        """Everything since the last call; `since`: as of the interface. Raises SafetyStop,
        ReadTimeout."""
        self._check()
        reading = self._stream.collect(self._settings.stale_after_s, since)
        self._check()
        if reading is None:
            raise self._stale()
        return reading

    def latest(self) -> Reading:
        """The newest block. Raises SafetyStop, ReadTimeout."""
        self._check()
        reading = self._stream.latest()
        if reading is None:
            raise self._stale()
        return reading

    def state(self) -> RobotState:
        """The newest values as they are. Raises SafetyStop, ReadTimeout."""
        self._check()
        return self._state()

    def _state(self) -> RobotState:
        with self._lock:
            row = self._last
        modes = _modes(row)
        return RobotState(
            q=row[PLACES["actual_q"]],
            q_target=row[PLACES["target_q"]],
            temperatures_C=row[PLACES["joint_temperatures"]],
            robot_mode=modes.robot_mode,
            safety_mode=modes.safety_mode,
            safety_status_bits=modes.safety_status_bits,
            runtime_state=modes.runtime_state,
            speed_rad_per_s=max(abs(v) for v in row[PLACES["actual_qd"]]),
            age_s=self._stream.age_s(),
            problems=("reduced mode",) if modes.safety_mode == REDUCED else (),
        )

    def _check(self) -> None:
        if self._alarm is not None:
            raise self._alarm
        self._check_alive()

    def _check_alive(self) -> None:
        if self._process is None:
            raise CannotConnect(self.name, "the connection is not open", "Open the device first.")
        if self._stream.failure is not None:
            raise self._stream.failure
        if self._stream.age_s() > self._settings.stale_after_s:
            raise self._stale()

    def _stale(self) -> DeviceError:
        """Ends what has fallen silent: a process that hangs would hang for ever."""
        limit = self._settings.stale_after_s
        if time.monotonic() - self._heard > max(0.3, limit / 2):
            fault = f"the process of the client library does not answer for more than {limit:g} s"
            error = ReadTimeout(self.name, fault, _UNPLUGGED)
        else:
            error = self._silent(self._silence(limit))
        self._stream.fail(error)
        if self._process is not None:
            self._process.stop()
        return error

    def _silence(self, limit: float) -> str:
        if self._status.get("connected"):
            return (
                f"keeps the connection open, but its timestamp stands still at "
                f"{self._status['timestamp']:.3f} s for more than {limit:g} s"
            )
        return f"has sent nothing for more than {limit:g} s"

    def _silent(self, what: str) -> ReadTimeout:
        return ReadTimeout(self.name, f"the controller {self._settings.host} {what}", _UNPLUGGED)

    # -- the reference pose

    def accept_present_state(self) -> None:
        """The arm may have been moved on purpose: what happened up to now is no fault.

        The present program state is the one to be kept from now on. Raises SafetyStop if the arm
        is not in a normal state now, ReadTimeout if it is silent.
        """
        self._check_alive()
        with self._lock:
            modes = _modes(self._last)
            self._baseline = modes.runtime_state
            self._alarm = self._judge(modes)
        if self._alarm is not None:
            raise self._alarm

    def go_to_reference(
        self,
        program: str,
        q_rad: Sequence[float],
        tolerance_rad: float,
        deadline_s: float,
        wanted: Callable[[], bool] = lambda: True,
    ) -> None:
        """Loads and plays a program taught on the pendant, and verifies the arrival by reading.

        Arrived: every joint within `tolerance_rad` of `q_rad` (6) and standing still for half a
        second, safety normal, program state steady. `deadline_s` in wall-clock seconds. Whatever
        prevents the arrival, Ctrl-C included, stops the program that was started here. Raises
        SafetyStop, ReadTimeout, CannotConnect, BadReply (refused, or ended elsewhere), NotWanted.
        """
        if not self._settings.dashboard:
            raise BadReply(
                self.name,
                f'"{program}" cannot be played because the station file says "dashboard: false"',
                'Set "dashboard: true", or bring the arm to its pose by hand.',
            )
        self.accept_present_state()
        with self._lock:
            self._baseline = None
        arrival = Arrival(self.name, program, q_rad, tolerance_rad, deadline_s)
        with self._dashboard() as dashboard:
            dashboard.load(program)
            self._go_on(program, wanted)
            try:
                dashboard.play()
                self._await_arrival(arrival, wanted)
            except BaseException:
                self._stop_program()
                raise
        self._stream.collect(0.0)  # readings of the motion belong to no measurement
        self.accept_present_state()

    def _dashboard(self) -> Dashboard:
        limit = time.monotonic() + self._settings.connect_deadline_s
        return Dashboard(self.name, self._settings.host, limit)

    def _stop_program(self) -> None:
        """In a thread of its own, which a second Ctrl-C does not cut short."""

        def stop() -> None:
            with suppress(DeviceError), self._dashboard() as dashboard:
                dashboard.stop()

        thread = Thread(target=stop, name="ur10e stop")
        thread.start()
        thread.join()

    def _go_on(self, program: str, wanted: Callable[[], bool]) -> None:
        if not wanted():
            fault = f'the program "{program}" was called off before the arm arrived'
            raise NotWanted(self.name, fault, "See that the arm stands still.")

    def _await_arrival(self, arrival: Arrival, wanted: Callable[[], bool]) -> None:
        while True:
            self._go_on(arrival.program, wanted)
            self._check()
            if arrival.seen_in(self._state()):
                return
            time.sleep(0.02)


def _modes(row: Sequence[float]) -> Modes:
    names = ("robot_mode", "safety_mode", "safety_status_bits", "runtime_state")
    return Modes(*(int(row[PLACES[name]][0]) for name in names))
