"""Loads that are on their way to a level, under the name of that level.

Whoever records all the time has holds that begin with the ramp that led there. Averaged with the
hold, a ramp is neither at rest nor on its way; and its scatter would pass for noise of the force.
Its samples are told (`GapData.in_ramp`): they are holds of their own, read as they are. Where
every sample bears the name of the level next to it, the first half of a ramp is under the name of
the level it leaves, and all of it may be; it is given to the level it leads to.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.data import ZERO, GapData
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.running import first_rows
from identification.stairs import steps_of_stairs
from identification.ways import AWAY, SEEN, elsewhere, leading_on

# Times as much of its range as the other channel of its own: what has yielded lets the displacement
# come back by as little as a third of what the force does.
_ABOUT = 4.0
_GENTLY = 0.5  # of what a force had to go at the sample before
_LAST = 0.25  # share of a hold whose mean is where it leads to
_TO_GO = 0.25  # of a step


def with_ramps_marked(data: GapData) -> GapData:
    """The data with ramps told; of what runs all the time, those that lead to no load. As they are
    where there are none."""
    data = _leading_on(steps_numbered(data))
    hold = hold_ids(data)
    moving = _moving(data, hold)
    if is_continuous(data, hold):
        moving &= data.branch == ZERO
    return replace(data, in_ramp=moving) if moving.any() else data


def steps_numbered(data: GapData) -> GapData:
    """The data with the steps of staircases numbered that bear no numbers; samples on their way to
    a level are under its branch, too."""
    if np.any(data.step >= 0):
        return data
    edges = [*first_rows(data.run).tolist(), len(data.run)]
    runs = [(data.force[a:b], data.displacement[a:b]) for a, b in pairwise(edges)]
    found = steps_of_stairs(runs, _sd(data))
    if found is None:
        return data
    at = np.concatenate([a + rows for a, (_, rows) in zip(edges, found, strict=False)])
    branch, step = data.branch[at], np.concatenate([s for s, _ in found])
    unloaded = (branch == ZERO) & (_at_level(data.displacement, at) < _NOTHING)
    return replace(data, step=np.where(unloaded, 0, step), branch=branch)


def _at_level(values: Array, at: Ints) -> Array:
    """(n,) size of the mean over the level that begins at row `at` (n,), of the largest one: a
    force that drifts away is no load where nothing moves."""
    mean = np.bincount(at, np.abs(values), len(at)) / np.maximum(np.bincount(at, None, len(at)), 1)
    return np.asarray(mean[at] / max(float(mean.max()), np.finfo(float).tiny))


_NOTHING = 0.05


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
    coming, far = np.zeros(n, dtype=bool), np.zeros(n)
    for setup in np.unique(data.setup):
        s = data.setup == setup
        read = data.force[s], data.displacement[s], _sd(data), hold[s]
        coming[s], far[s] = elsewhere(*read, last[s], _ABOUT)
    # of every hold: the place in it of the first sample that is there
    arrives = np.minimum.reduceat(np.where(coming, n, within), starts)
    arrives[far[starts] < AWAY] = 0
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
    while at < len(off) / 2 and abs(off[at]) > SEEN * sd and 0 < off[at] / off[at - 1] < _GENTLY:
        at += 1
    return at


def _leading_on(data: GapData) -> GapData:
    """The data with samples at the end of a hold that are on their way to the next one under the
    name of that. As they are where there are none."""
    branch, step, hold = data.branch.copy(), data.step.copy(), hold_ids(data)
    for run in np.unique(data.run):
        mine = np.flatnonzero(data.run == run)
        read = data.force[mine], data.displacement[mine], _sd(data), hold[mine]
        for leaves, b in leading_on(*read):
            way = mine[leaves:b]
            branch[way], step[way] = branch[mine[b]], step[mine[b]]
    if np.array_equal(step, data.step) and np.array_equal(branch, data.branch):
        return data
    return replace(data, branch=branch, step=step)


def _sd(data: GapData) -> tuple[float, float]:
    return data.instruments.force, data.instruments.displacement


def much_to_go(displacement: Array, level: Ints, sd: float) -> Flags:
    """(n,) rows at a level (n,) at which the displacement has much of its step to go, whatever a
    force says that scatters: the load may not be there yet. sd: of one sample."""
    ends = np.append(np.flatnonzero(np.diff(level)), len(level) - 1)
    off = np.abs(displacement - displacement[ends][level])
    step = np.abs(np.diff(displacement[ends], prepend=0.0))[level]
    return np.asarray((off > SEEN * sd) & (off > _TO_GO * step) & (step > 0))
