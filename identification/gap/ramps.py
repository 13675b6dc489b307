"""Ways from one level of the load to the next that were recorded under the name of the next.

Whoever records all the time has holds that begin with the ramp that led there. Averaged with the
hold, a ramp is neither at rest nor on its way; and its scatter would pass for noise of the force.
Such samples get a step of their own: they are read as they are, and the hold begins where it does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.gap.data import ZERO, Flags, GapData, Ints
from identification.gap.holds import hold_ids, is_continuous

_SEEN = 4.0  # standard deviations, of both together
_AWAY, _ABOUT = 0.01, 4.0  # of the range; as far, by shares of the range, to a factor
_LAST = 0.25  # share of a hold whose mean is where it leads to


def ramps_apart(data: GapData) -> GapData:
    """The data with ramps told, and as steps of their own; of what runs all the time, those that
    lead to no load. As they are where there are none."""
    hold = hold_ids(data)
    moving, runs = _moving(data, hold), is_continuous(data, hold)
    moving &= (data.branch == ZERO) | (not runs)
    if not moving.any():
        return data
    if runs:
        return replace(data, on_the_way=moving)
    beyond = int(data.step.max()) + 1
    step = np.where(moving, beyond + data.step, data.step)
    return replace(data, step=step, on_the_way=moving)


def _moving(data: GapData, hold: Ints) -> Flags:
    """(n,) samples at the beginning of holds (n,) at which force and displacement are both where
    neither ends, by about as much of their ranges: a drift or a lag moves one of them, creep the
    other. A run that begins unloaded comes from nowhere."""
    n = len(hold)
    starts = np.flatnonzero(np.diff(hold, prepend=-1))
    count = np.diff(np.append(starts, n))
    within = np.arange(n) - np.repeat(starts, count)
    last = within >= np.repeat(count - np.maximum(1, (_LAST * count).astype(int)), count)
    off, far = [], []
    for values, sd in (
        (data.force, data.instruments.force),
        (data.displacement, data.instruments.displacement),
    ):
        end = np.bincount(hold, values * last) / np.bincount(hold, last)
        away = np.abs(values - end[hold])
        off.append(away / sd)
        far.append(away / (np.ptp(values) or 1.0))
    alike = (np.minimum(*off) > 1) & (np.maximum(*far) < _ABOUT * np.minimum(*far))
    away = alike & (np.hypot(*off) > _SEEN)
    there = np.where(away, n, within)  # place in its hold of the first sample that is there
    arrives = np.minimum.reduceat(there, starts)
    arrives[np.maximum(*far)[starts] < _AWAY] = 0
    first = np.diff(data.run[starts], prepend=-1) != 0
    arrives[first & (data.branch[starts] == ZERO) & (data.step[starts] <= 0)] = 0
    return np.asarray(within < np.repeat(arrives, count))
