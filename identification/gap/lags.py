"""What lag of a kind does most nearly what was fitted: pure delay, first-order filter, average."""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.effects.time_lag import late
from identification.gap.history import sampling_time

_LAGS = np.geomspace(0.2, 16.0, 32)  # of the time between two samples: lags that are compared


def closest_lag(bench: Bench, channel: str, kind: str, does: Array) -> tuple[float, float]:
    """Lag s of that kind that does most nearly the same (n,), and what it misses, as a share."""
    lags, columns = _lagging(bench, channel, kind)
    scale = 1 / bench.noise.response
    y, does_each = does * scale, columns * scale
    i = int(np.sum((does_each - y) ** 2, axis=1).argmin())
    best = (np.inf, float(lags[i]))
    for k in (i - 1, i):  # between two lags, what a lag does is straight
        if 0 <= k < len(lags) - 1:
            way, ahead = does_each[k + 1] - does_each[k], y - does_each[k]
            at = float(np.clip(way @ ahead / max(float(way @ way), 1e-300), 0.0, 1.0))
            left = float(np.sum((ahead - at * way) ** 2))
            best = min(best, (left, float(lags[k] + at * (lags[k + 1] - lags[k]))))
    return best[1], float(np.sqrt(best[0] / max(float(y @ y), 1e-300)))


def _lagging(bench: Bench, channel: str, kind: str) -> tuple[Array, Array]:
    """Lags (k,) s and what each does to the responses (k, n). Kept with the bench: a cache of the
    module would keep the benches of many diagnoses alive."""
    if (channel, kind) not in bench.lags:
        lags = _LAGS * sampling_time(bench.rows)
        does = [late(bench, channel, kind, float(t))[: bench.rows.n] for t in lags]
        bench.lags[channel, kind] = lags, np.array(does)
    return bench.lags[channel, kind]
