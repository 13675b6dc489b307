"""A world that goes on in time: what the emulators sense.

The scene is integrated on demand in steps on a fixed grid, always to the first grid instant not
before now. A turn of the screw acts from there on, a new set-up or pose at once; what an emulator
may already have seen does not change.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

import numpy as np

from drivers.clock import Clock
from drivers.scene import ArmSignals
from rig.arrays import Array
from rig.worlds.arm import tool_poses
from rig.worlds.history import History
from rig.worlds.world import CONTROLLER_WAITS_S, ZERO_PLATEAU_S, World

TICK_S = 0.05  # while the screw turns
IDLE_TICKS = 4  # otherwise
KEPT_S, KEPT_WALL_S = 30.0, 4.0  # of the scene, and more where it runs fast
REACTION_WALL_S = 0.3  # about, for all between the end of one run and the start of the next
COMMAND_S = 1e-6  # that a new set-up or pose takes to show
FUTURE_TOLERANCE_S = 1e-6

# The floor: tones (Hz) and their amplitude (m), and how stiffly the arm passes them on (N/m).
_TONES_HZ = np.array([11.3, 17.9, 24.1])
_AMPLITUDE_M, _CONTACT_N_PER_M = 0.2e-6, 1.0e5
# Torque per ampere at the joints' output, about; holding current hides load behind friction.
_NM_PER_A = np.array([13.0, 13.0, 11.0, 10.0, 10.0, 10.0])
_WARM_UP_S = 1800.0

_FORCE, _MOVED, _JOINTS, _TARGET = slice(0, 3), slice(3, 4), slice(4, 10), slice(10, 16)
_TORQUE = slice(16, 22)
_WIDTH = 22


class WorldScene:
    """Meets `drivers.scene.Scene`; thread-safe.

    `poses`: joint angles (6) rad and tool (3) m in the flange frame of every pose the procedure
    knows; the arm stands in the first, and takes the tool of the one it is moved to.
    `zero_plateau_s` follows each run; till then what has given way stays. Asking for an instant
    after now() raises ValueError.
    """

    does_not_simulate = (
        "inertia and free vibration, motion of the commanded joints, bending of links and base, "
        "change of leverage by the deflection, load beside the mounted direction, friction of the "
        "screw, thermal growth"
    )

    def __init__(
        self,
        world: World,
        speed: float,
        seed: int,
        poses: Sequence[tuple[Sequence[float], Sequence[float]]] = (),
        now: Callable[[], float] | None = None,
        zero_plateau_s: float = ZERO_PLATEAU_S,
    ) -> None:
        self.speed = speed
        self.world = world
        self._now = now if now is not None else Clock(speed).now
        self._poses = [(np.array(q, dtype=float), tuple(tcp)) for q, tcp in poses]
        random = np.random.default_rng([seed, 1])
        self._phases = random.uniform(0.0, 2.0 * np.pi, len(_TONES_HZ))
        self._warm_C = random.uniform(24.0, 27.0, 6)
        self._rise_C = random.uniform(3.0, 8.0, 6)
        self._friction = random.uniform(0.7, 1.4, 6)
        # The procedure's reactions take wall time, which is more of the scene's where it runs fast.
        world.controller_waits_s = zero_plateau_s + CONTROLLER_WAITS_S + REACTION_WALL_S * speed
        if poses:
            world.move(*poses[0])
        self._first_command_s: float | None = None
        self._tick = 0
        self._history = History(_WIDTH, max(KEPT_S, KEPT_WALL_S * speed), TICK_S)
        self._lock = threading.RLock()
        self._record(0.0)
        self._go_on()

    def now(self) -> float:
        """Seconds since the scene began."""
        return self._now()

    @property
    def first_command_s(self) -> float | None:
        """When the operator first set up or turned the screw; None before."""
        return self._first_command_s

    def force_N(self, t: Array) -> Array:
        """(n, 3) force on the robot in the base frame, gain of the force chain included."""
        force = self._read(t, _FORCE)
        size = np.linalg.norm(force, axis=1, keepdims=True)
        pressed = force / np.where(size > 0, size, 1.0)
        shake = _CONTACT_N_PER_M * self._vibration(t)
        felt: Array = self.world.force_gain * (force + shake[:, None] * pressed)
        return felt

    def displacement_m(self, t: Array) -> Array:
        """(n,) displacement along the mounted direction, gain of the laser included."""
        moved = self._read(t, _MOVED)[:, 0]
        seen: Array = self.world.displacement_gain * (moved + self._vibration(t))
        return seen

    def arm(self, t: Array) -> ArmSignals:
        """Joint signals; the encoders sit at the joints' output and see their deflection."""
        rows = self._read(t, slice(None))
        target, torque = rows[:, _TARGET], rows[:, _TORQUE]
        q = target + rows[:, _JOINTS]
        holding = self.world.gravity_torques / _NM_PER_A
        warm = (1.0 - np.exp(-t / _WARM_UP_S))[:, None]
        return ArmSignals(
            q=q,
            q_target=target,
            tcp_pose=tool_poses(q, self.world.tcp_m),
            current=self._friction * (holding + 0.5 * torque / _NM_PER_A),
            target_current=np.tile(holding, (len(t), 1)),
            temperatures_C=self._warm_C + self._rise_C * warm,
        )

    def turn(self, advance_m: float) -> None:
        """The hand begins to turn the screw; returns at once."""
        with self._lock:
            self._advance()
            self._note_command()
            self.world.turn(advance_m)

    def mount(self, direction: Sequence[float]) -> None:
        """Screw and laser along a unit vector, unloaded, the joints taken back."""
        with self._lock:
            self._advance()
            self.world.mount(direction)
            self._note_command()
            self._start_anew()

    def move(self, q_rad: Sequence[float]) -> None:
        """The arm stands unloaded in another pose from now on."""
        with self._lock:
            self._advance()
            self.world.move(q_rad, self._tool(q_rad))
            self._start_anew()

    def _note_command(self) -> None:
        if self._first_command_s is None:
            self._first_command_s = self.now()

    def _start_anew(self) -> None:
        now = self.now()
        self._history.cut(now)
        self._record(now + COMMAND_S)

    def _tool(self, q_rad: Sequence[float]) -> Sequence[float] | None:
        for q, tcp_m in self._poses:
            if len(q_rad) == len(q) and np.allclose(q, q_rad, atol=1e-3):
                return tcp_m
        return None

    def _read(self, t: Array, columns: slice) -> Array:
        if len(t) == 0:
            return np.empty((0, len(range(_WIDTH)[columns])))
        latest, now = float(np.max(t)), self.now()
        if latest > now + FUTURE_TOLERANCE_S:
            raise ValueError(f"the scene is at {now:.6f} s; {latest:.6f} s has not happened yet")
        with self._lock:
            self._advance()
            return self._history.at(t, columns)

    def _advance(self) -> None:
        now = self.now()
        while self._history.newest < now:
            self._go_on()

    def _go_on(self) -> None:
        self._tick += 1 if self.world.turning else IDLE_TICKS
        self.world.step(self._tick * TICK_S - self._history.newest)
        self._record(self._tick * TICK_S)

    def _record(self, time: float) -> None:
        world = self.world
        row = np.empty(_WIDTH)
        row[_FORCE] = world.state.force_N * world.direction
        row[_MOVED] = world.state.displacement_m
        row[_JOINTS] = world.state.joints_rad
        row[_TARGET] = world.q
        row[_TORQUE] = world.torques_per_N * world.state.force_N
        self._history.append(time, row)

    def _vibration(self, t: Array) -> Array:
        waves = np.sin(2.0 * np.pi * t[:, None] * _TONES_HZ + self._phases)
        total: Array = _AMPLITUDE_M * waves.sum(axis=1)
        return total
