"""The observation model of one data set: stacked channels, their noise, and a pool of columns.

Channels, one below the other: response (displacement along the direction; where the displacement
is imposed, force over simulated stiffness) row by row, joint readings and tangential force hold by
hold, force at zero load row by row.
Every effect adds columns: what one unit of a coefficient does to all channels at once. The
observation is `y = prior simulation + base columns + effect columns + imperfection + noise`.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.data import GapData
from identification.gap.model.driven import driven
from identification.gap.model.history import moves, rests
from identification.gap.model.layout import Layout, layout_of
from identification.gap.model.lines import force_without_load, means_move, measured_slope
from identification.gap.model.noise import Noise, estimate_noise
from identification.gap.model.other_springs import springs_behind
from identification.gap.model.path import Path, load_path
from identification.gap.model.pool import Pool
from identification.gap.recording.imposed import displacement_imposed
from identification.gap.recording.load_history import LoadHistory
from identification.gap.recording.rows import Rows, reduce_rows

_MOVES_ON = 2.0  # times the noise of a sample


@dataclass(frozen=True, eq=False)
class KnownEffects:
    """Effects that the simulation has already (`--model`). does (size,): their stacked
    contribution. free (size, k): columns with independent unit-normal coefficients for what is
    uncertain of them, names (k). left m: rms of their contribution that may remain. across: whether
    what they leave for good outlasts a change of pose, which a model made in one pose can't tell;
    these data choose."""

    does: Array
    free: Array
    names: tuple[str, ...]
    left: float
    across: bool = False


@dataclass(frozen=True, eq=False)
class ArmState:
    """Where the actual arm differs from the nominal one, row by row. lever (n, m) m: actual levers
    along the direction. torque (n, m) Nm: on the joints, beside that of the load along the
    direction. ahead (n,) N: true load minus its reading (lag). moment (n, 3) m: change of the
    moment about the base's origin per newton along the direction. force (n, 3) N: across the
    direction; twist (n, 3) Nm: its moment about the base's origin."""

    lever: Array
    torque: Array
    ahead: Array
    moment: Array
    force: Array
    twist: Array


_FURTHER, _FIRST, _ONE_WAY = 6, 1.4, 0.9  # radii; the first, of the last inner one; of the range
TOOL_KG, TOOL_SD_KG = 1.5, 0.9  # screwed to the flange: 0 to 3 kg, nobody states it
_BOTH, _UNLIKE = 0.2, 0.03  # of a joint's largest torque
_FELT = 0.03  # of the range of the load's torque


@dataclass(frozen=True, eq=False)
class Bench:
    """The observation model of one data set: n rows, the channels stacked to `size` values,
    their noise, and a pool of columns that effects are made of. m joints."""

    data: GapData
    rows: Rows
    layout: Layout  # where the channels lie in what is stacked
    noise: Noise
    imposed: bool  # the displacement is driven, and the force answers
    sense: float  # +1; -1 where the displacement is imposed, as an effect takes force away then
    compliance: Array  # (m,) rad/Nm about which all is linear
    load: Array  # (n,) N that drives the rig
    # (n,) m; where the displacement is imposed, the measured force times the stated
    # compliance
    response: Array
    torque: Array  # (n, m) Nm under the load
    lever: Array  # (n, m) m
    elastic: Array  # (n, m) rad: deflection of each simulated joint
    slope: Array  # (n,) m/N: simulated compliance along the direction
    reach: float  # m: the largest response simulated or measured, the unit of what has no other
    scatter: Array  # (n,) m^2: mean square of the samples about their row
    trend: Array  # (n,) m s: mean product of time and response about the row
    observed: Array  # (size,) what was measured
    columns: Pool = field(default_factory=Pool)  # the pool, filled by the effects
    # states of viscoplastic plays, which take a loop over rows, by `Flow.key`
    flows: dict[bytes, Array] = field(default_factory=dict)
    # (n,) m: the path of the response, where more is known of it than `line`
    moves: Array | None = None
    known: KnownEffects | None = None  # effects that the simulation has already
    arm_state: ArmState | None = None  # actual state of the arm; None: as simulated
    # (channel, kind) -> lags (k,) s and what each does (k, n): of this bench alone, no copy's
    lags: dict[tuple[str, str], tuple[Array, Array]] = field(default_factory=dict, init=False)

    @property
    def has_q(self) -> bool:
        """Joint readings are there and contain the joints' deflection."""
        q = self.layout.q
        return bool(q.stop > q.start)

    @property
    def still(self) -> bool:
        """No load that changes, or nothing that moves by more than a reading is uncertain by."""
        return not np.ptp(self.load) > 0 or self.reach < self.noise.stated

    @property
    def torque_unit(self) -> str:
        """Of thresholds and friction."""
        return "Nm" if self.data.arm else "N"

    @property
    def has_zero_force(self) -> bool:
        """Force at zero load is a channel; where the displacement is imposed, there is no such."""
        zero = self.layout.zero_force
        return bool(zero.stop > zero.start)

    @cached_property
    def load_history(self) -> LoadHistory:
        """How the load went."""
        return LoadHistory(
            self.data,
            self.rows,
            self.imposed,
            self.load,
            self.response,
            self.slope,
            self.stated_slope,
        )

    @cached_property
    def line_slope(self) -> Array:
        """(n,) slope of the response over the load, m/N, as measured in each setup; what a gain or
        a lag acts on, however wrong the simulated springs are."""
        return measured_slope(self.rows, self.load, self.response)

    @cached_property
    def line(self) -> Array:
        """(n,) m: the response in proportion to the load, `line_slope * load`, or `moves` where
        that is given. Instruments (gain, lag) act on it."""
        return self.line_slope * self.load if self.moves is None else self.moves

    @cached_property
    def moves_on(self) -> bool:
        """Whether the mean of `response - line` differs between runs of one setup by more than
        twice the noise of a sample."""
        left = self.response - self.line
        return means_move(self.rows, self.load, left, _MOVES_ON * self.noise.stated)

    @cached_property
    def zero_line(self) -> Array:
        """(n,) N: what the force shows at zero load, as `force_without_load` has it. A threshold is
        met by the force less this; springs alone would not mind."""
        if self.imposed:
            return np.zeros(self.rows.n)
        tared = self.data.tare == "run"
        return force_without_load(self.rows, self.noise.force, tared=tared)

    @cached_property
    def true_load(self) -> Array:
        """(n,) N: the load without the drift and the lag of its reading."""
        read = self.load - self.zero_line
        return np.asarray(read if self.arm_state is None else read + self.arm_state.ahead)

    @cached_property
    def true_torque(self) -> Array:
        """(n, m) Nm: torques under `true_load`, that is without drift and lag of the reading, and
        with those of `arm_state`. Thresholds, plays and friction answer to these."""
        along = self.lever * self.true_load[:, None]
        return np.asarray(along if self.arm_state is None else along + self.arm_state.torque)

    def reach_of(self, load: Array) -> float:
        """Range of a load with zero in it. Where the displacement is imposed: of what the rig
        really carried, not of what the simulated spring would have."""
        span = float(np.ptp(np.append(load, 0.0)))
        if not self.imposed or not span > 0:
            return span
        carried = float(np.ptp(np.append(self.rows.measured_force, 0.0)))
        return min(span, span * carried / max(float(np.ptp(np.append(self.load, 0.0))), 1e-300))

    def radii(self, load: Array, inner: Array) -> Array:
        """Radii of plays: `inner`, and on an imposed path, which runs far beyond what yields,
        _FURTHER more: what has yielded hardens over all of it, or softens. Up to half of its
        range, since it is gone both ways; a single pull goes but one."""
        full, last = float(np.ptp(np.append(load, 0.0))), float(inner[-1])
        far = (_ONE_WAY if self.load_history.monotonic else 0.5) * full
        if not self.imposed or far <= last:
            return inner
        evenly = self.load_history.monotonic or _FIRST * last > far
        start = min(_FIRST, (far / last) ** (1 / _FURTHER)) if evenly else _FIRST
        return np.concatenate([inner, np.geomspace(start * last, far, _FURTHER)])

    def add(self, column: Array) -> int:
        """Puts a stacked column into the pool; its index."""
        return self.columns.add(column)

    def stacked(
        self,
        response: Array | None = None,
        q: Array | None = None,
        tangential: Array | None = None,
        zero_force: Array | None = None,
    ) -> Array:
        """A stacked column, as `Layout.stacked` has it."""
        return self.layout.stacked(self.rows, response, q, tangential, zero_force)

    def joint_column(self, joint: int, deflection: Array) -> Array:
        """What a deflection (n,) rad of one joint does to the laser and to that joint's reading;
        where the displacement is imposed it is negative for a joint that gives way (`sense`)."""
        response, turned = self.lever[:, joint] * deflection, self.sense * deflection
        if self.imposed:  # what one joint gives way, force and all other joints lose
            q = self._follow(response)
            q[:, joint] += turned
            return self.stacked(response, q)
        out = self.stacked(response)
        if self.has_q:
            readings = out[self.layout.q].reshape(self.data.joints, -1)
            readings[joint] = self.rows.hold_means(turned)
        return out

    def outside_column(self, motion: Array) -> Array:
        """What a motion (n,) m of the target does that does not come from the joints: the laser
        sees it; where the displacement is imposed, the joints are spared it, and force falls."""
        if not self.imposed:
            return self.stacked(motion)
        return self.stacked(-motion, self._follow(-motion))

    @cached_property
    def sigma(self) -> Array:
        """(size,) standard deviation of every stacked row."""
        noise, rows, layout = self.noise, self.rows, self.layout
        out = np.empty(layout.size)
        root = np.sqrt(rows.weight) if not rows.continuous else np.ones(rows.n)
        out[: layout.n] = noise.response
        total = np.sqrt(rows.hold_weight[rows.edges])
        if layout.q.stop > layout.q.start:
            out[layout.q] = np.maximum(noise.q[:, None] / total, noise.q_hold).ravel()
        if rows.tangential is not None:
            out[layout.tangential] = np.tile(noise.force / total, 2)
        if self.has_zero_force:
            out[layout.zero_force] = noise.force / root[rows.zero]
        return out

    @cached_property
    def simulated(self) -> Array | None:
        """(n,) m: the response that another simulator's curves predict; None where there are
        none."""
        if self.data.curves is None:
            return None
        out = np.empty(self.rows.n)
        for s, curve in enumerate(self.data.curves):
            mine = self.rows.setup == s
            slope, load = self.stated_slope[mine], self.load[mine]
            out[mine] = slope * curve.carried(slope * load) if self.imposed else curve.at(load)
        return out

    @cached_property
    def stated_slope(self) -> Array:
        """(n,) m/N: compliance along the direction as simulated, by which a response is a force."""
        return self.slope_of(self.data.compliance)

    def slope_of(self, compliance: Array) -> Array:
        """(n,) m/N: compliance along the direction with springs of that compliance (m,)."""
        return np.asarray(self.lever**2 @ compliance + self.data.outside_of(self.rows.setup))

    def _follow(self, response: Array) -> Array:
        """Deflections (n, m) of the joints under the force behind a response (n,) m."""
        per_newton = self.stated_slope
        force = np.divide(response, per_newton, out=np.zeros_like(response), where=per_newton > 0)
        return np.asarray(self._unit_elastic() * force[:, None])

    def add_joint(self, joint: int, deflection: Array) -> int:
        """Puts the column of a joint's deflection (n,) rad into the pool; its index."""
        return self.add(self.joint_column(joint, deflection))

    def force_column(self, force: Array) -> Array:
        """What an additional force (n,) N along the direction does."""
        return self.stacked(self.slope * force, self._unit_elastic() * force[:, None])

    def _unit_elastic(self) -> Array:
        return self.lever * self.compliance

    def path(self, load: Array, fresh: Flags | None = None, weight: Array | None = None) -> Path:
        """Of a load (n,), with what no row shows of it; fresh: where the memory is lost, by default
        where the arm goes to another pose. weight (n,): that acts beside the load."""
        lost = self.moved if fresh is None else fresh
        return load_path(load, self.rest, lost, weight, self.rows.overshoot, self.rows.onward)

    def along(self, overshoot: Array) -> Bench:
        """The bench with loads (n,) that no row shows (`Rows.overshoot`); what is known of it else
        stays, and its pool."""
        out = copy(self)  # with what has been worked out of rows and loads
        rows = copy(self.rows)
        object.__setattr__(rows, "overshoot", overshoot)
        for name, value in (("rows", rows), ("flows", {}), ("lags", {})):
            object.__setattr__(out, name, value)
        return out

    def with_arm_state(self, there: ArmState) -> Bench:
        """The bench of an arm in that state; its pool stays, and what is told by the levers that
        are simulated."""
        kept = {name: getattr(self, name) for name in ("stated_slope", "load_history")}
        torque = there.lever * self.load[:, None] + there.torque
        values = {"lever": there.lever, "torque": torque, "elastic": torque * self.compliance}
        return self._changed(**values, arm_state=there, **kept)

    def _changed(self, **values: object) -> Bench:
        """A copy with other values, without what was worked out of the old ones."""
        out = copy(self)
        for name, of_class in vars(Bench).items():
            if isinstance(of_class, cached_property):
                out.__dict__.pop(name, None)
        for name, value in {"flows": {}, "lags": {}, **values}.items():
            object.__setattr__(out, name, value)
        return out

    def plays(
        self, load: Array, radius: Array, fresh: Flags | None = None, weight: Array | None = None
    ) -> Array:
        """Play states (n, k) of the path of a load (n,), for radii (k,)."""
        return self.path(load, fresh, weight).plays(radius)

    def weight(self, joint: int, tool_kg: float = TOOL_KG) -> Array:
        """(n,) Nm: what the weights of arm and tool do to a joint."""
        each = [s.gravity + tool_kg * s.tool_gravity for s in self.data.setups]
        return np.asarray(np.stack(each)[self.rows.setup, joint])

    def weight_per_kg(self, joint: int) -> Array:
        """(n,) Nm/kg: what a tool does to a joint."""
        return self.weight(joint, 1.0) - self.weight(joint, 0.0)

    def meets_weight_unlike(self, joint: int) -> bool:
        """Whether pushes go both with the weights and against them, or weights differ between
        poses: else a law of the net torque is one of the push, shifted."""
        top = float(np.abs(self.true_torque[:, joint]).max())
        unlike = float(np.ptp(self.weight(joint))) > _UNLIKE * top
        return self.pushed_both_ways(joint) or unlike

    def pushed_both_ways(self, joint: int) -> bool:
        """Whether a joint is pushed to either side, by a good part of the most."""
        push = self.true_torque[:, joint]
        return min(float(push.max()), -float(push.min())) > _BOTH * float(np.abs(push).max())

    def feels_weight(self, joint: int) -> bool:
        """Whether weights make a difference to a joint, beside the torques of the load."""
        span = float(np.ptp(np.append(self.torque[:, joint], 0.0)))
        return bool(np.abs(self.weight(joint)).max() > _FELT * span)

    def scatter_about(self, predicted: Array) -> Array:
        """(n,) m^2: mean square of the samples about what was predicted of their row (n,), which
        goes on in time within it."""
        speed = self.rows.speed(predicted)
        square = self.scatter - 2 * speed * self.trend + speed**2 * self.rows.spread
        return np.asarray(np.maximum(square, 0.0))

    @cached_property
    def rest(self) -> Flags:
        """(n,) rows before which the load went back to zero."""
        return rests(self.rows)

    @cached_property
    def moved(self) -> Flags:
        """(n,) first rows after the arm went to another pose."""
        return moves(self.rows, [s.pose for s in self.data.setups])

    @cached_property
    def rebuilt(self) -> Flags:
        """(n,) first rows after the arm went to another pose, or the rig to another direction."""
        return moves(self.rows, [f"{i}" for i in range(len(self.data.setups))])

    def moving_joints(self) -> list[int]:
        """Joints whose compliance carries at least a hundredth of the deflection in some setup."""
        part = np.abs(self.lever * self.elastic)
        total = part.sum(axis=1).max() or 1.0
        return [j for j in range(self.data.joints) if part[:, j].max() > 0.01 * total]

    @cached_property
    def joint_log_priors(self) -> Array:
        """(m,) nats: log prior of a mechanism sitting in each joint, 0 on average over those that
        move. Mechanisms are a share of a joint's deflection, mostly of a few percent to about all
        of it; so the same motion of the target is a likelier share of a joint that contributes
        much: half the log of its largest contribution. 0 for joints that hardly move, and without
        an arm."""
        out, moving = np.zeros(self.data.joints), self.moving_joints()
        if not self.data.arm or not moving:
            return out
        gives = np.abs(self.lever * self.elastic).max(axis=0)[moving] ** _OF_SHARE
        out[moving] = np.log(gives / gives.mean())
        return out


_OF_SHARE = 0.5


def make_bench(data: GapData, compliance: Array | None = None, rows: Rows | None = None) -> Bench:
    """The bench of a data set. compliance (m,): point about which springs are linearised."""
    rows = rows or reduce_rows(data)
    c = springs_behind(data) if compliance is None else compliance
    lever = np.stack([s.lever for s in data.setups])[rows.setup]
    outside = data.outside_of(rows.setup)
    slope, stated = (lever**2 @ springs + outside for springs in (c, data.compliance))
    imposed = displacement_imposed(data)
    load = driven(data, rows, imposed)
    if imposed:
        load, response = load / stated, rows.measured_force * stated
        scatter, trend = rows.force_scatter * stated**2, rows.force_trend * stated
    else:
        response = rows.displacement
        scatter, trend = rows.displacement_scatter, rows.displacement_trend
    torque = lever * load[:, None]
    layout = layout_of(data, rows, imposed)
    reach = max(float(np.ptp(slope * load)), float(np.ptp(response)), 1e-15)
    return Bench(
        data=data,
        rows=rows,
        layout=layout,
        noise=estimate_noise(data, rows, stated, imposed),
        imposed=imposed,
        sense=-1.0 if imposed else 1.0,
        compliance=c,
        load=load,
        response=response,
        torque=torque,
        lever=lever,
        elastic=torque * c,
        slope=slope,
        reach=reach,
        scatter=scatter,
        trend=trend,
        observed=layout.stacked(rows, response, rows.q, rows.tangential, rows.measured_force),
    )
