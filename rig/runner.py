"""The procedure as a state machine: mount, then for each repetition unload, reset, tare, zero
plateau, steps, unload, zero plateau, rest.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from math import degrees, isnan, nan, radians

from drivers.errors import NotDischarged, NotWanted
from drivers.interfaces import Loader, Prompt
from drivers.readings import Reading
from rig.errors import MeasurementStopped
from rig.plan import TARE_S
from rig.procedure.acquisition import Acquisition
from rig.procedure.limits import Watch
from rig.procedure.progress import Progress
from rig.procedure.recorder import Recorder
from rig.procedure.step import StepProcedure, TopReached, Where
from rig.procedure.supervision import Supervision, Wish
from rig.protocol import MeasurementProtocol, Run, Step

# Within this the arm counts as standing in its reference pose: RTDE shows commanded poses to
# 0.001 deg, and by hand on the pendant a joint is brought there to about a tenth of a degree.
POSE_TOLERANCE_DEG = 0.5
STATE_COMES_S = 1.0  # wall clock: far longer than a robot's state is on its way
TO_RESET = "Turn the charge amplifier to Reset, then confirm."
TO_OPERATE = "Turn the charge amplifier to Operate, then confirm."


class Runner:
    """Carries out a protocol. `run` returns when it is done, or raises why it is not.

    `checkpoint` is called whenever there is time to bring the data set up to date.
    """

    def __init__(
        self,
        protocol: MeasurementProtocol,
        acquisition: Acquisition,
        loader: Loader,
        recorder: Recorder,
        progress: Progress,
        checkpoint: Callable[[], None],
    ) -> None:
        self._protocol = protocol
        self._devices = acquisition.devices
        self._acquisition = acquisition
        self._loader = loader
        self._recorder = recorder
        self._progress = progress
        self._checkpoint = checkpoint
        self._supervision = Supervision(
            acquisition, loader, recorder, Watch(protocol.limits), checkpoint, protocol.repetitions
        )
        self._unloaded = progress.unloaded
        self._steps = StepProcedure(protocol, self._supervision, recorder, loader, self._unloaded)
        self._mounted: tuple[str, str] | None = None
        self._segment = progress.segment
        self._datum_segment = 0  # in which the datum was set

    def interrupt(self) -> None:
        """Ctrl-C: the first asks, the second stops at once (raises KeyboardInterrupt), and so does
        the first while the arm moves."""
        self._supervision.interrupt()

    def run(self) -> None:
        """All runs and repetitions that are not done yet."""
        for index, run, repetition in self._protocol.sequence():
            if (index, repetition) not in self._progress.repetitions:
                self._repetition_until_accepted(index, run, repetition)
                self._checkpoint()

    def _repetition_until_accepted(self, index: int, run: Run, repetition: int) -> None:
        where = Where(index, run, repetition, self._protocol.directions[run.direction])
        begun = self._progress.first_rows.get((index, repetition), self._recorder.rows)
        if begun < self._recorder.rows:
            self._measure_anew(where, begun, "repetition interrupted before its end")
        self._supervision.show(
            pose=run.pose, direction=run.direction, repetition=repetition, step=0
        )
        self._supervision.look_along(where.unit_vector)
        while True:
            first_row = self._recorder.rows
            self._steps.event(where, "repetition_start", f"{run.direction}, {repetition}")
            try:
                self._repetition(where)
                self._steps.event(where, "repetition_done", "measured", outcome="measured")
                self._progress.repetitions.add((index, repetition))
                self._rest()
            except Wish:  # to redo the repetition; what is wished of a step stays there
                self._measure_anew(where, first_row, "repetition redone")
                continue
            self._loader.notify(f"{run.direction}, repetition {repetition}: measured")
            return

    def _measure_anew(self, where: Where, first_row: int, reason: str) -> None:
        self._recorder.discard(first_row, reason)
        self._steps.event(where, "repetition_redone", f"{reason}: measured anew as a whole")
        self._progress.forget_repetition(where.index, where.repetition)

    def _repetition(self, where: Where) -> None:
        self._mount(where)
        if self._progress.resting:  # it was interrupted, and the arm still creeps back
            self._rest()
            self._progress.resting = False
        where = self._zeroed(where)
        self._steps.zero_plateau(where, self._protocol.zero.before_s)
        self._all_steps(where)
        self._supervision.show(phase="unloading", step=0, target_N=0.0, band_N=0.0)
        self._unload()
        self._steps.event(where, "unloaded", "screw turned back")
        self._steps.zero_plateau(where, self._protocol.zero.after_s)
        self._question_the_tare(where)

    def _question_the_tare(self, where: Where) -> None:
        """What was zeroed under load shows only now that the load is gone."""
        fallen = self._unloaded.tared_under_load()
        if fallen is None:
            return
        force_N, moved_mm = fallen
        text = (
            f"Repetition {where.repetition} seems to have been tared while the screw still pressed:"
            f" unloaded, the force stands {force_N:.3g} N and the displacement {moved_mm:.3g} mm "
            "below their zeros, in the ratio of the loading curve. Its levels are that much too "
            "low. Redo the repetition, with the screw clear of the arm when it is tared."
        )
        self._steps.event(where, "tared_under_load", text)
        prompt = Prompt("tared_under_load", text, ("record", "redo_repetition", "abort"))
        answer = self._supervision.ask(prompt)
        if answer == "redo_repetition" and self._datum_segment == where.segment:
            self._recorder.datum_mm = nan
        self._supervision.obey(answer)
        kept = f"Repetition {where.repetition}, which seems to have been tared under load, is kept."
        self._loader.notify(kept, "warning")

    def _rest(self) -> None:
        self._supervision.show(phase="rest")
        until = self._supervision.now() + self._protocol.rest_s
        while self._supervision.now() < until:
            self._supervision.tick()

    def _all_steps(self, where: Where) -> None:
        steps = self._protocol.steps(where.run)
        loading_ended = False
        for position, step in enumerate(steps, start=1):
            if loading_ended and step.branch == "loading":
                continue
            try:
                self._step_until_accepted(where, step, (position, len(steps)))
            except TopReached:
                loading_ended = True

    def _step_until_accepted(self, where: Where, step: Step, place: tuple[int, int]) -> None:
        data = {"branch": step.branch, "step": step.number}
        text = f"{step.branch} to {step.target_N:g} N"
        again = False
        while True:
            if self._steps.below(where, step, again=again):
                force_N = self._supervision.view.force_N
                text += f": left out, the force is {force_N:.4g} N and would have to rise"
                self._steps.event(where, "step_left_out", text, **data)
                self._loader.notify(text, "warning")
                return
            first_row = self._recorder.rows
            self._steps.event(where, "step_start", text, **data)
            try:
                outcome = self._steps.measure(where, step, place)
            except Wish as wish:
                if wish.what == "redo_repetition":
                    raise
                self._recorder.discard(first_row, wish.why)
                if wish.what == "redo_step":
                    again = True
                    continue
                outcome = f"skipped: {self._reason()}"
            self._steps.event(where, "step_done", f"{text}: {outcome}", outcome=outcome, **data)
            return

    def _mount(self, where: Where) -> None:
        """Pose and setup, when they change; the amplifier is in Reset meanwhile."""
        run = where.run
        if self._mounted == (run.pose, run.direction):
            return
        # Nobody looks at the devices meanwhile: where the rig goes is told, and no value beside it.
        self._supervision.show(phase="mounting", force_N=nan, displacement_mm=nan)
        self._loader.guide(self._supervision.view)
        # In Reset nothing that happens while the rig is set up can overload the amplifier.
        self._reset()
        pose = self._protocol.poses[run.pose]
        if self._protocol.move_arm and pose.program is not None:
            self._play(pose.program, pose.q_rad)
            words = f"The arm stands in {run.pose}."
        else:
            q = ", ".join(f"{degrees(a):.2f}" for a in pose.q_rad)
            words = f"Bring the arm to pose {run.pose} ({q} deg), then let it stand."
        axis = ", ".join(f"{v:g}" for v in where.unit_vector)
        words += f" Set up screw, dynamometer and laser along {run.direction} ({axis}), "
        words += f"not touching. {self._protocol.prompts.get('before_run', '')}"
        rig = {"q_rad": list(pose.q_rad), "direction": list(where.unit_vector)}
        self._supervision.ask(Prompt("mount", words.strip(), ("ok",), rig), watching=False)
        self._verify_pose(run.pose, pose.q_rad)
        self._mounted = (run.pose, run.direction)
        self._recorder.datum_mm = nan
        self._steps.restart()
        self._steps.event(where, "mounted", f"set up along {run.direction} in pose {run.pose}")

    def _play(self, program: str, q_rad: tuple[float, ...]) -> None:
        """The arm moves: only because the protocol says so and the operator confirms it."""
        text = f"THE ARM WILL MOVE: {program} is played on the controller. Stand clear."
        if self._supervision.ask(Prompt("confirm_move", text, ("move", "abort"))) != "move":
            raise MeasurementStopped("the operator did not confirm the arm's motion")
        tolerance = radians(POSE_TOLERANCE_DEG)
        deadline = self._protocol.step_deadline_s
        robot = self._devices.robot
        try:
            with self._supervision.moving() as wanted:
                robot.go_to_reference(program, q_rad, tolerance, deadline, wanted)
        except NotWanted as error:
            raise MeasurementStopped(
                f"the operator ended the measurement: {error.fault}. {error.remedy}"
            ) from error

    def _verify_pose(self, name: str, q_rad: tuple[float, ...]) -> None:
        while True:
            off = self._off_pose(q_rad)
            worst = max(range(len(off)), key=off.__getitem__)
            if off[worst] <= POSE_TOLERANCE_DEG:
                return
            text = (
                f"Joint {worst + 1} is {off[worst]:.2f} deg away from pose {name} "
                f"(allowed {POSE_TOLERANCE_DEG:g} deg). Correct the pose, then check again."
            )
            prompt = Prompt("pose", text, ("abort", "check again", "accept"))
            answer = self._supervision.ask(prompt, watching=False)
            if answer == "accept":
                self._recorder.event("pose_accepted", text)
                return
            if answer == "abort":
                raise MeasurementStopped(text)

    def _off_pose(self, q_rad: tuple[float, ...]) -> list[float]:
        """deg that each joint is off. The newest state may be older than the answer that the arm is
        there (an emulated one is there at once): for a moment newer ones are waited for."""
        deadline = time.monotonic() + STATE_COMES_S
        while True:
            self._devices.robot.accept_present_state()
            q = self._devices.robot.state().q
            off = [degrees(abs(a - b)) for a, b in zip(q, q_rad, strict=True)]
            if max(off) <= POSE_TOLERANCE_DEG or time.monotonic() > deadline:
                return off
            time.sleep(STATE_COMES_S / 20)

    def _unload(self) -> None:
        text = "Turn the screw back until it no longer touches the arm, then confirm."
        self._supervision.ask(Prompt("unload", text))

    def _zeroed(self, where: Where) -> Where:
        """Unload, reset and operate the amplifier, tare, set the datum of a new setup."""
        self._supervision.show(phase="taring", step=0, target_N=0.0, band_N=0.0)
        while True:
            self._unload()
            self._reset()
            self._operate()
            _, force, laser = self._acquisition.average(TARE_S)
            if self._clear(where, laser):
                break
        self._devices.dynamometer.tare(force)
        self._segment += 1
        if isnan(self._recorder.datum_mm):
            self._recorder.datum_mm, self._datum_segment = laser.values[0], self._segment
        self._acquisition.average(0.0)  # what was read before taring is no force
        self._supervision.restart()
        where = replace(where, start_s=self._supervision.now(), segment=self._segment)
        data = {
            "datum_mm": self._recorder.datum_mm,
            "laser_mm": laser.values[0],
            "segment": self._segment,
        }
        self._steps.event(where, "tared", "amplifier reset, force tared", **data)
        self._unloaded.tared((where.run.pose, where.run.direction), laser.values[0])
        return where

    def _clear(self, where: Where, laser: Reading) -> bool:
        """False where the operator, asked about an arm that stands as if under load, sees that it
        is. A screw that presses and an arm that has given way look alike to the laser."""
        run = where.run
        off = self._unloaded.off((run.pose, run.direction), laser, run.forces_N)
        if off is None:
            return True
        text = (
            f"The laser shows the arm {off[0]:.3g} mm from where it last stood unloaded, as under "
            f"about {off[1]:.3g} N. What is zeroed under load spoils the repetition. Is the screw "
            "clear of the arm? (It is clear, too, where the arm has slipped or given way, or the "
            "laser was moved.)"
        )
        self._steps.event(where, "unloaded_elsewhere", text)
        prompt = Prompt("screw_clear", text, ("clear", "touching", "abort"))
        answer = self._supervision.ask(prompt, watching=False)
        self._supervision.obey(answer)
        if answer == "clear":
            words = f"Zeroed {off[0]:.3g} mm from where the arm last stood unloaded."
            self._loader.notify(words, "warning")
        return answer == "clear"

    def _reset(self) -> None:
        """By the line, or by the operator's hand: a switch that was not turned is asked for again,
        because the repetitions measured so far are no worse for it."""
        prompt = Prompt("reset", TO_RESET)
        while True:
            if self._devices.dynamometer.reset_by_hand:
                self._supervision.obey(self._supervision.ask(prompt, watching=False))
            try:
                self._devices.dynamometer.reset()
            except NotDischarged as error:
                if not self._devices.dynamometer.reset_by_hand:
                    raise
                text = f"Not discharged: {error.fault}. {TO_RESET}"
                prompt = Prompt("reset", text, ("ok", "abort"))
            else:
                return

    def _operate(self) -> None:
        if self._devices.dynamometer.reset_by_hand:
            self._supervision.ask(Prompt("operate", TO_OPERATE), watching=False)
        self._devices.dynamometer.operate()

    def _reason(self) -> str:
        return self._supervision.ask(Prompt("skip_reason", "Why? (one line)", ()))
