"""Recordings that begin while the load is already on its way.

What a channel that lags showed before the first reading nobody knows. Where the rig stood, it
stood; where it swung already, the channel is as far behind at the first reading as it is later on,
and the readings say which.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from identification.arrays import Array
from identification.gap.model.bench import Bench

_FIRST, _FEWEST = 3, 30  # rows that tell; of a run that is worth a look
_PLAINLY = 3.0  # standard uncertainties of a sample


def steady_way(bench: Bench, line: Array) -> tuple[Array, Array]:
    """(n,) m and m/s: the way at the speed that a line (n,) m of the load has at the beginning of a
    row's run, and that speed, where the response of a running recording lags there as it does later
    on; 0 elsewhere."""
    way, speeds = np.zeros(len(line)), np.zeros(len(line))
    if not bench.rows.continuous:
        return way, speeds
    for a, b in pairwise(bench.rows.run_edges.tolist()):
        time, x = bench.rows.time[a:b], line[a:b]
        if b - a < _FEWEST or np.any(np.diff(time) <= 0):
            continue
        speed = np.gradient(x, time)
        behind = bench.response[a:b] - x
        A = np.column_stack([np.ones(b - a), x, speed])
        w = np.linalg.lstsq(A, behind, rcond=None)[0]
        moving, resting = (
            float(np.mean((behind - A[:, :k] @ w[:k])[:_FIRST] ** 2)) for k in (3, 2)
        )
        plainly = resting > (_PLAINLY * bench.noise.stated) ** 2
        if w[2] < 0 and plainly and moving < resting / 2:
            speeds[a:b] = speed[:_FIRST].mean()
            way[a:b] = speeds[a:b] * (time - time[0])
    return way, speeds
