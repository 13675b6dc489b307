"""The last seconds of a scene, as rows that can be read at any instant in between."""

from __future__ import annotations

import numpy as np

from rig.arrays import Array


class History:
    """Rows of `width` values at rising instants, for at least the last `span_s` seconds."""

    def __init__(self, width: int, span_s: float, shortest_step_s: float) -> None:
        self._keep = int(span_s / shortest_step_s) + 2
        self._times = np.empty(2 * self._keep)
        self._rows = np.empty((2 * self._keep, width))
        self._count = 0

    @property
    def newest(self) -> float:
        """Instant of the last row, s."""
        return float(self._times[self._count - 1])

    def append(self, time: float, row: Array) -> None:
        """A further row (width); `time` must lie after the last one."""
        if self._count == len(self._times):  # the older half goes
            self._times[: self._keep] = self._times[self._keep :]
            self._rows[: self._keep] = self._rows[self._keep :]
            self._count = self._keep
        self._times[self._count] = time
        self._rows[self._count] = row
        self._count += 1

    def cut(self, time: float) -> None:
        """Forgets what lies after `time`, which then is the last instant."""
        row = self.at(np.array([time]), slice(None))[0]
        while self._count > 1 and self._times[self._count - 1] >= time:
            self._count -= 1
        self.append(max(time, float(np.nextafter(self.newest, np.inf))), row)

    def at(self, t: Array, columns: slice) -> Array:
        """(n, columns) values at instants t (n), linear in between; what is older than the first
        row has the first row's values."""
        times = self._times[: self._count]
        above = np.clip(np.searchsorted(times, t), 1, self._count - 1)
        start, end = times[above - 1], times[above]
        weight = np.clip((t - start) / (end - start), 0.0, 1.0)[:, None]
        rows = self._rows[:, columns]
        values: Array = rows[above - 1] * (1.0 - weight) + rows[above] * weight
        return values
