"""From the live view of the person at the screw to the state that the page shows."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nan

from drivers.interfaces import LimitLevel, LiveView, Prompt
from drivers.interfaces import Phase as LivePhase
from drivers.operator.screen import turning
from rig.panel.state import (
    STALE_S,
    Choice,
    DeviceState,
    Displacement,
    Force,
    LimitState,
    Phase,
    PromptState,
    RunState,
    SampleCount,
    SettleState,
    Slots,
    State,
    Turn,
)
from rig.protocol import MeasurementProtocol
from rig.station import Station

BANNER = "EMULATED: no real arm, no real measurement"
PHASES: dict[LivePhase, Phase] = {
    "idle": "starting",
    "mounting": "prompt",
    "taring": "zero",
    "zero": "zero",
    "approach": "turning",
    "unloading": "turning",
    "settling": "settling",
    "sampling": "sampling",
    "rest": "rest",
    "paused": "paused",
}
# What the page calls the answers of the built-in questions.
LABELS = {
    "ok": "Done",
    "continue": "Continue",
    "redo_step": "Redo step",
    "redo_repetition": "Redo repetition",
    "skip": "Skip",
    "abort": "Abort",
    "record": "Record as it is",
    "move": "Move the arm",
    "check again": "Check again",
    "accept": "Accept this pose",
    "clear": "It is clear",
    "touching": "It touches: turn it back",
}


@dataclass(frozen=True)
class Setting:
    """What stays the same during a measurement."""

    protocol: MeasurementProtocol
    emulated: bool
    speed: float
    pitch_mm: float


@dataclass(frozen=True)
class Moment:
    """What changes. `view_age_s`: since the view was made; `phase_s`: seconds of the procedure
    since its phase began; `ending`: how the measurement ended, once it has."""

    view: LiveView | None
    view_age_s: float
    phase_s: float
    prompt: Prompt | None
    prompt_id: str
    devices: tuple[DeviceState, ...]
    slots: Slots
    ending: Phase | None = None
    message: str = ""


def setting_of(protocol: MeasurementProtocol, station: Station) -> Setting:
    """From protocol and station."""
    emulation = station.emulation
    return Setting(
        protocol=protocol,
        emulated=emulation is not None,
        speed=1.0 if emulation is None else emulation.speed,
        pitch_mm=station.operator.screw_pitch_mm,
    )


def state_of(setting: Setting, moment: Moment) -> State:
    """All that the page shows, at the time of the call."""
    protocol, view = setting.protocol, moment.view
    return State(
        emulated=setting.emulated,
        banner=BANNER if setting.emulated else "",
        speed=setting.speed,
        protocol=protocol.title,
        robot=protocol.robot,
        phase=moment.ending or _phase(moment),
        run=_run(protocol, view),
        prompt=None if moment.ending else _prompt(moment),
        force=_force(moment),
        turn=None if moment.ending else _turn(setting, moment),
        displacement=_displacement(moment),
        samples=SampleCount(view.samples, view.samples_wanted) if view else SampleCount(0, 0),
        settle=_settle(protocol, view),
        countdown_s=_countdown_s(protocol, moment),
        limits=tuple(_limit(level) for level in (view.limits if view else ())),
        devices=moment.devices,
        slots=moment.slots,
        message=moment.message or (view.message if view else ""),
    )


def _phase(moment: Moment) -> Phase:
    phase = PHASES[moment.view.phase] if moment.view else "starting"
    if moment.prompt is not None and phase != "paused":
        return "prompt"
    return phase


def _run(protocol: MeasurementProtocol, view: LiveView | None) -> RunState:
    if view is None:
        return RunState("", "", (nan, nan, nan), 0, protocol.repetitions, 0, 0, "zero")
    unit_vector = protocol.directions.get(view.direction, (nan, nan, nan))
    return RunState(
        pose=view.pose,
        direction=view.direction,
        unit_vector=unit_vector,
        repetition=view.repetition,
        repetitions=view.repetitions,
        step=view.step,
        steps=view.steps,
        branch=view.branch,
    )


def _prompt(moment: Moment) -> PromptState | None:
    prompt = moment.prompt
    if prompt is None:
        return None
    choices = tuple(Choice(a, LABELS.get(a, a.replace("_", " "))) for a in prompt.answers)
    return PromptState(moment.prompt_id, prompt.key, prompt.text, choices)


def _force(moment: Moment) -> Force:
    view = moment.view
    if view is None:
        return Force(nan, nan, nan, 0.0, stale=True)
    age_s = view.force_age_s + moment.view_age_s if isfinite(view.force_N) else nan
    old = not age_s <= STALE_S or "dynamometer" in view.stale
    return Force(view.force_N, age_s, view.target_N, view.band_N, old)


def _displacement(moment: Moment) -> Displacement:
    view = moment.view
    if view is None:
        return Displacement(nan, nan, stale=True)
    known = isfinite(view.displacement_mm)
    age_s = view.displacement_age_s + moment.view_age_s if known else nan
    return Displacement(
        view.displacement_mm, age_s, stale=not age_s <= STALE_S or "laser" in view.stale
    )


def _turn(setting: Setting, moment: Moment) -> Turn | None:
    """As the terminal says it: old values and open questions take the hands off the screw."""
    view, prompt = moment.view, moment.prompt
    if prompt is not None:
        return Turn("out", nan, nan, nan) if prompt.key == "unload" else None
    if view is None or view.stale or _force(moment).stale:
        return None
    turn = turning(view, setting.pitch_mm)
    return (
        None if turn is None else Turn(turn.sense, turn.turns, 360 * turn.turns, turn.remaining_N)
    )


def _settle(protocol: MeasurementProtocol, view: LiveView | None) -> SettleState | None:
    if view is None or view.phase != "settling":
        return None
    left_s = view.settle_remaining_s
    reason = "the window fills" if left_s > 0 else "force or displacement still moves"
    return SettleState(left_s, protocol.settle.window_s, reason)


def _countdown_s(protocol: MeasurementProtocol, moment: Moment) -> float:
    """Seconds of the procedure until the phase ends; nan where nobody knows."""
    view = moment.view
    if view is None or moment.prompt is not None or moment.ending:
        return nan
    if view.phase in ("sampling", "zero"):
        return max(0, view.samples_wanted - view.samples) / protocol.sampling.rate_Hz
    if view.phase == "settling":
        return view.settle_remaining_s
    return max(0.0, protocol.rest_s - moment.phase_s) if view.phase == "rest" else nan


def _limit(level: LimitLevel) -> LimitState:
    left = 1.0 - level.value / level.limit if level.limit > 0 else 0.0
    return LimitState(level.quantity, level.value, level.limit, level.unit, left, level.action)
