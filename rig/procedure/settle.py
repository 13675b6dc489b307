"""Has the arm come to rest? Slope and spread of force and displacement over a sliding window."""

from __future__ import annotations

from collections import deque
from math import inf, sqrt

from rig.protocol import Settle


def line(points: list[tuple[float, float]]) -> tuple[float, float]:
    """Slope of the least-squares line through (t, y), and the standard deviation about it.

    Needs at least three points at different times; fewer say nothing: (inf, inf).
    """
    n = len(points)
    if n < 3:
        return inf, inf
    mean_t = sum(t for t, _ in points) / n
    mean_y = sum(y for _, y in points) / n
    s_tt = sum((t - mean_t) ** 2 for t, _ in points)
    if s_tt == 0.0:
        return inf, inf
    slope = sum((t - mean_t) * (y - mean_y) for t, y in points) / s_tt
    squares = sum((y - mean_y - slope * (t - mean_t)) ** 2 for t, y in points)
    return slope, sqrt(squares / (n - 2))


class SettleWindow:
    """Live values of the last seconds; `add` as they come, `settled` when asked."""

    def __init__(self, criterion: Settle) -> None:
        self._criterion = criterion
        self._points: deque[tuple[float, float, float]] = deque()
        self._since = inf

    def restart(self, now: float) -> None:
        """Forgets what was: the screw has just moved."""
        self._points.clear()
        self._since = now

    def add(self, t: float, force_N: float, displacement_mm: float) -> None:
        """One live value at time `t` (s); values from before the restart are ignored."""
        if t < self._since or (self._points and t <= self._points[-1][0]):
            return
        self._points.append((t, force_N, displacement_mm))
        while self._points[0][0] < t - self._criterion.window_s:
            self._points.popleft()

    def remaining_s(self, now: float) -> float:
        """Seconds until the window is full; 0 when only slopes and spreads decide."""
        return max(0.0, self._since + self._criterion.window_s - now)

    def settled(self, now: float) -> bool:
        """True when the window is full, and slopes and spreads are within their limits."""
        limits = self._criterion
        if self.remaining_s(now) > 0:
            return False
        force_slope, force_spread = line([(t, f) for t, f, _ in self._points])
        slope, spread = line([(t, u) for t, _, u in self._points])
        return (
            abs(force_slope) <= limits.force_slope_N_per_s
            and force_spread <= limits.force_spread_N
            and abs(slope) <= limits.displacement_slope_mm_per_s
            and spread <= limits.displacement_spread_mm
        )
