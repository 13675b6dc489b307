"""The course of the load: whether it came back, how often, at what rate, how it began and ended.

What these data can tell of memory, rates and holds hangs on it, whatever the effect.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.data import GapData
from identification.gap.recording.faults import Fault, found_in
from identification.gap.recording.force_drops import ForceDrops, let_go
from identification.gap.recording.imposed import approaches, turned_alike
from identification.gap.recording.loops import lost, work_used
from identification.gap.recording.rows import Rows
from identification.gap.recording.turns import largest_reversal, passes, turns
from identification.gap.recording.wandering import wanders

_MANY = 1000
_GONE = 0.03  # of the largest force: so little is none
_ASIDE = 0.1  # of the largest load: less of the other sign is none
_TREMBLES, _WAVERS = 2.0, 10.0  # stated standard deviations
_CLEARLY, _A_LITTLE = 5.0, 0.005  # standard deviations, and share of the range, of a way back
_AS_FAST = 4.0  # times: passes that differ by less go at one rate
_IDLE = 0.02  # of the response: what the springs make of a load that has no bearing on it
_STRETCHES, _LAST = 20, 3  # of a pull; so many of them are its end,
_FLOWS = 0.03  # whose stiffness is less than that of the steepest
_FALLS = 0.025  # of its range
_WANDERS = 0.05  # of the way: a displacement that goes back by more wanders
_AT_ZERO = 0.01  # of the largest displacement: so near to none
_PULLED = 0.3  # of the largest force: by less of the other sign metal does not flow back
_ENCLOSES, _AGAIN = 0.05, 0.1  # of its box, by a loop; of that, by the next ones
# Loops; the share of them that runs the other way round; of its box, by each: 17 recordings of 350
# without an arm had such loops, a late force or what no word names in all beyond 0.037.
_LOOPS, _EVERY, _GIVES_OUT = 4, 0.9, 0.037
_MET_AGAIN = 0.2  # of the smaller one's range of load
_RUNS_ON = 2.0  # times its mean speed: faster than anything creeps at rest
_STANDS = 0.1  # of the mean speed, and of the time
_COME = 0.03  # of the largest force: what stands below it, before anything is above it, waits
_HELD, _MANY_A_LEVEL = 2, 8  # samples
_FEW_LEVELS, _MANY_LEVELS, _BACK = 5, 40, 2.0  # readings; standard uncertainties
_SCATTERS = 1.0  # squares of differences over squares: of what scatters it is 2 (von Neumann 1941)


@dataclass(frozen=True, eq=False)
class LoadHistory:
    """Of a data set and its rows; load (n,) N drives the rig (imposed: as a displacement), response
    (n,) m answers, slope (n,) m/N is what the simulation gives, stated_slope (n,) as stated."""

    data: GapData
    rows: Rows
    imposed: bool
    load: Array
    response: Array
    slope: Array
    stated_slope: Array

    @property
    def session_span(self) -> float:
        """Length of the session, s; never 0."""
        return float(np.ptp(self.rows.session)) or 1.0

    @cached_property
    def unloads(self) -> bool:
        """Whether the load came back within some run, by a fifth of its range at least."""
        return self._returns(self.load)

    @cached_property
    def lets_go(self) -> bool:
        """Whether the force came back so: where a metal flows, little of an imposed stroke is given
        back to take the force away."""
        return self._returns(self.rows.measured_force)

    def _returns(self, values: Array) -> bool:
        size, span = np.abs(values), float(np.ptp(values))
        for run in np.unique(self.rows.run):
            if largest_reversal(size[self.rows.run == run]) > 0.2 * span:
                return True
        return False

    @property
    def returns(self) -> bool:
        """What was loaded was unloaded as well, or an imposed stroke went back."""
        return self.unloads or (self.lets_go and self._reverses)

    @property
    def _reverses(self) -> bool:
        """An imposed stroke went back, however little: a force may fall without that."""
        if not self.imposed:
            return False
        least = max(_CLEARLY * self._load_sd, _A_LITTLE * float(np.ptp(self.load)))
        return largest_reversal(np.abs(self.load)) > least

    @property
    def _load_sd(self) -> float:
        """Stated standard uncertainty of one sample of the load, N."""
        meter = self.data.instruments
        if self.imposed:
            return meter.displacement / float(self.stated_slope.min())
        return meter.force

    @cached_property
    def only_a_curve(self) -> bool:
        """A table of loads that were read once, one after the other, each of which moved a rig
        without an arm further, and about as the ones beside it: whatever it does from one to the
        next is a curve of the load, and there is nothing else in it."""
        n, one = self.rows.n, self.one_sided and len(self.data.setups) == 1 and not self.data.arm
        if (
            not (one and self.monotonic)
            or self.rows.continuous
            or not _FEW_LEVELS <= n <= _MANY_LEVELS
        ):
            return False
        load, meter = np.abs(self.load), self.data.instruments
        moved = self.response * np.sign(self.load[load.argmax()])
        sd = meter.force * float(self.slope.max()) if self.imposed else meter.displacement
        if np.any(np.diff(load) <= 0) or np.any(np.diff(moved) < -_BACK * sd):
            return False
        left = moved - np.polynomial.Polynomial.fit(load, moved, 1)(load)
        return bool(np.sum(np.diff(left) ** 2) < _SCATTERS * np.sum(left**2))

    @cached_property
    def turns_alike(self) -> bool:
        """Of what runs on without an arm: the reading of a load that comes and goes turns where it
        turned before, and the displacement elsewhere each time. A drift of the force would have to
        be made up for by a load that goes the other way, as a controller alone does that trusts the
        reading."""
        if self.data.arm or not self.rows.continuous:
            return False
        return turned_alike(self.rows.measured_force, self.response / self.slope, least=0.0)

    @property
    def one_sided(self) -> bool:
        """The load, and the force, keep their sign: nothing passes zero."""
        return _keeps_its_sign(self.load) and self.force_keeps_its_sign

    @cached_property
    def force_keeps_its_sign(self) -> bool:
        """It was only pressed, or only pulled."""
        return _keeps_its_sign(self.rows.measured_force)

    @cached_property
    def crosses_its_zero(self) -> bool:
        """One way from one sign of the load to the other, and where the force passes zero so does
        the displacement: what slips or flows would have left it elsewhere."""
        path, force = self.data.displacement, self.data.force
        if self.data.arm or len(self.data.setups) > 1 or self.one_sided:
            return False
        if largest_reversal(path * np.sign(path[-1] - path[0])) > _WANDERS * np.ptp(path):
            return False
        order = np.argsort(force, kind="stable")
        left = float(np.interp(0.0, force[order], path[order]))
        return abs(left) < _AT_ZERO * float(np.abs(path).max())

    @property
    def repeats(self) -> bool:
        """Some setup was loaded again from the start."""
        return len(np.unique(self.rows.run)) > len(self.data.setups)

    @cached_property
    def comes_again(self) -> bool:
        """Two runs of some setup went through the same loads: else what differs between runs may as
        well be a curve of the load."""
        pairs = combinations(np.unique(self.rows.run).tolist(), 2)
        return any(self._overlap(self.rows.run == a, self.rows.run == b) for a, b in pairs)

    def _overlap(self, one: Flags, other: Flags) -> bool:
        a, b = self.load[one], self.load[other]
        both = min(float(a.max()), float(b.max())) - max(float(a.min()), float(b.min()))
        same = self.rows.setup[one][0] == self.rows.setup[other][0]
        return bool(same and both > _MET_AGAIN * min(float(np.ptp(a)), float(np.ptp(b))))

    @cached_property
    def monotonic(self) -> bool:
        """Every setup was loaded once, and never unloaded: all memory is hidden."""
        return not self.returns and not self.repeats

    @property
    def left_behind(self) -> float:
        """Share of the largest displacement that is left when the force was taken away in the end,
        0 where it was not."""
        return self._left(_ASIDE)

    @property
    def stays(self) -> float:
        """The same where next to nothing of the force is left: a curve that stiffens has hardly any
        of it over a third of its way."""
        return self._left(_GONE)

    def _left(self, gone_below: float) -> float:
        """gone_below: share of the largest force."""
        force = np.abs(self.rows.measured_force if self.imposed else self.load)
        path = self.load if self.imposed else self.response
        moved = np.abs(path - path[0])
        gone = force[-1] < gone_below * force.max()
        return float(moved[-1] / moved.max()) if gone and moved.max() > 0 else 0.0

    @cached_property
    def passes(self) -> int:
        """How often the load comes from zero or goes back there: one for a single pull, two for a
        cycle; runs that start anew count at least one each; many where it only trembles."""
        if self.rests:
            return _MANY
        runs = np.unique(self.rows.run)
        return sum(passes(self.load[self.rows.run == r]) for r in runs)

    @property
    def rests(self) -> bool:
        """The load does not change: the same all the time, or none at all."""
        return not np.ptp(self.load) > 0 or self.stands

    @cached_property
    def stands(self) -> bool:
        """The load spreads by no more than its noise, or wavers without any bearing on what was
        seen: held all the time, or none at all."""
        sd, does = self._load_sd, float(np.std(self.slope * self.load))
        spread, idle = float(np.std(self.load)), does < _IDLE * float(np.std(self.response))
        return bool(spread <= _TREMBLES * sd or (spread <= _WAVERS * sd and idle))

    @property
    def timeless(self) -> bool:
        """Nobody knows when a level was read: nothing can be said of rates, lags and creep. Where a
        level was read many times in a row, the number of the reading tells the time."""
        once = int(self.rows.hold_weight.max()) < _MANY_A_LEVEL
        return not self.data.timed and not self.rows.continuous and once

    @cached_property
    def never_held(self) -> bool:
        """The load never stood while more than one sample was taken, and never came again."""
        seldom = not self.rows.continuous and int(self.rows.hold_weight.max()) < _HELD
        return self.monotonic and (self.always_moves or seldom)

    @cached_property
    def always_moves(self) -> bool:
        """A running recording in which the load never stands: rate and load are one thing. Of a
        single pull the wait before it is no stand."""
        if not self.rows.continuous or self.rests:
            return False
        moves, waits = self._shares
        return moves + (waits if self.monotonic else 0.0) > 1 - _STANDS

    @cached_property
    def one_rate(self) -> bool:
        """It always moves, and all passes go about as fast, or take about as long."""
        if not self.always_moves:
            return False
        whole = turns(self.load)  # from turn to turn; what comes before and after is cut off
        edges = np.array(whole if len(whole) > 1 else [0, *whole, self.rows.n - 1])
        time = np.maximum(np.diff(self.rows.session[edges]), 1e-300)
        speed = np.abs(np.diff(self.load[edges])) / time
        return any(v.max() < _AS_FAST * v.min() for v in (speed, time))

    @property
    def stroke_s(self) -> float:
        """s that one pass of the load takes, holds and pauses left out."""
        return self._shares[0] * self.session_span / self.passes

    @cached_property
    def _shares(self) -> tuple[float, float]:
        """Shares of the session in which the load moves, and in which it stands and is still to
        come, by means of even pieces of it: noise of the driven channel moves as well."""
        t = (self.rows.session - self.rows.session.min()) / self.session_span
        count = int(np.clip(self.rows.n // 4, 8, max(40, 10 * self.passes)))
        at = np.minimum((t * count).astype(np.int64), count - 1)
        rows = np.bincount(at, minlength=count)
        held, first = np.unique(at, return_index=True)

        def mean(values: Array) -> Array:
            return np.asarray(np.bincount(at, weights=values, minlength=count)[held] / rows[held])

        def speed(values: Array) -> Array:
            change = np.diff(mean(values)) / np.diff(held)
            return np.asarray(change * count / (np.ptp(values) or 1.0))

        slow = np.abs(speed(self.load)) < _STANDS
        if self.imposed:  # a force that grows is no hold, wherever the displacement was read
            slow &= speed(np.abs(self.rows.measured_force)) < _STANDS
        elif self.data.imposed != "force":  # a stroke that runs on while the force stands
            slow &= np.abs(speed(self.response)) < _RUNS_ON
        beside = np.pad(slow, 1)
        # a turning point alone is no hold; what was left out of one run for pieces together is
        one_run = self.rows.run[first[1:] - 1] == self.rows.run[first[1:]]
        left_out = (np.diff(held) > 1) & one_run
        stands = slow & (beside[:-2] | beside[2:] | left_out)
        force = np.abs(mean(self.rows.measured_force))
        come = np.maximum.accumulate(force)[1:] > _COME * np.abs(self.rows.measured_force).max()
        whole, time = max(count - 1, 1), np.diff(held)
        return float(time[~stands].sum()) / whole, float(time[stands & ~come].sum()) / whole

    @cached_property
    def flows_out(self) -> bool:
        """Of a single pull: it ends nearly flat, with a small share of its steepest stiffness, as
        what flows does, and elastic curves seldom."""
        if not (self.monotonic and self.always_moves) or self.data.arm or len(self.data.setups) > 1:
            return False
        path, force = (np.abs(v - v[0]) for v in (self.data.displacement, self.data.force))
        if largest_reversal(path) > _WANDERS * float(path.max()):
            return False
        edges = np.linspace(0.0, float(path.max()), _STRETCHES + 1)
        order = np.argsort(path, kind="stable")
        stiffness = np.diff(np.interp(edges, path[order], force[order]))
        return bool(stiffness[-_LAST:].mean() < _FLOWS * stiffness.max())

    @cached_property
    def fall(self) -> float:
        """By what share of its range the response goes back in a single pull whose load goes on;
        one reading that jumps off does not."""
        if not (self.monotonic and self.always_moves) or not np.ptp(self.response) > 0:
            return 0.0
        size = np.abs(self.response - self.response[0])
        if len(size) < 3:
            return 0.0
        fall = largest_reversal(np.median([size[:-2], size[1:-1], size[2:]], axis=0))
        return float(fall / np.ptp(self.response))

    @property
    def gives_in(self) -> bool:
        """The force falls plainly in a single pull whose stroke goes on."""
        if not self.imposed or self.data.arm:
            return False
        noise = self.data.instruments.force * float(np.abs(self.slope).max())
        return self.fall > max(_FALLS, _CLEARLY * noise / float(np.ptp(self.response) or 1.0))

    @cached_property
    def let_go(self) -> ForceDrops | None:
        """Forces that let go of a rig without an arm, None where they don't."""
        return None if self.data.arm else let_go(self.data)

    @cached_property
    def faults(self) -> tuple[Fault, ...]:
        """Of the instruments that recorded it."""
        return found_in(self.data)

    @cached_property
    def wanders(self) -> str | None:
        """The channel of a rig without an arm that moves while there is no load, where plain."""
        return None if self.data.arm else wanders(self.data)

    @cached_property
    def approaches(self) -> bool:
        """A single pull without an arm that begins with a way at no force, as before a contact."""
        every = np.arange(len(self.data.force))
        return not self.data.arm and approaches(self.data, every)

    @cached_property
    def lost_in_loops(self) -> tuple[float, float]:
        """As `loops.lost` has it, of a load that stays on one side; nan for all others."""
        data = self.data
        once = len(np.unique(data.run)) == 1 and len(data.setups) == 1 and not data.arm
        one_way = _keeps_its_sign(data.force, _PULLED)
        if not (once and self.rows.continuous and self.returns and one_way):
            return float("nan"), float("nan")
        return lost(data.displacement, data.force, self.imposed)

    @cached_property
    def gives_out(self) -> float:
        """Share of its box that every loop of a running recording without an arm gives out as work,
        the median; 0 where loops use it up, or it is too little to be sure, or loops are few."""
        data = self.data
        if data.arm or not self.rows.continuous:
            return 0.0
        used = [
            work_used(data.displacement[mine], data.force[mine], self.imposed)
            for mine in (data.run == run for run in np.unique(data.run))
        ]
        each = np.concatenate(used)
        if len(each) < _LOOPS or np.mean(each < 0) < _EVERY:
            return 0.0
        share = -float(np.median(each))
        return share if share > _GIVES_OUT else 0.0

    @property
    def comes_back_as_it_went(self) -> bool:
        """What was lost the first time is not lost again: nothing rubs there."""
        first, again = self.lost_in_loops
        return first > _ENCLOSES and again < _AGAIN * first

    @property
    def rubs(self) -> bool:
        """Every loop of a load from one side encloses much: nothing flows back there."""
        first, again = self.lost_in_loops
        return again > max(2 * _ENCLOSES, 0.5 * first)


def _keeps_its_sign(values: Array, aside: float = _ASIDE) -> bool:
    return min(-float(values.min()), float(values.max())) < aside * float(np.abs(values).max())
