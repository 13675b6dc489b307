"""Rows that the diagnosis works on, each the mean of a bin of samples (`bins`),
with the holds and levels that they belong to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.data import CYCLE, ZERO, GapData
from identification.gap.recording.bins import Bins
from identification.gap.recording.holds import (
    hold_ids,
    is_continuous,
    noise_in_holds,
    rest_ids,
    side_of,
    steadied,
)
from identification.gap.recording.ramps import much_to_go
from identification.gap.recording.relaxing import relaxed
from identification.gap.recording.turns import rises
from identification.running import first_rows, stretches

_LEVELS = 12  # force classes of a continuous recording, per sense of motion


_MOMENT = 0.05  # of the time between two levels that were read once


@dataclass(frozen=True, eq=False)
class Rows:
    """n rows, each the mean of a few samples: what the diagnosis computes with. Ids are
    consecutive."""

    time: Array  # (n,) s within the run
    session: Array  # (n,) s, always there: `clock` says whether it was recorded
    to_last: Array  # (n,) s from a row's time to its last sample
    clock: bool
    run: Ints
    setup: Ints
    repetition: Ints
    branch: Ints
    step: Ints
    hold: Ints  # (n,) id: samples at one level without a pause
    # (n,) id: same setup, branch and step (or class of force and sense of motion): what
    # repeats from repetition to repetition shares a level
    level: Ints
    weight: Array  # (n,) samples behind a row
    # (n,) N; in `steady` holds the mean of the hold, as its noise would pass for a small
    # friction or a lag
    force: Array
    measured_force: Array  # (n,) N: the mean of the row in any case
    displacement: Array  # (n,) m
    rested: Array  # (n,) m: the displacement; in holds that rest the mean of the hold
    tangential: Array | None  # (n, 2) N
    q: Array | None  # (n, m) rad
    temperature: Array | None  # (n, t) degC
    zero: Flags  # (n,) rows without load
    in_ramp: Flags  # (n,) rows of ramps that were recorded before holds
    steady: Flags  # (n,) rows of holds whose force scatters by no more than its noise
    rests: Flags  # (n,) the same of the displacement
    hold_weight: Array  # (n,) samples of the row's hold
    force_scatter: Array  # (n,) N^2: mean square of the samples about their row
    displacement_scatter: Array  # (n,) m^2
    spread: Array  # (n,) s^2: the same of their times, in rows of holds
    force_trend: Array  # (n,) N s: mean product of time and force about the row
    displacement_trend: Array  # (n,) m s
    continuous: bool  # the load runs, and does not rest at levels
    starts: Flags  # (n,) first row of a run
    hold_starts: Flags  # (n,) first row of a hold
    # (n,) share of a row's load by which the load went beyond it on the way there, which no
    # row shows: found, not recorded (`search.overshoots`), 0 until then
    overshoot: Array
    onward: Array  # (n,) as in `GapData`

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.force)

    @cached_property
    def edges(self) -> Ints:
        """(holds,) first row of every hold."""
        return np.flatnonzero(self.hold_starts)

    @cached_property
    def run_edges(self) -> Ints:
        """(runs + 1,) first row of every run, and the one after the last."""
        return np.append(np.flatnonzero(self.starts), self.n)

    @cached_property
    def half_sample(self) -> float:
        """How long a load has stood before it is first read, s: half of the time between samples.
        Where every level was read once nobody knows, and the load is taken to go straight from
        reading to reading, but for a moment about each."""
        return (_MOMENT if self.read_once else 0.5) * self.sample_time

    @property
    def read_once(self) -> bool:
        """Every level was read once, or none has a clock."""
        return not self._within

    @cached_property
    def sample_time(self) -> float:
        """Time between two samples, s: of a hold, between its first two rows, which are single
        readings, and of most holds, since one stamp may be wrong; where every level was read once,
        between these; of what has no clock 1 s."""
        return self._within or self.row_time or 1.0

    @cached_property
    def _within(self) -> float:
        """The same of holds that were read more than once; 0 where there are none."""
        first = np.flatnonzero(self.hold_starts[:-1] & ~self.hold_starts[1:])
        return _usual(np.diff(self.time)[first])

    @cached_property
    def row_time(self) -> float:
        """Time between most neighbouring rows, s; 0 where no time goes by."""
        return _usual(np.diff(self.time))

    @cached_property
    def gone_beyond(self) -> Flags:
        """(n,) rows of holds beyond which the load is taken to have gone before."""
        return np.asarray(np.isin(self.hold, self.hold[self.overshoot != 0]))

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

    def about_means(self, values: Array) -> Array:
        """Values (n,) or (n, k) less their mean per setup: the datum says nothing."""
        means = values.T @ self._share_of_setup
        return np.asarray(values - means[..., self.setup].T)

    def rms_about_means(self, values: Array) -> float:
        """rms of values (n,) about their mean per setup."""
        return self.rms(self.about_means(values))

    def hold_means(self, values: Array) -> Array:
        """(holds, ...) means of values (n, ...) over every hold, each sample counted."""
        weight = self.weight.reshape(-1, *(1,) * (values.ndim - 1))
        total = self.hold_weight[self.edges].reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(np.add.reduceat(values * weight, self.edges, axis=0) / total)

    def rms(self, values: Array) -> float:
        """Of values (n,), every sample counted."""
        return float(np.sqrt(self.weight @ values**2 / self.weight.sum()))


def _usual(step: Array) -> float:
    """Most of the steps (k,) s that take any time; 0 where none does."""
    return float(np.median(step[step > 0])) if np.any(step > 0) else 0.0


def reduce_rows(data: GapData) -> Rows:
    """Rows of the data, in their order."""
    hold = hold_ids(data)
    bins = Bins.of(data, hold, is_continuous(data, hold))
    mean, first, weight = bins.mean, bins.first, bins.count.astype(float)
    run, setup, branch, step = map(first, (data.run, data.setup, data.branch, data.step))
    force, displacement = mean(data.force), mean(data.displacement)
    holds = _blocks(run) if bins.running else stretches(first(hold))
    ramp = first(data.ways)
    if bins.running:
        level = _continuous_levels(setup, force)
    else:
        came = _approach(run, branch, holds, force)
        level = ids(np.column_stack([setup, branch, step, ramp, *came]))
    meter, at_zero = data.instruments, (branch == ZERO) & (step <= 0)
    # of what runs, holds are but stretches; a run that begins unloaded comes from nowhere
    stay = stretches(ids(np.column_stack([run, branch, step]))) if bins.running else holds
    begins = (stay == stay[first_rows(run)][stretches(run)]) & at_zero
    coming = ramp | (much_to_go(displacement, stay, meter.displacement) & ~begins)
    still = partial(_still, bins, rest_ids(data, hold), holds, ~coming)
    steadied, steady = still(data.force, meter.force)
    time, stands = mean(data.time), steady & ~at_zero
    rested, rests = still(data.displacement, meter.displacement)
    session = _session(data)
    return Rows(
        time=time,
        session=mean(session),
        to_last=bins.last(session) - mean(session),
        clock=data.session is not None,
        run=run,
        setup=setup,
        repetition=first(data.repetition),
        branch=branch,
        step=step,
        hold=holds,
        level=level,
        weight=weight,
        force=steadied * (1 + relaxed(force, displacement, time, holds, weight, stands)),
        measured_force=force,
        steady=steady,
        displacement=displacement,
        rested=rested,
        rests=rests,
        hold_weight=np.bincount(holds, weights=weight)[holds].astype(float),
        force_scatter=bins.scatter(data.force, data.displacement),
        displacement_scatter=bins.scatter(data.displacement, data.force),
        spread=bins.trend(data.time, data.time),
        force_trend=bins.trend(data.time, data.force),
        displacement_trend=bins.trend(data.time, data.displacement),
        tangential=bins.mean_of(data.tangential),
        q=bins.mean_of(data.q),
        temperature=bins.mean_of(data.temperature),
        zero=at_zero & ~coming,
        in_ramp=ramp,
        continuous=bins.running,
        starts=_changes(run),
        hold_starts=_changes(holds),
        overshoot=np.zeros(len(holds)),
        onward=np.zeros(len(holds)) if data.onward is None else first(data.onward),
    )


def _still(
    bins: Bins, hold: Ints, holds: Ints, there: Flags, values: Array, stated: float
) -> tuple[Array, Flags]:
    """A channel (k,) with its mean in holds in which it stands still within its noise, once it is
    there (k,); these. What runs has none: a slow pull would be read as stairs."""
    if bins.running:
        return bins.mean(values), np.zeros(len(bins.edges), dtype=bool)
    sd = noise_in_holds(values, hold, stated)
    weight, mean = bins.count * there, bins.mean(values)
    still, steady = steadied(holds, mean, weight.astype(float), sd)
    return np.where(there, still, mean), steady & there


def _blocks(run: Ints) -> Ints:
    """Stretches of a continuous recording over which a model's imperfection stays alike:
    fifty, since a smooth curve makes no more independent mistakes than that."""
    length = max(1, -(-len(run) // _STRETCHES))
    return stretches(np.arange(len(run)) // length, run)


_STRETCHES = 50


def _continuous_levels(setup: Ints, force: Array) -> Ints:
    return ids(np.column_stack([setup, rises(force).astype(np.int64), classes(force, _LEVELS)]))


def classes(values: Array, count: int) -> Ints:
    """(n,) which of so many even parts of their range values (n,) lie in."""
    span = float(np.ptp(values)) or 1.0
    number = np.minimum((values - values.min()) / span * count, count - 1)
    return np.asarray(number, dtype=np.int64)


def _approach(run: Ints, branch: Ints, hold: Ints, force: Array) -> tuple[Ints, Ints]:
    """(n,), (n,): to which side the force of a hold pushes, and, of a cycle, which way it came
    there: one number may stand for steps of the same size to and fro."""
    mean = np.bincount(hold, weights=force) / np.bincount(hold)
    first = first_rows(hold)
    came = np.where(_changes(run[first]), 0.0, np.sign(np.diff(mean, prepend=0.0)))
    way = np.where(branch[first] == CYCLE, came, 0.0)
    return side_of(mean)[hold].astype(np.int64), way[hold].astype(np.int64)


def ids(keys: Array | Ints) -> Ints:
    """(n,) the same number for the same keys (n, k)."""
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)


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
