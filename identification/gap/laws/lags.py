"""What a channel shows that lags, and what there was in truth of one that does."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from identification.arrays import Array
from identification.gap.laws.in_swing import steady_way
from identification.gap.laws.law import Law
from identification.gap.model.bench import Bench
from identification.gap.model.history import averaged, delayed, retarded
from identification.gap.recording.white import white_sd

CHANNELS = ("displacement", "force")
KINDS = ("delay", "filter", "average", "delayed filter", "two filters")


def late(bench: Bench, channel: str, kind: str, lag: float) -> Array:
    """(size,) what a lag of a channel does: the one that answers shows the response to earlier
    loads; the one that is driven was in truth ahead of what was read."""
    if channel != driven_channel(bench):
        line = _parabolas(bench, bench.line)
        way, speed = steady_way(bench, line)  # of which a lag shows what was that long ago
        shown = _behind(bench, (line - way)[:, None], kind, lag)[:, 0]
        return bench.stacked(shown + way - speed * lag - line)
    ahead = ahead_of_reading(bench, kind, lag)
    if bench.imposed:
        return bench.stacked(bench.line_slope * ahead)
    # unloaded, a force that lags still shows what is over
    return bench.force_column(ahead) + bench.stacked(zero_force=-ahead)


def kinds_of(law: Law) -> tuple[str, ...]:
    """Kinds of lag that a law's terms are: of a window half delay, half filter."""
    way = str(law.constants["way"])
    return KINDS[:2] if way == "window" else (way,)


def ahead_of_reading(bench: Bench, kind: str, lag: float) -> Array:
    """(n,) N by which the load that drives the rig is ahead of its reading, where that lags."""
    if way_shown(bench):
        return _ahead(bench, _parabolas(bench, bench.load), kind, lag)
    return _true_force(bench, kind, lag) - bench.load


def way_shown(bench: Bench) -> bool:
    """Whether the way of the driven channel was recorded, and need not be guessed."""
    return bench.rows.continuous or bool(np.mean(bench.rows.in_ramp) > _SHOWN)


_SHOWN = 0.1  # of the rows: then the way between levels was recorded, and need not be guessed


def driven_channel(bench: Bench) -> str:
    """The channel that the rig drives: one that lags was in truth ahead of what was read."""
    return "displacement" if bench.imposed else "force"


_SIDE = 4  # rows to either side
# Weights of nine rows for one at the middle of a parabola through them (Savitzky and Golay 1964).
_PARABOLA = np.array([-21, 14, 39, 54, 59, 54, 39, 14, -21]) / 231
_NOISE = 4.0  # standard deviations, by second differences


def _parabolas(bench: Bench, values: Array) -> Array:
    """Parabolas (n,) through the rows about each of a running recording (Savitzky and Golay 1964):
    noise of what is driven must not stand in the column that is to explain it. Where they are far
    from what was read, as about a step, it was no noise, and stays."""
    if not bench.rows.continuous:
        return values
    out = values.copy()
    for a, b in pairwise(bench.rows.run_edges):
        if b - a > 4 * _SIDE:
            inner = np.convolve(values[a:b], _PARABOLA, mode="valid")
            read = values[a + _SIDE : b - _SIDE]
            noise = white_sd(np.diff(values[a:b], 2))
            near = np.abs(inner - read) <= _NOISE * noise
            out[a + _SIDE : b - _SIDE] = np.where(near, inner, read)
    return out


def _behind(bench: Bench, values: Array, kind: str, lag: float) -> Array:
    """Values (n, k) as a channel shows them that lags."""
    if kind == "delay":
        return delayed(values, lag, bench.rows)
    if kind == "average":
        return averaged(values, 2 * lag, bench.rows)
    if kind == "delayed filter":  # half of the lag each: as of two filters, too
        return retarded(
            delayed(values, lag / 2, bench.rows), np.array([lag / 2]), bench.rows, bench.rest
        )
    for each in (lag / 2, lag / 2) if kind == "two filters" else (lag,):
        values = retarded(values, np.array([each]), bench.rows, bench.rest)
    return values


def _ahead(bench: Bench, load: Array, kind: str, lag: float) -> Array:
    """(n,) by how much the true load is ahead of a reading (n,) that lags: `x(t + d) - x(t)` of a
    delay, and about so of a mean, `T dx/dt` of a filter. Where the reading stands, there is nothing
    to be ahead of."""
    if kind != "filter":
        return delayed(load, -lag, bench.rows) - load
    out = np.zeros_like(load)
    for a, b in pairwise(bench.rows.run_edges):
        time = bench.rows.time[a:b]
        if b - a > 1 and np.all(np.diff(time) > 0):
            out[a:b] = lag * np.gradient(load[a:b], time)
    return out


def _true_force(bench: Bench, kind: str, lag: float) -> Array:
    """(n,) force that stands still in every hold and that, read with the lag, gives the readings
    best (least squares in every run; a hold that the readings hardly see keeps what was read)."""
    return still(bench, kind, lag)[0]


def still(bench: Bench, kind: str, lag: float) -> tuple[Array, Array]:
    """That force (n,), and what its readings with the lag leave (n,) of those that there are."""
    rows = bench.rows
    within = rows.hold - rows.hold[rows.starts][np.cumsum(rows.starts) - 1]  # number in its run
    holds = np.eye(int(within.max()) + 1)[within]
    shown, out = _behind(bench, holds, kind, lag), bench.load.copy()
    missed = np.zeros(rows.n)
    for mine in (slice(a, b) for a, b in pairwise(rows.run_edges)):
        number = within[mine]
        used = int(number[-1]) + 1
        A = shown[mine, :used]
        mean = np.bincount(number, weights=bench.load[mine]) / np.bincount(number)
        left = bench.load[mine] - A @ mean
        settled = np.abs(A[np.arange(len(A)), number] - 1) < _SETTLED
        seen = A.T * (rows.weight[mine] * np.where(settled, 1.0, _ON_THE_WAY))
        change = np.linalg.solve(seen @ A + _HOLDS_BACK**2 * np.eye(used), seen @ left)
        out[mine] = (mean + change)[number]
        missed[mine] = left - A @ change
    return out, missed


# Of a sample's weight: what is read while the load is still seen coming depends on a hand's path.
_SETTLED, _ON_THE_WAY = 0.02, 0.2
_HOLDS_BACK = 0.05  # of a sample's weight: keeps what nobody saw from running away
