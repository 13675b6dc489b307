"""From three readings to one row of the data set, on disk before it counts as recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import nan, sqrt
from typing import Any

from drivers.readings import Reading
from rig.journal import Journal
from rig.procedure.devices import Devices

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Slot:
    """All readings of one sampling slot. Times in s of the session clock."""

    number: int
    session_s: float
    lateness_s: float
    missed: int
    robot: Reading
    dynamometer: Reading
    laser: Reading

    def readings(self) -> dict[str, Reading]:
        """By the name of the device."""
        return {"robot": self.robot, "dynamometer": self.dynamometer, "laser": self.laser}

    def without_value(self) -> list[str]:
        """Devices that delivered no valid value in this slot."""
        return [name for name, reading in self.readings().items() if reading.count == 0]

    def lost(self) -> dict[str, int]:
        """Single values that were pushed out before anybody collected them, by device."""
        return {name: reading.lost for name, reading in self.readings().items() if reading.lost}


@dataclass(frozen=True, slots=True)
class Place:
    """Where in the procedure a row belongs."""

    pose: str
    direction: str
    unit_vector: Vector
    repetition: int
    branch: str
    step: int
    target_N: float
    run_start_s: float
    segment: int
    settled: bool


Listener = Callable[[str, Mapping[str, Any]], None]


def _nobody(_kind: str, _data: Mapping[str, Any]) -> None:
    """Nobody listens."""


class Recorder:
    """Writes rows and events to the journal; counts rows, so that they can be discarded later.

    `listener` is told of each record (kind, data) once it is on disk; it must return at once.
    """

    def __init__(
        self,
        journal: Journal,
        devices: Devices,
        now: Callable[[], float],
        sign: int,
        rows: int = 0,
        listener: Listener = _nobody,
    ) -> None:
        self._journal = journal
        self._devices = devices
        self._now = now
        self._sign = sign
        self._listener = listener
        self.rows = rows
        self.datum_mm = nan

    def displacement_mm(self, laser_mm: float) -> float:
        """Displacement along the direction since the datum."""
        return self._sign * (laser_mm - self.datum_mm)

    def sample(self, slot: Slot, place: Place) -> None:
        """One row; when this returns, it is on disk."""
        values: dict[str, float] = {}
        sd: dict[str, float] = {}
        readings = slot.readings()
        for device in self._devices.all():
            reading = readings[device.name]
            for signal, value, spread in zip(
                device.signals, reading.values, reading.sd, strict=True
            ):
                values[signal.name] = value
                sd[signal.name] = spread
        values["force_N"], sd["force_N"] = along(slot.dynamometer, place.unit_vector)
        values["displacement_mm"] = self.displacement_mm(slot.laser.values[0])
        sd["displacement_mm"] = slot.laser.sd[0]
        values["settled"] = float(place.settled)
        values["slots_missed"] = float(slot.missed)
        self._write(
            "sample",
            {
                "number": slot.number,
                "session_s": round(slot.session_s, 6),
                "time_s": round(slot.session_s - place.run_start_s, 6),
                "pose": place.pose,
                "direction": place.direction,
                "repetition": place.repetition,
                "branch": place.branch,
                "step": place.step,
                "target_N": place.target_N,
                "recorded": True,
                "lateness_s": round(slot.lateness_s, 6),
                "segment": place.segment,
                "values": values,
                "sd": sd,
                "count": {name: r.count for name, r in readings.items()},
                "invalid": {name: r.invalid for name, r in readings.items()},
                "age_s": {name: round(r.age_s, 4) for name, r in readings.items()},
            },
        )
        self.rows += 1

    def event(self, kind: str, text: str, **data: Any) -> None:
        """Something that happened, in words, with what a program needs to know of it."""
        when = {"session_s": round(self._now(), 3)}
        self._write("event", {"kind": kind, "text": text, **when, **data})

    def _write(self, kind: str, data: dict[str, Any]) -> None:
        self._journal.append(kind, data)
        self._listener(kind, data)

    def discard(self, first: int, reason: str) -> None:
        """Rows from `first` to the newest stay in the file, marked as not to be used."""
        if first < self.rows:
            last = self.rows - 1
            text = f"rows {first} to {last} discarded: {reason}"
            self.event("discard", text, first=first, last=last, reason=reason)

    def stop(self, reason: str, *, complete: bool) -> None:
        """The last record. Without one the data set counts as incomplete."""
        self._write("stop", {"reason": reason, "complete": complete})


def along(force: Reading, unit_vector: Vector) -> tuple[float, float]:
    """Component of the force along the direction, and the spread of its single values, N."""
    value = sum(f * e for f, e in zip(force.values, unit_vector, strict=False))
    variance = sum((s * e) ** 2 for s, e in zip(force.sd, unit_vector, strict=False) if e)
    return value, sqrt(variance)
