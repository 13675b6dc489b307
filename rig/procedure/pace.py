"""Whether the machine keeps up with the speed that an emulated station was asked for.

Where it does not, slots are missed and the scripted hand sees the force too late: it overshoots its
levels, and takes a screw that still presses for one that is released. The clock can't be slowed
meanwhile: the emulators' process has its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from drivers.errors import DeviceError, SafetyStop

_ENOUGH = 20  # slots before anything is said
_USUAL_SPEED = 25  # of the project's emulated station
_MOST_MISSED = 1 / 3  # of them; up to there steps settle and the hand finds its levels


class Pace:
    """Counts the slots of a journal's records; tells `behind`, once, when too many are missed."""

    def __init__(self, speed: float, behind: Callable[[str], None]) -> None:
        self._speed = speed
        self._behind = behind
        self._served = self._missed = 0
        self._told = False

    def record(self, kind: str, data: Mapping[str, Any]) -> None:
        """A record of the journal is on disk."""
        if kind != "sample":
            return
        self._served += 1
        self._missed += int(data["values"]["slots_missed"])
        if self._told:
            return
        text = self.text()
        if text is not None:
            self._told = True
            self._behind(text)

    def text(self) -> str | None:
        """What to say of all slots so far; None where the machine keeps up, or nothing ran ahead of
        real time."""
        slots = self._served + self._missed
        if self._speed <= 1 or slots < _ENOUGH or self._missed <= _MOST_MISSED * slots:
            return None
        kept = max(1, int(self._speed * self._served / slots))
        return (
            f"This machine can't keep up with {self._speed:g} times real time: "
            f"{100 * self._missed / slots:.0f} % of the sampling slots are missed, and whoever "
            "turns the screw sees the force too late: levels may be overshot, and values be wrong. "
            f"Measure again with --speed {kept} or less."
        )


@contextmanager
def speed_named(speed: float) -> Iterator[None]:
    """A device that seems to have failed far ahead of real time may only have been given no time:
    the error then says so, ahead of the remedy for a device."""
    try:
        yield
    except DeviceError as error:
        if speed <= _USUAL_SPEED or isinstance(error, SafetyStop):
            raise
        hint = (
            f"At {speed:g} times real time this may be the emulation that can't keep up: try "
            f"--speed {_USUAL_SPEED} or less. If that does not help: "
        )
        raise type(error)(error.device, error.fault, hint + error.remedy) from error
