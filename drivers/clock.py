"""The one clock that devices and procedure share; emulated stations may run it faster."""

from __future__ import annotations

import time


class Clock:
    """Monotonic seconds since creation, `speed` times as fast as the wall clock.

    With hardware `speed` is 1. Deadlines of devices are wall-clock seconds whatever the speed
    (a socket does not answer faster because the scene does); durations of the procedure
    (settling, holds, slots) are seconds of this clock.
    """

    def __init__(self, speed: float = 1.0) -> None:
        if not speed > 0:
            raise ValueError(f"clock speed is {speed}; it must be above 0")
        self.speed = speed
        self._start = time.monotonic()

    def now(self) -> float:
        """Seconds of this clock."""
        return (time.monotonic() - self._start) * self.speed

    def sleep_until(self, when: float) -> None:
        """Returns when `now()` has reached `when`; at once if it has passed."""
        remaining = (when - self.now()) / self.speed
        if remaining > 0:
            time.sleep(remaining)

    def sleep(self, seconds: float) -> None:
        """Waits `seconds` of this clock."""
        time.sleep(max(0.0, seconds) / self.speed)
