"""Plays that are reached by viscoplastic flow, on rows in their order."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.model.history import PEAK, beginnings, clipped, phases_of, rests
from identification.gap.recording.rows import Rows

_PARTS = 4  # of the way from hold to hold; within a hold the load hardly moves, and one will do
_AT_ONCE = 1_000_000  # numbers that are made at once
_FEW = 13  # columns: of fewer, numbers of Python take less time than arrays of numpy


def flowing_play(
    load: Array,
    radius: Array,
    times: Array,
    rows: Rows,
    fresh: Flags,
    weight: Array | None = None,
    square: Flags | bool = False,
) -> Array:
    """Plays (n, k) of radii (k,) that follow with time constants (k,) s (Bingham, Perzyna 1966).

    `T p' = clip(p, x - r, x + r) - p`: what is beyond the radius flows off, and stops when the load
    falls below it, wherever it has come to; it flows back in a rest. load (n,), or (n, k): of each.
    square (k,): it flows with the square of the overstress, `T p' = o |o| / r`, and slows down as
    it comes near. weight (n,): as in `play`.
    """
    load = load.reshape(len(load), -1)
    n, k = len(load), len(radius)
    centre = np.zeros((n, 1)) if weight is None else weight[:, None]
    below, above = centre - radius, centre + radius
    hung = clipped(0.0, below, above)
    begins = beginnings(fresh)
    before = np.where(begins[:, None], 0.0, np.roll(load, 1, axis=0))
    steps = _steps(rows, begins)
    squared = np.broadcast_to(np.asarray(square, dtype=bool), k)
    states, state = np.empty((len(steps.row), k)), hung[0]
    for a, b in pairwise(_edges(steps, max(_AT_ONCE // max(k, 1), 1))):
        row = steps.row[a:b]
        x = steps.old[a:b, None] * before[row] + steps.new[a:b, None] * load[row]
        over = steps.seconds[a:b, None] / times
        share = np.where(squared, over / radius, -np.expm1(-over))
        start = hung[row[0]] if steps.begins[a] else state
        states[a:b] = _followed(start, share, x + below[row], x + above[row], squared)
        state = states[b - 1]
    last = np.searchsorted(steps.row, np.arange(n), side="right") - 1
    return np.asarray(states[last] - hung)


@dataclass(frozen=True, eq=False)
class _Steps:
    """Whiles (m,) in which a load holds still, in their order: of which row; seconds; the load, as
    a share of that of the row before, and one of its own; whether memory begins there."""

    row: Ints
    seconds: Array
    old: Array
    new: Array
    begins: Flags


def _steps(rows: Rows, begins: Flags) -> _Steps:
    """The old load, a rest, the way to the new one in parts, the new load; where memory begins
    (n,), there is neither of the first two, and one step at least."""
    rest = rests(rows)
    phases, every = phases_of(rows, rest), np.arange(rows.n)
    parts = np.where(rows.hold_starts | rest | rows.continuous, _PARTS, 1)
    way = np.repeat(every, parts)
    share = (np.arange(len(way)) - np.repeat(np.cumsum(parts) - parts, parts) + 0.5) / parts[way]
    old, new = _on_the_way(share, rows.overshoot[way])
    none, one = np.zeros(rows.n), np.ones(rows.n)
    kinds = (
        (every, np.where(begins, 0.0, phases.pause), one, none),
        (every, np.where(begins, 0.0, phases.unloaded), none, none),
        (way, phases.ramp[way] / parts[way], np.where(rest[way], 0.0, old), new),
        (every, phases.stands, none, one),
    )
    row, seconds, old, new = (np.concatenate(each) for each in zip(*kinds, strict=True))
    first = np.arange(len(row)) < rows.n
    kept = np.flatnonzero((seconds > 0) | (first & begins[row]))
    order = kept[np.argsort(row[kept], kind="stable")]
    return _Steps(row[order], seconds[order], old[order], new[order], (first & begins[row])[order])


def _on_the_way(share: Array, beyond: Array) -> tuple[Array, Array]:
    """Shares (m,) of the load before and of the one after that stand at shares (m,) of the time
    between; on the way the load may go beyond the one after, by shares (m,) of it."""
    there, back = share / PEAK, (share - PEAK) / (1 - PEAK)
    old = np.where(beyond == 0, 1 - share, np.maximum(1 - there, 0.0))
    new = np.where(back < 0, there * (1 + beyond), 1 + (1 - back) * beyond)
    return old, np.where(beyond == 0, share, new)


def _edges(steps: _Steps, most: int) -> list[int]:
    """Where pieces of `most` steps begin and end, and where memory does."""
    m = len(steps.row)
    return sorted({*range(0, m, most), *np.flatnonzero(steps.begins).tolist(), m})


def _followed(start: Array, share: Array, least: Array, most: Array, square: Flags) -> Array:
    """States (m, k) after steps in which they flow, from start (k,), towards [least, most] (m, k):
    by a share (m, k) of what is beyond; square (k,): by `s o / (1 + s o)` of it."""
    out = np.empty(share.shape)
    for squared in (False, True):
        mine = np.flatnonzero(square == squared)
        if mine.size < _FEW:
            follow = _squared if squared else _in_proportion
            for k in mine:
                one = (share[:, k].tolist(), least[:, k].tolist(), most[:, k].tolist())
                out[:, k] = follow(float(start[k]), *one)
        else:
            each = (share[:, mine], least[:, mine], most[:, mine])
            out[:, mine] = _side_by_side(start[mine], *each, squared=squared)
    return out


def _side_by_side(state: Array, share: Array, least: Array, most: Array, *, squared: bool) -> Array:
    """The same (m, k) for many of one kind; in place, since small arrays take longer to be made
    than to be filled."""
    out, over, way = np.empty(share.shape), np.empty(len(state)), np.empty(len(state))
    for i, given, low, high in zip(range(len(out)), share, least, most, strict=True):
        part = given
        np.minimum(np.maximum(state, low, out=over), high, out=over)
        np.subtract(over, state, out=over)
        if squared:
            np.multiply(np.abs(over, out=way), given, out=way)
            part = np.divide(way, np.add(way, 1.0, out=out[i]), out=way)
        state = np.add(state, np.multiply(part, over, out=over), out=out[i])
    return out


def _in_proportion(
    z: float, share: list[float], least: list[float], most: list[float]
) -> list[float]:
    out = []
    for s, low, high in zip(share, least, most, strict=True):
        if z < low:
            z += s * (low - z)
        elif z > high:
            z += s * (high - z)
        out.append(z)
    return out


def _squared(z: float, share: list[float], least: list[float], most: list[float]) -> list[float]:
    out = []
    for s, low, high in zip(share, least, most, strict=True):
        over = low - z if z < low else min(high - z, 0.0)
        way = s * abs(over)
        z += way / (1 + way) * over
        out.append(z)
    return out
