"""The operator's page as the measurement sees it: told everything, asked for wishes, never awaited.

Methods may be called from the measuring thread and from that of a prompt.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import nan
from typing import Any, Literal, cast

from drivers.clock import Clock
from drivers.errors import DeviceError
from drivers.interfaces import Command, LiveView, Loader, Prompt
from rig.panel.link import Links, PanelLink, PanelOptions, PanelUnavailable
from rig.panel.onlooker import Onlooker
from rig.panel.picture import Moment, setting_of, state_of
from rig.panel.plan import plan_of, prediction_of
from rig.panel.state import DeviceState, Discard, Log, Phase, Sample, Slots
from rig.protocol import MeasurementProtocol
from rig.station import Station

DEVICES = ("robot", "dynamometer", "laser")
COMMANDS: Mapping[str, Command] = {
    "pause": "pause",
    "redo": "redo_step",
    "redo_repetition": "redo_repetition",
    "skip": "skip",
    "abort": "abort",
}
# Events that the operator hears of by other ways, or that say nothing to him.
SILENT_EVENTS = (
    "step_start",
    "limit",
    "not_settled",
    "device_failed",
    "repetition_done",
    "step_left_out",
    "stopped",
    "tared_under_load",
    "top",
    "touched",
    "unloaded_elsewhere",
)
WISHES = 8  # commands that wait to be heard; more is somebody hammering on a button
INVALID_REMEDY = "One is no harm; when it goes on, see the table of faults for this device."

Say = Callable[[str], None]
Level = Literal["info", "warning", "error"]


class Question:
    """A prompt on the page. `done` is set with an answer, or when the operator aborts."""

    def __init__(self, prompt: Prompt, number: int) -> None:
        self.prompt = prompt
        self.id = f"q{number}"
        self.answer: str | None = None
        self.aborted = False
        self.done = threading.Event()


class Panel(Onlooker):
    """Serves the page; all of `Onlooker`, and the operator's wishes."""

    def __init__(self, protocol: MeasurementProtocol, station: Station) -> None:
        self._protocol = protocol
        self._setting = setting_of(protocol, station)
        self._link = PanelLink(self._receive)
        self._lock = threading.Lock()
        self._view: LiveView | None = None
        self._view_at = 0.0
        self._phase_at = 0.0
        self._procedure_s: Callable[[], float] = time.monotonic
        self._question: Question | None = None
        self._questions = 0
        self._wishes: deque[Command] = deque(maxlen=WISHES)
        self._devices = {name: DeviceState(name, "off", "not opened yet") for name in DEVICES}
        self._slots = Slots(0, nan)
        self._rows = 0
        self._session_s = 0.0
        self._ending: tuple[Phase, str] | None = None
        self.attended = False  # somebody sits at the controls on the page

    def start(self, options: PanelOptions) -> Links:
        """Starts to serve; PanelUnavailable if that can't be done."""
        links = self._link.start(options)
        self._link.add({"plan": plan_of(self._protocol, self._setting.pitch_mm)})
        self._link.add({"prediction": prediction_of(self._protocol)})
        self._show()
        return links

    @property
    def trouble(self) -> str:
        """Why the page is no longer served; empty while it is."""
        return self._link.trouble

    def device(self, name: str, fault: DeviceError | None = None) -> None:
        """Lights the device's lamp."""
        if fault is None:
            lamp = DeviceState(name, "ok")
        else:
            lamp = DeviceState(fault.device, "fault", fault.fault, fault.remedy)
        with self._lock:
            self._devices[lamp.name] = lamp
        self._show()

    def record(self, kind: str, data: Mapping[str, Any]) -> None:
        """Passes samples, discards and events on."""
        if kind == "sample":
            self._sample(data)
        elif kind == "event":
            self._session_s = data.get("session_s", self._session_s)
            if data["kind"] == "discard":
                discard = Discard(data["first"], data["last"], data["reason"])
                self._link.add({"discard": discard})
            if data["kind"] not in SILENT_EVENTS:
                self.log(_in_words(data))

    def log(self, text: str, level: Level = "info") -> None:
        """One line for everybody who looks on."""
        self._link.add({"log": Log(self._session_s, level, text)})

    def operator(self, loader: Loader, clock: Clock, *, scripted: bool) -> Loader:
        """The loader with the page beside it."""
        from rig.panel.loader import PanelLoader

        self._procedure_s = clock.now
        return PanelLoader(loader, self, scripted=scripted)

    def look(self, view: LiveView) -> None:
        """The newest live view."""
        with self._lock:
            if self._view is None or view.phase != self._view.phase:
                self._phase_at = self._procedure_s()
            self._view, self._view_at = view, time.monotonic()
        self._show()

    def ask(self, prompt: Prompt) -> Question:
        """Puts a question on the page, until `withdraw`."""
        with self._lock:
            self._questions += 1
            self._question = question = Question(prompt, self._questions)
        self._show()
        return question

    def withdraw(self, question: Question) -> None:
        """The question has been answered, here or elsewhere."""
        with self._lock:
            if self._question is question:
                self._question = None
        self._show()

    def wish(self) -> Command | None:
        """The next command from the page."""
        with self._lock:
            return self._wishes.popleft() if self._wishes else None

    def finish(self, phase: str, text: str) -> None:
        """Shows how it ended and ends the page's process; a second call does nothing."""
        with self._lock:
            if self._ending is not None:
                return
            self._ending = cast("Phase", phase), text
        self.log(text, "info" if phase == "done" else "error")
        self._show()
        self._link.finish(phase, text)

    def _sample(self, data: Mapping[str, Any]) -> None:
        values = data["values"]
        self._session_s = data["session_s"]
        sample = Sample(
            row=self._rows,
            pose=data["pose"],
            direction=data["direction"],
            repetition=data["repetition"],
            step=data["step"],
            branch=data["branch"],
            settled=bool(values["settled"]),
            force_N=values["force_N"],
            displacement_mm=values["displacement_mm"],
            time_s=data["time_s"],
            session_s=data["session_s"],
        )
        self._rows += 1
        with self._lock:
            missed = self._slots.missed + int(values["slots_missed"])
            self._slots = Slots(missed, 1e3 * data["lateness_s"])
            for name, invalid in data["invalid"].items():
                self._note_invalid(name, invalid)
        self._link.add({"sample": sample})

    def _note_invalid(self, name: str, invalid: int) -> None:
        """Single invalid values are a warning until a slot comes without."""
        if self._devices[name].state in ("ok", "warn"):
            reason = f"{invalid} invalid values in the last slot"
            ok = DeviceState(name, "ok")
            warn = DeviceState(name, "warn", reason, INVALID_REMEDY)
            self._devices[name] = warn if invalid else ok

    def _show(self) -> None:
        with self._lock:
            question, ending = self._question, self._ending
            moment = Moment(
                view=self._view,
                view_age_s=time.monotonic() - self._view_at,
                phase_s=self._procedure_s() - self._phase_at,
                prompt=question.prompt if question else None,
                prompt_id=question.id if question else "",
                devices=self._lamps(),
                slots=self._slots,
                ending=ending[0] if ending else None,
                message=ending[1] if ending else "",
            )
            self._link.show(state_of(self._setting, moment))

    def _lamps(self) -> tuple[DeviceState, ...]:
        stale = self._view.stale if self._view else ()
        return tuple(
            replace(lamp, state="warn", reason="no fresh value")
            if lamp.name in stale and lamp.state == "ok"
            else lamp
            for lamp in self._devices.values()
        )

    def _receive(self, message: Mapping[str, Any]) -> None:
        """What the page's process says, in a thread of the link."""
        if "operator" in message:
            self.attended = bool(message["operator"])
            return
        order = message["command"]
        name = order["command"]
        with self._lock:
            question = self._question
            if name == "answer":
                if question is not None and question.id == order["prompt_id"]:
                    question.answer = order["key"]
                    question.done.set()
            elif name == "abort" and question is not None:
                question.aborted = True
                question.done.set()
            elif name in COMMANDS:
                self._wishes.append(COMMANDS[name])


def _in_words(event: Mapping[str, Any]) -> str:
    """An event of the journal for people."""
    if event["kind"] == "repetition_start":
        return f"{event['direction']}, repetition {event['repetition']} begins"
    if event["kind"] == "prompt":
        return f"{event['text']} Answer: {event['answer']}"
    return str(event["text"])


def start_panel(
    protocol: MeasurementProtocol, station: Station, options: PanelOptions, say: Say
) -> Onlooker:
    """The page, its links said; or nobody, and the reason said: it is worth no measurement."""
    panel = Panel(protocol, station)
    try:
        links = panel.start(options)
    except PanelUnavailable as reason:
        say(f"There is no operator's page: {reason}. The measurement goes on without it.")
        return Onlooker()
    say(f"Operator's page: {links.operator}")
    say(f"To look on only: {links.viewer}")
    return panel
