"""Second values straight from a world, without devices, emulators or waiting.

For statistics over many seeds and for checks in which the devices don't matter: follows a
protocol's runs as a careful operator would, one second value after the other, and gives the
columns of a measured table. Times are those of the hand and of settling, not of a wall clock.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Array
from rig.worlds.world import HAND_SPEED_M_PER_S, World

SET_UP_S = 120.0  # the fixture is turned to another direction or pose
RESET_S = 4.0  # charge amplifier: reset, operate
SETTLE_S = 5.0  # between the end of a turn and the first sample


class _Run(Protocol):
    @property
    def pose(self) -> str: ...
    @property
    def direction(self) -> str: ...


class Procedure(Protocol):
    """What is asked of a protocol; `rig.protocol.MeasurementProtocol` has it."""

    @property
    def poses(self) -> Mapping[str, Any]:
        """Of each name: q_rad (6) and tcp_xyz_mm (3)."""

    @property
    def directions(self) -> Mapping[str, Sequence[float]]:
        """Unit vectors in the base frame."""

    @property
    def sampling(self) -> Any:
        """rate_Hz and samples_per_step."""

    @property
    def zero(self) -> Any:
        """before_s and after_s of the zero-load plateaus."""

    @property
    def hold_s(self) -> float:
        """Every step is sampled at least so long."""

    @property
    def rest_s(self) -> float:
        """Unloaded between two runs."""

    def sequence(self) -> Iterable[tuple[int, Any, int]]:
        """Index of the run, run (pose, direction), repetition, in the order of measurement."""

    def steps(self, run: Any) -> Iterable[Any]:
        """number, branch and target_N of every level of a run."""


@dataclass(frozen=True)
class Sensors:
    """Noise of one second value (standard deviations), and what the sensors do besides.

    `drift_N_per_s`: largest drift of the force along base x, y, z: 0.05 pC/s in every one of two
    channels of 7.5 pC/N (four of 3.7 pC/N along z), drawn evenly and anew at every reset.
    `aim_N`, `aim_relative`: how far before a force the hand stops; it goes past none.
    """

    force_N: float = 0.05
    displacement_mm: float = 0.001
    joint_rad: float = 1.0e-5
    drift_N_per_s: tuple[float, float, float] = (0.0133, 0.0133, 0.054)
    aim_N: float = 0.1
    aim_relative: float = 0.002


@dataclass(frozen=True)
class _Row:
    """One sample before noise: state of the world and where in the procedure it belongs."""

    time_s: float
    session_s: float
    place: tuple[str, str, int, str, int]  # pose, direction, repetition, branch, step
    force_N: Array
    displacement_mm: float
    q: Array


class _Session:
    """One walk through the protocol."""

    def __init__(
        self, world: World, procedure: Procedure, random: np.random.Generator, sensors: Sensors
    ) -> None:
        self.world, self.procedure = world, procedure
        self._random, self._sensors = random, sensors
        self._now = 0.0
        self._run_start = 0.0
        self._setup: tuple[str, str] | None = None
        self._drift = np.zeros(3)
        # The rest between two runs is short or long: the controller uses its second half.
        world.controller_waits_s = SETTLE_S + procedure.zero.after_s + 0.5 * procedure.rest_s

    def rows(self) -> Iterator[_Row]:
        """Samples in the order of measurement."""
        for _, run, repetition in self.procedure.sequence():
            self._prepare(run)
            yield from self._run(run, repetition)
            self._pass(self.procedure.rest_s)

    def _prepare(self, run: _Run) -> None:
        setup = (run.pose, run.direction)
        if setup != self._setup:
            if self._setup is None or run.pose != self._setup[0]:
                pose = self.procedure.poses[run.pose]
                self.world.move(pose.q_rad, [mm * 1e-3 for mm in pose.tcp_xyz_mm])
            self.world.mount(self.procedure.directions[run.direction])
            self._setup = setup
            self._pass(SET_UP_S)
        self._pass(RESET_S)
        most = np.array(self._sensors.drift_N_per_s)
        self._drift = self._random.uniform(-most, most)
        self._run_start = self._now

    def _run(self, run: _Run, repetition: int) -> Iterator[_Row]:
        def place(branch: str, step: int) -> tuple[str, str, int, str, int]:
            return run.pose, run.direction, repetition, branch, step

        zero = self.procedure.zero
        limit = getattr(run, "stop_at_displacement_mm", None)
        yield from self._sample(place("zero", 0), zero.before_s)
        beyond = False
        for step in self.procedure.steps(run):
            if beyond and step.branch == "loading":
                continue
            self._load(step.target_N, -1.0 if step.branch == "loading" else 1.0)
            yield from self._sample(place(step.branch, step.number), self._step_s())
            beyond = limit is not None and 1e3 * self.world.state.displacement_m > limit
        self._load(0.0, 0.0)
        yield from self._sample(place("zero", 0), zero.after_s)

    def _step_s(self) -> float:
        sampling = self.procedure.sampling
        return max(self.procedure.hold_s, float(sampling.samples_per_step / sampling.rate_Hz))

    def _load(self, target_N: float, side: float) -> None:
        aim = self._sensors.aim_N + self._sensors.aim_relative * target_N
        force = max(0.0, target_N + side * aim * abs(self._random.standard_normal()))
        before = self.world.advance_m
        self.world.impose(force, SETTLE_S)
        self._now += abs(self.world.advance_m - before) / HAND_SPEED_M_PER_S + SETTLE_S

    def _pass(self, seconds: float) -> None:
        self.world.step(seconds)
        self._now += seconds

    def _sample(self, place: tuple[str, str, int, str, int], seconds: float) -> Iterator[_Row]:
        rate = self.procedure.sampling.rate_Hz
        for _ in range(max(1, round(seconds * rate))):
            self._pass(1.0 / rate)
            time, world, state = self._now - self._run_start, self.world, self.world.state
            force = world.force_gain * state.force_N * world.direction + self._drift * time
            moved = 1e3 * world.displacement_gain * state.displacement_m
            q = world.q + np.array(state.joints_rad)
            yield _Row(time, self._now, place, force, moved, q)


def sample_protocol(
    world: World, protocol: Procedure, seed: int, sensors: Sensors | None = None
) -> dict[str, NDArray[Any]]:
    """Columns of a table of measurements, one row per sample, by their contracted names.

    Force is tared at the start of every run; the laser is zeroed once per pose and direction, at
    its first sample. `seed` draws the sensors' noise and drifts and the hand's aim; gains and
    scatter belong to the world, which keeps its history: take a fresh one for every data set.
    """
    sensors = sensors or Sensors()
    random = np.random.default_rng([seed, 2])
    rows = list(_Session(world, protocol, random, sensors).rows())
    return _columns(rows, protocol, random, sensors)


def _columns(
    rows: list[_Row], protocol: Procedure, random: np.random.Generator, sensors: Sensors
) -> dict[str, NDArray[Any]]:
    n = len(rows)
    session = np.array([row.session_s for row in rows])
    columns: dict[str, NDArray[Any]] = {
        "time_s": np.array([row.time_s for row in rows]),
        "session_s": session,
    }
    names = ("pose", "direction", "repetition", "branch", "step")
    for index, name in enumerate(names):
        columns[name] = np.array([row.place[index] for row in rows])
    force = np.array([row.force_N for row in rows]) + sensors.force_N * random.standard_normal(
        (n, 3)
    )
    along = np.array([protocol.directions[row.place[1]] for row in rows])
    columns["force_N"] = np.einsum("ni,ni->n", force, along)
    columns |= {f"force_{axis}_N": force[:, i] for i, axis in enumerate("xyz")}
    laser = np.array([row.displacement_mm for row in rows])
    laser += sensors.displacement_mm * random.standard_normal(n)
    columns["displacement_mm"] = laser - _datum(laser, columns["pose"], columns["direction"])
    q = np.array([row.q for row in rows]) + sensors.joint_rad * random.standard_normal((n, 6))
    columns |= {f"q{joint + 1}_rad": q[:, joint] for joint in range(6)}
    warm = 26.0 + 6.0 * (1.0 - np.exp(-session / 1800.0))
    columns |= {f"temperature{joint + 1}_C": warm + 0.3 * joint for joint in range(6)}
    return columns


def _datum(laser: Array, pose: NDArray[Any], direction: NDArray[Any]) -> Array:
    """(n,) mm: the first value of each sample's pose and direction."""
    datum = np.empty(len(laser))
    for setup in set(zip(pose.tolist(), direction.tolist(), strict=True)):
        mask = (pose == setup[0]) & (direction == setup[1])
        datum[mask] = laser[mask][0]
    return datum
