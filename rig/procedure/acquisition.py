"""The rhythm of the measurement: live values ten times a second, sampling slots on the clock."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, inf

from drivers.clock import Clock
from drivers.readings import Reading
from rig.procedure.devices import Devices
from rig.procedure.limits import Live
from rig.procedure.recorder import Slot

TICK_S = 0.1
# A sped-up clock must not make the loop spin: between two ticks at least so much wall time.
TICK_WALL_S = 0.005


class Acquisition:
    """Waits for ticks and slots, and collects the devices; the only place that reads them."""

    def __init__(
        self, devices: Devices, clock: Clock, rate_Hz: float, session_offset_s: float = 0.0
    ) -> None:
        self.devices = devices
        self._clock = clock
        self._period = 1.0 / rate_Hz
        self._tick = max(TICK_S, TICK_WALL_S * clock.speed)
        self._origin = clock.now() - session_offset_s
        self._next_tick = clock.now()
        self._next_slot = clock.now() + self._period
        self._number = 0

    def now(self) -> float:
        """Seconds of the session clock."""
        return self._clock.now() - self._origin

    def wait(self) -> Slot | None:
        """Sleeps until the next tick or slot; returns the slot when its time has come.

        Slots are multiples of the sampling period; one that could not be served in time is left
        out, and the next one says how many are missing, and holds what its own period brought.
        """
        wake = min(self._next_tick, self._next_slot)
        self._clock.sleep_until(wake)
        now = self._clock.now()
        if now >= self._next_tick:
            self._next_tick = now + self._tick
        if now < self._next_slot:
            return None
        lateness = now - self._next_slot
        missed = int(lateness // self._period)
        self._number += 1 + missed
        self._next_slot += (1 + missed) * self._period
        since = now - self._period if missed else -inf
        return Slot(
            number=self._number,
            session_s=now - self._origin,
            lateness_s=lateness,
            missed=missed,
            robot=self.devices.robot.collect(since),
            dynamometer=self.devices.dynamometer.collect(since),
            laser=self.devices.laser.collect(since),
        )

    def average(self, seconds: float) -> tuple[Reading, Reading, Reading]:
        """Robot, dynamometer and laser over a fresh span of `seconds` (for taring and datum).

        Blocks that began before the call are discarded, so that nothing older gets in.
        """
        began = self._clock.now()
        for device in self.devices.all():
            # The first to end after the call may have begun before it, and goes with the older.
            while device.collect().end < began:
                pass
        self._clock.sleep(seconds)
        devices = self.devices
        readings = devices.robot.collect(), devices.dynamometer.collect(), devices.laser.collect()
        self.leave_out_slots()
        return readings

    def leave_out_slots(self) -> None:
        """Slots that have passed are not missed: nothing was to be sampled (tare, a file that was
        written in a pause)."""
        self._next_slot += self._period * max(
            0.0, ceil((self._clock.now() - self._next_slot) / self._period)
        )

    def live(self, displacement_mm: Callable[[float], float]) -> Live:
        """The newest values of all devices; raises the error of one that has none."""
        force = self.devices.dynamometer.latest()
        laser = self.devices.laser.latest()
        x, y, z = force.values[:3]
        return Live(
            # the laser and the DAQ block in parallel; the older of the two dates the pair
            t=min(force.end, laser.end) - self._origin,
            force_N=(x, y, z),
            displacement_mm=displacement_mm(laser.values[0]),
            robot=self.devices.robot.state(),
            force_age_s=force.age_s,
            displacement_age_s=laser.age_s,
        )
