"""The small interfaces that a device of each kind meets. A third device needs only these."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from drivers.readings import Reading, RobotState, Signal


class Device(Protocol):
    """Anything that is opened, delivers readings in the background, and is closed.

    `open` connects, identifies the device and starts its background thread or process; it
    returns when the first values have arrived, or raises a `DeviceError` within its deadline.
    `collect` reduces everything since its last call; `latest` peeks at about the last tenth of a
    second. Both raise a `DeviceError` when the device has failed or its values are stale.
    `close` never raises and never hangs, may be called twice, and leaves no thread or process.
    """

    name: str

    @property
    def signals(self) -> Sequence[Signal]:
        """The columns that readings deliver, in their order."""

    def open(self) -> None:
        """Connects, identifies, starts; returns with the first values, or raises DeviceError."""

    def close(self) -> None:
        """Releases everything; never raises."""

    def identity(self) -> Mapping[str, str]:
        """What the device says of itself: model, serial number, versions, settings."""

    def collect(self, since: float = -math.inf) -> Reading:
        """Everything since the last call, reduced; no single value is given twice. What is older
        than `since` (seconds of the clock) is left out where there is anything newer."""

    def latest(self) -> Reading:
        """About the last tenth of a second, collected or not."""


class Robot(Device, Protocol):
    """An arm that stands still. Nothing here moves it but `go_to_reference`."""

    def state(self) -> RobotState:
        """The newest values; raises when they are stale."""

    def go_to_reference(
        self,
        program: str,
        q_rad: Sequence[float],
        tolerance_rad: float,
        deadline_s: float,
        wanted: Callable[[], bool],
    ) -> None:
        """Loads and plays a program taught on the pendant, and verifies the arrival by reading.

        `wanted` is asked all the while; once it says False the program is stopped, and NotWanted
        raised.
        """

    def accept_present_state(self) -> None:
        """The arm was moved on purpose, by hand or pendant: mode and program changes up to now
        are no fault, and the present ones are to be kept. Raises where it does not stand safely."""


class Dynamometer(Device, Protocol):
    """A force sensor. `values` of its readings are tared; the first three signals are
    force_x_N, force_y_N, force_z_N on the robot in its base frame, then moments and raw channels.
    """

    @property
    def reset_by_hand(self) -> bool:
        """Whether a person must turn the amplifier's switch before `reset` and `operate`."""

    def reset(self) -> None:
        """Holds the charge amplifier in Reset (force meaningless) for its settle time.

        Raises NotDischarged where its outputs do not fall to zero.
        """

    def operate(self) -> None:
        """Switches to Operate and waits for the settle time."""

    def tare(self, reading: Reading) -> None:
        """From now on the forces and moments of `reading` (raw channels included) count as zero."""


class DisplacementSensor(Device, Protocol):
    """A laser; first signal `laser_mm`, the distance in its measuring range."""

    range_mm: float


WITHDRAWN = "(withdrawn)"  # what `Loader.ask` returns for a question that was taken back

Command = Literal["pause", "redo_step", "redo_repetition", "skip", "abort"]


@dataclass(frozen=True, slots=True)
class Prompt:
    """A question to the operator; the first of `answers` is what the emulated operator gives."""

    key: str  # "mount", "confirm_move", "unload", "paused", "interrupt", "settle_deadline", ...
    text: str
    answers: tuple[str, ...] = ("ok",)
    # what the emulated rig needs to carry it out: {"q_rad", "direction"} for "mount"
    details: Mapping[str, object] | None = None


@dataclass(frozen=True, slots=True)
class LimitLevel:
    """A watched quantity next to its limit, both in `unit`; `action`: "stop", "pause", "warn"."""

    quantity: str
    value: float
    limit: float
    unit: str
    action: Literal["stop", "pause", "warn"]


Phase = Literal[
    "idle",  # before the first set-up
    "mounting",
    "taring",
    "zero",  # a plateau without load
    "approach",
    "settling",
    "sampling",
    "unloading",
    "rest",
    "paused",
]
Branch = Literal["zero", "loading", "unloading"]


@dataclass(frozen=True, slots=True)
class LiveView:
    """All that the person at the screw sees, ten times a second.

    `stale` names devices whose value is older than its deadline; their numbers must not look live.
    Ages are wall-clock seconds of the newest single value at the time of the view. `step` counts
    from 1 to `steps` over both branches; 0 without a step under way.
    """

    phase: Phase
    pose: str
    direction: str
    repetition: int
    repetitions: int
    step: int
    steps: int
    force_N: float
    target_N: float
    band_N: float
    displacement_mm: float
    stiffness_N_per_mm: float  # of the last points: how far to turn; nan when unknown
    settle_remaining_s: float
    samples: int
    samples_wanted: int
    stale: tuple[str, ...] = ()
    message: str = ""
    branch: Branch = "zero"
    force_age_s: float = 0.0
    displacement_age_s: float = 0.0
    limits: tuple[LimitLevel, ...] = ()


class Loader(Protocol):
    """Whoever turns the screw: a person at a console or a page, or the scripted stand-in."""

    name: str

    def open(self) -> None:
        """Takes the terminal, or connects to the emulated screw."""

    def close(self) -> None:
        """Gives it back; never raises, may be called twice."""

    def identity(self) -> Mapping[str, str]:
        """Who turns the screw, and its pitch."""

    def ask(self, prompt: Prompt) -> str:
        """Blocks until one of `prompt.answers` is given, and returns it, or until `withdraw`."""

    def withdraw(self) -> None:
        """Takes the open question back: its `ask` returns WITHDRAWN. Without one, or where whoever
        is asked answers at once by himself, nothing happens."""

    def guide(self, view: LiveView) -> None:
        """Shows where the force is and where it should go; returns at once."""

    def notify(self, text: str, level: Literal["info", "warning", "error"] = "info") -> None:
        """One line that must reach the operator."""

    def command(self) -> Command | None:
        """What the operator has asked for since the last call, if anything."""
