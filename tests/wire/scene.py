"""A scene without physics: force, displacement and pose are what the test sets."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np

from drivers.arrays import Array
from drivers.clock import Clock
from drivers.scene import ArmSignals


class StillScene:
    """Meets `drivers.scene.Scene`; every signal is constant until the test changes it.

    force (3) N, displacement m, q and q_target (6) rad, tcp_pose (6) m and rad, current (6) A,
    temperatures (6) deg C. `turn` adds its advance to the displacement and `stiffness` times it
    to the force along x; `move` sets the pose at once.
    """

    def __init__(self, speed: float = 1.0, stiffness_N_per_m: float = 0.0) -> None:
        self.clock = Clock(speed)
        self.speed = speed
        self.stiffness_N_per_m = stiffness_N_per_m
        self.force = np.zeros(3)
        self.displacement = 0.0
        self.q = np.zeros(6)
        self.q_target = np.zeros(6)
        self.pose = np.array([0.75, 0.0, 0.4, 0.0, 3.14, 0.0])
        self.current = np.linspace(0.5, 3.0, 6)
        self.temperatures_C = np.linspace(28.0, 33.0, 6)
        self.mounts: list[tuple[float, ...]] = []
        self.turns: list[float] = []
        self._lock = threading.Lock()

    def now(self) -> float:
        return self.clock.now()

    def force_N(self, t: Array) -> Array:
        with self._lock:
            return np.tile(self.force, (len(t), 1))

    def displacement_m(self, t: Array) -> Array:
        with self._lock:
            return np.full(len(t), self.displacement)

    def arm(self, t: Array) -> ArmSignals:
        def rows(values: Array) -> Array:
            return np.tile(values, (len(t), 1))

        with self._lock:
            return ArmSignals(
                q=rows(self.q),
                q_target=rows(self.q_target),
                tcp_pose=rows(self.pose),
                current=rows(self.current),
                target_current=rows(self.current),
                temperatures_C=rows(self.temperatures_C),
            )

    def turn(self, advance_m: float) -> None:
        with self._lock:
            self.turns.append(advance_m)
            self.displacement += advance_m
            self.force = self.force + np.array([self.stiffness_N_per_m * advance_m, 0.0, 0.0])

    def mount(self, direction: Sequence[float]) -> None:
        with self._lock:
            self.mounts.append(tuple(direction))
            self.force = np.zeros(3)
            self.displacement = 0.0

    def move(self, q_rad: Sequence[float]) -> None:
        with self._lock:
            self.q = np.array(q_rad, dtype=float)
            self.q_target = self.q.copy()
