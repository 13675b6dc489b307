"""A laser that is not there: the sensor's bytes on a pseudo terminal, faulty on demand."""

from __future__ import annotations

import math
import os
import select
import struct
import threading
import time
import tty
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from drivers.ild2200 import commands, frames
from drivers.ild2200.commands import Command
from drivers.scene import Scene

TICK_S = 0.01
OTHER_RATE_HZ = {20000: 10000, 10000: 5000, 5000: 2500, 2500: 5000}
DIGITS_BELOW_MM, RELATIVE_ZERO_MM = 0.1, 2.0
WIRE_ERRORS = 0.003  # share of bytes lost, or with one flipped bit

ERROR_VALUES = {
    "no_object": 65522,
    "before_range": 65524,
    "beyond_range": 65526,
    "poor_target": 65528,
    "laser_off": 65530,
    "unknown_error_value": 65532,
}
FAULTS: Mapping[str, str] = {
    "silence": "sends nothing and answers nothing",
    "close": "the port vanishes, as when the adapter is unplugged",
    "garbage": "random bytes instead of values and replies, as at a wrong baud rate",
    "lost_bytes": "some bytes in a thousand are lost",
    "bit_flips": "some bytes in a thousand have one wrong bit",
    "no_object": "no target in front of the sensor (error value 65522)",
    "before_range": "the target is too near (error value 65524)",
    "beyond_range": "the target is too far (error value 65526)",
    "poor_target": "the target reflects too badly (error value 65528)",
    "laser_off": "the laser is switched off (error value 65530)",
    "unknown_error_value": "an error value without a name (65532)",
    "relative_zero": "someone has pressed the zero key: distances count from there",
    "wrong_range": "a sensor with five times the range",
    "wrong_rate": "another output rate",
    "mute_to_commands": "values come, commands stay unanswered",
}


@dataclass
class _Sensor:
    """What the sensor remembers between commands."""

    averaging: int
    averaging_type: int = 1  # moving
    output_on: bool = True
    laser_on: bool = True
    relative_zero: bool = False
    pending: bytearray = field(default_factory=bytearray)


class Ild2200Emulator:
    """Meets `drivers.emulation.Emulator`. `start` returns the path of the port.

    `start_mm`: distance at zero displacement; `sign` -1: displacement shortens the distance.
    `output_rate_Hz` values per second of wall time whatever the speed of the scene: they carry no
    time stamp. `noise_um` of a single value (standard deviation), `linearity_um` amplitude of a
    smooth error over the range; the seed decides over both.
    """

    faults = FAULTS
    does_not_simulate = (
        "warm-up and temperature, tilt and speckle of the target, the delay of averaging, "
        "the key lock, the baud rate (a pseudo terminal takes any), the pace of single bytes"
    )

    def __init__(
        self,
        scene: Scene,
        *,
        range_mm: float = 10.0,
        output_rate_Hz: int = 2500,
        serial_number: str = "00000000",
        seed: int = 0,
        start_mm: float = 5.0,
        sign: int = 1,
        averaging: int = 1,
        noise_um: float = 1.0,
        linearity_um: float = 0.3,
    ) -> None:
        if output_rate_Hz not in commands.RATES_HZ.values():
            known = ", ".join(str(rate) for rate in sorted(commands.RATES_HZ.values()))
            raise ValueError(f"output rate {output_rate_Hz} Hz; the sensor has {known} Hz")
        self._scene = scene
        self._range_mm = range_mm
        self._rate_Hz = output_rate_Hz
        self._serial_number = serial_number
        self._random = np.random.default_rng(seed)
        self._phase = float(self._random.uniform(0, 2 * math.pi))
        self._start_mm = start_mm
        self._sign = sign
        self._noise_mm = noise_um * 1e-3
        self._linearity_mm = linearity_um * 1e-3
        self._averaging = averaging
        self._sensor = _Sensor(averaging)
        self._active: frozenset[str] = frozenset()
        self._ends: tuple[int, int] | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> str:
        """Opens the pseudo terminal and starts sending; returns its path."""
        master, slave = os.openpty()
        # Before the first byte: a cooked terminal would echo values back as commands.
        tty.setraw(slave)
        os.set_blocking(master, False)
        path = os.ttyname(slave)
        # The slave end stays open here, or the master fails whenever no client has it open.
        self._ends = (master, slave)
        self._stop.clear()
        self._thread = threading.Thread(target=self._serve, name="ild2200-emulator", daemon=True)
        self._thread.start()
        return path

    def stop(self) -> None:
        """Stops sending and closes the pseudo terminal; may be called twice."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=5)
            self._thread = None

    def inject(self, fault: str) -> None:
        """Shows the fault from now on; raises ValueError for one that `faults` does not list."""
        if fault not in FAULTS:
            raise ValueError(f"the laser has no fault {fault!r}; it has {', '.join(FAULTS)}")
        self._active |= {fault}

    def clear(self) -> None:
        """Ends all faults, as far as they can end: a closed port stays closed."""
        self._active = frozenset()

    def _serve(self) -> None:
        assert self._ends is not None
        try:
            self._send_until_stopped(self._ends[0])
        finally:
            for end in self._ends:
                os.close(end)
            self._ends = None

    def _send_until_stopped(self, master: int) -> None:
        last_wall, last_scene, owed = time.monotonic(), self._scene.now(), 0.0
        while not self._stop.is_set() and "close" not in self._active:
            self._listen(master, TICK_S)
            wall, now = time.monotonic(), self._scene.now()
            owed += (wall - last_wall) * self._shown_rate_Hz()
            # More than a second in arrears is no measurement: the host was asleep.
            count = min(int(owed), self._rate_Hz)
            owed -= int(owed)
            if count and self._sensor.output_on:
                instants = last_scene + (now - last_scene) * np.arange(1, count + 1) / count
                self._send(master, self._values(instants))
            last_wall, last_scene = wall, now

    def _values(self, instants: frames.Floats) -> bytes:
        for fault, raw in ERROR_VALUES.items():
            if fault in self._active:
                return frames.encode(np.full(len(instants), raw, dtype=np.int32))
        if not self._sensor.laser_on:
            return frames.encode(np.full(len(instants), 65530, dtype=np.int32))
        displacement = self._scene.displacement_m(instants) * 1e3
        distance = self._start_mm + self._sign * displacement
        span = 5 * self._range_mm if "wrong_range" in self._active else self._range_mm
        noise = self._noise_mm / math.sqrt(self._sensor.averaging)
        shown = distance + self._random.normal(0, noise, len(instants))
        shown += self._linearity_mm * np.sin(9.0 * distance / self._range_mm + self._phase)
        before = distance < -DIGITS_BELOW_MM
        beyond = distance > span + DIGITS_BELOW_MM
        if self._relative_zero:
            shown = shown - RELATIVE_ZERO_MM
        raw_values = np.clip(frames.to_raw(shown, span), 0, frames.LARGEST_MEASUREMENT)
        raw_values[before] = ERROR_VALUES["before_range"]
        raw_values[beyond] = ERROR_VALUES["beyond_range"]
        return frames.encode(raw_values)

    @property
    def _relative_zero(self) -> bool:
        return self._sensor.relative_zero or "relative_zero" in self._active

    def _send(self, master: int, data: bytes) -> None:
        if "silence" in self._active:
            return
        try:
            # What does not fit into the buffer is lost, as in an adapter that nobody reads.
            os.write(master, self._on_the_wire(data))
        except BlockingIOError:
            return

    def _on_the_wire(self, data: bytes) -> bytes:
        if "garbage" in self._active:
            return self._random.bytes(len(data))
        line = np.frombuffer(data, dtype=np.uint8).copy()
        hit = self._random.random(len(line)) < WIRE_ERRORS
        if "bit_flips" in self._active:
            line[hit] ^= np.left_shift(1, self._random.integers(0, 8, hit.sum())).astype(np.uint8)
        if "lost_bytes" in self._active:
            line = line[~hit]
        return line.tobytes()

    def _listen(self, master: int, wait_s: float) -> None:
        readable, _, _ = select.select([master], [], [], wait_s)
        if not readable:
            return
        try:
            self._sensor.pending += os.read(master, 4096)
        except BlockingIOError:
            return
        self._answer_all(master)

    def _answer_all(self, master: int) -> None:
        pending = self._sensor.pending
        start = commands.START + commands.IDENTIFIER
        while (at := pending.find(start)) >= 0:
            head = bytes(pending[at + 8 : at + 12])
            if len(head) < 4:
                return
            command, words = struct.unpack(">HH", head)
            end = at + 4 + 4 * words
            if len(pending) < end:
                return
            data = struct.unpack(f">{max(0, words - 2)}I", pending[at + 12 : end])
            del pending[:end]
            if "mute_to_commands" not in self._active:
                self._send(master, self._reply(command, data))

    def _reply(self, command: int, data: tuple[int, ...]) -> bytes:
        if command == Command.INFO:
            return commands.pack_reply(command, self._info())
        if command == Command.GET_SETTINGS:
            return commands.pack_reply(command, self._settings())
        refusal = self._carry_out(command, data)
        return commands.pack_reply(command, refusal=refusal)

    def _carry_out(self, command: int, data: tuple[int, ...]) -> int | None:
        """Changes the sensor as a command asks; returns a refusal's code, or None."""
        sensor = self._sensor
        fixed = {
            Command.AVERAGE_1: 1,
            Command.AVERAGE_4: 4,
            Command.AVERAGE_32: 32,
            Command.AVERAGE_128: 128,
        }
        for number, averaging in fixed.items():
            if command == number:
                sensor.averaging = averaging
                return None
        if command in (Command.AVERAGE_N, Command.AVERAGING_TYPE):
            return self._set_averaging(command, data)
        switches = {
            Command.OUTPUT_STOP: ("output_on", False),
            Command.OUTPUT_START: ("output_on", True),
            Command.LASER_OFF: ("laser_on", False),
            Command.LASER_ON: ("laser_on", True),
            Command.ZERO: ("relative_zero", not sensor.relative_zero),
        }
        for number, (name, value) in switches.items():
            if command == number:
                setattr(sensor, name, value)
                return None
        if command == Command.RESET:
            self._sensor = _Sensor(self._averaging)
            return None
        return 1

    def _set_averaging(self, command: int, data: tuple[int, ...]) -> int | None:
        if len(data) != 1:
            return 3
        if command == Command.AVERAGING_TYPE:
            if data[0] not in commands.AVERAGING_TYPES:
                return 2
            self._sensor.averaging_type = data[0]
            return None
        if self._sensor.averaging_type == 2:
            return 5
        if data[0] > 15:
            return 2
        self._sensor.averaging = 2 ** data[0]
        return None

    def _shown_range_mm(self) -> int:
        return round(self._range_mm * (5 if "wrong_range" in self._active else 1))

    def _shown_rate_Hz(self) -> int:
        wrong = "wrong_rate" in self._active
        return OTHER_RATE_HZ[self._rate_Hz] if wrong else self._rate_Hz

    def _info(self) -> bytes:
        text = (
            f"ILD2200 emulator\r\nAverage: {self._sensor.averaging:04d}\r\n"
            f"Range: {self._shown_range_mm()}\r\nSerialN: {self._serial_number}\r\n"
        )
        return text.encode("ascii")

    def _settings(self) -> bytes:
        sensor = self._sensor
        code = next(c for c, r in commands.RATES_HZ.items() if r == self._shown_rate_Hz())
        laser_on = sensor.laser_on and "laser_off" not in self._active
        words = (
            code,
            sensor.averaging,
            0,
            sensor.averaging_type,
            round(RELATIVE_ZERO_MM * 1000) if self._relative_zero else 0,
            int(self._relative_zero),
            self._shown_range_mm(),
            0,
            int(sensor.output_on),
            int(laser_on),
        )
        return struct.pack(">10I", *words)
