"""The dynamometer: Kistler 9257B, charge amplifier with Reset/Operate line, NI DAQ."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from drivers.arrays import Array
from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect, NotDischarged, Overload, ReadTimeout
from drivers.kistler.calibration import Calibration, drift_bound_N_per_s
from drivers.kistler.explain import DEVICE, device_error
from drivers.kistler.settings import KistlerSettings, PerAxis
from drivers.kistler.timeline import Timeline
from drivers.readings import Reading, Signal
from drivers.stream import Block, Stream

if TYPE_CHECKING:
    from drivers.kistler.daq import Daq


RESET_RESIDUAL_V = 0.2  # an amplifier in Reset gives some mV, whatever its charge was
_NOT_OPEN = ("it is not open", "Start the measurement again.")


class Kistler9257B:
    """Meets `drivers.interfaces.Dynamometer`.

    Signals: force_x_N, force_y_N, force_z_N (on the robot, base frame, tared), with eight channels
    moment_x_Nm, moment_y_Nm, moment_z_Nm (about the az0 point, base frame, tared), then
    dynamometer1_V ... as they come from the amplifier. Three summed channels hold no moments.

    A thread reads blocks of hardware-timed samples. `sd` of a reading is the spread of its single
    values: with white noise the mean's type A uncertainty is sd / sqrt(count) (see
    `calibration.u_type_a` for hum and drift). Samples taken in Reset or while the amplifier settles
    are counted as invalid. An overload in any single sample makes `collect` and `latest` raise
    until `reset` or `operate`. With `reset_line` null nothing is driven: the operator has turned
    the switch before `reset` and `operate` are called, which then wait for the settle times.
    """

    name = DEVICE

    def __init__(self, settings: KistlerSettings, clock: Clock, emulated: bool = False) -> None:
        self.settings = settings
        self.signals = _signals(settings)
        self._clock = clock
        self._emulated = emulated
        self._calibration = Calibration.from_settings(settings)
        self._components = len(self._calibration.matrix)
        # Whole tenths of a second: whole periods of 50 Hz and 60 Hz mains.
        self._block_s = round(min(1.0, max(0.1, 0.025 * clock.speed)), 1)
        self._zero = np.zeros(len(self.signals))
        self._identity: dict[str, str] = {}
        self._daq: Daq | None = None
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._overload: Overload | None = None
        self._valid_from = -math.inf
        self._volts = np.full(settings.channels, math.nan)
        self._stream = self._new_stream()

    @property
    def reset_by_hand(self) -> bool:
        """True when the operator must turn the amplifier to Reset and Operate."""
        return self.settings.reset_line is None

    def open(self) -> None:
        """Connects, identifies the DAQ, starts sampling, waits for the first block.

        Raises CannotConnect or BadReply within `connect_deadline_s`. Leaves the amplifier in the
        state it is in; one that is saturated from before shows at the first `latest`.
        """
        self.close()
        until = time.monotonic() + self.settings.connect_deadline_s
        self._stop = threading.Event()
        self._stream = self._new_stream()
        self._clear(valid_from=-math.inf)
        with contextlib.ExitStack() as undo:
            undo.callback(self.close)
            self._start(until)
            self._await_first_block(until)
            undo.pop_all()

    def close(self) -> None:
        """Ends thread, tasks and connection within about two seconds; may be called twice."""
        self._stop.set()
        thread, self._thread = self._thread, None
        daq, self._daq = self._daq, None
        if thread is not None:
            thread.join(0.5)
        if daq is not None:
            daq.close()  # also fails a read that the thread is stuck in
        if thread is not None:
            thread.join(1.0)

    def identity(self) -> Mapping[str, str]:
        """DAQ product type, serial number, driver version; calibration as used."""
        return dict(self._identity)

    def collect(self, since: float = -math.inf) -> Reading:
        """Everything since the last call; waits for a first block if there is none. `since`: as of
        the interface."""
        self._raise_if_unfit()
        wait_s = max(0.0, self.settings.stale_after_s - self._stream.age_s())
        reading = self._stream.collect(wait_s, since)
        self._raise_if_unfit()
        if reading is None:
            raise self._silent()
        return self._tared(reading)

    def latest(self) -> Reading:
        """The newest block."""
        self._raise_if_unfit()
        reading = self._stream.latest()
        if reading is None:
            raise self._silent()
        return self._tared(reading)

    def reset(self) -> None:
        """Discharges the amplifier: force meaningless until `operate`. Forgets the tare.

        Raises NotDischarged when the outputs do not fall to zero, which a dead or inverted Reset
        line, or a switch that nobody turned, would leave unseen.
        """
        with self._lock:
            self._valid_from = math.inf
        self._drive(reset=True)
        self._clock.sleep(self.settings.reset_settle_s)
        self._await_block_from(self._clock.now())
        self._clear(valid_from=math.inf)
        self._zero = np.zeros(len(self.signals))
        self._check_discharged()

    def operate(self) -> None:
        """Lets the amplifier integrate, waits for the settle time and the first sound samples.

        What was sampled before is dropped: the next `collect` begins after the settling.
        """
        self._drive(reset=False)
        self._clock.sleep(self.settings.operate_settle_s)
        self._clear(valid_from=self._clock.now())
        deadline = time.monotonic() + self.settings.stale_after_s + self._block_s
        while self.collect().count == 0:
            if time.monotonic() > deadline:
                raise self._silent()

    def tare(self, reading: Reading) -> None:
        """From now on the raw volts of `reading` count as zero force and moment."""
        volts = np.array(reading.values[self._components :])
        if reading.count == 0 or not np.isfinite(volts).all():
            raise BadReply(
                DEVICE,
                "the reading to tare with holds no valid sample",
                "Wait until the amplifier has settled in Operate, and tare again.",
            )
        zero = np.zeros(len(self.signals))
        zero[: self._components] = self._calibration.components(volts)
        self._zero = zero

    # ------------------------------------------------------------------ opening

    def _start(self, until: float) -> None:
        try:
            from drivers.kistler.daq import DAQ_ERRORS, Daq
        except ImportError as error:
            raise CannotConnect(
                DEVICE,
                f"the Python package nidaqmx cannot be loaded ({error})",
                "Install it anew with `pip install --force-reinstall nidaqmx`.",
            ) from error
        self._daq = daq = Daq(self.settings, self._block_s, self._clock.speed)
        try:
            daq.open(until)
            found = daq.identity()
            daq.start()
        except DAQ_ERRORS as error:
            raise device_error(error, self.settings, connecting=True) from error
        self._identity = dict(found) | self._calibration_text()
        self._thread = threading.Thread(
            target=self._run, args=(daq, self._stream, self._stop), name=DEVICE, daemon=True
        )
        self._thread.start()

    def _await_first_block(self, until: float) -> None:
        while self._stream.age_s() == math.inf:
            if self._stream.failure is not None:
                raise self._stream.failure
            if time.monotonic() > until:
                raise CannotConnect(
                    DEVICE,
                    f"no samples came within {self.settings.connect_deadline_s:g} s",
                    f'Reset "{self.settings.device}" in NI MAX or replug it, then start again.',
                )
            time.sleep(0.005)

    def _calibration_text(self) -> dict[str, str]:
        s = self.settings
        drift = (60 * drift_bound_N_per_s(s)).tolist()
        return {
            "model": "Kistler 9257B",
            "source": self._source(),
            "connection": s.grpc_server or "local NI-DAQmx driver",
            "daq_device": s.device,
            "channels": str(s.channels),
            "full_scale_N": _axes_text(s.full_scale_N),
            "sensitivity_pC_per_N": _axes_text(s.sensitivity_pC_per_N),
            "a_mm": f"{s.a_mm:g}",
            "b_mm": f"{s.b_mm:g}",
            "az0_mm": f"{s.az0_mm:g}",
            "drift_bound_N_per_min": _axes_text(PerAxis(x=drift[0], y=drift[1], z=drift[2])),
        }

    # ------------------------------------------------------------------ reading thread

    def _run(self, daq: Daq, stream: Stream, stop: threading.Event) -> None:
        from drivers.kistler.daq import DAQ_ERRORS

        period = daq.samples / self.settings.sample_rate_Hz
        timeline = Timeline(self._clock.now(), period)
        while not stop.is_set():
            try:
                volts = daq.read()
            except DAQ_ERRORS as error:
                if not stop.is_set():
                    first = stream.age_s() == math.inf
                    stream.fail(device_error(error, self.settings, connecting=first))
                return
            end = timeline.end_of_block(self._clock.now())
            stream.put(self._block(volts.T, end - period, end))

    def _block(self, volts: Array, start: float, end: float) -> Block:
        """Reduces volts (n, channels); a block with an overload in it is no force."""
        peaks = np.abs(volts).max(axis=0)
        with self._lock:
            self._volts = volts.mean(axis=0)
            settled = start >= self._valid_from
            if settled and peaks.max() >= self.settings.overload_V:
                self._overload = self._overload or self._overloaded(volts, int(peaks.argmax()))
                return self._invalid(start, end, len(volts), "amplifier overloaded")
        if not settled:
            return self._invalid(start, end, len(volts), "amplifier in Reset or settling")
        values = np.hstack([self._calibration.components(volts), volts])
        mean = values.mean(axis=0)
        m2 = np.square(values - mean).sum(axis=0)
        return Block(start, end, len(volts), tuple(mean.tolist()), tuple(m2.tolist()))

    def _invalid(self, start: float, end: float, count: int, problem: str) -> Block:
        nothing = (math.nan,) * len(self.signals)
        return Block(start, end, 0, nothing, nothing, invalid=count, problems=(problem,))

    def _overloaded(self, volts: Array, channel: int) -> Overload:
        s = self.settings
        column = volts[:, channel]
        worst = column[np.abs(column).argmax()]
        name = f"ai{int(s.first_channel.removeprefix('ai')) + channel}"
        return Overload(
            DEVICE,
            f"channel {channel + 1} ({s.device}/{name}) stood at {worst:.2f} V, beyond"
            f" {s.overload_V:g} V: the amplifier is saturated and its value no force",
            "Unload the arm, put the amplifier in Reset, and if the load is meant set a larger"
            " full scale at the amplifier and in the station file.",
        )

    # ------------------------------------------------------------------ handing over

    def _raise_if_unfit(self) -> None:
        if self._daq is None:
            raise ReadTimeout(DEVICE, *_NOT_OPEN)
        with self._lock:
            overload = self._overload
        if overload is not None:
            raise Overload(overload.device, overload.fault, overload.remedy)
        if self._stream.failure is not None:
            raise self._stream.failure
        if self._stream.age_s() > self.settings.stale_after_s:
            raise self._silent()

    def _silent(self) -> ReadTimeout:
        return ReadTimeout(
            DEVICE,
            f"no samples for {self.settings.stale_after_s:g} s",
            "Check DAQ device, cable and network, then go on with --resume.",
        )

    def _tared(self, reading: Reading) -> Reading:
        """The tare is taken off here, so that it counts at once for blocks already on their way."""
        values = np.array(reading.values) - self._zero
        return replace(reading, values=tuple(values.tolist()))

    def _drive(self, *, reset: bool) -> None:
        if self.reset_by_hand:
            return
        if self._daq is None:
            raise ReadTimeout(DEVICE, *_NOT_OPEN)
        from drivers.kistler.daq import DAQ_ERRORS

        try:
            self._daq.drive_line(reset == self.settings.reset_active_high)
        except DAQ_ERRORS as error:
            raise device_error(error, self.settings, connecting=False) from error

    def _check_discharged(self) -> None:
        with self._lock:
            volts = self._volts
        channel = int(np.abs(volts).argmax())
        if abs(volts[channel]) > RESET_RESIDUAL_V:
            seen = f"in Reset channel {channel + 1} still shows {volts[channel]:.2f} V, more than"
            why, remedy = self._why_charged()
            raise NotDischarged(DEVICE, f"{seen} {RESET_RESIDUAL_V:g} V: {why}", remedy)

    def _why_charged(self) -> tuple[str, str]:
        """Fault and remedy."""
        if self.reset_by_hand:
            fault = "the amplifier's switch does not stand at Reset"
            return fault, "Turn the charge amplifier's switch to Reset."
        return (
            f"Reset line {self.settings.reset_line} has no effect",
            "Check its wiring, `reset_line` and `reset_active_high` in the station file,"
            " or set `reset_line: null` and press Reset by hand.",
        )

    def _await_block_from(self, start: float) -> None:
        """Waits for a block that was sampled wholly after `start`, and drops all up to it."""
        deadline = time.monotonic() + self.settings.stale_after_s + 2 * self._block_s
        newest = -math.inf
        while newest < start:
            reading = self._stream.collect(max(0.0, deadline - time.monotonic()))
            if reading is None:
                raise self._silent()
            newest = reading.end - self._block_s

    def _clear(self, valid_from: float) -> None:
        with self._lock:
            self._overload = None
            self._valid_from = valid_from

    def _source(self) -> str:
        return "emulated+kistler9257b" if self._emulated else "kistler9257b"

    def _new_stream(self) -> Stream:
        return Stream(len(self.signals), self._clock, self._source())


def _signals(settings: KistlerSettings) -> tuple[Signal, ...]:
    forces = [Signal(f"force_{a}_N", "N", f"force on the robot along base {a}") for a in "xyz"]
    moments = [
        Signal(f"moment_{a}_Nm", "N m", f"moment on the robot about base {a}") for a in "xyz"
    ]
    volts = [
        Signal(f"dynamometer{i + 1}_V", "V", f"charge amplifier output {i + 1}")
        for i in range(settings.channels)
    ]
    return tuple(forces + (moments if settings.channels == 8 else []) + volts)


def _axes_text(values: PerAxis) -> str:
    return f"x {values.x:.4g}, y {values.y:.4g}, z {values.z:.4g}"
