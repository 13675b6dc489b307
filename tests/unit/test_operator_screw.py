"""The emulated screw's port, its client, and the scripted operator that uses it."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator

import pytest

from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect, ReadTimeout
from drivers.interfaces import Prompt
from drivers.operator.screw import ScrewClient, ScrewServer
from drivers.operator.scripted import ScriptedOperator
from drivers.operator.settings import OperatorSettings
from tests.unit.test_operator_hand import view
from tests.wire.scene import StillScene

MOUNT = {"direction": [0.0, 1.0, 0.0], "q_rad": [0.1, -1.5, 1.0, -1.0, 1.5, 0.0]}


class Rig:
    def __init__(self) -> None:
        self.scene = StillScene(speed=20.0, stiffness_N_per_m=57e3)
        self.asked: list[object] = []
        handlers = {"fault": self.fault, "amplifier": self.fault}
        self.server = ScrewServer(self.scene, handlers)
        self.address = self.server.start()

    def fault(self, value: object) -> object:
        self.asked.append(value)
        if value == "fire":
            raise ValueError("no device burns")
        return {"injected": value}


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    yield rig
    rig.server.stop()
    rig.server.stop()


def test_turns_mounts_and_tells_its_state(rig: Rig) -> None:
    client = ScrewClient(rig.address, 5.0)
    client.turn(0.2e-3)
    client.turn(-0.05e-3)
    assert rig.scene.turns == pytest.approx([0.2e-3, -0.05e-3])
    state = client.request(state=True)
    assert isinstance(state, dict)
    assert state["turned_mm"] == pytest.approx(0.15)
    assert state["speed"] == 20.0
    client.mount([0.0, 1.0, 0.0], MOUNT["q_rad"])
    assert rig.scene.mounts == [(0.0, 1.0, 0.0)]
    assert rig.scene.q.tolist() == MOUNT["q_rad"]
    client.mount([1.0, 0.0, 0.0])
    assert rig.scene.q.tolist() == MOUNT["q_rad"], "without q_rad the arm stays"
    client.close()


def test_the_host_adds_requests(rig: Rig) -> None:
    client = ScrewClient(rig.address, 5.0)
    assert client.request(fault={"device": "laser"}) == {"injected": {"device": "laser"}}
    with pytest.raises(BadReply, match="no device burns"):
        client.request(fault="fire")
    client.close()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b"nonsense", "Expecting value"),
        (b"[" * 30000, ""),
        (b"[1]", "a request is an object with one of the keys"),
        (b'{"a": 1, "b": 2}', "one of the keys"),
        (b'{"fly": 1}', "unknown request 'fly'; known: turn_mm, mount, state, fault"),
        (b'{"turn_mm": "x"}', "turn_mm is 'x'; it must be a finite number"),
        (b'{"turn_mm": true}', "finite number"),
        (b'{"turn_mm": NaN}', "finite number"),
        (b'{"mount": 3}', "mount needs direction"),
        (b'{"mount": {"direction": [1, 0]}}', "list of 3 numbers"),
        (b'{"mount": {"direction": [1, 1, 0]}}', "it must be 1"),
        (b'{"mount": {"direction": [1, 0, 0], "q_rad": [1]}}', "list of 6 numbers"),
    ],
)
def test_bad_requests_get_a_sentence(rig: Rig, line: bytes, message: str) -> None:
    reply = json.loads(rig.server.answer(line))
    assert message in reply["error"]
    assert rig.scene.turns == []
    assert rig.scene.mounts == []


def test_a_bad_request_does_not_end_the_connection(rig: Rig) -> None:
    client = ScrewClient(rig.address, 5.0)
    with pytest.raises(BadReply, match="known: turn_mm"):
        client.request(fly=1)
    client.turn(1e-3)
    assert rig.scene.turns == [1e-3]
    client.close()


@pytest.mark.parametrize("address", ["nowhere", ":1", "127.0.0.1:x", "127.0.0.1:0"])
def test_an_address_that_is_none(address: str) -> None:
    with pytest.raises(CannotConnect, match="is not address:port"):
        ScrewClient(address)


def test_nobody_there_and_somebody_gone(rig: Rig) -> None:
    client = ScrewClient(rig.address, 5.0)
    client.turn(0.0)
    rig.server.stop()
    with pytest.raises(CannotConnect, match="cannot be reached"):
        client.turn(1e-3)
    with pytest.raises(CannotConnect, match=r"cannot be reached.*rig emulate"):
        ScrewClient(rig.address, 5.0).turn(1e-3)


@pytest.mark.parametrize(
    ("reply", "error", "message"),
    [
        (b"", ReadTimeout, "has not answered for 0.3 s"),
        (b"hello\n", BadReply, "no reply"),
        (b"{}\n", BadReply, "no reply"),
        (b"x" * 200_000, CannotConnect, "its reply has no end"),
    ],
)
def test_a_server_that_is_no_screw(reply: bytes, error: type[Exception], message: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        done = threading.Event()

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                connection.sendall(reply)
                done.wait(5)

        thread = threading.Thread(target=serve)
        thread.start()
        client = ScrewClient(f"127.0.0.1:{server.getsockname()[1]}", 0.3)
        with pytest.raises(error, match=message):
            client.turn(1e-3)
        client.close()
        done.set()
        thread.join()


def operator(rig: Rig, **options: object) -> ScriptedOperator:
    settings = OperatorSettings(driver="scripted", screw=rig.address)
    return ScriptedOperator(settings, rig.scene.clock, **options)  # type: ignore[arg-type]


def test_scripted_operator_reaches_a_target_through_the_port(rig: Rig) -> None:
    hand = operator(rig)
    hand.open()
    assert hand.identity()["source"].startswith("emulated")
    deadline = time.monotonic() + 20
    while abs(rig.scene.force[0] - 20.0) > 0.6 and time.monotonic() < deadline:
        hand.guide(view(float(rig.scene.force[0]) + 1e-6 * time.monotonic(), 20.0))
        time.sleep(0.005)
    assert abs(rig.scene.force[0] - 20.0) <= 0.6
    assert max(rig.scene.turns) <= 0.3e-3
    hand.close()
    hand.close()


def test_scripted_operator_mounts_and_answers(rig: Rig) -> None:
    hand = operator(rig, answers={"paused": "skip"})
    hand.open()
    assert hand.ask(Prompt("mount", "Set up.", ("ok",), MOUNT)) == "ok"
    assert rig.scene.mounts == [(0.0, 1.0, 0.0)]
    assert hand.ask(Prompt("unload", "Turn back.")) == "ok"
    assert rig.scene.turns == [], "set up means that the screw does not touch"
    assert hand.ask(Prompt("paused", "Paused.", ("continue", "skip"))) == "skip"
    assert hand.ask(Prompt("interrupt", "Stop?", ("abort", "continue"))) == "abort"
    assert hand.ask(Prompt("skip_reason", "Why?", ()))
    with pytest.raises(BadReply, match="'skip' to 'paused' is none of continue, abort"):
        hand.ask(Prompt("paused", "Paused.", ("continue", "abort")))
    hand.press("pause")
    hand.notify("careful", "warning")
    assert (hand.command(), hand.command()) == ("pause", None)
    assert list(hand.notices) == [("warning", "careful")]
    hand.close()


def test_turns_the_switch_of_the_amplifier(rig: Rig) -> None:
    hand = operator(rig)
    hand.open()
    assert hand.ask(Prompt("reset", "Turn it to Reset.")) == "ok"
    assert hand.ask(Prompt("operate", "Turn it to Operate.")) == "ok"
    assert rig.asked == ["reset", "operate"]
    hand.close()


def test_unloads_by_the_views_that_come_during_the_prompt(rig: Rig) -> None:
    hand = operator(rig)
    hand.open()
    rig.scene.turn(1e-3)  # 57 N
    answered = threading.Event()

    def ask() -> None:
        hand.ask(Prompt("unload", "Turn back."))
        answered.set()

    threading.Thread(target=ask, daemon=True).start()
    deadline = time.monotonic() + 20
    while not answered.is_set() and time.monotonic() < deadline:
        force = max(0.0, float(rig.scene.force[0])) + 1e-6 * time.monotonic()
        hand.guide(view(force, 0.0, "unloading"))
        time.sleep(0.005)
    assert answered.is_set()
    assert rig.scene.displacement < -0.09e-3
    assert rig.scene.displacement > -0.8e-3
    hand.close()


def test_unloads_by_counting_turns_when_nobody_shows_the_force(rig: Rig) -> None:
    hand = operator(rig)
    hand.open()
    hand.ask(Prompt("mount", "Set up.", ("ok",), MOUNT))
    deadline = time.monotonic() + 20
    while len(rig.scene.turns) < 3 and time.monotonic() < deadline:
        hand.guide(view(float(rig.scene.force[0]) + 1e-6 * time.monotonic(), 50.0))
        time.sleep(0.005)
    assert rig.scene.displacement > 0
    hand.ask(Prompt("unload", "Turn back."))
    assert -0.2e-3 < rig.scene.displacement < -0.05e-3
    turned = len(rig.scene.turns)
    hand.guide(view(0.0, 0.0, "zero"))
    assert len(rig.scene.turns) == turned, "it is free, and known to be"
    hand.close()


def test_scripted_operator_without_a_screw() -> None:
    hand = ScriptedOperator(OperatorSettings(driver="scripted"), Clock())
    with pytest.raises(CannotConnect, match="has no screw to turn"):
        hand.open()
    with pytest.raises(CannotConnect):
        hand.ask(Prompt("mount", "Set up.", ("ok",), MOUNT))
