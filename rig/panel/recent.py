"""Force and displacement of the last two minutes, for who opens the page in the middle of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from rig.panel.state import STALE_S

RECENT_S = 120.0  # what the page's chart over time shows
STEP_S = 0.05  # at high speed states come faster than anybody sees

Row = tuple[float, float | None, float | None]


class Recent:
    """Rows of (monotonic s, force N, displacement mm); null where a value was old."""

    def __init__(self) -> None:
        self._rows: deque[Row] = deque()

    def add(self, state: Mapping[str, Any], at: float) -> None:
        """The values of a state that was made at this time."""
        since_s = at - self._rows[-1][0] if self._rows else STEP_S
        if since_s < STEP_S:
            return
        if since_s > STALE_S:  # nothing was measured meanwhile: no line leads across
            self._rows.append((at, None, None))
        self._rows.append((at, _fresh(state["force"], "N"), _fresh(state["displacement"], "mm")))
        while self._rows[0][0] < at - RECENT_S:
            self._rows.popleft()

    def rows(self) -> list[Row]:
        """Oldest first."""
        return list(self._rows)


def _fresh(value: Mapping[str, Any], unit: str) -> float | None:
    number: float | None = None if value["stale"] else value[unit]
    return number
