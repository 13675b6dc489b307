"""When hardware-timed samples were taken, on the clock that all devices share."""

from __future__ import annotations

from collections import deque

_REMEMBERED = 600


class Timeline:
    """Lays the DAQ's sample clock against the station's clock.

    Blocks arrive late by a delay that varies and is never negative, while their true spacing is
    exact. So the least delay seen decides: over the last `_REMEMBERED` blocks only, because the
    two quartzes drift apart (50 ppm are 0.2 s in an hour). A constant least delay cannot be seen.
    """

    def __init__(self, started: float, period: float) -> None:
        """`started`: clock seconds just after sampling began; `period`: seconds a block."""
        self._period = period
        self._blocks = 0
        self._offsets: deque[float] = deque([started], maxlen=_REMEMBERED)

    def end_of_block(self, arrived: float) -> float:
        """Clock seconds at the end of the next block, which has `arrived` just now."""
        self._blocks += 1
        elapsed = self._blocks * self._period
        self._offsets.append(arrived - elapsed)
        return min(self._offsets) + elapsed
