"""A rig without bytes and without waiting: devices in memory on a clock that jumps.

For the procedure only; what the devices do on the wire is tested in tests/wire.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from drivers.clock import Clock
from drivers.errors import DeviceError, NotDischarged, NotWanted
from drivers.interfaces import Command, LiveView, Prompt
from drivers.readings import Reading, RobotState, Signal


class JumpClock(Clock):
    """Sleeping moves the time on at once."""

    def __init__(self) -> None:
        super().__init__()
        self.t = 0.0

    def now(self) -> float:
        return self.t

    def sleep_until(self, when: float) -> None:
        self.t = max(self.t, when)

    def sleep(self, seconds: float) -> None:
        self.t += max(0.0, seconds)


@dataclass
class Arm:
    """A spring: displacement u mm under the screw's advance; 100 N/mm up to `yield_N`."""

    clock: JumpClock
    stiffness: float = 100.0
    yield_N: float = 1e9
    u: float = 0.0
    q: tuple[float, ...] = (0.0,) * 6
    broken: dict[str, DeviceError] = field(default_factory=dict)
    tared_at: float = 0.0
    offset_N: float = 3.0  # what the amplifier shows before taring
    temperature_C: float = 30.0  # of all joints

    @property
    def force(self) -> float:
        return min(self.stiffness * max(self.u, 0.0), self.yield_N)


class FakeDevice:
    name = "device"
    signals: tuple[Signal, ...] = ()

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.since = -math.inf  # of the last `collect`

    def open(self) -> None: ...
    def close(self) -> None: ...

    def identity(self) -> Mapping[str, str]:
        return {"model": "fake"}

    def values(self) -> tuple[float, ...]:
        raise NotImplementedError

    def latest(self) -> Reading:
        if self.name in self.arm.broken:
            raise self.arm.broken[self.name]
        t = self.arm.clock.now()
        values = self.values()
        return Reading(t - 0.1, t, values, (0.0,) * len(values), 10, 0, 0.0, "emulated+fake")

    def collect(self, since: float = -math.inf) -> Reading:
        self.since = since
        return self.latest()


class FakeRobot(FakeDevice):
    name = "robot"
    signals = tuple(Signal(f"q{i}_rad", "rad", f"joint {i}") for i in range(1, 7))
    moved: tuple[str, ...] = ()
    on_the_way: Callable[[], None] = staticmethod(lambda: None)

    def values(self) -> tuple[float, ...]:
        return self.arm.q

    def accept_present_state(self) -> None:
        self.arm.broken.pop("robot", None)

    def state(self) -> RobotState:
        return RobotState(
            self.arm.q, self.arm.q, (self.arm.temperature_C,) * 6, 7, 1, 1, 2, 0.0, 0.0
        )

    def go_to_reference(
        self,
        program: str,
        q_rad: object,
        tolerance_rad: float,
        deadline_s: float,
        wanted: Callable[[], bool],
    ) -> None:
        self.moved = (*self.moved, program)
        self.on_the_way()
        if not wanted():
            raise NotWanted(self.name, f'the program "{program}" was called off', "Look at it.")


class FakeDynamometer(FakeDevice):
    name = "dynamometer"
    signals = tuple(Signal(f"force_{a}_N", "N", a) for a in "xyz")
    reset_by_hand = False
    charged = 0  # so often the switch stands elsewhere when it should be at Reset

    def values(self) -> tuple[float, ...]:
        return (self.arm.force + self.arm.offset_N, 0.0, 0.0)

    def reset(self) -> None:
        self.charged -= 1
        if self.charged >= 0:
            raise NotDischarged(self.name, "in Reset channel 1 still shows 2.00 V", "Turn it.")
        self.arm.offset_N = 3.0

    def operate(self) -> None: ...

    def tare(self, reading: Reading) -> None:
        self.arm.offset_N -= reading.values[0]


class FakeLaser(FakeDevice):
    name = "laser"
    signals = (Signal("laser_mm", "mm", "distance"),)
    range_mm = 10.0

    def values(self) -> tuple[float, ...]:
        return (5.0 + self.arm.u,)


@dataclass
class FakeLoader:
    """Turns straight to the target. `script` may act on every look at the live view."""

    arm: Arm
    answers: dict[str, list[str]] = field(default_factory=dict)
    script: Callable[[LiveView], None] = lambda _view: None
    asked: list[Prompt] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    commands: list[Command] = field(default_factory=list)
    views: list[LiveView] = field(default_factory=list)
    name: str = "operator"

    def open(self) -> None: ...
    def close(self) -> None: ...

    def identity(self) -> Mapping[str, str]:
        return {"operator": "fake"}

    def ask(self, prompt: Prompt) -> str:
        self.asked.append(prompt)
        if prompt.key in ("unload", "mount"):
            self.arm.u = -0.5
        if prompt.key == "mount" and prompt.details:
            self.arm.q = tuple(prompt.details["q_rad"])  # type: ignore[call-overload]
        given = self.answers.get(prompt.key)
        if given:
            return given.pop(0)
        return prompt.answers[0] if prompt.answers else "because"

    def withdraw(self) -> None: ...

    def guide(self, view: LiveView) -> None:
        self.views.append(view)
        self.script(view)
        if view.phase == "approach":
            wanted = view.target_N / self.arm.stiffness
            if view.target_N > self.arm.yield_N:
                wanted = self.arm.u + 0.1
            self.arm.u += max(-0.2, min(0.2, wanted - self.arm.u))

    def notify(self, text: str, level: Literal["info", "warning", "error"] = "info") -> None:
        self.said.append(text)

    def command(self) -> Command | None:
        return self.commands.pop(0) if self.commands else None
