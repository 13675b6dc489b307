"""The loading history of a hidden measurement, and the arm that goes through it.

A history is a row of instants: fine steps while the screw turns, one a sample while it stands, a
few while the arm rests unloaded between two runs. Effects say what they change; `observe` composes
arm and changes to what ideal instruments would read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.arrays import Array
from rig.worlds.arm import GRAVITY_M_PER_S2, place
from rig.worlds.hidden.design import Plan

Index = NDArray[np.int64]
TURN_STEPS = 12  # instants while the screw turns from one force to the next
SETTLED_S = 0.5  # from the end of a turn to the first sample
_BEYOND = (0.02, 0.2)  # of the largest load, by which a hand turns past a level
_BACK = 2 / 3  # of a turn, when the hand that went too far turns back
BRANCHES = ("zero", "loading", "unloading")


@dataclass(frozen=True)
class History:
    """(n) instants: session time s, load N along the direction, setup, run; `sample` (m) picks the
    recorded ones, `branch`, `step`, `repetition`, `run_time` (m) belong to these."""

    time: Array
    load: Array
    setup: Index
    run: Index
    sample: Index
    branch: Index
    step: Index
    repetition: Index
    run_time: Array

    @cached_property
    def run_starts(self) -> Index:
        """Index of the first instant of every run."""
        return np.flatnonzero(np.diff(self.run, prepend=-1))


@dataclass(frozen=True)
class Scene:
    """Plan, history and nominal geometry: of each setup levers (s, 6, 3) m per rad, tool (s, 3) m
    over the base, unit (s, 3), weight (s, 6) Nm on the joints, of arm and tool; poses (s) as
    numbers. turned: where the arm stands otherwise or is pulled across, so that its joints carry
    other torques."""

    plan: Plan
    history: History
    levers: Array
    tool: Array
    unit: Array
    weight: Array
    pose: Index
    turned: Change | None = None

    @cached_property
    def torque(self) -> Array:
        """(n, 6) Nm on the joints under the load as it acts, the weights as planned."""
        changed = self.turned or Change()
        levers = self.levers if changed.levers is None else changed.levers
        return np.asarray(np.einsum("nij,nj->ni", levers[self.history.setup], self.force))

    @cached_property
    def force(self) -> Array:
        """(n, 3) N: the load as it acts."""
        pulls = self.unit[self.history.setup]
        if self.turned is not None and self.turned.across is not None:
            pulls = pulls + self.turned.across
        return np.asarray(pulls * self.history.load[:, None])

    @property
    def point(self) -> Array:
        """(s, 3) m: where it acts, over the base."""
        moved = None if self.turned is None else self.turned.tools
        return self.tool if moved is None else moved

    @cached_property
    def net(self) -> Array:
        """(n, 6) Nm: what the joints really carry, the weights with it."""
        return np.asarray(self.torque + self.weight[self.history.setup])

    @cached_property
    def standing(self) -> Index:
        """(n) counts up whenever the arm drives to another pose."""
        return self.pose[self.history.setup]

    def since_standing(self, path: Array) -> Array:
        """A path (n) against where it was when the arm came to stand, under its weight alone."""
        begins = np.diff(self.standing, prepend=-1) != 0
        return np.asarray(path - path[begins][np.cumsum(begins) - 1])

    @cached_property
    def elastic(self) -> Array:
        """(n) m of deflection along the direction with six springs only, as planned."""
        along = np.einsum("sij,sj->si", self.levers, self.unit)[self.history.setup]
        softness = np.sum(along**2 / self.plan.springs, axis=1)
        return np.asarray(softness * self.history.load)


@dataclass(frozen=True)
class Change:
    """What one effect changes; all that is left out stays as it was.

    springs (6) factors; levers (s, 6, 3) and tools (s, 3) m instead of the nominal ones; stands
    (s, 6) rad off the commanded angles; across (n, 3) load beside the nominal one, as its share;
    joints (n, 6) rad; outside (n) m along the direction; laser and force map channels (n) m,
    (n, 3) N to channels.
    """

    springs: Array | None = None
    levers: Array | None = None
    tools: Array | None = None
    stands: Array | None = None
    across: Array | None = None
    joints: Array | None = None
    outside: Array | None = None
    laser: Callable[[Array], Array] | None = None
    force: Callable[[Array], Array] | None = None


@dataclass(frozen=True)
class Reading:
    """(m) samples of ideal instruments before datum and tare: displacement mm along the direction,
    force (m, 3) N, joint angles (m, 6) rad as the encoders see them."""

    displacement_mm: Array
    force_N: Array
    q: Array


def make_scene(plan: Plan, random: Generator) -> Scene:
    """The history of the plan (how fast the hand turns, how long rests last) and its geometry."""
    history = _Clock(plan, random).walk()
    names = list(plan.poses)
    levers, tools, weights = [], [], []
    for setup in plan.setups:
        arm = place(plan.poses[setup.pose])
        tool = arm.tool(plan.tcp_mm * 1e-3)
        tools.append(tool)
        levers.append(arm.levers(tool))
        carried = plan.tool_kg * GRAVITY_M_PER_S2
        weights.append(arm.gravity_torques() + arm.levers(tool) @ carried)
    return Scene(
        plan=plan,
        history=history,
        levers=np.array(levers),
        tool=np.array(tools),
        unit=np.array([s.unit for s in plan.setups]),
        weight=np.array(weights),
        pose=np.array([names.index(s.pose) for s in plan.setups]),
    )


def observe(scene: Scene, changes: Sequence[Change] = ()) -> Reading:
    """What ideal instruments read at the samples when the arm is changed so."""
    path = observe_path(scene, changes)
    pick = scene.history.sample
    return Reading(path.displacement_mm[pick], path.force_N[pick], path.q[pick])


def observe_path(scene: Scene, changes: Sequence[Change] = ()) -> Reading:
    """The same at every instant (n) of the history."""
    history, plan = scene.history, scene.plan
    setup, levers, springs = history.setup, scene.levers, plan.springs
    load = scene.unit[setup] * history.load[:, None]
    stands = np.array([plan.poses[s.pose] for s in plan.setups])
    for change in changes:
        levers = levers if change.levers is None else change.levers
        springs = springs if change.springs is None else springs * change.springs
        stands = stands if change.stands is None else stands + change.stands
        if change.across is not None:
            load = load + change.across * history.load[:, None]
    lever = levers[setup]
    joints = np.einsum("nij,nj->ni", lever, load) / springs
    joints = joints + sum((c.joints for c in changes if c.joints is not None), np.zeros(6))
    along = np.einsum("nij,nj->ni", lever, scene.unit[setup])
    moved = np.sum(along * joints, axis=1)
    moved = moved + sum((c.outside for c in changes if c.outside is not None), np.zeros(1))
    for change in changes:
        moved = moved if change.laser is None else change.laser(moved)
        load = load if change.force is None else change.force(load)
    seen = joints if plan.recorded.encoder == "output" else np.zeros(6)
    return Reading(1e3 * moved, load, stands[setup] + seen)


class _Clock:
    """Goes through the procedure and notes instants."""

    def __init__(self, plan: Plan, random: Generator) -> None:
        self._plan, self._random = plan, random
        self._now = 0.0
        self._rows: list[tuple[float, float, int, int]] = []
        self._samples: list[tuple[int, int, int, int, float]] = []
        self._turn_s = random.uniform(2.0, 6.0)

    def walk(self) -> History:
        run = 0
        for number, setup in enumerate(self._plan.setups):
            for repetition in range(1, self._plan.repetitions + 1):
                if run:
                    fresh = repetition == 1
                    changed = fresh and setup.pose != self._plan.setups[number - 1].pose
                    low = 400.0 if changed else (200.0 if fresh else 50.0)
                    self._rest(self._random.uniform(low, 1.8 * low), number, run)
                self._run(number, run, repetition)
                run += 1
        time, load, setups, runs = zip(*self._rows, strict=True)
        sample, branch, step, repetitions, run_time = zip(*self._samples, strict=True)
        return History(
            *(np.array(time), np.array(load), np.array(setups), np.array(runs)),
            *(np.array(sample), np.array(branch), np.array(step), np.array(repetitions)),
            np.array(run_time),
        )

    def _run(self, setup: int, run: int, repetition: int) -> None:
        plan, top = self._plan, self._plan.setups[setup].top_N
        start, load = self._now, 0.0
        up = [(1, k) for k in range(1, plan.steps + 1)]
        down = [(2, k) for k in range(plan.steps - 1, 0, -1)] if plan.unloads else []
        levels = [*up, *down, *([(0, 0)] if plan.zero_after else [])]
        self._note(0.0, setup, run)
        self._hold(plan.zero_before, 0.0, setup, run, (0, 0, repetition), start)
        for branch, step in levels:
            aim = 0.0 if step == 0 else top * step / plan.steps
            aim += (0.2 + 0.003 * aim) * self._random.standard_normal() if step else 0.0
            self._turn(load, aim, setup, run, self._past(aim - load, top) if step else 0.0)
            load = aim
            count = plan.hold if step else plan.zero_after
            self._hold(count, load, setup, run, (branch, step, repetition), start)

    def _past(self, change: float, top: float) -> float:
        """How far (N) the hand goes past a level that it turns to by `change`: mostly nothing."""
        if self._random.random() >= self._plan.beyond:
            return 0.0
        return float(np.sign(change) * top * self._random.uniform(*_BEYOND))

    def _turn(self, old: float, new: float, setup: int, run: int, past: float = 0.0) -> None:
        """past: N by which the load goes past the new one; never to where a screw would pull."""
        seconds = self._turn_s * self._random.uniform(0.7, 1.5)
        shares = np.arange(1, TURN_STEPS + 1) / TURN_STEPS
        corners = (0.0, _BACK, 1.0) if past else (0.0, 1.0)
        loads = (old, max(new + past, 0.0), new) if past else (old, new)
        for load in np.interp(shares, corners, loads).tolist():
            self._now += seconds / TURN_STEPS
            self._note(load, setup, run)

    def _hold(
        self,
        count: int,
        load: float,
        setup: int,
        run: int,
        place: tuple[int, int, int],
        start: float,
    ) -> None:
        self._now += SETTLED_S
        for k in range(count):
            self._now = round(self._now + (1.0 if k else 0.0), 1)
            self._note(load, setup, run)
            self._samples.append((len(self._rows) - 1, *place, round(self._now - start + 0.5, 1)))
        self._now += 0.5

    def _rest(self, seconds: float, setup: int, run: int) -> None:
        begin = self._now
        last = self._rows[-1]
        self._turn(last[1], 0.0, last[2], last[3])
        for share in (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0):
            self._now = begin + 3.0 * self._turn_s + share * seconds
            # the last instant belongs to the run that follows
            self._note(0.0, setup if share == 1.0 else last[2], run if share == 1.0 else last[3])

    def _note(self, load: float, setup: int, run: int) -> None:
        self._rows.append((self._now, load, setup, run))
