"""Operators with memory, on rows in their order: what friction, creep and lag make of a load.

All run over the load path of the whole session. Between two runs the load returns to zero, unless
both neighbours stay far from it (one continuous recording cut into runs).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.gap.data import Array, Flags
from identification.gap.rows import Rows

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


def play(load: Array, radius: Array, rest: Flags, fresh: Flags) -> Array:
    """Play operator (backlash of half width `radius`), (n, k) for load (n, k), radius (k,).

    `p_i = max(x_i - r, min(x_i + r, p_{i-1}))`, p = 0 in the beginning (Krasnosel'skii, Pokrovskii
    1989). rest: rows before which the load was zero. fresh: rows before which the state went back
    to zero (the arm moved to another pose, or a controller took the joint back).
    """
    out = np.empty_like(load)
    state = np.zeros(load.shape[1])
    upper, lower = load + radius, load - radius
    for i in range(len(load)):
        if fresh[i]:
            state = np.zeros_like(state)
        elif rest[i]:
            state = np.clip(state, -radius, radius)
        state = np.minimum(upper[i], np.maximum(lower[i], state))
        out[i] = state
    return out


@dataclass(frozen=True, eq=False)
class Path:
    """A load path with a cycle put before every fresh start; kept: the rows that were there."""

    load: Array
    fresh: Flags
    kept: Flags


def worked_in(load: Array, fresh: Flags) -> Path:
    """The path (n,) with a cycle to its largest load and back before every fresh start."""
    starts = np.flatnonzero(fresh)
    parts, begins, kept = [], [], []
    for a, b in zip(starts, np.append(starts[1:], len(load)), strict=True):
        top = load[a + int(np.abs(load[a:b]).argmax())]
        parts.append(np.concatenate([[top, 0.0], load[a:b]]))
        begins.append(np.concatenate([[True], np.zeros(b - a + 1, dtype=bool)]))
        kept.append(np.concatenate([[False, False], np.ones(b - a, dtype=bool)]))
    return Path(np.concatenate(parts), np.concatenate(begins), np.concatenate(kept))


def bristles(load: Array, reach: Array, fresh: Flags, elastic: bool) -> Array:
    """State z in [-1, 1] of a friction whose bristles bend over `reach` (k,), (n, k).

    `dz = (s - z) s dx / r` with s the sense of motion (Dahl); elastic: while z opposes the motion
    it falls linearly, `dz = dx / r` (Bouc-Wen with beta = gamma). Exact between rows.
    """
    out = np.empty((len(load), len(reach)))
    z = np.zeros(len(reach))
    before = 0.0
    for i, x in enumerate(load):
        if fresh[i]:
            z, before = np.zeros_like(z), 0.0
        way = np.abs(x - before) / reach
        s = np.sign(x - before)
        if elastic:
            back = np.minimum(np.maximum(-s * z, 0.0), way)
            z, way = z + s * back, way - back
        if s != 0:
            z = s - (s - z) * np.exp(-way)
        before = x
        out[i] = z
    return out


def retarded(load: Array, times: Array, rows: Rows, rest: Flags) -> Array:
    """First-order lag `T z' = x - z` of a load (n, k) with times (k,): deflection of a Kelvin-Voigt
    element per unit of its compliance. Exact for a load that ramps between rows and then stands."""
    out = np.empty_like(load)
    z = np.zeros(load.shape[1])
    before = np.zeros(load.shape[1])
    step = np.diff(rows.session, prepend=rows.session[0])
    stands = settling_share(rows)
    for i in range(len(load)):
        d = max(step[i], 0.0)
        if rest[i]:
            z = z * np.exp(-d / times)
            before = np.zeros_like(before)
            d = min(d, 5.0)
        z = _ramp(z, before, load[i], max(d - stands[i], 0.0), times)
        z = load[i] + (z - load[i]) * np.exp(-min(d, stands[i]) / times)
        before = load[i]
        out[i] = z
    return out


def settling_share(rows: Rows) -> Array:
    """(n,) s: how long the load has stood before a row: half a sample at the start of a hold."""
    if rows.continuous:
        return np.zeros(rows.n)
    return np.where(rows.hold_starts, half_sample(rows), 0.0)


def half_sample(rows: Rows) -> float:
    """Half of the time between two samples of a hold, s."""
    step = np.diff(rows.time)
    inner = step[~rows.hold_starts[1:] & (step > 0)]
    return float(np.min(inner)) / 2 if inner.size else 0.5


def _ramp(z: Array, start: Array, end: Array, duration: float, times: Array) -> Array:
    if duration <= 0:
        return z
    rate = (end - start) / duration
    return np.asarray(end - rate * times + (z - start + rate * times) * np.exp(-duration / times))


def delayed(values: Array, delay: float, rows: Rows) -> Array:
    """`values(t - delay)` (n,), within every run, the path between rows being straight ramps."""
    out = np.empty_like(values)
    half = half_sample(rows)
    edges = np.append(np.flatnonzero(rows.starts), rows.n)
    for a, b in pairwise(edges):
        t, v = rows.time[a:b], values[a:b]
        if not rows.continuous:
            new = rows.hold_starts[a:b]
            t = np.concatenate([t, t[new] - half, t[:-1][new[1:]] + half])
            v = np.concatenate([v, v[new], v[:-1][new[1:]]])
            order = np.argsort(t, kind="stable")
            t, v = t[order], v[order]
        out[a:b] = np.interp(rows.time[a:b] - delay, t, v)
    return out
