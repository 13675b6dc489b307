"""Single values of the controller, reduced to blocks: runs in the child, without numpy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from drivers.ur10e.rtde import VARIABLES

_LENGTH = {"DOUBLE": 1, "INT32": 1, "UINT32": 1, "VECTOR6D": 6}


def slices() -> Mapping[str, slice]:
    """Where each variable lies in a row of all of them."""
    places = {}
    start = 0
    for name, kind in VARIABLES.items():
        places[name] = slice(start, start + _LENGTH[kind])
        start += _LENGTH[kind]
    return places


PLACES = slices()
_ROTATION = slice(PLACES["actual_TCP_pose"].start + 3, PLACES["actual_TCP_pose"].stop)
_MODES = slice(PLACES["robot_mode"].start, PLACES["runtime_state"].stop)


class Reduction:
    """Collects rows; `take` gives count, means, sums of squares and every mode that occurred."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []
        self._start = 0.0
        self._end = 0.0
        self._rotation: tuple[float, ...] | None = None

    def add(self, now: float, row: tuple[float, ...]) -> None:
        """One row that arrived at `now` (time.monotonic())."""
        rotation = row[_ROTATION]
        if self._rotation is not None:
            rotation = nearest_rotation(self._rotation, rotation)
        self._rotation = rotation
        if not self._rows:
            self._start = now
        self._end = now
        self._rows.append(row[: _ROTATION.start] + rotation + row[_ROTATION.stop :])

    def span_s(self, now: float) -> float:
        """Age of the first row in wall seconds; 0 without rows."""
        return now - self._start if self._rows else 0.0

    def take(self) -> dict[str, Any]:
        """The block as JSON can carry it, and starts the next."""
        rows, self._rows = self._rows, []
        count = len(rows)
        mean = [math.fsum(column) / count for column in zip(*rows, strict=True)]
        m2 = [
            math.fsum((value - center) ** 2 for value in column)
            for center, column in zip(mean, zip(*rows, strict=True), strict=True)
        ]
        modes = list(dict.fromkeys(tuple(int(v) for v in row[_MODES]) for row in rows))
        return {
            "block": {
                "start": self._start,
                "end": self._end,
                "count": count,
                "mean": mean,
                "m2": m2,
                "last": rows[-1],
                "modes": modes,
            }
        }


def nearest_rotation(reference: Sequence[float], rotation: Sequence[float]) -> tuple[float, ...]:
    """The rotation vector or its complement of 2 pi, whichever lies nearer to the reference.

    A tool that points down is turned by about pi, where the controller may jump between r and
    r (1 - 2 pi / |r|), which are the same attitude; a mean over both would be none.
    """
    angle = math.hypot(*rotation)
    if angle < 1e-9:
        return tuple(rotation)
    other = tuple(v * (1 - 2 * math.pi / angle) for v in rotation)
    if math.dist(reference, other) < math.dist(reference, rotation):
        return other
    return tuple(rotation)
