"""Loads that are on their way to a level, under the name of that level.

Whoever records all the time has holds that begin with the ramp that led there. Averaged with the
hold, a ramp is neither at rest nor on its way; and its scatter would pass for noise of the force.
Its samples are told (`GapData.on_the_way`): they are holds of their own, read as they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.gap.data import ZERO, Array, Flags, GapData, Ints
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.running import first_rows

_SEEN = 4.0  # standard deviations
_AWAY = 0.01  # of the range: so far the first sample of a ramp has to go at least
_ABOUT = 2.0  # times as much of its range as the other channel of its own
_LAST = 0.25  # share of a hold whose mean is where it leads to
_TO_GO = 0.25  # of a step


def ramps_told(data: GapData) -> GapData:
    """The data with ramps told; of what runs all the time, those that lead to no load. As they are
    where there are none."""
    hold = hold_ids(data)
    moving = _moving(data, hold)
    if is_continuous(data, hold):
        moving &= data.branch == ZERO
    return replace(data, on_the_way=moving) if moving.any() else data


def _moving(data: GapData, hold: Ints) -> Flags:
    """(n,) samples at the beginning of holds (n,) at which force and displacement are both where
    neither ends, to the sides that belong together and by about as much of their ranges: a drift
    or a lag moves one of them, creep the other, and a screw that relaxes both against each other.
    A run that begins unloaded comes from nowhere."""
    n = len(hold)
    starts = first_rows(hold)
    count = np.diff(np.append(starts, n))
    within = np.arange(n) - np.repeat(starts, count)
    last = within >= np.repeat(count - np.maximum(1, (_LAST * count).astype(int)), count)
    away, far = [], []
    for values, sd in (
        (data.force, data.instruments.force),
        (data.displacement, data.instruments.displacement),
    ):
        end = np.bincount(hold, values * last) / np.bincount(hold, last)
        off = values - end[hold]
        away.append(off / sd)
        far.append(np.abs(off) / _spans(data, values))
    alike = away[0] * away[1] * _senses(data) > 0
    alike &= (np.minimum(*np.abs(away)) > 1) & (np.maximum(*far) < _ABOUT * np.minimum(*far))
    coming = alike & (np.hypot(*away) > _SEEN)
    # of every hold: the place in it of the first sample that is there
    arrives = np.minimum.reduceat(np.where(coming, n, within), starts)
    arrives[np.maximum(*far)[starts] < _AWAY] = 0
    first = np.diff(data.run[starts], prepend=-1) != 0
    arrives[first & (data.branch[starts] == ZERO) & (data.step[starts] <= 0)] = 0
    return np.asarray(within < np.repeat(arrives, count))


def _spans(data: GapData, values: Array) -> Array:
    """(n,) range of values (n,) in the setup of every sample."""
    out = np.ones(len(values))
    for s in np.unique(data.setup):
        mine = data.setup == s
        out[mine] = np.ptp(values[mine]) or 1.0
    return out


def _senses(data: GapData) -> Array:
    """(n,) 1 where force and displacement of a setup rise together, -1 where they do not."""
    out = np.zeros(len(data.force))
    for s in np.unique(data.setup):
        mine = data.setup == s
        force, u = data.force[mine], data.displacement[mine]
        out[mine] = np.sign((force - force.mean()) @ (u - u.mean()))
    return out


def much_to_go(displacement: Array, level: Ints, sd: float) -> Flags:
    """(n,) rows at a level (n,) at which the displacement has much of its step to go, whatever a
    force says that scatters: the load may not be there yet. sd: of one sample."""
    ends = np.append(np.flatnonzero(np.diff(level)), len(level) - 1)
    off = np.abs(displacement - displacement[ends][level])
    step = np.abs(np.diff(displacement[ends], prepend=0.0))[level]
    return np.asarray((off > _SEEN * sd) & (off > _TO_GO * step) & (step > 0))
