"""Single readings that jump off and come back at once: set aside, and said.

Converters drop a bit, a clamp knocks at a turning point. A handful of such readings, far off beside
hundreds that follow a law, is no effect of the rig; but where many are most of what a straight line
leaves of a running recording, they are the gap, and stay. At rest only what lies between two
readings of its hold is looked at: the first of a hold may lag.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.data import GapData
from identification.gap.recording.holds import hold_ids, is_continuous, rest_ids, scatter_within
from identification.gap.recording.white import white_sd

_WINDOW = 25  # readings, in which a typical change is
_NOISE, _STEPS, _RANGE = 6.0, 3.0, 0.02  # a glitch is off by more than each: standard deviations,
# typical changes from one reading to the next, share of the range
_LONGEST = 3  # readings in a row
_MOST = 0.05  # of all readings: more of them are how this rig behaves
_STRAY = 0.002  # of all readings: so few are stray, however far off they are
_MINOR = 0.8  # of the rms that a straight line leaves without them
_FEWEST = 40


def without_glitches(data: GapData) -> GapData:
    """The data without them, and a note that says how many; as they are where there are none."""
    if len(data.force) < _FEWEST:
        return data
    hold = hold_ids(data)
    off = (
        _while_running(data) if is_continuous(data, hold) else _at_rest(data, rest_ids(data, hold))
    )
    if not off.any():
        return data
    count = int(off.sum())
    note = (
        f"{count} of {len(off)} readings jump off and come back at once: set aside as glitches "
        f"(the first {data.time_label(int(off.argmax()))}). See to cables, converter and clamps."
    )
    return picked(data, ~off, note)


def _while_running(data: GapData) -> Flags:
    """(n,) those of a running recording."""
    if data.arm:
        return np.zeros(len(data.force), dtype=bool)
    off = _off(data.force, data.run) | _off(data.displacement, data.run)
    share = off.mean()
    return off & bool(share <= _STRAY or (share <= _MOST and _minor(data, off)))


def _at_rest(data: GapData, hold: Ints) -> Flags:
    """(n,) those within holds."""
    meter = data.instruments
    off = _off_in_holds(data.force, hold, meter.force)
    off |= _off_in_holds(data.displacement, hold, meter.displacement)
    return off & bool(off.mean() <= _MOST_AT_REST)


_FAR = 8.0  # standard deviations of what a reading is off the line between its neighbours
_MOST_AT_REST = 0.01  # of all readings


def _off_in_holds(values: Array, hold: Ints, stated: float) -> Flags:
    """Readings between two of the same hold that agree with each other, but not with it."""
    noise = max(stated, scatter_within(values, hold) or 0.0)
    off = np.zeros(len(values), dtype=bool)
    before, here, after = values[:-2], values[1:-1], values[2:]
    away = np.abs(here - (before + after) / 2)
    same = (hold[:-2] == hold[1:-1]) & (hold[2:] == hold[1:-1])
    off[1:-1] = same & (away > _FAR * 1.5**0.5 * noise) & (np.abs(after - before) < away / 2)
    return off


def _off(values: Array, run: Ints) -> Flags:
    """(n,) readings that are off, in every run."""
    out = np.zeros(len(values), dtype=bool)
    for r in np.unique(run):
        mine = np.flatnonzero(run == r)
        if len(mine) >= _FEWEST:
            out[mine] = _off_in_one(values[mine])
    return out


def _off_in_one(x: Array) -> Flags:
    """Readings, up to _LONGEST in a row, that are all off the line between the ones about them."""
    from scipy.ndimage import median_filter

    noise = white_sd(np.diff(x, 2))
    step = median_filter(np.abs(np.diff(x, append=x[-1])), _WINDOW, mode="nearest")
    limit = np.maximum(_STEPS * step, max(_NOISE * noise, _RANGE * float(np.ptp(x))))
    off = np.zeros(len(x), dtype=bool)
    for long in range(1, _LONGEST + 1):
        at = np.arange(1, len(x) - long)  # first of the block
        share = np.arange(1, long + 1)[:, None] / (long + 1)
        block = at + np.arange(long)[:, None]
        away = x[block] - (1 - share) * x[at - 1] - share * x[at + long]
        jumps = np.all(np.abs(away) > limit[at], axis=0) & (np.ptp(np.sign(away), axis=0) == 0)
        jumps &= np.abs(x[at + long] - x[at - 1]) < np.abs(away).min(axis=0)  # else it is a step
        off[block[:, jumps]] = True
    return off


def _minor(data: GapData, off: Flags) -> bool:
    """Whether they are the lesser part of what a straight line leaves."""
    line = np.column_stack([data.force, np.ones(len(off))])
    w = np.linalg.lstsq(line[~off], data.displacement[~off], rcond=None)[0]
    left = data.displacement - line @ w
    at = np.arange(len(off))
    jump = left - np.interp(at, at[~off], left[~off])
    return bool(np.sum(jump**2) < _MINOR**2 * np.sum(left[~off] ** 2))


def picked(data: GapData, kept: Flags, *notes: str) -> GapData:
    """Some of the rows, kept (n,); notes: what is said of the others."""
    n, out = len(kept), dict[str, Any]()
    for f in fields(data):
        value = getattr(data, f.name)
        if isinstance(value, np.ndarray) and len(value) == n and f.name not in _NOT_ROWS:
            out[f.name] = value[kept]
    return replace(data, **out, aside=(*data.aside, *notes))


_NOT_ROWS = frozenset({"compliance", "compliance_relative_sd"})
