"""How well joints are read: from reading to reading, from run to run, from setup to setup."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.data import GapData
from identification.gap.recording.digits import from_first, in_one_number, left_of, step_of
from identification.gap.recording.holds import ENOUGH, scatter_within
from identification.gap.recording.rows import Rows
from identification.gap.recording.white import QUARTILE

ENCODER_RAD = 1e-5  # resolution and jitter of a joint reading, where holds can't tell
RESTS_RAD = 1e-5  # at rest a controller leaves a joint elsewhere by about what it can read
ENCODER_OFFSET_RAD = 4e-5  # repeatability of the arm, 0.05 mm at 1.3 m: q against command


class Readings(NamedTuple):
    """Standard deviations, rad: of one reading (m,); of what digits leave of a hold's (m, h); of
    what all of a run are off by, and all of a setup, each joint by its own."""

    one: Array
    hold: Array
    run: float
    setup: float


def readings_of(data: GapData, rows: Rows, hold: Ints) -> Readings:
    """From what the joints read while the arm rests in holds (n,), and at zero load."""
    one, rounded = _one(data, rows, hold), np.zeros((data.joints, len(rows.edges)))
    if data.q is None or rows.q is None or rows.continuous:
        return Readings(one, rounded, 0.0, 0.0)
    turned = from_first(data.q, data.setup)
    common = step_of(turned.T.ravel())  # a joint that hardly turns shows too few of them
    for j, step in enumerate(common or step_of(q) for q in turned.T):
        one[j] = max(one[j], step / 12**0.5)
        if step > 0 and in_one_number(data.q[:, j], hold):
            means = rows.hold_means(rows.q[:, j])
            rounded[j] = left_of(means, rows.setup[rows.edges], step)
    run, setup = _between_runs(data, rows, one)
    return Readings(one, rounded, run, max(setup, RESTS_RAD))


def _one(data: GapData, rows: Rows, hold: Ints) -> Array:
    """Noise of one joint reading (m,), rad: within holds, or between repetitions where holds are
    too short; what is usual where neither tells."""
    q = np.full(data.joints, ENCODER_RAD)
    if data.q is None or rows.continuous:
        return q
    each = [scatter_within(data.q[:, j], hold) for j in range(data.joints)]
    if any(found is None for found in each):
        q[:] = _between_repetitions(data, rows) or ENCODER_RAD
    for j, found in enumerate(each):
        q[j] = max(found or q[j], 1e-7)
    return q


def _between_repetitions(data: GapData, rows: Rows) -> float | None:
    """Noise of one joint reading from how levels repeat, rad: that of the middle joint, as one may
    have a trouble of its own. Forces that differ a little are allowed for as simulated. Of levels
    that were read but once nothing is left, and they say nothing."""
    again = np.bincount(rows.level)[rows.level] > 1
    left, free = _unloaded(data, rows, rows.force)[again], int(again.sum())
    for ids in (rows.level[again], rows.run[again]):
        _, group = np.unique(ids, return_inverse=True)
        left = left - _means(left, group, np.ones(len(left)))[group]
        free -= int(group.max(initial=-1)) + 1
    free += len(np.unique(rows.setup[again]))
    if free < ENOUGH:
        return None
    spread = np.median(np.abs(left) * np.sqrt(rows.weight[again])[:, None], axis=0) / QUARTILE
    return float(np.median(spread) * (len(left) / free) ** 0.5)


def _between_runs(data: GapData, rows: Rows, one: Array) -> tuple[float, float]:
    """Standard deviations between runs of a setup, and between setups of a pose, rad, of what
    joints read at zero load: the arm was sent to the same pose. As read, or less what the force
    that is read there does, whichever scatters less: one that drifts is none, and a load that was
    left is. 0 where readings alone explain it."""
    assert rows.q is not None
    readings = rows.q, _unloaded(data, rows, rows.measured_force)
    return min(_of_zeros(data, rows, q, one) for q in readings)


def _unloaded(data: GapData, rows: Rows, force: Array) -> Array:
    """(n, m) rad: readings less what a force (n,) does as simulated."""
    assert rows.q is not None
    lever = np.stack([s.lever for s in data.setups])[rows.setup]
    return np.asarray(rows.q - lever * data.compliance * force[:, None])


def _of_zeros(data: GapData, rows: Rows, q: Array, one: Array) -> tuple[float, float]:
    """The same of readings q (n, m) rad, of which each scatters by one (m,)."""
    zero = rows.zero
    runs, of_run = np.unique(rows.run[zero], return_inverse=True)
    if len(runs) < 2:
        return 0.0, 0.0
    weight = np.bincount(of_run, rows.weight[zero])
    means = _means(q[zero], of_run, rows.weight[zero])
    setup = rows.setup[zero][np.unique(of_run, return_index=True)[1]]
    run = _beyond(means, setup, 1 / weight, one)
    setups, of_setup = np.unique(setup, return_inverse=True)
    known = 1 / (1 / weight + run / float(np.median(one)) ** 2)
    poses = [data.setups[s].pose for s in setups]
    pose = np.array([poses.index(p) for p in poses])
    between = _beyond(_means(means, of_setup, known), pose, 1 / np.bincount(of_setup, known), one)
    return run**0.5, between**0.5


def _means(values: Array, group: Ints, weight: Array) -> Array:
    """(g, m) of values (n, m), weighted."""
    sums = np.stack([np.bincount(group, weight * v) for v in values.T], axis=1)
    return np.asarray(sums / np.bincount(group, weight)[:, None])


def _beyond(means: Array, group: Ints, variance: Array, one: Array) -> float:
    """Variance (rad^2) that means (r, m) scatter by within groups (r,) beyond their own, which is
    variance (r,) times the square of one (m,); 0 where that may be chance. By the moments of the
    weighted squares (DerSimonian, Laird 1986), of the two thirds of the joints that scatter least,
    as far as chance lets them: a trouble sits in one or two, and what the readings do all joints
    do. Of fewer than four joints nothing is said."""
    from scipy.special import chdtri

    _, group = np.unique(group, return_inverse=True)
    count = np.bincount(group)
    free = int(np.sum(count - 1))
    if not free or means.shape[1] < _FEWEST:
        return 0.0
    left = (means - _means(means, group, 1 / variance)[group]) / one
    each = np.sum(left**2 / variance[:, None], axis=0) / free
    order = np.argsort(each)[: means.shape[1] * 2 // 3]
    # medians of the ranks of as many chi squares (Benard)
    above = 1 - (np.arange(1, len(order) + 1) - 0.3) / (means.shape[1] + 0.4)
    ratio = float(each[order].mean() / (chdtri(free, above) / free).mean())
    if ratio < chdtri(_AS_MANY * free, _CHANCE) / (_AS_MANY * free):
        return 0.0
    total = np.bincount(group, 1 / variance)
    grows = float(np.sum(total - np.bincount(group, variance**-2) / total))  # times the excess
    return (ratio - 1.0) * free / (grows * float(np.mean(one[order] ** -2.0)))


_FEWEST = 4
# That mean of four of six scatters as a chi square of so many times the degrees of freedom would;
# how seldom chance alone is taken for more.
_AS_MANY, _CHANCE = 3, 0.01
