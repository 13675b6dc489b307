"""The procedure on a rig in memory: order, redo, skip, pause, limits, faults, resume."""

from __future__ import annotations

import time
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

import pytest

from drivers.errors import NotDischarged, ReadTimeout, SafetyStop
from drivers.interfaces import Command, LiveView, Prompt
from rig.errors import MeasurementStopped
from rig.journal import Journal, Record, replay
from rig.procedure.acquisition import Acquisition
from rig.procedure.devices import Devices
from rig.procedure.progress import Progress, read_progress
from rig.procedure.recorder import Recorder
from rig.protocol import parse_protocol
from rig.runner import Runner
from tests.unit.fake_rig import Arm, FakeDynamometer, FakeLaser, FakeLoader, FakeRobot, JumpClock

PROTOCOL = """\
schema: rig.protocol/1
title: test
station: emulated
robot: ur10e
poses:
  P1: {q_deg: [13.43, -99.84, -108.10, -62.06, 90.0, -76.57], tcp_xyz_mm: [0, 0, 0],
    program: go.urp}
move_arm: false
joint_encoder: output
directions: {x: [1, 0, 0]}
runs:
  - {pose: P1, direction: x, steps_N: [20, 40, 60]}
repetitions: 2
branches: loading
order: by_run
sampling: {rate_Hz: 1, samples_per_step: 3}
hold_s: 0
force_band: {absolute_N: 0.5, relative: 0.01}
settle: {window_s: 2, force_slope_N_per_s: 0.05, force_spread_N: 0.3,
  displacement_slope_mm_per_s: 0.002, displacement_spread_mm: 0.01, deadline_s: 20,
  at_deadline: record}
step_deadline_s: 30
zero: {before_s: 2, after_s: 2}
rest_s: 1
rated_load_N: null
limits:
  force_N: {max: 100, at: stop}
  displacement_mm: {max: 5, at: pause}
  displacement_rate_mm_per_s: {max: 100, at: warn}
prompts: {}
"""

MOVING = PROTOCOL.replace("move_arm: false", "move_arm: true")

Step = tuple[int, str, int]


class Bench:
    """One measurement in memory, with its journal on disk."""

    def __init__(self, folder: Path, text: str = PROTOCOL) -> None:
        self.protocol = parse_protocol(text, folder / "test.yaml")
        self.clock = JumpClock()
        self.arm = Arm(self.clock)
        self.robot = FakeRobot(self.arm)
        self.loader = FakeLoader(self.arm)
        self.dynamometer = FakeDynamometer(self.arm)
        self.devices = Devices(self.robot, self.dynamometer, FakeLaser(self.arm))
        self.path = folder / "run.h5.journal"
        self.checkpoints = 0
        self.runner: Runner | None = None

    def run(self) -> None:
        if self.path.exists():
            journal = Journal.reopen(self.path)
            progress = read_progress(journal.records)
        else:
            journal, progress = Journal.create(self.path, {}), Progress()
        acquisition = Acquisition(self.devices, self.clock, 1.0, progress.session_s)
        recorder = Recorder(journal, self.devices, acquisition.now, 1, progress.rows)
        self.runner = Runner(
            self.protocol, acquisition, self.loader, recorder, progress, self.check
        )
        try:
            self.runner.run()
        finally:
            journal.close()

    def check(self) -> None:
        self.checkpoints += 1

    def records(self, kind: str) -> list[dict[str, Any]]:
        return [r.data for r in replay(self.path) if r.kind == kind]

    def events(self, kind: str) -> list[dict[str, Any]]:
        return [e for e in self.records("event") if e["kind"] == kind]

    def good(self) -> list[dict[str, Any]]:
        """Rows that are not discarded."""
        bad = {i for e in self.events("discard") for i in range(e["first"], e["last"] + 1)}
        return [row for i, row in enumerate(self.records("sample")) if i not in bad]

    def steps(self) -> list[Step]:
        """Steps of the usable settled rows, in order, once each."""
        rows = [r for r in self.good() if r["values"]["settled"] and r["step"]]
        return list(dict.fromkeys((r["repetition"], r["branch"], r["step"]) for r in rows))


ALL = [(rep, "loading", step) for rep in (1, 2) for step in (1, 2, 3)]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def at(bench: Bench, step: int, act: Any, phase: str = "sampling", samples: int = 1) -> None:
    """Does something once, in the middle of a step."""
    done: list[bool] = []

    def script(view: LiveView) -> None:
        here = (view.step, view.phase, view.samples) == (step, phase, samples)
        if here and not done:
            done.append(True)
            act()

    bench.loader.script = script


def test_an_undisturbed_run_measures_every_step_and_zero_plateau(bench: Bench) -> None:
    bench.run()
    assert bench.steps() == ALL
    for number, force in ((1, 20.0), (2, 40.0), (3, 60.0)):
        rows = [r for r in bench.good() if r["step"] == number and r["values"]["settled"]]
        assert len(rows) == 2 * 3
        for row in rows:
            assert row["values"]["force_N"] == pytest.approx(force, abs=0.9)
            assert row["values"]["displacement_mm"] == pytest.approx(force / 100 + 0.5, abs=0.01)
    zeros = [r for r in bench.good() if r["branch"] == "zero" and r["values"]["settled"]]
    assert len(zeros) == 2 * (2 + 2)
    assert all(r["values"]["force_N"] == pytest.approx(0.0, abs=1e-9) for r in zeros)
    assert bench.checkpoints == 2


def test_settling_rows_are_kept_and_marked(bench: Bench) -> None:
    bench.run()
    unsettled = [r for r in bench.good() if not r["values"]["settled"]]
    assert unsettled
    assert {r["step"] for r in unsettled} == {0, 1, 2, 3}


def test_the_operator_is_asked_in_the_order_of_the_procedure(bench: Bench) -> None:
    bench.run()
    keys = [p.key for p in bench.loader.asked]
    assert keys == ["mount", "unload", "unload", "unload", "unload"]


def test_where_the_rig_is_set_up_is_told_before_the_question(tmp_path: Path) -> None:
    text = PROTOCOL.replace("{x: [1, 0, 0]}", "{x: [1, 0, 0], y: [0, 1, 0]}")
    run = "  - {pose: P1, direction: x, steps_N: [20, 40, 60]}\n"
    bench = Bench(tmp_path, text.replace(run, run + run.replace("x,", "y,")))
    newest: list[LiveView] = []
    ask = bench.loader.ask

    def ask_and_note(prompt: Prompt) -> str:
        if prompt.key == "mount":
            newest.append(bench.loader.views[-1])
        return ask(prompt)

    bench.loader.ask = ask_and_note  # type: ignore[method-assign]
    bench.run()
    told = [(view.phase, view.pose, view.direction, view.repetition) for view in newest]
    assert told == [("mounting", "P1", "x", 1), ("mounting", "P1", "y", 1)]
    assert all(isnan(view.force_N) and isnan(view.displacement_mm) for view in newest)


def test_an_amplifier_without_a_line_is_switched_by_the_operator(bench: Bench) -> None:
    bench.dynamometer.reset_by_hand = True
    bench.run()
    keys = [p.key for p in bench.loader.asked]
    tare = ["unload", "reset", "operate"]
    assert keys == ["reset", "mount", *tare, "unload", *tare, "unload"]
    texts = {p.key: p.text for p in bench.loader.asked}
    assert texts["reset"] == "Turn the charge amplifier to Reset, then confirm."
    assert texts["operate"] == "Turn the charge amplifier to Operate, then confirm."


def test_a_switch_that_was_not_turned_is_asked_for_again(bench: Bench) -> None:
    bench.dynamometer.reset_by_hand, bench.dynamometer.charged = True, 2
    bench.run()
    asked = [p for p in bench.loader.asked if p.key == "reset"]
    assert len(asked) == 2 + 3
    assert asked[1].text == (
        "Not discharged: in Reset channel 1 still shows 2.00 V. "
        "Turn the charge amplifier to Reset, then confirm."
    )
    assert asked[1].answers == ("ok", "abort")
    assert bench.steps() == ALL


def test_a_switch_that_cannot_be_turned_ends_the_measurement(bench: Bench) -> None:
    bench.dynamometer.reset_by_hand, bench.dynamometer.charged = True, 2
    bench.loader.answers["reset"] = ["ok", "abort"]
    with pytest.raises(MeasurementStopped, match="the operator ended the measurement"):
        bench.run()


def test_a_line_without_effect_is_a_failed_device(bench: Bench) -> None:
    bench.dynamometer.charged = 1
    with pytest.raises(NotDischarged):
        bench.run()
    assert not bench.loader.asked


def test_redo_step_discards_its_rows_and_measures_it_again(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("redo_step"))
    bench.run()
    assert bench.steps() == ALL
    discards = bench.events("discard")
    assert len(discards) == 1
    rows = bench.records("sample")[discards[0]["first"] : discards[0]["last"] + 1]
    assert {r["step"] for r in rows} == {2}
    assert len([r for r in bench.good() if r["step"] == 2 and r["values"]["settled"]]) == 6


def test_redo_repetition_starts_it_again(bench: Bench) -> None:
    at(bench, 3, lambda: bench.loader.commands.append("redo_repetition"))
    bench.run()
    assert bench.steps() == ALL
    assert {r["segment"] for r in bench.good()} == {2, 3}


def test_skip_asks_for_the_reason_and_goes_on(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("skip"))
    bench.loader.answers["skip_reason"] = ["screw slipped"]
    bench.run()
    assert bench.steps() == [s for s in ALL if s != (1, "loading", 2)]
    outcomes = [e["outcome"] for e in bench.events("step_done")]
    assert outcomes.count("skipped: screw slipped") == 1


def outside(bench: Bench, phase: str, command: Command) -> None:
    """Gives the command once, late in the first repetition, with no step under way."""
    done: list[bool] = []

    def script(view: LiveView) -> None:
        measured = bool(bench.events("unloaded"))
        if measured and (view.phase, view.repetition) == (phase, 1) and not done:
            done.append(True)
            bench.loader.commands.append(command)

    bench.loader.script = script


@pytest.mark.parametrize("phase", ["zero", "rest"])
@pytest.mark.parametrize("command", ["redo_step", "skip"])
def test_without_a_step_there_is_none_to_redo_or_skip(
    bench: Bench, phase: str, command: Command
) -> None:
    outside(bench, phase, command)
    bench.run()
    assert bench.loader.said[0] == (
        f"No step is under way: nothing to {command.replace('_', ' ')}."
    )
    assert not bench.events("discard")
    assert [e["outcome"] for e in bench.events("repetition_done")] == ["measured"] * 2
    assert bench.steps() == ALL


@pytest.mark.parametrize("phase", ["zero", "rest"])
def test_a_pause_without_a_step_offers_what_is_left_and_goes_on(bench: Bench, phase: str) -> None:
    outside(bench, phase, "pause")
    bench.run()
    paused = next(p for p in bench.loader.asked if p.key == "paused")
    assert paused.answers == ("continue", "redo_repetition", "abort")
    assert not bench.events("discard")
    assert bench.steps() == ALL


def test_a_pause_in_a_step_offers_to_redo_and_to_skip_it(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("pause"))
    bench.run()
    paused = next(p for p in bench.loader.asked if p.key == "paused")
    assert {"redo_step", "skip"} <= set(paused.answers)


def test_a_zero_plateau_that_does_not_settle_is_no_step(bench: Bench) -> None:
    text = PROTOCOL.replace("at_deadline: record", "at_deadline: ask")
    bench.protocol = parse_protocol(text, bench.path)

    def creep(view: LiveView) -> None:
        if view.phase == "settling" and view.branch == "zero":
            bench.arm.u -= 0.0005

    bench.loader.script = creep
    bench.run()
    asked = [p for p in bench.loader.asked if p.key == "settle_deadline"]
    assert [p.answers for p in asked] == [("record", "abort")] * 4


def test_abort_keeps_rows_and_says_what_to_do_with_the_hands(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("abort"))
    message = r"the operator ended the measurement\. Turn the screw back"
    with pytest.raises(MeasurementStopped, match=message):
        bench.run()
    assert bench.steps()[:1] == ALL[:1]


def test_a_pause_in_a_step_measures_the_step_again(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("pause"))
    bench.run()
    assert bench.steps() == ALL
    assert len(bench.events("discard")) == 1
    assert bench.checkpoints == 3


def test_the_force_limit_stops_keeps_and_tells(bench: Bench) -> None:
    def push() -> None:
        bench.arm.u = 1.5  # 150 N

    at(bench, 2, push)
    message = "force 150 N is above the limit of 100 N; the measurement is stopped. Turn the screw"
    with pytest.raises(MeasurementStopped, match=message):
        bench.run()
    assert bench.loader.said[-1].startswith("force 150 N is above the limit of 100 N")
    assert len(bench.records("sample")) > 5


def test_a_limit_may_pause_instead(bench: Bench) -> None:
    def drift() -> None:
        bench.arm.yield_N, bench.arm.u = 30.0, 6.0

    at(bench, 2, drift)
    bench.loader.answers["paused"] = ["abort"]
    with pytest.raises(MeasurementStopped, match="the operator ended"):
        bench.run()
    assert bench.events("limit")[0]["text"] == ("displacement 6.5 mm is above the limit of 5 mm")


def test_a_dead_device_ends_the_run_and_keeps_the_rows(bench: Bench) -> None:
    error = ReadTimeout("laser", "silent for 1.0 s", "Check its cable.")
    at(bench, 2, lambda: bench.arm.broken.update(laser=error))
    with pytest.raises(ReadTimeout, match=r"laser: silent for 1\.0 s\. Check its cable\."):
        bench.run()
    assert bench.steps()[:1] == ALL[:1]


@pytest.mark.parametrize("step", [1, 2, 3])
def test_resume_goes_on_at_the_interrupted_step(bench: Bench, step: int) -> None:
    error = ReadTimeout("laser", "silent", "Check.")
    at(bench, step, lambda: bench.arm.broken.update(laser=error))
    with pytest.raises(ReadTimeout):
        bench.run()
    before = len(bench.records("sample"))
    bench.arm.broken.clear()
    bench.loader.script = lambda _view: None
    bench.run()
    assert bench.steps() == ALL
    assert len(bench.records("sample")) > before
    settled = [r for r in bench.good() if r["step"] == step and r["values"]["settled"]]
    assert len(settled) == 6, "rows of the broken step must not count twice"
    clock = [r["session_s"] for r in bench.records("sample")]
    assert clock == sorted(clock)


def test_the_first_ctrl_c_asks_and_the_second_stops(bench: Bench) -> None:
    at(bench, 2, lambda: bench.runner and bench.runner.interrupt())
    bench.loader.answers["interrupt"] = ["continue"]
    bench.run()
    assert bench.steps() == ALL
    assert [p.key for p in bench.loader.asked].count("interrupt") == 1
    assert bench.runner is not None
    bench.runner.interrupt()
    with pytest.raises(KeyboardInterrupt):
        bench.runner.interrupt()


def test_the_arm_moves_only_if_protocol_and_operator_say_so(tmp_path: Path) -> None:
    still = Bench(tmp_path)
    still.run()
    assert still.robot.moved == ()
    (tmp_path / "a").mkdir()
    refused = Bench(tmp_path / "a", MOVING)
    refused.loader.answers["confirm_move"] = ["abort"]
    with pytest.raises(MeasurementStopped, match="did not confirm the arm's motion"):
        refused.run()
    assert refused.robot.moved == ()
    (tmp_path / "b").mkdir()
    moving = Bench(tmp_path / "b", MOVING)
    moving.run()
    assert moving.robot.moved == ("go.urp",)


def test_an_abort_while_the_arm_moves_stops_it(tmp_path: Path) -> None:
    bench = Bench(tmp_path, MOVING)
    wishes: list[Command] = ["pause", "abort"]
    bench.robot.on_the_way = lambda: bench.loader.commands.extend(wishes)
    reason = 'the operator ended the measurement: the program "go.urp" was called off. Look at it.'
    with pytest.raises(MeasurementStopped) as stopped:
        bench.run()
    assert str(stopped.value) == reason
    assert bench.loader.said == ["The arm moves: nothing but an abort is heard."]


def test_the_first_ctrl_c_while_the_arm_moves_stops_at_once(tmp_path: Path) -> None:
    bench = Bench(tmp_path, MOVING)
    bench.robot.on_the_way = lambda: bench.runner and bench.runner.interrupt()
    with pytest.raises(KeyboardInterrupt):
        bench.run()


def test_a_ctrl_c_before_the_arm_moves_keeps_it_where_it_is(tmp_path: Path) -> None:
    bench = Bench(tmp_path, MOVING)
    ask = bench.loader.ask

    def asked(prompt: Any) -> str:
        if prompt.key == "confirm_move" and bench.runner:
            bench.runner.interrupt()
        return ask(prompt)

    bench.loader.ask = asked  # type: ignore[method-assign]
    with pytest.raises(MeasurementStopped, match="was called off"):
        bench.run()


def test_a_wrong_pose_is_noticed(bench: Bench) -> None:
    def mount_wrongly(_view: LiveView) -> None:
        bench.arm.q = tuple(a + 0.02 for a in bench.protocol.poses["P1"].q_rad)

    bench.loader.script = mount_wrongly
    ask = bench.loader.ask

    def asked(prompt: Any) -> str:
        answer = ask(prompt)
        if prompt.key == "mount":
            bench.arm.q = (0.5,) * 6
        return answer

    bench.loader.ask = asked  # type: ignore[method-assign]
    bench.loader.answers["pose"] = ["abort"]
    with pytest.raises(MeasurementStopped, match="deg away from pose P1"):
        bench.run()
    prompt = next(p for p in bench.loader.asked if p.key == "pose")
    assert "deg away from pose P1 (allowed 0.5 deg)" in prompt.text


def test_a_force_that_is_not_reached_is_recorded_as_such(bench: Bench) -> None:
    bench.arm.yield_N = 50.0
    text = PROTOCOL.replace("{max: 5, at: pause}", "{max: 500, at: pause}")
    bench.protocol = parse_protocol(text, bench.path)
    bench.run()
    assert (1, "loading", 3) in bench.steps()
    outcomes = [e["outcome"] for e in bench.events("step_done")]
    assert "band not reached" in outcomes


def test_records_are_numbered_rows(bench: Bench) -> None:
    bench.run()
    records: list[Record] = replay(bench.path)
    assert [r.number for r in records] == list(range(len(records)))


def test_resume_does_not_repeat_what_is_done(bench: Bench) -> None:
    error = ReadTimeout("laser", "silent", "Check.")

    def script(view: LiveView) -> None:
        if (view.repetition, view.step, view.phase) == (2, 2, "sampling"):
            bench.arm.broken["laser"] = error

    bench.loader.script = script
    with pytest.raises(ReadTimeout):
        bench.run()
    before = len(bench.records("sample"))
    bench.arm.broken.clear()
    bench.loader.script = lambda _view: None
    bench.run()
    assert bench.steps() == ALL
    assert {r["repetition"] for r in bench.records("sample")[before:]} == {2}
    assert {r["step"] for r in bench.records("sample")[before:]} == {0, 2, 3}


def test_an_operator_who_cannot_be_asked_is_a_failed_device(bench: Bench) -> None:
    error = ReadTimeout("operator", "no terminal to ask at", "Start rig in a terminal.")

    def refuse(_prompt: Any) -> str:
        raise error

    bench.loader.ask = refuse  # type: ignore[method-assign]
    with pytest.raises(ReadTimeout, match="no terminal"):
        bench.run()


def test_a_force_that_relaxes_out_of_its_band_is_approached_again(bench: Bench) -> None:
    def relax() -> None:
        bench.arm.u -= 0.05  # 5 N at 100 N/mm, while hands are off

    done: list[bool] = []

    def script(view: LiveView) -> None:
        if view.step == 2 and view.phase == "settling" and not done:
            done.append(True)
            relax()

    bench.loader.script = script
    bench.run()
    forces = [r["values"]["force_N"] for r in bench.good() if r["step"] == 2]
    assert forces == pytest.approx([40.0] * len(forces), abs=0.5)


def test_a_hold_is_sampled_for_as_long_as_it_lasts(bench: Bench) -> None:
    bench.protocol = parse_protocol(PROTOCOL.replace("hold_s: 0", "hold_s: 7"), bench.path)
    bench.run()
    settled = [r for r in bench.good() if r["step"] == 1 and r["values"]["settled"]]
    assert len(settled) == 2 * 7


def test_loading_ends_at_the_displacement_of_the_run(bench: Bench) -> None:
    run = "steps_N: [20, 40, 60]"
    text = PROTOCOL.replace(run, f"{run}, stop_at_displacement_mm: 3")
    bench.protocol = parse_protocol(text, bench.path)
    bench.arm.yield_N = 50.0
    bench.run()
    assert bench.steps() == [s for s in ALL if s[2] != 3]
    assert [e["text"] for e in bench.events("top")] == ["displacement is above 3 mm"] * 2
    assert not bench.events("band_not_reached")


def test_a_slot_without_a_valid_value_is_no_row_but_an_event(bench: Bench) -> None:
    laser = bench.devices.laser
    collect = laser.collect
    empty = iter([True, False] * 500)

    def sometimes(_since: float = 0.0) -> Any:
        reading = collect()
        return replace(reading, count=0) if next(empty) else reading

    laser.collect = sometimes  # type: ignore[method-assign]
    bench.run()
    assert all(r["count"]["laser"] > 0 for r in bench.records("sample"))
    assert "no valid value from laser" in bench.events("no_value")[0]["text"]
    assert bench.steps() == ALL


@pytest.mark.parametrize(("at_deadline", "outcome"), [("record", "not settled"), ("stop", "")])
def test_an_arm_that_does_not_settle(bench: Bench, at_deadline: str, outcome: str) -> None:
    text = PROTOCOL.replace("at_deadline: record", f"at_deadline: {at_deadline}")
    bench.protocol = parse_protocol(text, bench.path)

    def creep(view: LiveView) -> None:
        if view.phase == "settling":
            bench.arm.u += 0.0005

    bench.loader.script = creep
    if at_deadline == "stop":
        with pytest.raises(MeasurementStopped, match="has not settled within 20 s"):
            bench.run()
    else:
        bench.run()
        assert all(outcome in e["outcome"] for e in bench.events("step_done"))


def test_leading_the_arm_to_its_pose_is_no_fault(bench: Bench) -> None:
    """Play, freedrive and stop on the pendant change the controller's state while mounting."""
    ask = bench.loader.ask

    def asked(prompt: Any) -> str:
        if prompt.key == "mount":
            bench.arm.broken["robot"] = SafetyStop("robot", "the program state changed", "Look.")
            time.sleep(0.2)
        return ask(prompt)

    bench.loader.ask = asked  # type: ignore[method-assign]
    bench.run()
    assert bench.steps() == ALL


def test_taring_is_no_missed_slot(bench: Bench) -> None:
    bench.run()
    assert all(r["values"]["slots_missed"] == 0 for r in bench.records("sample"))
    assert all(r["lateness_s"] < 1e-6 for r in bench.records("sample"))
