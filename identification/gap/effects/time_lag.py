"""One channel lags the other: shows where the load changes, at the first samples of a hold.

Pure delay of the laser, `u(t) = u_0(t - d)`, or of the force; or a first-order filter of either.
Lags of filters, averaging and transmission: 0.05 to 10 s.

Size: 0.05 to 10 s; 0.6 to 12 times the sampling interval here.
Prior: coefficient positive, 1 is the lag itself; lags, channels and kinds equally likely.
Source: averaging and filter settings of amplifiers and laser sensors.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.history import delayed, half_sample, rests, retarded
from identification.gap.variants import Variant, variant

WORD = "time_lag"
LAGS = (0.3, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 4.0, 7.0, 12.0)  # of the time between two samples


def variants(bench: Bench) -> list[Variant]:
    """Lags of laser or force, as delays and as filters; coefficient 1 is the lag itself."""
    sample = 2 * half_sample(bench.rows) if not bench.rows.continuous else _typical_step(bench)
    out = []
    for multiple in LAGS:
        lag = multiple * sample
        for channel in ("displacement", "force"):
            pair = []
            for kind in ("delay", "filter"):
                change = late(bench, channel, kind, lag)
                if not np.any(change):
                    continue
                pair.append(bench.add(change))
                info: dict[str, Any] = {"lag_s": lag, "kind": kind, "channel": channel}
                out.append(variant(WORD, f"{channel} {kind} {lag:.3g} s", pair[-1:], (0.5, 1.0),
                                   **info))  # fmt: skip
            if len(pair) > 1:
                info = {"lag_s": lag, "kind": "window", "channel": channel}
                out.append(variant(WORD, f"{channel} window {lag:.3g} s", pair, (0.5,), prior=0.5,
                                   **info))  # fmt: skip
    return out


def late(bench: Bench, channel: str, kind: str, lag: float) -> Array:
    """(size,) what a lag of a channel does: the laser shows the response of earlier loads; a force
    that lags was in truth ahead of what was read."""
    if channel == "displacement":
        line = _smooth(bench, bench.line)
        return bench.stacked(bench.sense * (_behind(bench, line[:, None], kind, lag)[:, 0]
                                            - line))  # fmt: skip
    if bench.rows.continuous:
        load = _smooth(bench, bench.load)
        ahead = load - _behind(bench, load[:, None], kind, lag)[:, 0]
    else:
        ahead = _true_force(bench, kind, lag) - bench.load
    # unloaded, a force that lags still shows what is over
    return bench.force_column(bench.sense * ahead) + bench.stacked(zero_force=-ahead)


_SIDE = 4  # rows to either side


def _smooth(bench: Bench, values: Array) -> Array:
    """Means (n,) of a running recording over the rows about each: noise of what is driven is in the
    response as well, and must not stand in the column that is to explain it."""
    if not bench.rows.continuous:
        return values
    out, edges = values.copy(), np.append(np.flatnonzero(bench.rows.starts), bench.rows.n)
    kernel = np.ones(2 * _SIDE + 1)
    for a, b in pairwise(edges):
        if b - a > 4 * _SIDE:
            inner = np.convolve(values[a:b], kernel / kernel.sum(), mode="valid")
            out[a + _SIDE : b - _SIDE] = inner
    return out


def _behind(bench: Bench, values: Array, kind: str, lag: float) -> Array:
    """Values (n, k) as a channel shows them that lags."""
    if kind == "delay":
        return np.column_stack([delayed(v, lag, bench.rows) for v in values.T])
    times = np.full(values.shape[1], lag)
    return retarded(values, times, bench.rows, rests(bench.rows))


def _true_force(bench: Bench, kind: str, lag: float) -> Array:
    """(n,) force that stands still in every hold and that, read with the lag, gives the readings
    best (least squares in every run; a hold that the readings hardly see keeps what was read)."""
    rows = bench.rows
    first = rows.hold[rows.starts][np.cumsum(rows.starts) - 1]
    within = rows.hold - first  # number of the hold in its run
    holds = np.eye(int(within.max()) + 1)[within]
    shown, out = _behind(bench, holds, kind, lag), bench.load.copy()
    for run in np.unique(rows.run):
        mine = rows.run == run
        used = np.unique(within[mine])
        A, root = shown[mine][:, used], np.sqrt(rows.weight[mine])
        mean = np.array([out[mine][within[mine] == h].mean() for h in used])
        left = bench.load[mine] - A @ mean
        weighted = np.vstack([A * root[:, None], _HOLDS_BACK * np.eye(len(used))])
        change = np.linalg.lstsq(weighted, np.append(left * root, np.zeros(len(used))), rcond=None)
        out[mine] = holds[mine][:, used] @ (mean + change[0])
    return out


_HOLDS_BACK = 0.05  # of a sample's weight: keeps what nobody saw from running away


def _typical_step(bench: Bench) -> float:
    step: Array = np.diff(bench.rows.time)
    return float(np.median(step[step > 0])) if np.any(step > 0) else 1.0
