"""The procedure on a rig in memory: limits, faults, stops, arms that move."""

from __future__ import annotations

import threading
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from drivers.errors import ReadTimeout, SafetyStop
from drivers.interfaces import WITHDRAWN, Command, LiveView, Prompt
from rig.errors import MeasurementStopped
from rig.protocol import parse_protocol
from tests.unit.runner_bench import ALL, MOVING, PROTOCOL, Bench, at


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_abort_keeps_rows_and_says_what_to_do_with_the_hands(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("abort"))
    message = r"the operator ended the measurement\. Turn the screw back"
    with pytest.raises(MeasurementStopped, match=message):
        bench.run()
    assert bench.steps()[:1] == ALL[:1]


def test_the_force_limit_stops_keeps_and_tells(bench: Bench) -> None:
    def push() -> None:
        bench.arm.u = 1.5  # 150 N

    at(bench, 2, push)
    message = "force 150 N is above the limit of 100 N; the measurement is stopped. Turn the screw"
    with pytest.raises(MeasurementStopped, match=message):
        bench.run()
    assert bench.loader.said[-1] == (
        "Stopped at a limit of force. Turn the screw back until it no longer touches the arm."
    )
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


@pytest.mark.parametrize("key", ["mount", "unload"])
@pytest.mark.parametrize("answer", ["continue", "abort"])
def test_a_ctrl_c_under_a_question_comes_before_its_answer(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, key: str, answer: str
) -> None:
    ask, withdrawn = bench.loader.ask, threading.Event()

    def not_answered(prompt: Prompt) -> str:
        if prompt.key == key and not withdrawn.is_set():
            assert bench.runner is not None
            bench.runner.interrupt()
            assert withdrawn.wait(10.0)
            bench.loader.asked.append(prompt)
            return WITHDRAWN
        return ask(prompt)

    monkeypatch.setattr(bench.loader, "ask", not_answered)
    monkeypatch.setattr(bench.loader, "withdraw", withdrawn.set)
    bench.loader.answers["interrupt"] = [answer]
    with pytest.raises(MeasurementStopped) if answer == "abort" else nullcontext():
        bench.run()
    asked = [p.key for p in bench.loader.asked]
    first = asked.index(key)
    assert asked[first + 1] == "interrupt"
    assert asked.count("interrupt") == 1
    assert asked[first + 2 : first + 3] == ([key] if answer == "continue" else []), "asked anew"
    assert bench.steps() == (ALL if answer == "continue" else [])
    assert WITHDRAWN not in [e["answer"] for e in bench.events("prompt")]


def test_who_aborts_after_a_ctrl_c_is_not_asked_again(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask = bench.loader.ask

    def interrupted(prompt: Prompt) -> str:
        if prompt.key == "paused":
            assert bench.runner is not None
            bench.runner.interrupt()
        return ask(prompt)

    monkeypatch.setattr(bench.loader, "ask", interrupted)
    at(bench, 2, lambda: bench.loader.commands.append("pause"))
    bench.loader.answers["paused"] = ["abort"]
    with pytest.raises(MeasurementStopped, match="the operator ended the measurement"):
        bench.run()
    assert bench.loader.asked[-1].key == "paused"


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


def test_a_state_that_is_still_on_its_way_is_waited_for(bench: Bench) -> None:
    """The newest state may be older than the answer that the arm is there."""
    robot, late = bench.devices.robot, [3]
    state = robot.state

    def behind() -> Any:
        late[0] -= 1
        there = state()
        return replace(there, q=(0.5,) * 6) if late[0] > 0 else there

    robot.state = behind  # type: ignore[method-assign]
    bench.run()
    assert late[0] <= 0
    assert "pose" not in [p.key for p in bench.loader.asked]


def test_an_operator_who_cannot_be_asked_is_a_failed_device(bench: Bench) -> None:
    error = ReadTimeout("operator", "no terminal to ask at", "Start rig in a terminal.")

    def refuse(_prompt: Any) -> str:
        raise error

    bench.loader.ask = refuse  # type: ignore[method-assign]
    with pytest.raises(ReadTimeout, match="no terminal"):
        bench.run()


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
        assert len(bench.events("not_settled")) == 2 * (1 + 3 + 1)  # zero plateaus, too
        assert not any(row["values"]["settled"] for row in bench.records("sample"))


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
