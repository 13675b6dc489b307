"""What travels to the page: one state ten times a second, and items that are kept for the run.

The page opens `GET /events?token=T&client=C&last=I` (server-sent events, no `event:` field: all
arrive as "message"). I is the last id that it holds, or empty: a Last-Event-ID that a page can
set. Each message is one JSON object of these kinds, told apart by its keys:

    {"seq": ...}           a `State`, see below: the newest only, never queued; carries no id.
    {"batch": [item, ...]} one or more `Item`s; the SSE id names the last of them. A viewer who
                           comes late or reloads gets all of them; who reconnects, those after
                           his last id.
    {"reset": run id}      forget all items: another run, or the gap can't be filled. Items follow.
    {"recent": [[t_s, force_N, displacement_mm], ...]}  the last two minutes, once in each stream
                           before its first state: in place of what the viewer kept of them.
    {"end": {"phase", "text"}}  the last message: the measurement is over; don't reconnect.

Items, each an object with one key:

    {"plan": Plan}  {"prediction": {"P1|x": [[force_N, displacement_mm], ...]}}
    {"sample": Sample}  {"discard": Discard}  {"log": Log}

Commands are `POST /command` with `Content-Type: application/json`, the headers `X-Panel-Token: T`
and `X-Panel-Client: C`, and a `CommandRequest` as body. T is `token` in the page's own address,
C any random word of the page's (8 to 64 of [A-Za-z0-9_-], kept over a reload). The reply is
`{"ok": true}` (it was passed on; what follows from it comes by the stream) or
`{"ok": false, "error": words for the operator}` with a status of 400 and more.

Numbers that are not known are null. Times in s; `speed` of an emulated run counts for
`settle`, `countdown_s`, `time_s` and `session_s`, which are seconds of the procedure.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Literal

Phase = Literal[
    "starting",  # devices are being opened
    "prompt",
    "turning",
    "settling",
    "sampling",
    "zero",
    "paused",
    "rest",
    "done",
    "aborted",
    "fault",
]
CommandName = Literal[
    "pause",
    "resume",
    "redo",  # the step; "redo_repetition" the whole repetition
    "redo_repetition",
    "skip",
    "abort",
    "answer",  # with prompt_id and key
    "take_over",  # become the operator; needs the operator's token, as all commands do
]
COMMANDS: tuple[CommandName, ...] = (
    "pause",
    "resume",
    "redo",
    "redo_repetition",
    "skip",
    "abort",
    "answer",
    "take_over",
)
STALE_S = 1.0  # older values must not look live
BRANCHES = ("zero", "loading", "unloading")


@dataclass(frozen=True, slots=True)
class RunState:
    """Where in the protocol. `unit_vector` (3) in the base frame; steps count from 1, 0: none."""

    pose: str
    direction: str
    unit_vector: tuple[float, float, float]
    repetition: int
    repetitions: int
    step: int
    steps: int
    branch: str


@dataclass(frozen=True, slots=True)
class Choice:
    """One answer: `key` goes back, `label` is for people."""

    key: str
    label: str


@dataclass(frozen=True, slots=True)
class PromptState:
    """A question. Without choices it wants one line of free text as `key` of the answer."""

    id: str
    kind: str  # "mount", "unload", "paused", "interrupt", "step_deadline", ...
    text: str
    choices: tuple[Choice, ...]


@dataclass(frozen=True, slots=True)
class Force:
    """Along the direction, tared; `band_N` is the half width about the target."""

    N: float
    age_s: float
    target_N: float
    band_N: float
    stale: bool


@dataclass(frozen=True, slots=True)
class Displacement:
    """Along the direction since the datum."""

    mm: float
    age_s: float
    stale: bool


@dataclass(frozen=True, slots=True)
class Turn:
    """What to do with the screw; turns and degrees null while the stiffness is unknown."""

    sense: Literal["in", "out", "hold"]
    turns: float
    degrees: float
    remaining_N: float


@dataclass(frozen=True, slots=True)
class SettleState:
    """Countdown of the settling window; at 0 `reason` says what is still waited for."""

    left_s: float
    of_s: float
    reason: str


@dataclass(frozen=True, slots=True)
class LimitState:
    """A watched limit; `left_fraction` 1 at zero, 0 at the limit, negative beyond."""

    name: str
    value: float
    limit: float
    unit: str
    left_fraction: float
    action: str  # "stop", "pause", "warn"


@dataclass(frozen=True, slots=True)
class DeviceState:
    """A lamp. `reason` and `remedy` are empty while all is well."""

    name: str
    state: Literal["ok", "warn", "fault", "off"]
    reason: str = ""
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class Slots:
    """Missed since the start, and lateness of the last slot."""

    missed: int
    late_ms: float


@dataclass(frozen=True, slots=True)
class SampleCount:
    """Of the step or zero plateau under way."""

    taken: int
    wanted: int


@dataclass(frozen=True, slots=True)
class State:
    """Everything that the page shows now, as the measuring process gives it.

    The server adds three keys: "seq" (counts the states), "t_s" (its monotonic clock) and
    "operator": {"you": this viewer may command now, "taken": somebody may, "may_take": this viewer
    has the operator's link}; and it makes `age_s` and `stale` true for the moment of sending.
    """

    emulated: bool
    banner: str  # what a band across the page says; empty for real measurements
    speed: float
    protocol: str
    robot: str
    phase: Phase
    run: RunState
    prompt: PromptState | None
    force: Force
    turn: Turn | None
    displacement: Displacement
    samples: SampleCount
    settle: SettleState | None
    countdown_s: float
    limits: tuple[LimitState, ...]
    devices: tuple[DeviceState, ...]
    slots: Slots
    message: str


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """Force levels along one direction in one pose."""

    pose: str
    direction: str
    unit_vector: tuple[float, float, float]
    forces_N: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Plan:
    """What the run is going to be. `arms`: by pose, the joints' and the loaded point's positions
    in the base frame (mm), base first: the arm as a line of segments."""

    title: str
    robot: str
    repetitions: int
    screw_pitch_mm: float
    rate_Hz: float
    runs: tuple[PlannedRun, ...]
    arms: Mapping[str, tuple[tuple[float, float, float], ...]]


@dataclass(frozen=True, slots=True)
class Sample:
    """A recorded row: on disk before it comes here. `row` counts from 0 over the data set."""

    row: int
    pose: str
    direction: str
    repetition: int
    step: int
    branch: str
    settled: bool
    force_N: float
    displacement_mm: float
    time_s: float
    session_s: float


@dataclass(frozen=True, slots=True)
class Discard:
    """Rows first to last, both included, are not to be used: measured again, or disturbed."""

    first: int
    last: int
    reason: str


@dataclass(frozen=True, slots=True)
class Log:
    """One line for the operator."""

    session_s: float
    level: Literal["info", "warning", "error"]
    text: str


def to_json(value: object) -> bytes:
    """Compact JSON of a dataclass, mapping or sequence; nan and infinity become null."""
    return json.dumps(_plain(value), separators=(",", ":"), ensure_ascii=False).encode()


def _plain(value: object) -> Any:
    if isinstance(value, float):
        return round(value, 6) if math.isfinite(value) else None
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value
