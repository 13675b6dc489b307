"""Was the screw turned, or the arm leaned on, while a level was sampled?

A resting screw holds a place, not a force. What the arm then does by itself goes against the force:
it creeps or gives way (the displacement grows, the force falls), or comes back (the displacement
falls, the force grows). That is data, however far it goes. Force and displacement that go the same
way, beyond what still counts as the level and as rest, were moved from outside. Only seconds are
compared: over minutes an amplifier drifts, and its drift may go either way.
"""

from __future__ import annotations

from collections import deque

from rig.protocol import Settle


class Touched:
    """Live values of the last seconds of a hold; `look` at each of them."""

    def __init__(self, criterion: Settle, band_N: float) -> None:
        self._span_s = criterion.window_s
        self._force_N = 2 * band_N  # as while settling: twice the band is still the level
        self._displacement_mm = criterion.displacement_spread_mm
        self._points: deque[tuple[float, float, float]] = deque()

    def look(self, t: float, force_N: float, displacement_mm: float) -> str:
        """One live value at time `t` (s); in words what moved, "" where nothing did."""
        self._points.append((t, force_N, displacement_mm))
        while self._points[0][0] < t - self._span_s:
            self._points.popleft()
        _, force_before, before = self._points[0]
        change_N, moved_mm = force_N - force_before, displacement_mm - before
        outside = abs(change_N) > self._force_N and abs(moved_mm) > self._displacement_mm
        if not outside or change_N * moved_mm < 0:
            return ""
        way = "rose" if change_N > 0 else "fell"
        return (
            f"the force {way} from {force_before:.4g} to {force_N:.4g} N, and the displacement "
            f"with it by {abs(moved_mm):.2g} mm"
        )
