"""The UR10e's client and emulator through the real ur-rtde, when nothing is wrong; its motion."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import psutil
import pytest

from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect, NotWanted, SafetyStop
from drivers.interfaces import Robot
from drivers.stream import Block, Stream
from drivers.ur10e.client import Ur10e
from drivers.ur10e.dashboard import Dashboard
from drivers.ur10e.emulator import Ur10eEmulator
from drivers.ur10e.settings import Ur10eSettings
from drivers.ur10e.words import PLAYING, STOPPED
from tests.wire.processes import children_running
from tests.wire.scene import StillScene

PROJECT = Path(__file__).resolve().parents[2]
REFERENCE = (0.1, -0.2, 0.3, -0.4, 0.5, -0.6)

pytestmark = pytest.mark.timeout(60)

Rig = Callable[..., tuple[StillScene, Ur10eEmulator, Ur10e]]


@pytest.fixture
def rig() -> Iterator[Rig]:
    """Scene, started emulator and client that is not open yet; afterwards nothing may remain."""
    with ExitStack() as stack:

        def make(
            speed: float = 1.0,
            frequency_Hz: float = 125.0,
            dashboard: bool = True,
            **options: object,
        ) -> tuple[StillScene, Ur10eEmulator, Ur10e]:
            scene = StillScene(speed)
            programs = {"reference.urp": REFERENCE}
            emulator = Ur10eEmulator(scene, programs=programs, **options)  # type: ignore[arg-type]
            stack.callback(emulator.stop)
            settings = Ur10eSettings(
                driver="ur10e",
                host=emulator.start(),
                frequency_Hz=frequency_Hz,
                dashboard=dashboard,
                connect_deadline_s=15.0,
                stale_after_s=5.0,
            )
            robot = Ur10e(settings, Clock(speed), emulated=True)
            stack.callback(robot.close)
            return scene, emulator, robot

        yield make
    assert children_running("drivers.ur10e.child") == []


def test_a_first_block_that_is_handed_over_late_is_waited_for(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a busy machine may stop the thread between taking the values in and handing the block over
    def late(
        stream: Stream, block: Block, put: Callable[[Stream, Block], None] = Stream.put
    ) -> None:
        time.sleep(0.3)
        put(stream, block)

    monkeypatch.setattr(Stream, "put", late)
    _, _, robot = rig()
    robot.open()
    assert robot.latest().count > 0


def test_every_column_arrives_in_its_place(rig: Rig) -> None:
    scene, _, robot = rig()
    scene.q = np.arange(6) / 10 + 0.05
    scene.q_target = np.arange(6) / 10
    scene.pose = np.array([0.7, 0.1, 0.4, 1.0, 2.0, 0.5])
    robot.open()
    reading = robot.collect()

    got = dict(zip((s.name for s in robot.signals), reading.values, strict=True))
    assert reading.count > 0
    assert reading.source == "emulated+ur10e"
    assert reading.invalid == 0
    assert reading.problems == ()
    for n in range(6):
        assert got[f"q{n + 1}_rad"] == pytest.approx(n / 10 + 0.05, abs=1e-4)
        assert got[f"target_q{n + 1}_rad"] == pytest.approx(n / 10, abs=1e-12)
        assert got[f"current{n + 1}_A"] == pytest.approx(scene.current[n], abs=0.1)
        assert got[f"target_current{n + 1}_A"] == pytest.approx(scene.current[n], abs=1e-12)
        assert got[f"temperature{n + 1}_C"] == pytest.approx(scene.temperatures_C[n], abs=1e-9)
    places = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")
    for name, wanted in zip(places, scene.pose, strict=True):
        assert got[f"tcp_{name}"] == pytest.approx(wanted, abs=1e-4)
    modes = ("robot_mode", "safety_mode", "safety_status_bits", "runtime_state")
    assert [got[name] for name in modes] == [7, 1, 1, PLAYING]


def test_meets_the_interface_and_says_who_was_measured(rig: Rig) -> None:
    _, _, robot = rig()
    as_robot: Robot = robot  # checked by the type checker
    as_robot.open()
    identity = robot.identity()
    assert identity["source"] == "emulated+ur10e"
    assert identity["controller_version"] == "5.12.2.1101534"
    assert identity["model"] == "UR10"
    assert "EMULATED" in identity["serial_number"]
    assert identity["safety_status"] == "NORMAL"


def test_a_value_counts_once_however_often_it_is_read(rig: Rig) -> None:
    """At 10 messages a second the library is read twenty times as often."""
    _, _, robot = rig(frequency_Hz=10.0)
    robot.open()
    place = [s.name for s in robot.signals].index("controller_time_s")
    robot.collect()
    first = robot.latest().values[place]
    count = 0
    while count < 8:
        reading = robot.collect()
        count += reading.count
    assert count <= (robot.latest().values[place] - first) * 10 + 2


def test_readings_lie_on_the_clock_and_do_not_overlap(rig: Rig) -> None:
    _, _, robot = rig(speed=20.0)
    clock = robot._clock
    robot.open()
    one, two = robot.collect(), robot.collect()
    assert 0 < one.start <= one.end < two.start <= two.end < clock.now()
    assert robot.latest().age_s < 5.0


def test_without_dashboard_only_rtde_is_used(rig: Rig) -> None:
    _, emulator, robot = rig(dashboard=False)
    robot.open()
    assert robot.collect().count > 0
    assert emulator.commands == ()
    with pytest.raises(BadReply, match="dashboard: false"):
        robot.go_to_reference("reference.urp", REFERENCE, 1e-3, 5.0)


def test_two_clients_share_one_controller(rig: Rig) -> None:
    _, _, robot = rig()
    other = Ur10e(robot._settings, Clock(), emulated=True)
    robot.open()
    try:
        other.open()
        assert robot.collect().count > 0
        assert other.collect().count > 0
    finally:
        other.close()


def test_reading_alone_sends_questions_only(rig: Rig) -> None:
    _, emulator, robot = rig()
    robot.open()
    robot.collect()
    robot.close()
    assert not {c.split()[0] for c in emulator.commands} & {
        "load",
        "play",
        "stop",
        "power",
        "brake",
    }


def test_closing_twice_opening_again_and_reading_when_closed(rig: Rig) -> None:
    _, _, robot = rig()
    robot.close()
    robot.open()
    robot.close()
    robot.close()
    with pytest.raises(CannotConnect, match="not open"):
        robot.collect()
    robot.open()
    assert robot.collect().count > 0


def collect_until_it_fails(robot: Ur10e) -> None:
    for _ in range(200):
        robot.collect()


# -- the reference pose


@pytest.mark.parametrize("programs_end", [False, True])
def test_the_reference_program_moves_the_arm_and_arrival_is_read(
    rig: Rig, programs_end: bool
) -> None:
    scene, _, robot = rig(speed=50.0, programs_end=programs_end)
    robot.open()
    robot.go_to_reference("reference.urp", REFERENCE, 1e-3, 20.0)
    state = robot.state()
    assert state.q == pytest.approx(REFERENCE, abs=1e-3)
    assert scene.q_target == pytest.approx(REFERENCE, abs=1e-9)
    assert state.runtime_state == (STOPPED if programs_end else PLAYING)
    q1 = [s.name for s in robot.signals].index("q1_rad")
    assert robot.collect().values[q1] == pytest.approx(REFERENCE[0], abs=1e-3)  # no motion in it


def test_a_program_that_is_not_there(rig: Rig) -> None:
    _, emulator, robot = rig()
    robot.open()
    with pytest.raises(BadReply, match=r"File not found: missing\.urp.*pendant"):
        robot.go_to_reference("missing.urp", REFERENCE, 1e-3, 5.0)
    assert "play" not in emulator.commands


def test_a_program_name_is_no_way_to_send_commands(rig: Rig) -> None:
    _, emulator, robot = rig()
    robot.open()
    before = emulator.commands
    with pytest.raises(BadReply, match="is not one printable line, and was not sent"):
        robot.go_to_reference("reference.urp\npower off", REFERENCE, 1e-3, 5.0)
    assert emulator.commands == before


@pytest.mark.parametrize(
    ("programs_end", "deadline_s", "words"),
    [(True, 20.0, "ended with joint 2 0.5000 rad away"), (False, 2.0, "did not arrive within 2 s")],
)
def test_a_program_that_leads_elsewhere_is_stopped(
    rig: Rig, programs_end: bool, deadline_s: float, words: str
) -> None:
    _, emulator, robot = rig(speed=50.0, programs_end=programs_end)
    robot.open()
    wanted = (REFERENCE[0], REFERENCE[1] - 0.5, *REFERENCE[2:])
    with pytest.raises(BadReply) as caught:
        robot.go_to_reference("reference.urp", wanted, 1e-3, deadline_s)
    assert words in str(caught.value).replace("0.4999", "0.5000").replace("0.5001", "0.5000")
    assert "allowed 0.0010 rad" in str(caught.value)
    assert emulator.commands[-1] == "stop"


def test_a_protective_stop_on_the_way_is_never_released(rig: Rig) -> None:
    scene, emulator, robot = rig(speed=2.0)
    robot.open()
    stops = iter((False, False, True))
    original = robot._state

    def state() -> object:
        if next(stops, False):
            emulator.inject("protective_stop")
        return original()

    robot._state = state  # type: ignore[method-assign,assignment]
    with pytest.raises(SafetyStop, match="protective stop"):
        robot.go_to_reference("reference.urp", REFERENCE, 1e-3, 20.0)
    assert 0 <= scene.q_target[0] < REFERENCE[0]  # stands where it was stopped
    assert {c.split()[0] for c in emulator.commands} & {"unlock", "power", "brake"} == set()
    with pytest.raises(SafetyStop):
        robot.accept_present_state()
    with pytest.raises(SafetyStop):
        robot.go_to_reference("reference.urp", REFERENCE, 1e-3, 20.0)


def test_ctrl_c_on_the_way_stops_the_program(rig: Rig) -> None:
    _, emulator, robot = rig()
    robot.open()

    def interrupted() -> object:
        raise KeyboardInterrupt

    robot._state = interrupted  # type: ignore[method-assign,assignment]
    with pytest.raises(KeyboardInterrupt):
        robot.go_to_reference("reference.urp", REFERENCE, 1e-3, 20.0)
    assert emulator.commands[-1] == "stop"


def test_a_motion_that_is_no_longer_wanted_is_stopped(rig: Rig) -> None:
    scene, emulator, robot = rig()
    robot.open()
    with pytest.raises(NotWanted, match=r'"reference\.urp" was called off before the arm arrived'):
        robot.go_to_reference("reference.urp", REFERENCE, 1e-3, 20.0, _for_s(0.3))
    assert emulator.commands[-2:] == ("play", "stop")
    stands = scene.q_target.copy()
    assert 0 < stands[0] < REFERENCE[0]
    time.sleep(0.2)
    assert scene.q_target.tolist() == stands.tolist()


def test_a_motion_that_is_not_wanted_never_begins(rig: Rig) -> None:
    _, emulator, robot = rig()
    robot.open()
    with pytest.raises(NotWanted):
        robot.go_to_reference("reference.urp", REFERENCE, 1e-3, 20.0, lambda: False)
    assert "play" not in emulator.commands


def _for_s(seconds: float) -> Callable[[], bool]:
    end: list[float] = []

    def wanted() -> bool:
        end.append(time.monotonic() + seconds)
        return time.monotonic() < end[0]

    return wanted


def test_a_second_ctrl_c_does_not_cut_the_stop_short(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, emulator, robot = rig()
    robot.open()
    monkeypatch.setattr(Dashboard, "__init__", _slowly(Dashboard.__init__))

    def impatient(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    earlier = signal.signal(signal.SIGALRM, impatient)
    wanted = _for_s(0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            robot.go_to_reference(
                "reference.urp", REFERENCE, 1e-3, 20.0, lambda: wanted() or _alarm()
            )
    finally:
        signal.signal(signal.SIGALRM, earlier)
    assert emulator.commands[-1] == "play"
    deadline = time.monotonic() + 5
    while emulator.commands[-1] != "stop":
        assert time.monotonic() < deadline
        time.sleep(0.02)


def _alarm() -> bool:
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    return False


def _slowly(call: Callable[..., None]) -> Callable[..., None]:
    def later(*given: object) -> None:
        time.sleep(0.4)
        call(*given)

    return later


def test_a_move_by_hand_is_accepted_only_when_said_so(rig: Rig) -> None:
    _, emulator, robot = rig()
    robot.open()
    emulator.inject("program_stopped")
    with pytest.raises(SafetyStop, match=r"playing \(2\) to stopped \(1\)"):
        collect_until_it_fails(robot)
    with pytest.raises(SafetyStop):  # it stays
        robot.latest()
    robot.accept_present_state()
    assert robot.collect().count > 0
    assert robot.state().runtime_state == STOPPED


# -- nothing is left behind


def test_the_client_process_leaves_by_itself_when_its_input_closes(rig: Rig) -> None:
    _, _, robot = rig()
    robot.open()
    process = robot._process
    assert process is not None
    robot.close()
    assert process._process.returncode == 0  # not killed


_OPEN_AND_WAIT = """
import json, sys, time
from drivers.clock import Clock
from drivers.ur10e.client import Ur10e
from drivers.ur10e.settings import Ur10eSettings
robot = Ur10e(Ur10eSettings(driver="ur10e", host=sys.argv[1], connect_deadline_s=15), Clock())
robot.open()
print(robot._process.pid, flush=True)
time.sleep(60)
"""


def gone(pid: int, within_s: float = 20.0) -> bool:
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        try:
            if psutil.Process(pid).status() == psutil.STATUS_ZOMBIE:
                return True
        except psutil.NoSuchProcess:
            return True
        time.sleep(0.02)
    return False


@pytest.mark.skipif(sys.platform == "win32", reason="there is no kill -9")
def test_the_client_process_goes_with_its_killed_parent(rig: Rig) -> None:
    _, _, robot = rig()
    parent = subprocess.Popen(
        [sys.executable, "-c", _OPEN_AND_WAIT, robot._settings.host],
        stdout=subprocess.PIPE,
        cwd=PROJECT,
    )
    with parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert psutil.pid_exists(child)
        os.kill(parent.pid, signal.SIGKILL)
    assert gone(child)


def test_the_watchdog_ends_a_constructor_that_hangs(rig: Rig) -> None:
    """The library holds the interpreter's lock there: neither parent nor signal handler helps."""
    _, emulator, robot = rig()
    emulator.inject("silence")
    options = {
        "host": robot._settings.host,
        "frequency_Hz": 125,
        "connect_s": 0.1,
        "block_s": 0.1,
        "poll_s": 0.004,
    }
    child = subprocess.Popen(
        [sys.executable, "-m", "drivers.ur10e.child", json.dumps(options)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=PROJECT,
    )
    with child:
        try:
            assert child.wait(20) == 1
        finally:
            child.kill()


def test_what_the_library_prints_does_not_mix_with_the_messages(tmp_path: Path) -> None:
    talkative = "import os\nclass RTDEReceiveInterface:\n    def __init__(self, *_):\n"
    talkative += "        os.write(1, b'chatter')\n        raise RuntimeError('out of order')\n"
    (tmp_path / "rtde_receive.py").write_text(talkative)
    options = {"host": "", "frequency_Hz": 125, "connect_s": 9, "block_s": 0.1, "poll_s": 0.004}
    child = subprocess.Popen(
        [sys.executable, "-m", "drivers.ur10e.child", json.dumps(options)],
        stdin=subprocess.PIPE,  # stays open: closing it would end the child
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=PROJECT,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )
    with child:
        assert child.wait(20) == 3
        assert child.stdout is not None
        assert child.stderr is not None
        assert json.loads(child.stdout.read()) == {"error": "out of order"}
        assert child.stderr.read() == b"chatter"


def test_a_mean_of_attitudes_is_an_attitude(rig: Rig) -> None:
    """A tool that points down turns by pi; there the controller's rotation vector flips."""
    scene, _, robot = rig()
    scene.pose = np.array([0.7, 0.0, 0.4, 0.0, math.pi, 0.0])
    scene_arm = scene.arm
    flips = iter(range(10**9))

    def flipping(t: np.ndarray) -> object:
        scene.pose = scene.pose * np.array([1, 1, 1, 1, -1 if next(flips) % 2 else 1, 1])
        return scene_arm(t)

    scene.arm = flipping  # type: ignore[method-assign,assignment]
    robot.open()
    place = [s.name for s in robot.signals].index("tcp_ry_rad")
    reading = robot.collect()
    assert abs(reading.values[place]) == pytest.approx(math.pi, abs=1e-3)
    assert reading.sd[place] < 1e-3
