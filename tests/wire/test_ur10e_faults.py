"""Every fault of the controller, at start and in mid-run, as the real ur-rtde meets it.

Each must end in an error of the right class whose text names device, fault and remedy, and leave
no process behind. The deadlines are those of the client; the test's own timeout only catches a
client that hangs.
"""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import psutil
import pytest

from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect, DeviceError, ReadTimeout, SafetyStop
from drivers.ur10e import probe as probe_module
from drivers.ur10e.client import Ur10e
from drivers.ur10e.emulator import FAULTS, Ur10eEmulator
from drivers.ur10e.process import ReceiveProcess
from drivers.ur10e.settings import Ur10eSettings
from tests.wire.processes import children_running
from tests.wire.scene import StillScene

pytestmark = pytest.mark.timeout(60)

FaultTable = Callable[[str, str, str, str, str], None]
Rig = Callable[[float], tuple[Ur10eEmulator, Ur10e]]


@pytest.fixture
def rig() -> Iterator[Rig]:
    with ExitStack() as stack:

        def make(connect_deadline_s: float) -> tuple[Ur10eEmulator, Ur10e]:
            emulator = Ur10eEmulator(StillScene())
            stack.callback(emulator.stop)
            settings = Ur10eSettings(
                driver="ur10e",
                host=emulator.start(),
                connect_deadline_s=connect_deadline_s,
                stale_after_s=1.0,
            )
            robot = Ur10e(settings, Clock(), emulated=True)
            stack.callback(robot.close)
            return emulator, robot

        yield make
    assert children_running("drivers.ur10e.child") == []


def assert_explained(error: DeviceError, words: tuple[str, ...]) -> None:
    text = str(error)
    assert text.startswith("robot: ")
    for word in words:
        assert word in text
    assert error.remedy.endswith(".")
    assert any(
        hint in error.remedy
        for hint in ("Check", "Restart", "Update", "pendant", "again", "Enable")
    )


def fail_in_mid_run(robot: Ur10e) -> None:
    """Reads as a measurement does, until an error ends it."""
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        robot.collect()
        robot.latest()
        robot.state()
        time.sleep(0.05)


AT_START: dict[str, tuple[type[DeviceError], tuple[str, ...]]] = {
    "silence": (CannotConnect, ("accepts the connection", "did not send the protocol version")),
    "close": (CannotConnect, ("closed the connection", "RTDE is enabled")),
    "refuse": (CannotConnect, (":30004 refuses the connection", "RTDE is enabled")),
    "garbage": (CannotConnect, ("that is no RTDE",)),
    "bad_size": (CannotConnect, ("a message of 2 bytes", "that is no RTDE")),
    "wrong_version": (CannotConnect, ("does not accept RTDE protocol version 2", "PolyScope")),
    "frozen_timestamp": (BadReply, ("timestamp stands still at 1",)),
    "slow_start": (CannotConnect, ("did not send data within",)),
    "protective_stop": (SafetyStop, ("protective stop (3)", "loosen the screw", "never from here")),
    "emergency_stop": (SafetyStop, ("robot emergency stop (7)", "loosen the screw")),
}
# Mute ports cost their whole deadline, so it is short there; others must not depend on it.
SHORT = frozenset(("silence", "slow_start", "frozen_timestamp"))


@pytest.mark.parametrize("fault", AT_START)
def test_at_start(rig: Rig, fault_table: FaultTable, fault: str) -> None:
    emulator, robot = rig(1.0 if fault in SHORT else 15.0)
    emulator.inject(fault)
    kind, words = AT_START[fault]
    with pytest.raises(DeviceError) as caught:
        robot.open()
    assert type(caught.value) is kind
    assert_explained(caught.value, words)
    fault_table("robot", fault, "start", kind.__name__, str(caught.value))


IN_MID_RUN: dict[str, tuple[type[DeviceError], tuple[str, ...]]] = {
    "silence": (ReadTimeout, ("timestamp stands still at 1", "more than 1 s")),
    "close": (ReadTimeout, ("closed the connection", "network cable")),
    "refuse": (ReadTimeout, ("closed the connection", "network cable")),
    "garbage": (ReadTimeout, ("robot: the",)),  # how the library takes it depends on the bytes
    "bad_size": (ReadTimeout, ("process of the client library died of signal SIGABRT",)),
    "frozen_timestamp": (ReadTimeout, ("timestamp stands still at 1", "more than 1 s")),
    "protective_stop": (SafetyStop, ("protective stop (3)", "loosen the screw", "never from here")),
    "emergency_stop": (SafetyStop, ("robot emergency stop (7)", "loosen the screw")),
    "program_stopped": (SafetyStop, ("from playing (2) to stopped (1)", "Loosen the screw")),
}


@pytest.mark.parametrize("fault", IN_MID_RUN)
def test_in_mid_run(rig: Rig, fault_table: FaultTable, fault: str) -> None:
    emulator, robot = rig(15.0)
    robot.open()
    robot.collect()
    emulator.inject(fault)
    kind, words = IN_MID_RUN[fault]
    with pytest.raises(DeviceError) as caught:
        fail_in_mid_run(robot)
    assert type(caught.value) is kind
    assert_explained(caught.value, words)
    with pytest.raises(kind):  # nothing looks alive again afterwards
        robot.latest()
    with pytest.raises(kind):
        robot.state()
    fault_table("robot", fault, "mid-run", kind.__name__, str(caught.value))


@pytest.mark.parametrize(
    ("fault", "when"),
    [
        ("program_stopped", "start"),
        ("wrong_version", "mid-run"),
        ("slow_start", "mid-run"),
    ],
)
def test_what_cannot_be_seen_changes_nothing(
    rig: Rig, fault_table: FaultTable, fault: str, when: str
) -> None:
    """An arm without a program is a normal one; a handshake that is over cannot fail."""
    emulator, robot = rig(15.0)
    if when == "start":
        emulator.inject(fault)
    robot.open()
    emulator.inject(fault)
    for _ in range(3):
        assert robot.collect().count > 0
    fault_table("robot", fault, when, "none", "The measurement goes on; nothing shows of it.")


def test_the_values_that_limits_watch(rig: Rig) -> None:
    """A deviating or hot joint is no fault of the device: the limits of the protocol decide."""
    emulator, robot = rig(15.0)
    robot.open()
    emulator.inject("joint_deviation")
    emulator.inject("hot_joint")
    robot.collect()
    for _ in range(100):
        robot.collect()
        state = robot.state()
        if state.temperatures_C[2] > 60:
            break
    assert state.q[0] - state.q_target[0] == pytest.approx(0.1745, abs=1e-3)
    assert state.temperatures_C[2] == pytest.approx(85.0)


def test_all_faults_are_tested() -> None:
    in_limits = {"joint_deviation", "hot_joint"}
    assert set(AT_START) | {"program_stopped"} | in_limits == set(FAULTS)
    assert set(IN_MID_RUN) | {"wrong_version", "slow_start"} | in_limits == set(FAULTS)


def test_an_unknown_fault_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r'no fault "sleepy"; known: bad_size, close'):
        Ur10eEmulator(StillScene()).inject("sleepy")


# -- faults of the client's own parts


def test_the_client_process_is_killed(rig: Rig, fault_table: FaultTable) -> None:
    _, robot = rig(15.0)
    robot.open()
    assert robot._process is not None
    os.kill(robot._process.pid, signal.SIGKILL)
    with pytest.raises(ReadTimeout) as caught:
        fail_in_mid_run(robot)
    assert_explained(caught.value, ("died of signal SIGKILL",))
    fault_table("robot", "client killed", "mid-run", "ReadTimeout", str(caught.value))


def test_the_client_process_hangs(rig: Rig, fault_table: FaultTable) -> None:
    _, robot = rig(15.0)
    robot.open()
    assert robot._process is not None
    pid = robot._process.pid
    os.kill(pid, signal.SIGSTOP)
    with pytest.raises(ReadTimeout) as caught:
        fail_in_mid_run(robot)
    assert_explained(caught.value, ("client library does not answer", "more than 1 s"))
    assert not psutil.pid_exists(pid)
    fault_table("robot", "client hangs", "mid-run", "ReadTimeout", str(caught.value))


def test_the_controller_falls_mute_after_the_handshake(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library's constructor then never returns."""
    emulator, robot = rig(2.0)
    real_probe = probe_module.probe

    def probe_then_silence(*args: object) -> object:
        version = real_probe(*args)  # type: ignore[arg-type]
        emulator.inject("silence")
        return version

    monkeypatch.setattr("drivers.ur10e.client.probe", probe_then_silence)
    monkeypatch.setattr(robot, "_ask_dashboard", lambda deadline: {})
    with pytest.raises(CannotConnect) as caught:
        robot.open()
    assert_explained(caught.value, ("delivered no values", "although the handshake worked"))


@pytest.mark.parametrize("peek", ["latest", "state"])
def test_peeking_alone_finds_out_that_the_values_are_old(rig: Rig, peek: str) -> None:
    emulator, robot = rig(15.0)
    robot.open()
    emulator.inject("silence")
    deadline = time.monotonic() + 30
    with pytest.raises(ReadTimeout, match="more than 1 s"):
        peek_until(robot, peek, deadline)


def peek_until(robot: Ur10e, peek: str, deadline: float) -> None:
    while time.monotonic() < deadline:
        assert getattr(robot, peek)().age_s < 30
        time.sleep(0.02)


def test_a_name_service_that_stays_mute(monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()

    def mute(*_: object) -> list[object]:
        released.wait(50)
        raise OSError

    monkeypatch.setattr("socket.getaddrinfo", mute)
    settings = Ur10eSettings(driver="ur10e", host="robot.lab", connect_deadline_s=0.3)
    try:
        with pytest.raises(CannotConnect, match=r"robot\.lab:30004 did not answer within 0\.\d s"):
            Ur10e(settings, Clock()).open()
    finally:
        released.set()


def test_a_process_that_outlives_its_kill_is_left_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    process = ReceiveProcess({}, lambda _: None, lambda _: None)
    real = process._process

    def stuck(timeout: float | None = None) -> int:
        assert timeout is not None, "waits for ever"
        raise subprocess.TimeoutExpired("child", timeout)

    with monkeypatch.context() as patched:
        patched.setattr(real, "wait", stuck)
        process.stop()
    assert real.wait(10) != 0


def test_a_host_name_that_nobody_knows() -> None:
    settings = Ur10eSettings(driver="ur10e", host="no such host", connect_deadline_s=10.0)
    with pytest.raises(CannotConnect) as caught:
        Ur10e(settings, Clock()).open()
    assert_explained(caught.value, ('the host name "no such host" is unknown',))


@pytest.mark.parametrize(
    ("fault", "kind", "words"),
    [
        ("silence", CannotConnect, ("did not send a greeting: it stays mute", "dashboard: false")),
        ("close", CannotConnect, ("did not send a greeting", "dashboard: false")),
        ("refuse", CannotConnect, (":29999 refuses the connection", "dashboard: false")),
        ("garbage", CannotConnect, ("greet",)),
    ],
)
def test_the_dashboard_alone_fails(
    rig: Rig,
    monkeypatch: pytest.MonkeyPatch,
    fault: str,
    kind: type[DeviceError],
    words: tuple[str, ...],
) -> None:
    emulator, robot = rig(2.0)
    real_probe = probe_module.probe

    def probe_then_fault(*args: object) -> object:
        version = real_probe(*args)  # type: ignore[arg-type]
        emulator.inject(fault)
        return version

    monkeypatch.setattr("drivers.ur10e.client.probe", probe_then_fault)
    with pytest.raises(kind) as caught:
        robot.open()
    assert_explained(caught.value, words)
