"""The laser over a serial line: identified at start, read all the time, reduced in blocks."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect, DeviceError
from drivers.ild2200 import commands, complaints, frames
from drivers.ild2200.commands import Command
from drivers.ild2200.settings import Ild2200Settings
from drivers.readings import Reading, Signal
from drivers.stream import Block, Stream

if TYPE_CHECKING:
    import serial

TICK_S = 0.02  # the buffer of a serial port holds 4095 bytes: 68 ms at 20 kHz
BLOCK_S = 0.1
RATE_WINDOW_S, RATE_TOLERANCE = 1.0, 0.3
RECHECK_WITHIN_S, RECHECK_EVERY_S = 2.0, 5.0
READ_TIMEOUT_S = 0.05


@dataclass
class _Health:
    """What the reader has last seen; written by its thread alone. Instants: time.monotonic."""

    last_byte: float = math.nan
    last_value: float = math.nan
    causes: Counter[str] = field(default_factory=Counter)  # of invalid values since last_value


@dataclass
class _Gathered:
    """Single values on their way into a block."""

    start: float
    values: list[frames.Floats] = field(default_factory=list)
    invalid: int = 0
    problems: dict[str, None] = field(default_factory=dict)


class Ild2200:
    """Meets `drivers.interfaces.DisplacementSensor`.

    `laser_mm` is the distance in the measuring range as the sensor counts it; the `sign` of the
    settings turns it into displacement and is left to whoever subtracts the datum. Nothing is
    changed in the sensor but a stopped output, which is started: settings that differ from the
    station file are refused with the way to set them right.
    """

    name = "laser"
    signals: Sequence[Signal] = (
        Signal("laser_mm", "mm", "distance of the target in the measuring range of the laser"),
    )

    def __init__(self, settings: Ild2200Settings, clock: Clock, emulated: bool = False) -> None:
        self.range_mm = settings.range_mm
        self._settings = settings
        self._clock = clock
        self._source = "emulated+ild2200" if emulated else "ild2200"
        self._stream = Stream(1, clock, self._source)
        self._health = _Health()
        self._connecting = True
        self._identity: dict[str, str] = {}
        self._port: serial.Serial | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self) -> None:
        """Opens the port, identifies the sensor, compares its settings, waits for first values.

        Raises CannotConnect, BadReply or OutOfRange within `connect_deadline_s`.
        """
        self.close()
        self._connecting = True
        deadline = time.monotonic() + self._settings.connect_deadline_s
        self._port = self._open_port()
        try:
            self._identify(self._port, deadline)
            self._start_reader(self._port)
            self._await_values(deadline)
            self._connecting = False
        except DeviceError:
            self.close()
            raise
        except OSError as error:
            self.close()
            raise complaints.unplugged(self._settings.port, error, connecting=True) from None

    def close(self) -> None:
        """Stops the reader and closes the port; never raises, may be called twice."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=2)
            self._thread = None
        if self._port is not None:
            with contextlib.suppress(OSError):  # it may be gone already
                self._port.close()
            self._port = None

    def identity(self) -> Mapping[str, str]:
        """Serial number, range, rate and averaging as the sensor has them; empty before `open`."""
        return dict(self._identity)

    def collect(self, since: float = -math.inf) -> Reading:
        """Everything since the last call, at least one block; `since`: as of the interface."""
        reading = self._stream.collect(self._settings.stale_after_s, since)
        return self._fresh(reading)

    def latest(self) -> Reading:
        """The newest block."""
        return self._fresh(self._stream.latest())

    def _fresh(self, reading: Reading | None) -> Reading:
        health = self._health
        now = time.monotonic()
        if reading is None or (now - health.last_value) > self._settings.stale_after_s:
            silent_s = now - health.last_byte
            if silent_s > self._settings.stale_after_s or not health.causes:
                raise complaints.silent(self._settings.port, silent_s, connecting=self._connecting)
            raise complaints.invalid(health.causes, self._settings)
        return replace(reading, age_s=now - health.last_value)

    def _open_port(self) -> serial.Serial:
        import serial

        settings = self._settings
        try:
            return serial.Serial(
                settings.port,
                settings.baud,
                bytesize=serial.EIGHTBITS,
                parity=serial.PARITY_NONE,
                stopbits=serial.STOPBITS_ONE,
                timeout=READ_TIMEOUT_S,
                write_timeout=1.0,
                exclusive=True,  # two readers would each miss what the other took
            )
        except (OSError, ValueError) as error:
            raise complaints.no_port(settings.port, settings.baud, error) from None

    def _identify(self, port: serial.Serial, deadline: float) -> None:
        try:
            info = commands.parse_info(commands.exchange(port, Command.INFO, deadline))
            data = commands.exchange(port, Command.GET_SETTINGS, deadline)
            sensor = commands.parse_settings(data)
            complaints.check(sensor, self._settings, info.range_mm)
            if not sensor.output_on:
                commands.exchange(port, Command.OUTPUT_START, deadline)
        except commands.NoReply as error:
            raise complaints.no_reply(error, self._settings) from None
        except (commands.Refused, ValueError) as error:
            remedy = "Switch the sensor's controller off and on, and check that it is an ILD2200"
            raise BadReply(self.name, f"the sensor {error}", remedy + ".") from None
        self._identity = {
            "device": "Micro-Epsilon optoNCDT ILD2200",
            "serial_number": info.serial_number or "not stated",
            "range_mm": f"{sensor.range_mm:g}",
            "output_rate_Hz": str(sensor.rate_Hz),
            "averaging": f"{sensor.averaging_type} over {sensor.averaging}",
            "port": self._settings.port,
            "info": info.text,
            "source": self._source,
        }

    def _start_reader(self, port: serial.Serial) -> None:
        now = time.monotonic()
        self._health = _Health(last_byte=now, last_value=now)
        self._stream = Stream(1, self._clock, self._source)
        self._stop = threading.Event()
        reader = _Reader(port, self._settings, self._clock, self._stream, self._health, self._stop)
        self._thread = threading.Thread(target=reader.run, name="ild2200", daemon=True)
        self._thread.start()

    def _await_values(self, deadline: float) -> None:
        # Values that are all invalid are told as soon as they are stale, not at the deadline.
        while True:
            reading = self.latest() if self._stream.age_s() < math.inf else None
            if reading is not None and reading.count:
                return
            if time.monotonic() > deadline:
                raise CannotConnect(
                    self.name,
                    f"no valid value within {self._settings.connect_deadline_s:g} s",
                    complaints.CABLE,
                )
            self._stop.wait(TICK_S)
            if self._stream.age_s() == math.inf:
                self._silent_since_start()

    def _silent_since_start(self) -> None:
        if self._stream.failure is not None:
            raise self._stream.failure
        silent_s = time.monotonic() - self._health.last_byte
        if silent_s > self._settings.stale_after_s:
            raise complaints.silent(self._settings.port, silent_s, connecting=True)


class _Reader:
    """The thread that empties the port every 20 ms and puts blocks."""

    def __init__(
        self,
        port: serial.Serial,
        settings: Ild2200Settings,
        clock: Clock,
        stream: Stream,
        health: _Health,
        stop: threading.Event,
    ) -> None:
        self._port = port
        self._settings = settings
        self._clock = clock
        self._stream = stream
        self._health = health
        self._stop = stop
        self._decoder = frames.FrameDecoder()
        self._filter = frames.StepFilter(settings.max_step_mm)
        self._gathered = _Gathered(clock.now())
        self._rate_since, self._rate_count = time.monotonic(), 0
        self._doubt = False  # the values look as if someone had changed the sensor
        self._inquiry: commands.Inquiry | None = None
        self._asked = -math.inf

    def run(self) -> None:
        try:
            self._read_until_stopped()
        except OSError as error:  # SerialException included: unplugged
            self._stream.fail(complaints.unplugged(self._settings.port, error, connecting=False))
        except DeviceError as error:
            self._stream.fail(error)

    def _read_until_stopped(self) -> None:
        period = max(TICK_S, BLOCK_S / self._clock.speed)
        emitted = time.monotonic()
        while not self._stop.wait(TICK_S):
            waiting = self._port.in_waiting
            data = self._port.read(waiting) if waiting else b""
            if data:
                self._take(data)
            now = time.monotonic()
            self._watch_rate(now)
            if now - emitted >= period * 0.99:
                self._put()
                emitted = now
            self._recheck(now, data)

    def _take(self, data: bytes) -> None:
        health, gathered = self._health, self._gathered
        health.last_byte = time.monotonic()
        raw, lost = self._decoder.feed(data)
        self._rate_count += len(raw)
        measured = frames.measurements(raw)
        causes: Counter[str] = Counter()
        if lost:
            causes["bytes that are no values"] = lost
        if len(measured) < len(raw):
            errors = raw[raw > frames.LARGEST_MEASUREMENT]
            numbers, counts = np.unique(errors, return_counts=True)
            for number, count in zip(numbers, counts, strict=True):
                causes[frames.error_name(int(number))] += int(count)
        valid = len(measured) > 0 and self._measured(measured, causes)
        if not len(measured) and causes:
            self._filter.reset()
        gathered.invalid += causes.total()
        gathered.problems.update(dict.fromkeys(name for name, _ in causes.most_common(5)))
        if valid:
            health.causes = Counter()
            health.last_value = time.monotonic()
        else:
            # Replaced, not changed: another thread may be looking at it.
            health.causes = health.causes + causes

    def _measured(self, raw: frames.Integers, causes: Counter[str]) -> bool:
        distance = frames.to_mm(raw, self._settings.range_mm)
        accepted, rejected, jump = self._filter.feed(distance)
        if rejected:
            limit = f"{self._settings.max_step_mm:g} mm"
            causes[f"single values further than {limit} from their neighbours"] = rejected
        if jump:
            text = f"the distance jumped by {jump:+.3f} mm between two values"
            self._gathered.problems[text] = None
            self._doubt = True
        if len(accepted):
            self._gathered.values.append(accepted)
        return len(accepted) > 0

    def _watch_rate(self, now: float) -> None:
        span = now - self._rate_since
        if span < RATE_WINDOW_S:
            return
        rate, expected = self._rate_count / span, self._settings.output_rate_Hz
        if self._rate_count and abs(rate / expected - 1) > RATE_TOLERANCE:
            text = f"{float(f'{rate:.1e}'):.0f} values/s arrive instead of {expected}/s"
            self._gathered.problems[text] = None
            self._doubt = True
        self._rate_since, self._rate_count = now, 0

    def _recheck(self, now: float, data: bytes) -> None:
        """Asks the sensor for its settings in mid-run; raises BadReply when they have changed.

        A bumped target and a pressed zero key look the same in the values; only the sensor knows.
        """
        if self._inquiry is None:
            if self._doubt and now - self._asked > RECHECK_EVERY_S:
                self._inquiry = commands.Inquiry(self._port, Command.GET_SETTINGS)
                self._asked, self._doubt = now, False
            return
        try:
            reply = self._inquiry.feed(data)
            if reply is not None:
                complaints.check(commands.parse_settings(reply), self._settings, under_way=True)
        except (commands.Refused, ValueError) as error:
            self._gathered.problems[f"asked for its settings, the sensor {error}"] = None
            self._inquiry = None
            return
        late = now - self._asked > RECHECK_WITHIN_S
        if reply is None and late:
            self._gathered.problems["the sensor does not answer when asked for its settings"] = None
        if reply is not None or late:
            self._inquiry = None

    def _put(self) -> None:
        gathered, end = self._gathered, self._clock.now()
        self._gathered = _Gathered(end)
        if not gathered.values and not gathered.invalid:
            self._gathered.problems = gathered.problems
            return  # silence ages by itself
        values = np.concatenate(gathered.values) if gathered.values else np.empty(0)
        mean = float(values.mean()) if len(values) else math.nan
        squares = float(np.square(values - mean).sum()) if len(values) else 0.0
        self._stream.put(
            Block(
                start=gathered.start,
                end=end,
                count=len(values),
                mean=(mean,),
                m2=(squares,),
                invalid=gathered.invalid,
                problems=tuple(gathered.problems),
            )
        )
