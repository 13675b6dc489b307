"""Where the unloaded arm stood, and how far loads have moved it: what shows a screw that still
presses while force and displacement are zeroed."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan
from statistics import median

from drivers.readings import Reading
from rig.zeroing import Pair, tared_under_load

# A laser further off than this share of the first step's deflection is asked about.
ASK_FROM = 0.25
_PRESSED = 0.1  # of the largest load: no zero plateau lies so far on the loaded side
_SPREADS = 3.0  # of its single values: nearer than that the laser shows noise

Setup = tuple[str, str]  # pose, direction


class Unloaded:
    """Fed with every row and every tare, replayed ones too; of the setup that stands now.

    Laser readings are raw: they outlive the datum. What resets the laser is a new setup.
    """

    def __init__(self) -> None:
        self._setup: Setup | None = None
        self._laser_mm = nan  # when the arm was last seen unloaded
        self._mm_per_N = nan  # of the last repetition that had loads
        self._before: Pair = (nan, nan)
        self._loaded: list[Pair] = []
        self._after: Pair = (nan, nan)

    def tared(self, setup: Setup, laser_mm: float) -> None:
        """A repetition begins; laser_mm: nan where it was not noted."""
        if setup != self._setup:
            self._setup, self._laser_mm, self._mm_per_N = setup, nan, nan
        else:
            self._mm_per_N = self._slope()
        self._loaded = []
        self._before = self._after = (0.0, laser_mm)
        if isfinite(laser_mm):
            self._laser_mm = laser_mm

    def row(self, branch: str, force_N: float, laser_mm: float) -> None:
        """One sample, force tared; branch "zero": without load."""
        if not (isfinite(force_N) and isfinite(laser_mm)):
            return
        pair = (force_N, laser_mm)
        if branch != "zero":
            self._loaded.append(pair)
            return
        top = max((f - self._before[0] for f, _ in self._loaded), key=abs, default=0.0)
        if (force_N - self._before[0]) * top > _PRESSED * top * top:
            return  # nobody has turned the screw back
        self._laser_mm = laser_mm
        if self._loaded:
            self._after = pair
        else:
            self._before = self._after = pair

    def off(self, setup: Setup, laser: Reading, forces_N: Sequence[float]) -> Pair | None:
        """(mm, N): how far off the loaded side the arm stands that should be unloaded, and the load
        that would do it; None where that is too little to ask, or nothing is known to compare with.

        forces_N: the steps of the run.
        """
        slope = self._slope()
        if setup != self._setup or not isfinite(slope) or slope == 0.0:
            return None
        away_mm = laser.values[0] - self._laser_mm
        force_N = away_mm / slope
        noise_mm = _SPREADS * laser.sd[0]
        if not isfinite(away_mm) or abs(away_mm) <= noise_mm or force_N <= ASK_FROM * min(forces_N):
            return None
        return abs(away_mm), force_N

    def tared_under_load(self) -> Pair | None:
        """(N, mm) that force and displacement have fallen below their zeros, where the repetition
        looks as if it was tared under load."""
        if not tared_under_load(self._before, self._loaded, self._after):
            return None
        (f0, u0), (f1, u1) = self._before, self._after
        return abs(f1 - f0), abs(u1 - u0)

    def _slope(self) -> float:
        """mm/N of the loads so far, of the last repetition that had any."""
        f0, u0 = self._before
        top = max((abs(f - f0) for f, _ in self._loaded), default=0.0)
        slopes = [(u - u0) / (f - f0) for f, u in self._loaded if abs(f - f0) > 0.5 * top]
        return median(slopes) if slopes else self._mm_per_N
