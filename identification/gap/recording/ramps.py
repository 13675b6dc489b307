"""Loads that are on their way to a level, under the name of that level.

Whoever records all the time has holds that begin with the ramp that led there. Averaged with the
hold, a ramp is neither at rest nor on its way; and its scatter would pass for noise of the force.
Its samples are told (`GapData.on_the_way`): they are holds of their own, read as they are. Where
every sample bears the name of the level next to it, the first half of a ramp is under the name of
the level it leaves; it is given to the level it leads to.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from identification.gap.data import ZERO, Array, Flags, GapData, Ints
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.running import first_rows

_SEEN = 4.0  # standard deviations
_AWAY = 0.01  # of the range: so far the first sample of a ramp has to go at least
_ABOUT = 2.0  # times as much of its range as the other channel of its own
# The same of what leaves: the curve may be steeper there than on the whole, and the rest has crept
# on meanwhile.
_STEEPER = 4.0
_GENTLY = 0.5  # of what a force had to go at the sample before
_LAST = 0.25  # share of a hold whose mean is where it leads to
_TO_GO = 0.25  # of a step
_MIDDLE = (0.35, 0.75)  # of a hold: it rests there, if it ever does
_AT_REST = 0.1  # of the step to the next one


def ramps_told(data: GapData) -> GapData:
    """The data with ramps told; of what runs all the time, those that lead to no load. As they are
    where there are none."""
    data = _leading_on(data)
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
    coming, far = _away(data, hold, last, _ABOUT)
    # of every hold: the place in it of the first sample that is there
    arrives = np.minimum.reduceat(np.where(coming, n, within), starts)
    arrives[far[starts] < _AWAY] = 0
    for k in np.flatnonzero(arrives):
        mine = slice(starts[k], starts[k] + count[k])
        arrives[k] = _settled(data.force[mine], int(arrives[k]), data.instruments.force)
    first = np.diff(data.run[starts], prepend=-1) != 0
    arrives[first & (data.branch[starts] == ZERO) & (data.step[starts] <= 0)] = 0
    return np.asarray(within < np.repeat(arrives, count))


def _settled(force: Array, at: int, sd: float) -> int:
    """The first sample of a hold from `at` on at which the force (n,) is there: it may come to rest
    gently, while the displacement has much else to do."""
    off = force - force[-max(1, int(_LAST * len(force))) :].mean()
    while at < len(off) / 2 and abs(off[at]) > _SEEN * sd and 0 < off[at] / off[at - 1] < _GENTLY:
        at += 1
    return at


def _away(data: GapData, hold: Ints, there: Flags, about: float) -> tuple[Flags, Array]:
    """Samples (n,) at which force and displacement are both elsewhere than where their hold is
    there (n,), to the sides that belong together, by shares of their ranges of which none is more
    than `about` times the other; and how far (n,), the larger share."""
    away, far = [], []
    for values, sd in (
        (data.force, data.instruments.force),
        (data.displacement, data.instruments.displacement),
    ):
        mean = np.bincount(hold, values * there) / np.maximum(np.bincount(hold, there), 1)
        off = values - mean[hold]
        away.append(off / sd)
        far.append(np.abs(off) / _spans(data, values))
    alike = away[0] * away[1] * _senses(data) > 0
    alike &= (np.minimum(*np.abs(away)) > 1) & (np.maximum(*far) < about * np.minimum(*far))
    return alike & (np.hypot(*away) > _SEEN), np.maximum(*far)


def _leading_on(data: GapData) -> GapData:
    """The data with samples at the end of a hold that has come to rest, on their way to the next
    one of their run, under the name of that. As they are where there are none."""
    hold = hold_ids(data)
    starts = first_rows(hold)
    count = np.diff(np.append(starts, len(hold)))
    share = (np.arange(len(hold)) - np.repeat(starts, count)) / np.repeat(count, count)
    middle = (share >= _MIDDLE[0]) & (share < _MIDDLE[1])
    going, far = _away(data, hold, middle, _STEEPER)
    force = data.force
    level = np.bincount(hold, force * middle) / np.maximum(np.bincount(hold, middle), 1)
    branch, step = data.branch.copy(), data.step.copy()
    for a, b in pairwise(starts.tolist()):
        leaves = a + int(np.flatnonzero(~going[a:b]).max(initial=0)) + 1
        there, step_N = force[a:b][middle[a:b]], abs(level[hold[b]] - level[hold[a]])
        rested = there.size > 0 and np.ptp(there) < _AT_REST * step_N
        if rested and far[b - 1] > _AWAY and data.run[b] == data.run[a]:
            branch[leaves:b], step[leaves:b] = branch[b], step[b]
    if np.array_equal(step, data.step) and np.array_equal(branch, data.branch):
        return data
    return replace(data, branch=branch, step=step)


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
