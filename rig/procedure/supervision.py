"""One look at everything, ten times a second: devices, limits, operator's wishes, Ctrl-C.

Wishes and faults leave the step under way as exceptions, so that no phase of the procedure has
to know them.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from math import nan
from typing import TypedDict, Unpack

from drivers.interfaces import (
    WITHDRAWN,
    Branch,
    Command,
    LimitLevel,
    LiveView,
    Loader,
    Phase,
    Prompt,
)
from rig.errors import MeasurementStopped
from rig.procedure.acquisition import Acquisition
from rig.procedure.limits import UNLOAD, Breach, Live, Watch
from rig.procedure.recorder import Recorder, Slot, Vector

PAUSE_ANSWERS = ("continue", "redo_step", "redo_repetition", "skip", "abort")
# Without a step under way there is nothing that they could mean.
OF_A_STEP = {"redo_step": "redone", "skip": "skipped"}
ONLY_ABORT = "Meanwhile nothing is heard but an abort"
TO_STOP = "Stop the measurement? --resume then measures a repetition under way anew, as a whole."


class Changes(TypedDict, total=False):
    """The fields of `LiveView` that change on the way."""

    phase: Phase
    pose: str
    direction: str
    repetition: int
    step: int
    steps: int
    force_N: float
    target_N: float
    band_N: float
    displacement_mm: float
    stiffness_N_per_mm: float
    settle_remaining_s: float
    samples: int
    samples_wanted: int
    branch: Branch
    force_age_s: float
    displacement_age_s: float
    limits: tuple[LimitLevel, ...]


class Wish(Exception):
    """The operator, or what happened at the screw, wants the step under way to be left. why: in
    words, for what is discarded."""

    def __init__(self, what: Command, why: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.why = why or what.replace("_", " ")


class Supervision:
    """Owns the live view; `tick` is the only wait of the procedure, `ask` its only question."""

    def __init__(
        self,
        acquisition: Acquisition,
        loader: Loader,
        recorder: Recorder,
        watch: Watch,
        checkpoint: Callable[[], None],
        repetitions: int,
    ) -> None:
        self._acquisition = acquisition
        self._loader = loader
        self._recorder = recorder
        self._watch = watch
        self._checkpoint = checkpoint
        self._unit_vector: Vector = (nan, nan, nan)
        self._warned: set[str] = set()
        self._interrupts = 0
        self._moving = False
        self._prompts = 0
        self._paused = False
        self._standing: tuple[Breach, ...] = ()  # limits that pause, passed at the last look
        self.view = LiveView(
            phase="idle",
            pose="",
            direction="",
            repetition=0,
            repetitions=repetitions,
            step=0,
            steps=0,
            force_N=nan,
            target_N=nan,
            band_N=0.0,
            displacement_mm=nan,
            stiffness_N_per_mm=nan,
            settle_remaining_s=0.0,
            samples=0,
            samples_wanted=0,
        )

    def now(self) -> float:
        """Seconds of the session clock."""
        return self._acquisition.now()

    def show(self, **changes: Unpack[Changes]) -> None:
        """Changes fields of the live view."""
        self.view = replace(self.view, **changes)

    def look_along(self, unit_vector: Vector) -> None:
        """The direction whose force component is shown from now on."""
        self._unit_vector = unit_vector

    def restart(self) -> None:
        """After taring or remounting values jump without motion, and warnings are due again."""
        self._watch.restart()
        self._warned.clear()

    def interrupt(self) -> None:
        """Ctrl-C: the first asks at the next tick, the second stops at once; while the arm moves,
        when there are no ticks, so does the first."""
        self._interrupts += 1
        if self._moving or self._interrupts > 1:
            raise KeyboardInterrupt

    @contextmanager
    def moving(self) -> Iterator[Callable[[], bool]]:
        """While the arm moves; gives what tells whether the operator still wants it to."""
        self._moving = True
        try:
            yield self._motion_wanted
        finally:
            self._moving = False

    def _motion_wanted(self) -> bool:
        while (command := self._loader.command()) is not None:
            if command == "abort":
                return False
            self._loader.notify("The arm moves: nothing but an abort is heard.", "warning")
        return not self._interrupts  # one that came before the arm moved

    def tick(self) -> tuple[Live, Slot | None]:
        """Waits for the next tick; watches limits, operator and Ctrl-C on the way."""
        slot = self._acquisition.wait()
        live = self._acquisition.live(self._recorder.displacement_mm)
        force = sum(f * e for f, e in zip(live.force_N, self._unit_vector, strict=True))
        breaches = self._watch.breaches(live)
        self._standing = tuple(b for b in breaches if b.action == "pause")
        self.show(
            force_N=force,
            displacement_mm=live.displacement_mm,
            force_age_s=live.force_age_s,
            displacement_age_s=live.displacement_age_s,
            limits=self._watch.levels,
        )
        self._stop_at(breaches)
        if not self._prompts:  # ahead of a pause, which may leave the step: Ctrl-C is heard always
            self._hear_interrupt()
        for breach in breaches:
            self._on_breach(breach)
        self._loader.guide(self.view)  # during prompts too: unloading is done by the live force
        if not self._prompts:
            self._hear()
        return live, slot

    def ask(self, prompt: Prompt, *, watching: bool = True) -> str:
        """Asks without looking away: limits and devices are watched until the answer comes.

        watching False is for work on the unloaded rig, which looks like any fault: the arm is led
        to its pose, cables are touched, the amplifier is in Reset. A Ctrl-C meanwhile takes the
        question back until it is answered whether to stop: else one would have to confirm what one
        does not want; a motion of the arm is called off unasked.
        """
        while True:
            answer = self._ask(prompt, watching)
            if answer not in ("abort", "move"):
                self._hear_interrupt(watching)
            if answer != WITHDRAWN:
                return answer

    def _ask(self, prompt: Prompt, watching: bool) -> str:
        answer: Future[str] = Future()

        def wait_for_answer() -> None:
            try:
                answer.set_result(self._loader.ask(prompt))
            except BaseException as error:  # noqa: BLE001 - raised again by result()
                answer.set_exception(error)

        thread = threading.Thread(target=wait_for_answer, name="prompt", daemon=True)
        self._prompts += 1
        interrupts = self._interrupts
        thread.start()
        try:
            while thread.is_alive():
                if self._interrupts > interrupts:
                    self._loader.withdraw()
                if watching:
                    self.tick()
                else:
                    thread.join(0.05)
        finally:
            self._prompts -= 1
        if answer.result() != WITHDRAWN:
            self._recorder.event("prompt", prompt.text, key=prompt.key, answer=answer.result())
        return answer.result()

    def answers(self, answers: tuple[str, ...]) -> tuple[str, ...]:
        """Those of `answers` that mean something now."""
        return tuple(a for a in answers if self.view.step or a not in OF_A_STEP)

    def obey(self, answer: str) -> None:
        """Turns an answer or a command into what it asks for; others do nothing."""
        if answer == "abort":
            raise MeasurementStopped(f"the operator ended the measurement. {UNLOAD}")
        if answer == "redo_step":
            raise Wish("redo_step")
        if answer == "redo_repetition":
            raise Wish("redo_repetition")
        if answer == "skip":
            raise Wish("skip")

    def _hear_interrupt(self, watching: bool = True) -> None:
        if self._interrupts:
            prompt = Prompt("interrupt", TO_STOP, ("abort", "continue"))
            answer = self._ask(prompt, watching)
            self._interrupts = 0
            self.obey(answer)

    def _hear(self) -> None:
        """What the operator has asked for since the last tick."""
        command = self._loader.command()
        if self._paused and command not in (None, "abort"):
            self._loader.notify(f"{ONLY_ABORT}.", "warning")
        elif command == "pause":
            self._pause("Paused. The arm may be under load.")
        elif command is not None and command in OF_A_STEP and not self.view.step:
            done = OF_A_STEP[command]
            self._loader.notify(f"No step is under way that could be {done}.", "warning")
        elif command is not None:
            self.obey(command)

    def _pause(self, text: str) -> None:
        self._recorder.event("pause", text)
        phase = self.view.phase
        self.show(phase="paused")
        self._checkpoint()
        self._acquisition.leave_out_slots()
        self._paused = True
        try:
            answer = self.ask(Prompt("paused", text, self.answers(PAUSE_ANSWERS)))
            if answer != "abort":
                self._wait_for_limits()
        finally:
            self._paused = False
        self.show(phase=phase)
        self._recorder.event("resume", f"after the pause: {answer}")
        # What was under way before a pause of unknown length is measured again from its start.
        self.obey("redo_step" if answer == "continue" and self.view.step else answer)

    def _wait_for_limits(self) -> None:
        """Going on beyond a limit would only pause again, and again."""
        told = False
        while self._standing:
            self.tick()
            if self._standing and not told:
                told = True
                text = (
                    f"Still paused: {self._standing[0].text}. It goes on once that is within its "
                )
                self._loader.notify(f"{text}limit. {ONLY_ABORT} or Ctrl-C.", "warning")

    def _stop_at(self, breaches: list[Breach]) -> None:
        for breach in breaches:
            if breach.action == "stop":
                self._recorder.event("limit", breach.text, action="stop")
                # The limit follows as the command's last word, once the data are safe.
                self._loader.notify(f"Stopped at a limit of {breach.quantity}. {UNLOAD}", "error")
                raise MeasurementStopped(f"{breach.text}; the measurement is stopped. {UNLOAD}")

    def _on_breach(self, breach: Breach) -> None:
        if breach.action == "pause" and not self._prompts and not self._paused:
            self._recorder.event("limit", breach.text, action="pause")
            self._pause(f"{breach.text}. {UNLOAD}")
        elif breach.quantity not in self._warned:
            self._warned.add(breach.quantity)
            self._recorder.event("limit", breach.text, action="warn")
            self._loader.notify(breach.text, "warning")
