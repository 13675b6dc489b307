"""One force step: guide the hand into the band, let the arm settle, sample."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import Any

from drivers.interfaces import Loader, Prompt
from rig.errors import MeasurementStopped
from rig.procedure.limits import UNLOAD
from rig.procedure.recorder import Place, Recorder, Slot, Vector, along
from rig.procedure.settle import SettleWindow
from rig.procedure.supervision import Supervision, Wish
from rig.procedure.touched import Touched
from rig.procedure.unloaded import Unloaded
from rig.protocol import MeasurementProtocol, Run, Step


class TopReached(Exception):
    """The displacement is above the run's own limit, and the screw would have to push on. Of
    loading, what was reached is recorded."""


@dataclass(frozen=True, slots=True)
class Where:
    """The repetition of a run under way; `start_s` is where its `time_s` begins."""

    index: int
    run: Run
    repetition: int
    unit_vector: Vector
    start_s: float = nan
    segment: int = 0


class StepProcedure:
    """Measures one step after the other; knows nothing of runs, taring and repetitions."""

    def __init__(
        self,
        protocol: MeasurementProtocol,
        supervision: Supervision,
        recorder: Recorder,
        loader: Loader,
        unloaded: Unloaded,
    ) -> None:
        self._protocol = protocol
        self._supervision = supervision
        self._recorder = recorder
        self._loader = loader
        self._unloaded = unloaded
        self._window = SettleWindow(protocol.settle)
        self._done: list[tuple[float, float]] = []  # (force N, displacement mm), unloaded first
        self.restart()

    def restart(self) -> None:
        """A new setup: earlier steps say nothing about how far to turn."""
        self._done = [(0.0, 0.0)]

    def measure(self, where: Where, step: Step, place: tuple[int, int]) -> str:
        """Carries out the step and returns how it went, in words. place: which step of how many,
        as it is shown; levels share their number with those of the other branch."""
        show = self._supervision.show
        half_width = self._protocol.force_band.half_width_N(step.target_N)
        position, steps = place
        show(step=position, steps=steps, target_N=step.target_N, band_N=half_width)
        show(branch=step.branch)
        show(samples=0, samples_wanted=self._protocol.samples_of_step)
        deadline = self._supervision.now() + self._protocol.step_deadline_s
        while True:
            first_row = self._recorder.rows
            try:
                reached = self._approach(where, step, deadline)
            except TopReached:
                self._top(where, step)
                raise
            settled = self._settle(where, step, banded=reached)
            if settled != "left the band":
                break
            why = "the force left its band while settling"
            if self.below(where, step, again=True):
                raise Wish("redo_step", why)
            self._recorder.discard(first_row, why)
        self._sample(where, step, settled=settled == "settled")
        view = self._supervision.view
        self._done.append((view.force_N, view.displacement_mm))
        words = ["measured"] if reached else ["band not reached"]
        return ", ".join(words if settled == "settled" else [*words, settled])

    def _top(self, where: Where, step: Step) -> None:
        """Records, as a level outside of its band, what loading has reached where it ends: an arm
        that gives way has come far beyond the last level, and remembers it."""
        loading = step.branch == "loading"
        text = f"displacement is above {where.run.stop_at_displacement_mm:g} mm"
        self.event(where, "top", text, branch=step.branch, step=step.number)
        ends = "loading ends here, and is recorded" if loading else "this level is left out"
        self._loader.notify(f"{step.branch} to {step.target_N:g} N: {text}; {ends}")
        if loading:
            settled = self._settle(where, step, banded=False)
            self._sample(where, step, settled=settled == "settled")

    def below(self, where: Where, step: Step, *, again: bool) -> bool:
        """Whether an unloading step would have to be reached from below: that is loading, and might
        drive an arm on that has given way. Again: the hand may have loosened too far, but not to
        the next level."""
        if step.branch != "unloading":
            return False
        half_width_N = self._protocol.force_band.half_width_N
        lowest_N = step.target_N - half_width_N(step.target_N)
        if again:
            next_N = max((f for f in where.run.forces_N if f < step.target_N), default=0.0)
            lowest_N = next_N + half_width_N(next_N)
        return self._supervision.view.force_N < lowest_N

    def _approach(self, where: Where, step: Step, deadline: float) -> bool:
        """Guides the hand until the force is in its band; False if it was given up."""
        top = where.run.stop_at_displacement_mm
        self._supervision.show(phase="approach", stiffness_N_per_mm=self._stiffness())
        while True:
            live, _ = self._supervision.tick()
            view = self._supervision.view
            if abs(view.force_N - step.target_N) <= view.band_N:
                return True
            pushing = step.branch == "loading" or view.force_N < step.target_N
            if top is not None and pushing and live.displacement_mm > top:
                raise TopReached
            if self._supervision.now() > deadline:
                if self._give_up(where, step):
                    return False
                deadline = self._supervision.now() + self._protocol.step_deadline_s

    def _give_up(self, where: Where, step: Step) -> bool:
        text = (
            f"{step.target_N:g} N were not reached within {self._protocol.step_deadline_s:g} s; "
            f"the force is {self._supervision.view.force_N:.4g} N"
        )
        answers = ("record", "continue", "skip", "abort")
        answer = self._supervision.ask(Prompt("step_deadline", f"{text}.", answers))
        if answer == "record":
            self.event(where, "band_not_reached", text, step=step.number)
            return True
        self._supervision.obey(answer)
        return False

    def _settle(self, where: Where, step: Step, *, banded: bool) -> str:
        """Hands off; records while the arm comes to rest. Returns how it ended."""
        start = self._supervision.now()
        self._window.restart(start)
        while not self._window.settled(self._supervision.now()):
            now = self._supervision.now()
            remaining = self._window.remaining_s(now)
            self._supervision.show(phase="settling", settle_remaining_s=remaining)
            live, slot = self._supervision.tick()
            view = self._supervision.view
            self._window.add(live.t, view.force_N, live.displacement_mm)
            if slot is not None:
                self.record(slot, where, step, settled=False)
            # The arm relaxes a little: twice the band is still this step, more is another force.
            if banded and abs(view.force_N - step.target_N) > 2 * view.band_N:
                return "left the band"
            if now - start > self._protocol.settle.deadline_s:
                return self._not_settled(where, step)
        return "settled"

    def _not_settled(self, where: Where, step: Step) -> str:
        settle = self._protocol.settle
        text = f"step {step.number} has not settled within {settle.deadline_s:g} s"
        self.event(where, "not_settled", text, step=step.number)
        if settle.at_deadline == "stop":
            raise MeasurementStopped(f"{text}; the protocol stops there. {UNLOAD}")
        if settle.at_deadline == "ask":
            answers = self._supervision.answers(("record", "redo_step", "skip", "abort"))
            self._supervision.obey(
                self._supervision.ask(Prompt("settle_deadline", f"{text}.", answers))
            )
        else:
            self._loader.notify(f"{text}; it is recorded, and marked as not settled", "warning")
        return "not settled"

    def _sample(self, where: Where, step: Step, *, settled: bool) -> None:
        taken = 0
        touched = Touched(self._protocol.settle, self._supervision.view.band_N)
        while taken < self._protocol.samples_of_step:
            self._supervision.show(phase="sampling", settle_remaining_s=0.0, samples=taken)
            _, slot = self._supervision.tick()
            view = self._supervision.view
            if what := touched.look(self._supervision.now(), view.force_N, view.displacement_mm):
                self._touched(where, step, what)
            if slot is not None and self.record(slot, where, step, settled=settled):
                taken += 1

    def _touched(self, where: Where, step: Step, what: str) -> None:
        text = f"{step.branch} to {step.target_N:g} N: while it was sampled {what}"
        self.event(where, "touched", text, branch=step.branch, step=step.number)
        self._loader.notify(
            f"{text}. The screw was turned, or the arm was touched: the step is measured again. "
            "After a large change redo the repetition: an arm remembers.",
            "warning",
        )
        raise Wish("redo_step", "screw or arm were moved while it was sampled")

    def zero_plateau(self, where: Where, seconds: float) -> None:
        """Samples without load for so long, once the unloaded arm has settled."""
        zero = Step(0, "zero", 0.0)
        wanted = round(seconds * self._protocol.sampling.rate_Hz)
        if wanted == 0:
            return
        self._supervision.show(step=0, target_N=0.0, band_N=0.0, samples=0, samples_wanted=wanted)
        self._supervision.show(branch="zero")
        settled = self._settle(where, zero, banded=False) == "settled"
        taken = 0
        while taken < wanted:
            self._supervision.show(phase="zero", samples=taken)
            _, slot = self._supervision.tick()
            if slot is not None and self.record(slot, where, zero, settled=settled):
                taken += 1

    def record(self, slot: Slot, where: Where, step: Step, *, settled: bool) -> bool:
        """Writes the slot; False, and an event, if a device had no valid value in it.

        Values that were lost before the slot could hold them are an event and a warning.
        """
        if lost := slot.lost():
            values = ", ".join(f"{count} values of {name}" for name, count in lost.items())
            text = f"{values} before slot {slot.number} were lost: the program was held up"
            self.event(where, "values_lost", text, lost=lost)
            self._loader.notify(text, "warning")
        missing = slot.without_value()
        if missing:
            text = f"no valid value from {', '.join(missing)} in slot {slot.number}"
            self.event(where, "no_value", text)
            return False
        place = Place(
            pose=where.run.pose,
            direction=where.run.direction,
            unit_vector=where.unit_vector,
            repetition=where.repetition,
            branch=step.branch,
            step=step.number,
            target_N=step.target_N,
            run_start_s=where.start_s,
            segment=where.segment,
            settled=settled,
        )
        self._recorder.sample(slot, place)
        force_N, _ = along(slot.dynamometer, where.unit_vector)
        self._unloaded.row(step.branch, force_N, slot.laser.values[0])
        return True

    def event(self, where: Where, kind: str, text: str, **data: Any) -> None:
        """Something that happened in this repetition."""
        place = {"pose": where.run.pose, "direction": where.run.direction}
        repetition = {"run": where.index, "repetition": where.repetition}
        self._recorder.event(kind, text, **repetition, **place, **data)

    def _stiffness(self) -> float:
        """Over the last two steps, N/mm: tells how far to turn; nan before there are two."""
        if len(self._done) < 2:
            return nan
        (f0, u0), (f1, u1) = self._done[-2:]
        return (f1 - f0) / (u1 - u0) if u1 != u0 else nan
