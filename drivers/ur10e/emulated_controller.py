"""The state of the emulated controller: modes, program, and the values of its variables."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drivers.scene import Scene
from drivers.ur10e import words
from drivers.ur10e.words import Modes

MOVE_S = 4.0  # seconds of the scene that a program's motion takes
HOLDING = "hold.urp"
_UPTIME_S = 100.0  # a controller has been on for a while when somebody connects
_ENCODER_SD_RAD = 1e-5
_ENCODER_DIGIT_RAD = 2 * np.pi / 2**20
_POSE_SD = 1e-5  # m and rad
_SPEED_SD_RAD_PER_S = 2e-4
_CURRENT_SD_A = 0.02
_TEMPERATURE_DIGIT_C = 0.1
_DEVIATION_RAD = np.deg2rad(10.0)
_HOT_C = 85.0
_NORMAL = Modes(words.RUNNING, words.NORMAL, 1 << 0, words.PLAYING)
_STOPPED_BITS = 1 << 10


@dataclass(frozen=True)
class _Motion:
    start_s: float
    q_start: tuple[float, ...]
    q_goal: tuple[float, ...]

    def at(self, now: float) -> tuple[list[float], list[float]]:
        """Angles rad and speeds rad/s on a cosine-shaped way."""
        phase = min(1.0, max(0.0, (now - self.start_s) / MOVE_S))
        way = (1 - np.cos(np.pi * phase)) / 2
        rate = np.pi / 2 / MOVE_S * np.sin(np.pi * phase)
        ends = list(zip(self.q_start, self.q_goal, strict=True))
        return [a + (b - a) * way for a, b in ends], [(b - a) * rate for a, b in ends]


class Controller:
    """Thread-safe. A program moves to its pose and then holds, or ends with `programs_end`."""

    def __init__(
        self,
        scene: Scene,
        programs: Mapping[str, Sequence[float]],
        seed: int,
        programs_end: bool,
    ) -> None:
        self._scene = scene
        self.programs = {name: tuple(q) for name, q in programs.items()}
        self._programs_end = programs_end
        self._noise = np.random.default_rng(seed)
        self._lock = threading.RLock()
        self._motion: _Motion | None = None
        self._faults: set[str] = set()
        self._frozen_s: float | None = None
        self.modes = _NORMAL
        self.loaded = HOLDING
        self.commands: deque[str] = deque(maxlen=1000)  # what the Dashboard was told

    def fault(self, name: str) -> None:
        """Shows a fault of the arm from now on; others change nothing here."""
        with self._lock:
            self._faults.add(name)
            if name == "frozen_timestamp":
                self._frozen_s = self._timestamp()
            elif name == "program_stopped":
                self._interrupt(self.modes._replace(runtime_state=words.STOPPED))
            elif name == "protective_stop":
                bits = 1 << 2 | _STOPPED_BITS
                mode = words.PROTECTIVE_STOP
                self._interrupt(Modes(words.RUNNING, mode, bits, words.PAUSED))
            elif name == "emergency_stop":
                bits = 1 << 6 | 1 << 7 | _STOPPED_BITS
                self._interrupt(Modes(3, words.ROBOT_EMERGENCY_STOP, bits, words.STOPPED))

    def load(self, program: str) -> bool:
        """Whether the program is known; it is then the loaded one, and stopped."""
        with self._lock:
            if program != HOLDING and program not in self.programs:
                return False
            self._interrupt(self.modes._replace(runtime_state=words.STOPPED))
            self.loaded = program
            return True

    def play(self) -> bool:
        """Starts the loaded program, if the arm is in a state to follow it."""
        with self._lock:
            if words.unsafe(self.modes) is not None:
                return False
            self.modes = self.modes._replace(runtime_state=words.PLAYING)
            goal = self.programs.get(self.loaded)
            if goal is not None:
                now = self._scene.now()
                q = self._scene.arm(np.array([now])).q_target[0]
                self._motion = _Motion(now, tuple(float(v) for v in q), goal)
            return True

    def stop(self) -> None:
        """Ends the program; the arm stays where it is."""
        with self._lock:
            self._interrupt(self.modes._replace(runtime_state=words.STOPPED))

    def values(self) -> dict[str, tuple[float, ...]]:
        """All variables now, as `rtde.VARIABLES` names them."""
        with self._lock:
            self._advance()
            now = self._scene.now()
            arm = self._scene.arm(np.array([now]))
            q, q_target = arm.q[0].copy(), arm.q_target[0].copy()
            speed = np.zeros(6)
            if self._motion is not None:
                angles, rates = self._motion.at(now)
                q, q_target, speed = np.array(angles), np.array(angles), np.array(rates)
            temperatures = arm.temperatures_C[0].copy()
            if "joint_deviation" in self._faults:
                q[0] += _DEVIATION_RAD
            if "hot_joint" in self._faults:
                temperatures[2] = _HOT_C
            return {
                "timestamp": (self._timestamp(),),
                "actual_q": self._encoders(q),
                "target_q": tuple(q_target),
                "actual_qd": self._noisy(speed, _SPEED_SD_RAD_PER_S),
                "actual_TCP_pose": self._noisy(arm.tcp_pose[0], _POSE_SD),
                "actual_current": self._noisy(arm.current[0], _CURRENT_SD_A),
                "target_current": tuple(arm.target_current[0]),
                "joint_temperatures": tuple(_digits(temperatures, _TEMPERATURE_DIGIT_C)),
                "robot_mode": (self.modes.robot_mode,),
                "safety_mode": (self.modes.safety_mode,),
                "safety_status_bits": (self.modes.safety_status_bits,),
                "runtime_state": (self.modes.runtime_state,),
            }

    def _timestamp(self) -> float:
        return self._scene.now() + _UPTIME_S if self._frozen_s is None else self._frozen_s

    def _advance(self) -> None:
        """Hands a motion that has arrived to the scene."""
        motion = self._motion
        if motion is not None and self._scene.now() - motion.start_s >= MOVE_S:
            self._motion = None
            self._scene.move(motion.q_goal)
            if self._programs_end:
                self.modes = self.modes._replace(runtime_state=words.STOPPED)

    def _interrupt(self, modes: Modes) -> None:
        self._advance()
        self.modes = modes
        if self._motion is not None:
            self._scene.move(self._motion.at(self._scene.now())[0])
            self._motion = None

    def _encoders(self, q: np.ndarray) -> tuple[float, ...]:
        noisy = q + self._noise.normal(0.0, _ENCODER_SD_RAD, 6)
        return tuple(_digits(noisy, _ENCODER_DIGIT_RAD))

    def _noisy(self, values: np.ndarray, sd: float) -> tuple[float, ...]:
        return tuple(values + self._noise.normal(0.0, sd, len(values)))


def _digits(values: np.ndarray, digit: float) -> np.ndarray:
    rounded: np.ndarray = np.round(values / digit) * digit
    return rounded
