"""Samples become rows: holds keep their first samples and geometric bins of the rest.

A hold gives many nearly equal samples; creep, lag and drift need its beginning and its length, not
every second of it. A continuous recording is cut at its turning points and binned evenly; a short
one is kept as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.gap.data import CYCLE, ZERO, Array, Flags, GapData, Ints

_ROWS_PER_PASS, _MOST_ROWS = 80, 4000  # memory needs the turning points of every cycle
CONTINUOUS_ROWS = 500  # bins of a continuous recording; more tells no effect from another
_RUNNING_SHARE = 0.5  # a "hold" through which the force runs by half its range is none
_LEVELS = 12  # force classes of a continuous recording, per sense of motion


@dataclass(frozen=True, eq=False)
class Rows:
    """n rows. weight (n,): samples behind a row; hold, level, run, setup (n,): consecutive ids.

    level: same setup, branch and step (or class of force and sense of motion): what repeats from
    repetition to repetition shares a level. session (n,) s is always there: `clock` says whether
    it was recorded. force: of a hold whose samples scatter by no more than their noise, the mean
    of the hold in all its rows (its noise would else pass for a small friction or a lag);
    measured_force: as it is. steady (n,): such holds. rested (n,) m: the displacement with its
    mean likewise; rests (n,): such holds. hold_weight (n,): samples of the row's hold;
    force_scatter, displacement_scatter (n,): mean squares of the samples about their row, N^2 and
    m^2; of rows of holds also spread (n,) s^2: of their times; force_trend,
    displacement_trend (n,): mean products of time and channel about the row, N s and m s.
    """

    time: Array
    session: Array
    clock: bool
    run: Ints
    setup: Ints
    repetition: Ints
    branch: Ints
    step: Ints
    hold: Ints
    level: Ints
    weight: Array
    force: Array
    measured_force: Array
    displacement: Array
    rested: Array
    tangential: Array | None
    q: Array | None
    temperature: Array | None
    simulated: Array | None
    zero: Flags
    steady: Flags
    rests: Flags
    hold_weight: Array
    force_scatter: Array
    displacement_scatter: Array
    spread: Array
    force_trend: Array
    displacement_trend: Array
    continuous: bool
    starts: Flags  # first row of a run
    hold_starts: Flags

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.force)

    @cached_property
    def edges(self) -> Ints:
        """(holds,) first row of every hold."""
        return np.flatnonzero(self.hold_starts)

    @cached_property
    def _share_of_setup(self) -> Array:
        """(n, s) what each row weighs in the mean of its setup."""
        weight = (
            np.equal.outer(self.setup, np.arange(int(self.setup.max()) + 1)) * self.weight[:, None]
        )
        return np.asarray(weight / np.maximum(weight.sum(axis=0), 1e-300))

    def speed(self, values: Array) -> Array:
        """(n,) by how much values (n,) change per second at every row: between the slopes before
        and after it, and beyond the last of a hold, as an exponential goes on; 0 where there are no
        two slopes of one sense, as after a step."""
        first = self.edges[self.hold]
        last = np.append(self.edges[1:], self.n)[self.hold] - 1
        b = np.clip(np.arange(self.n), first + 1, np.maximum(last - 1, first + 1))
        a, b, c = b - 1, np.minimum(b, last), np.minimum(b + 1, last)
        t, v = self.time, values
        with np.errstate(divide="ignore", invalid="ignore"):
            before = (v[b] - v[a]) / (t[b] - t[a])
            after = (v[c] - v[b]) / (t[c] - t[b])
            ratio, way = after / before, (2 * t - t[a] - t[b]) / (t[c] - t[a])
            out = before * ratio ** np.where(ratio > 1, np.clip(way, 0.0, 1.0), way)
        return np.where(np.isfinite(out), out, 0.0)  # no power of what is below zero

    def moved(self, values: Array) -> Array:
        """Values (n, k) less their mean per setup: the datum says nothing."""
        means = values.T @ self._share_of_setup
        return np.asarray(values - means[:, self.setup].T)

    def hold_means(self, values: Array) -> Array:
        """(holds, ...) means of values (n, ...) over every hold, each sample counted."""
        weight = self.weight.reshape(-1, *(1,) * (values.ndim - 1))
        total = self.hold_weight[self.edges].reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(np.add.reduceat(values * weight, self.edges, axis=0) / total)

    def rms(self, values: Array) -> float:
        """Of values (n,), every sample counted."""
        return float(np.sqrt(self.weight @ values**2 / self.weight.sum()))


def reduce_rows(data: GapData) -> Rows:
    """Rows of the data, in their order."""
    hold = hold_ids(data)
    continuous = is_continuous(data, hold)
    edges = _continuous_edges(data) if continuous else _hold_edges(hold, data.time)
    count = np.diff(np.append(edges, len(data.force)))

    def mean(values: Array) -> Array:
        sums = np.add.reduceat(values, edges, axis=0)
        return np.asarray(sums / (count if values.ndim == 1 else count[:, None]))

    def scatter(values: Array) -> Array:
        """Mean square about the row; of a running recording, about the line in it."""
        u = values - values.mean()
        square = np.maximum(mean(u**2) - mean(u) ** 2, 0.0)
        if not continuous:
            return square
        other = data.displacement if values is data.force else data.force
        x = other - other.mean()
        var = mean(x**2) - mean(x) ** 2
        slope = np.where(var > 0, (mean(x * u) - mean(x) * mean(u)) / np.maximum(var, 1e-300), 0.0)
        return np.maximum(square - slope**2 * var, 0.0)

    def trend(values: Array) -> Array:
        """Mean product of time and values about the row."""
        t, u = data.time - data.time.mean(), values - values.mean()
        return np.zeros(len(edges)) if continuous else mean(t * u) - mean(t) * mean(u)

    def first(values: Ints) -> Ints:
        return values[edges]

    run, setup, branch, step = map(first, (data.run, data.setup, data.branch, data.step))
    force = mean(data.force)
    holds = _blocks(run) if continuous else _consecutive(hold[edges])
    level = (
        _continuous_levels(setup, force)
        if continuous
        else _ids(np.column_stack([setup, branch, step, *_approach(run, branch, holds, force)]))
    )
    zero = (branch == ZERO) & (step <= 0)
    weight = count.astype(float)

    def steady_in(values: Array, stated: float) -> tuple[Array, Flags]:
        """A channel with its mean in holds in which it stands still within its noise; these. What
        runs has none: a slow pull would be read as stairs."""
        if continuous:
            return mean(values), np.zeros(len(edges), dtype=bool)
        return _steadied(holds, mean(values), weight, _noise_in_holds(values, hold, stated))

    meter = data.instruments
    steadied, steady = steady_in(data.force, meter.force)
    rested, rests = steady_in(data.displacement, meter.displacement)
    session = mean(_session(data))
    return Rows(
        time=mean(data.time), session=session, clock=data.session is not None, run=run, setup=setup,
        repetition=first(data.repetition), branch=branch, step=step, hold=holds, level=level,
        weight=weight, force=steadied, measured_force=force, steady=steady,
        displacement=mean(data.displacement), rested=rested, rests=rests,
        hold_weight=np.bincount(holds, weights=weight)[holds].astype(float),
        force_scatter=scatter(data.force), displacement_scatter=scatter(data.displacement),
        spread=trend(data.time), force_trend=trend(data.force),
        displacement_trend=trend(data.displacement),
        tangential=None if data.tangential is None else mean(data.tangential),
        q=None if data.q is None else mean(data.q),
        temperature=None if data.temperature is None else mean(data.temperature),
        simulated=None if data.simulated is None else mean(data.simulated),
        zero=zero, continuous=continuous, starts=_changes(run), hold_starts=_changes(holds),
    )  # fmt: skip


# Noise reaches this square sum in one hold of ten thousand (chi squared of 1 to 8 degrees);
# what really moves (a lagging channel, a relaxing screw) goes far beyond it.
_STEADY_PER_ROW, _STEADY_ONCE = 2.6, 12.5
# What is stated is known to a factor of two (GUM G.4.2): a force that scatters more than that may
# really tremble.
_MISJUDGED = 2.0
ENOUGH = 30  # second differences: then their scatter is known to about an eighth


def scatter_within(values: Array, hold: Ints) -> float | None:
    """Standard deviation of the white part of values (n,), from second differences within holds,
    the first sample left out (it may lag); trimmed at 5 %, corrected for that (normal noise:
    0.8713). None where there are too few."""
    second = values[3:] - 2 * values[2:-1] + values[1:-2] if len(values) > 3 else np.zeros(0)
    same = (hold[3:] == hold[:-3]) if len(values) > 3 else np.zeros(0, dtype=bool)
    squares = np.sort((second[same]) ** 2)
    if squares.size < ENOUGH:
        return None
    kept = squares[: int(0.95 * squares.size)]
    return float(np.sqrt(kept.mean() / 6.0) / 0.8713)


def swing_within(values: Array, hold: Ints) -> float:
    """rms of what values (n,) have in common with the next one about the mean of their hold: a
    vibration that samples follow, not their own noise. 0 where holds are too short."""
    count = np.bincount(hold)[hold]
    left = values - np.bincount(hold, weights=values)[hold] / count
    pairs = (hold[1:] == hold[:-1]) & (count[1:] >= _SWINGS)
    common = (left[1:] * left[:-1])[pairs]
    return float(max(common.mean(), 0.0) ** 0.5) if common.size >= ENOUGH else 0.0


_SWINGS = 5  # samples of a hold


def _noise_in_holds(values: Array, hold: Ints, stated: float) -> float:
    """What values (n,) scatter in their holds: as stated, or more as far as that may be wrong."""
    return min(max(stated, scatter_within(values, hold) or 0.0), _MISJUDGED * stated)


def _steadied(hold: Ints, values: Array, weight: Array, sd: float) -> tuple[Array, Flags]:
    """Values (n,) with their mean in holds in which they stand still within noise; these (n,)."""
    mean = np.bincount(hold, weights=weight * values) / np.bincount(hold, weights=weight)
    square = np.bincount(hold, weights=weight * (values - mean[hold]) ** 2) / sd**2
    steady = (square <= _STEADY_PER_ROW * np.bincount(hold) + _STEADY_ONCE)[hold]
    return np.where(steady, mean[hold], values), steady


def hold_ids(data: GapData) -> Ints:
    """(n,) number of the hold of every sample: same run, branch and step, without a pause, and on
    one side of no load: steps of the same size to and fro may bear the same number."""
    keys = np.column_stack([data.run, data.branch, data.step])
    new = np.any(np.diff(keys, axis=0) != 0, axis=1)
    loaded = (data.step > 0) & (np.abs(data.force) > _LOADED * data.instruments.force)
    side = np.where(loaded, _side(data.force), 0.0)
    new |= side[1:] * side[:-1] < 0
    return np.concatenate([[0], np.cumsum(new)]).astype(np.int64)


_NUMBERED, _ONCE = 60, 0.9  # levels a run; readings that are alone on theirs, as a share


def _numbered(data: GapData, hold: Ints) -> bool:
    """Whether steps count readings. Levels are looked up only where there are as many holds."""
    least = max(_NUMBERED * len(np.unique(data.run)), _ONCE * len(hold))
    if hold[-1] + 1 < least:
        return False
    return len(np.unique(np.column_stack([data.run, data.step]), axis=0)) >= least


def is_continuous(data: GapData, hold: Ints) -> bool:
    """Whether the force runs instead of resting at levels; or rests at one all the time. Without an
    arm so many levels, each read once and never met again, are no levels, but numbered readings."""
    if np.any(data.step < 0) or (hold[-1] == 0 and not data.arm):
        return True
    if not data.arm and _numbered(data, hold):
        return True
    edges = np.flatnonzero(np.concatenate([[True], np.diff(hold) != 0]))
    count = np.diff(np.append(edges, len(hold)))
    width = np.maximum.reduceat(data.force, edges) - np.minimum.reduceat(data.force, edges)
    span = float(np.ptp(data.force))
    return bool(np.any((count > 2) & (width > _RUNNING_SHARE * span) & (span > 0)))


def _hold_edges(hold: Ints, time: Array) -> Ints:
    """Bins of 1, 1, 2, 4, 8 ... samples from the start of every hold; where these are taken ever
    more seldom, as creep often is, no bin over more than twice its time since then."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(hold) != 0]))
    count = np.diff(np.append(starts, len(hold)))
    within = np.arange(len(hold)) - np.repeat(starts, count)
    edge = (within & (within - 1)) == 0  # 0, 1, 2, 4, 8 ...
    since = np.maximum(time - np.repeat(time[starts], count), 0.0)
    begin = np.flatnonzero(edge)
    size = np.diff(np.append(begin, len(hold)))
    ratio = since / np.repeat(np.maximum(since[begin], 1e-300), size)
    last = np.repeat(np.maximum.reduceat(ratio, begin), size)
    doubled = np.where(
        (last > _SELDOM) & (within > 0), np.floor(np.log2(np.maximum(ratio, 1.0))), 0
    )
    edge |= np.diff(doubled, prepend=0.0) > 0
    return np.flatnonzero(edge).astype(np.int64)


_SELDOM = 3.0  # times: samples evenly spaced keep a bin below 2


def _continuous_edges(data: GapData) -> Ints:
    """Bins of equal path of force and displacement together, so that fast and slow parts count
    alike and no bin straddles much of either; every run starts a bin."""
    n = len(data.force)
    wanted = int(np.clip(_ROWS_PER_PASS * passes(data.force), CONTINUOUS_ROWS, _MOST_ROWS))
    if n <= wanted:
        return np.arange(n, dtype=np.int64)
    path = np.arange(n) / n
    width = max(1, n // (4 * wanted))
    for values in (data.force, data.displacement):
        smooth = np.repeat(values[::width], width)[:n]  # steps of the noise are no path
        step = np.abs(np.diff(smooth, prepend=smooth[0]))
        total = step.sum()
        path = path + (np.cumsum(step) / total if total > 0 else 0.0)
    number = np.floor(path / path[-1] * wanted * (1 - 1e-12)).astype(np.int64)
    new = (np.diff(number, prepend=-1) != 0) | (np.diff(data.run, prepend=-1) != 0)
    return np.flatnonzero(new).astype(np.int64)


def passes(force: Array) -> int:
    """How often the force goes up or down by a quarter of its range: passes of the cycles."""
    return len(turns(force)) + 1


def turns(force: Array, share: float = 0.25) -> list[int]:
    """Where it turns from one such pass to the next. share: of its range that a pass takes."""
    stride = max(1, len(force) // 20_000)
    coarse = force[::stride].tolist()
    back = share * float(np.ptp(force))
    out: list[int] = []
    low, high, rising = coarse[0], coarse[0], None
    at_low = at_high = 0
    for i, x in enumerate(coarse):
        if x < low:
            low, at_low = x, i
        if x > high:
            high, at_high = x, i
        if rising is not False and high - x > back:
            if rising:
                out.append(at_high * stride)
            rising, low, at_low = False, x, i
        elif rising is not True and x - low > back:
            if rising is False:
                out.append(at_low * stride)
            rising, high, at_high = True, x, i
    return out


def _blocks(run: Ints) -> Ints:
    """Stretches of a continuous recording over which a model's imperfection stays alike:
    fifty, since a smooth curve makes no more independent mistakes than that."""
    length = max(1, -(-len(run) // _STRETCHES))
    new = (np.arange(len(run)) % length == 0) | _changes(run)
    return (np.cumsum(new) - 1).astype(np.int64)


_STRETCHES = 50


def way_back(path: Array) -> float:
    """How far a path (n,) falls back from the largest value before."""
    return float((np.maximum.accumulate(path) - path).max())


def rises(values: Array) -> Flags:
    """(n,): whether a signal goes up there, or stands."""
    return np.gradient(values) >= 0 if len(values) > 1 else np.ones(len(values), dtype=bool)


def _continuous_levels(setup: Ints, force: Array) -> Ints:
    rising = rises(force)
    span = np.ptp(force) or 1.0
    number = np.minimum((force - force.min()) / span * _LEVELS, _LEVELS - 1).astype(np.int64)
    return _ids(np.column_stack([setup, rising.astype(np.int64), number]))


_SIDE = 0.05  # of the largest force: less is no load, nor
_LOADED = 5.0  # standard uncertainties of one sample


def _side(force: Array) -> Array:
    """Sign of forces (n,), 0 of what is no load."""
    return np.where(np.abs(force) > _SIDE * np.abs(force).max(initial=0.0), np.sign(force), 0.0)


def _approach(run: Ints, branch: Ints, hold: Ints, force: Array) -> tuple[Ints, Ints]:
    """(n,), (n,): to which side the force of a hold pushes, and, of a cycle, which way it came
    there: one number may stand for steps of the same size to and fro."""
    mean = np.bincount(hold, weights=force) / np.bincount(hold)
    first = np.flatnonzero(_changes(hold))
    came = np.where(_changes(run[first]), 0.0, np.sign(np.diff(mean, prepend=0.0)))
    way = np.where(branch[first] == CYCLE, came, 0.0)
    return _side(mean)[hold].astype(np.int64), way[hold].astype(np.int64)


def _session(data: GapData) -> Array:
    """The session clock, or the runs one after the other with minutes of rest between them."""
    if data.session is not None:
        return data.session
    out = np.empty_like(data.time)
    offset = 0.0
    for run in np.unique(data.run):
        rows = data.run == run
        out[rows] = data.time[rows] - data.time[rows][0] + offset
        offset = out[rows][-1] + REST_S
    return out


REST_S = 180.0  # between two runs the arm stands unloaded for minutes


def _changes(ids: Ints) -> Flags:
    return np.concatenate([[True], np.diff(ids) != 0])


def _ids(keys: Ints) -> Ints:
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)


def _consecutive(ids: Ints) -> Ints:
    return (np.cumsum(_changes(ids)) - 1).astype(np.int64)
