"""What every emulator offers to the process that hosts it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol


class Emulator(Protocol):
    """A stand-in that speaks the device's real bytes to the real client library.

    `faults` maps every fault it can show to a sentence that says what then happens;
    `does_not_simulate` is shown to whoever starts it.
    """

    faults: Mapping[str, str]
    does_not_simulate: str

    def start(self) -> str:
        """Starts serving on loopback or a pseudo terminal; returns what the station file needs
        in place of "emulated" (an address, an address:port, a path)."""

    def stop(self) -> None:
        """Ends every thread and closes every socket; may be called twice."""

    def inject(self, fault: str) -> None:
        """Shows the fault from now on; raises ValueError for one that `faults` does not list."""
