"""Operators with memory, on rows in their order: what friction, creep and lag make of a load.

All run over the load path of the whole session. Between two runs the load returns to zero, unless
both neighbours stay far from it (one continuous recording cut into runs).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import exp

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.recording.rows import REST_S, Rows

_FAR = 0.2  # share of the load's range: a run that starts and ends beyond it was not unloaded


def rests(rows: Rows) -> Flags:
    """(n,): rows before which the load went back to zero (first rows of runs)."""
    out = rows.starts.copy()
    span = float(np.ptp(np.append(rows.force, 0.0)))
    for i in np.flatnonzero(out)[1:]:
        if min(abs(rows.force[i - 1]), abs(rows.force[i])) > _FAR * span:
            out[i] = False
    return out


def moves(rows: Rows, poses: list[str]) -> Flags:
    """(n,): first rows after the arm went to another pose. poses: of every setup."""
    number = np.array([poses.index(p) for p in poses])[rows.setup]
    return np.concatenate([[True], np.diff(number) != 0])


def play(
    load: Array, radius: Array, rest: Flags, fresh: Flags, weight: Array | float = 0.0
) -> Array:
    """Play operator (backlash of half width `radius`), (n, k) for load (n, k), radius (k,).

    `p_i = max(x_i - r, min(x_i + r, p_{i-1}))`, p = 0 in the beginning (Krasnosel'skii, Pokrovskii
    1989). rest: rows before which the load was zero. fresh: rows before which the state went back
    to zero (the arm moved to another pose, or a controller took the joint back). weight (n, 1):
    what came on beside the load then, and stays; states count from where it left them.
    """
    least, most = weight - radius, weight + radius
    hung = clipped(0.0, least, most)
    low, high = load + least, load + most
    least, most, start = (np.broadcast_to(v, load.shape) for v in (least, most, hung))
    back, new = np.flatnonzero(rest & ~fresh), np.flatnonzero(fresh)
    # from anywhere without load
    low[back], high[back] = (clipped(v[back], low[back], high[back]) for v in (least, most))
    low[new] = high[new] = clipped(start[new], low[new], high[new])
    return np.asarray(_clips(low, high, start[:1]) - hung)


_MANY = 8000  # numbers, whose halves take less time than the calls for these


def _clips(low: Array, high: Array, start: Array) -> Array:
    """(n, k) states of what starts at (1, k), and which every row clips to [low, high] (n, k),
    which are lost. Clips of clips are clips: of many rows every second state is found by half as
    many clips, and the rest from these; of few all prefixes in log2(n) passes over the rows."""
    n = len(low)
    if low.size > _MANY:
        out, first, then = np.empty_like(low), slice(0, n - n % 2, 2), slice(1, n, 2)
        ends = low[then], high[then]
        lower, upper = clipped(low[first], *ends), clipped(high[first], *ends)
        out[then] = _clips(lower, upper, start)
        before = np.concatenate([start, out[1 : n - 1 : 2]])
        out[::2] = clipped(before, low[::2], high[::2])
        return out
    step = 1
    while step < n:
        lower = clipped(low[:-step], low[step:], high[step:])
        upper = clipped(high[:-step], low[step:], high[step:])
        low[step:], high[step:] = lower, upper
        step *= 2
    return clipped(start, low, high)


def clipped(values: Array | float, low: Array, high: Array) -> Array:
    """As np.clip, which takes three times as long for arrays as small as these."""
    return np.asarray(np.minimum(np.maximum(values, low), high))


def beginnings(fresh: Flags) -> Flags:
    """Rows (n,) from which a memory counts: where it is fresh (n,), and the first one."""
    return np.asarray(fresh | (np.arange(len(fresh)) == 0))


def whiles(fresh: Flags) -> list[tuple[int, int]]:
    """[(start, end), ...]: rows between two resets of the memory, end exclusive; the first begins
    at row 0."""
    return list(pairwise([*np.flatnonzero(beginnings(fresh)).tolist(), len(fresh)]))


def bristles(
    load: Array, reach: Array, fresh: Flags, elastic: bool, weight: Array | None = None
) -> Array:
    """State z in [-1, 1] of a friction whose bristles bend over `reach` (k,), (n, k); with a
    weight (n,) that came on when it was fresh, against where that left it.

    `dz = (s - z) s dx / r` with s the sense of motion (Dahl); elastic: while z opposes the motion
    it falls linearly, `dz = dx / r` (Bouc-Wen with beta = gamma). Exact between rows.
    """
    hung = np.zeros((len(load), len(reach)))
    if weight is not None:
        hung = -np.sign(weight)[:, None] * np.expm1(-np.abs(weight)[:, None] / reach)
    begins = beginnings(fresh)
    step = load - np.where(begins, 0.0, np.concatenate([[0.0], load[:-1]]))
    sense, way = np.sign(step)[:, None], np.abs(step)[:, None] / reach
    if not elastic:
        from_before = np.where(begins[:, None], hung, 0.0)
        still = np.exp(-way)
        gain = still * from_before - sense * np.expm1(-way)
        return np.asarray(_prefix(np.where(begins[:, None], 0.0, still), gain) - hung)
    changes = begins | (step != 0)
    at = np.flatnonzero(changes)
    senses, fresh_at = sense[at, 0].tolist(), begins[at].tolist()
    each = zip(way[at].T.tolist(), hung[at].T.tolist(), strict=True)
    states = np.array([_let_go(senses, fresh_at, *one) for one in each]).T
    return np.asarray(states[np.cumsum(changes) - 1] - hung)


def _let_go(
    sense: list[float], begins: list[bool], way: list[float], hung: list[float]
) -> list[float]:
    """States of bristles of one reach that let go elastically; numbers of Python, of which numpy
    would make a third as many in the time."""
    out, z = [], hung[0]
    for s, new, w, start in zip(sense, begins, way, hung, strict=True):
        z = start if new else z
        back = min(max(-s * z, 0.0), w)
        z = s - (s * (1 - back) - z) * exp(back - w)
        out.append(z)
    return out


@dataclass(frozen=True, eq=False)
class Phases:
    """How the time since the row before was spent, (n,) s each. step: all of it; then in this order
    pause: the old load stands on; unloaded; ramp; stands: the new load stands. After a rest the
    ramp takes the last 5 s at most."""

    step: Array
    pause: Array
    unloaded: Array
    ramp: Array
    stands: Array


def phases_of(rows: Rows, rest: Flags, stood: float = 0.0, rested: float | None = None) -> Phases:
    """Of every row; rest (n,): before which the load went back to zero. stood: share of a rest for
    which the old load stood on, which no row shows. rested: s between two runs, where no clock of
    the session was recorded; None: as `Rows.session` has it."""
    step = np.maximum(np.diff(rows.session, prepend=rows.session[0]), 0.0)
    if rested is not None and not rows.clock:
        step += np.where(rows.starts & (step > 0), rested - REST_S, 0.0)
    ease = np.where(rest, np.minimum(step, _REST_RAMP_S), step)
    stands = np.minimum(time_under_load(rows), ease)
    pause = np.minimum(hold_time_after_row(rows), np.where(rest, step - ease, ease - stands))
    pause += np.where(rest, stood * (step - ease - pause), 0.0)
    ramp = np.maximum(ease - stands - np.where(rest, 0.0, pause), 0.0)
    return Phases(step, pause, np.where(rest, step - ease - pause, 0.0), ramp, stands)


def retarded(
    load: Array,
    times: Array,
    rows: Rows,
    rest: Flags,
    fresh: Flags | None = None,
    stood: float = 0.0,
    rested: float | None = None,
) -> Array:
    """First-order lag `T z' = x - z` of a load (n, k) with times (k,), or one (1,) for all:
    deflection of a Kelvin-Voigt element per unit of its compliance. Exact for a load that ramps
    between rows and then stands. fresh: rows (n,), after a rest, before which it is forgotten.
    stood, rested: as in `phases_of`."""
    old = np.vstack([np.zeros((1, load.shape[1])), load[:-1]])
    if fresh is not None:
        old[fresh] = 0.0
    before = np.where(rest[:, None], 0.0, old)
    phases = phases_of(rows, rest, stood, rested)
    # z_i = keep_i z_{i-1} + gain_i: the old load standing on, a rest; a ramp to the new load, then
    # standing there. What there was goes back all the while.
    paused = np.exp(-phases.pause[:, None] / times)
    ramp = phases.ramp[:, None] / times
    held = np.exp(-phases.stands[:, None] / times)
    during = np.exp(-ramp)
    ramped = _ramped(before, load, ramp)
    beyond = np.flatnonzero(rows.overshoot)
    if beyond.size:
        peak = load[beyond] * (1 + rows.overshoot[beyond, None])
        there, back = PEAK * ramp[beyond], (1 - PEAK) * ramp[beyond]
        gone = _ramped(before[beyond], peak, there) * np.exp(-back)
        ramped[beyond] = gone + _ramped(peak, load[beyond], back)
    keep = np.exp(-phases.step[:, None] / times)
    if fresh is not None:
        keep[fresh] = 0.0
    during *= np.exp(-phases.unloaded[:, None] / times)
    return _prefix(keep, held * (ramped + during * old * (1 - paused)) + load * (1 - held))


def _ramped(before: Array, after: Array, ramp: Array) -> Array:
    """What a lag follows of a load that ramps from before to after (n, k) in `ramp` (n, k) of its
    time, from nothing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(ramp > 0, -np.expm1(-ramp) / ramp, 1.0)
    return np.asarray(after * (1 - share) + before * (share - np.exp(-ramp)))


PEAK = 5 / 8  # of the time on the way to a hold: there the load has gone furthest beyond it


def followed(values: Array, clock: Array, times: Array) -> Array:
    """First-order lags (n, k) with times (k,) s behind values (n,) that were read at clock (n,) s,
    from where they began on: exact for values that go straight from reading to reading."""
    rise = (values - values[0])[:, None]
    before = np.vstack([np.zeros((1, 1)), rise[:-1]])
    step = np.diff(clock, prepend=clock[0])[:, None] / times
    keep = np.exp(-step)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(step > 0, -np.expm1(-step) / step, 1.0)
    return _prefix(keep, rise * (1 - share) + before * (share - keep))


_REST_RAMP_S = 5.0  # the last of a rest: the screw comes to the load


def _prefix(keep: Array, gain: Array) -> Array:
    """z (n, k) of `z_i = keep_i z_{i-1} + gain_i`, z = 0 before: steps of steps are steps, so all
    prefixes are found in log2(n) passes."""
    keep, gain = keep.copy(), gain.copy()
    step = 1
    while step < len(keep):
        further = gain[step:] + keep[step:] * gain[:-step]
        keep[step:] = keep[step:] * keep[:-step]
        gain[step:] = further
        step *= 2
    return gain


def time_under_load(rows: Rows) -> Array:
    """(n,) s: from the arrival of the load at its level to the row, or since the row before: half a
    sampling period in the first row of a hold, 0 in the others and in running recordings."""
    if rows.continuous:
        return np.zeros(rows.n)
    return np.where(rows.hold_starts, rows.half_sample, 0.0)


def hold_time_after_row(rows: Rows) -> Array:
    """(n,) s: how long the old load still stood after the time of the row before, 0 within holds:
    the time of a row is the mean of its samples', the load moves half a sample after the last."""
    if rows.continuous:
        return np.zeros(rows.n)
    last = rows.half_sample + np.concatenate([[0.0], rows.to_last[:-1]])
    return np.where(rows.hold_starts, last, 0.0)


def unread_ramp_duration(rows: Rows) -> float | None:
    """Median duration (s) of the ramps between holds, which no reading shows. None in running
    recordings, and of a single hold."""
    begins = rows.hold_starts & ~rows.starts
    if rows.continuous or not begins.any():
        return None
    gaps = np.diff(rows.session, prepend=rows.session[0])
    return float(np.median((gaps - time_under_load(rows) - hold_time_after_row(rows))[begins]))


def sampling_time(rows: Rows) -> float:
    """Time between two samples of a hold; of a running recording, between most of its rows, s."""
    return (rows.row_time or 1.0) if rows.continuous else rows.sample_time


def delayed(values: Array, delay: float, rows: Rows) -> Array:
    """`values(t - delay)` of values (n,) or (n, k), within every run, along a path through rows."""
    out = np.empty_like(values)
    for a, b, t, v in _paths(values, rows):
        place = np.interp(rows.time[a:b] - delay, t, np.arange(len(t), dtype=float))
        low = place.astype(np.intp)
        share = (place - low).reshape(-1, *[1] * (v.ndim - 1))
        out[a:b] = v[low] + share * (v[np.minimum(low + 1, len(v) - 1)] - v[low])
    return out


def averaged(values: Array, window: float, rows: Rows) -> Array:
    """Means of values (n,) or (n, k) over the last `window` s, along the same path; before a run
    they are what they are at its first row."""
    out = np.empty_like(values)
    for a, b, t, v in _paths(values, rows):
        step = np.diff(t).reshape(-1, *[1] * (v.ndim - 1))
        area = np.concatenate([0.0 * v[:1], np.cumsum(step * (v[1:] + v[:-1]) / 2, axis=0)])

        def until(at: Array, t: Array = t, v: Array = v, area: Array = area) -> Array:
            k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 1)
            after = (at - t[k]).reshape(-1, *[1] * (v.ndim - 1))
            high = np.minimum(k + 1, len(t) - 1)
            length = np.maximum(t[high] - t[k], 1e-300).reshape(after.shape)
            rise = np.where(after > 0, (v[high] - v[k]) / length, 0.0)
            return np.asarray(area[k] + after * (v[k] + 0.5 * after * rise))

        now = rows.time[a:b]
        out[a:b] = (until(now) - until(now - window)) / window
    return out


def _paths(values: Array, rows: Rows) -> Iterator[tuple[int, int, Array, Array]]:
    """Of every run its first row and the one after its last, and corners of its path: times (m,)
    and values (m,) or (m, k). From hold to hold it is straight."""
    half = rows.half_sample
    for a, b in pairwise(rows.run_edges.tolist()):
        t, v = rows.time[a:b], values[a:b]
        if not rows.continuous:
            new = rows.hold_starts[a:b]
            last = half + rows.to_last[a:b][:-1]
            leaves, comes = (t[:-1] + last)[new[1:]], t[1:][new[1:]] - half
            beyond = rows.overshoot[a + 1 : b][new[1:]]
            peaks = beyond != 0
            peak = (v[1:][new[1:]].T * (1 + beyond)).T[peaks]
            turns = (leaves + PEAK * (comes - leaves))[peaks]
            t = np.concatenate([t, t[new] - half, leaves, turns])
            v = np.concatenate([v, v[new], v[:-1][new[1:]], peak])
            order = np.argsort(t, kind="stable")
            t, v = t[order], v[order]
        elif len(t) > 1:
            t, v = _rounded(t, v)
        yield a, b, t, v


def _rounded(time: Array, values: Array) -> tuple[Array, Array]:
    """More corners, along a smooth path through values (n, ...) read at times (n,) (Akima 1970):
    straight ramps would cut the tops of fast swings off. Across a pause, or where a time stands
    twice, nobody knows the path, and it is straight."""
    from scipy.interpolate import Akima1DInterpolator

    step = np.diff(time)
    cut = np.flatnonzero((step <= 0) | (step > _PAUSE * np.median(step))) + 1
    times, paths = [], []
    for part in np.split(np.arange(len(time)), cut):
        t, v = time[part], values[part]
        if len(t) >= _FEWEST:
            fine = np.interp(np.arange(_BETWEEN * (len(t) - 1) + 1) / _BETWEEN, part - part[0], t)
            t, v = fine, np.asarray(Akima1DInterpolator(t, v)(fine))
        times.append(t)
        paths.append(v)
    return np.concatenate(times), np.concatenate(paths)


_BETWEEN, _FEWEST = 4, 4  # corners for each row; rows that have a curve
_PAUSE = 3.0  # times the usual time from row to row
