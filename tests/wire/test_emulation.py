"""The emulated rig as the measuring process meets it, with the real client libraries."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect, DeviceError, NotDischarged
from drivers.ild2200.client import Ild2200
from drivers.kistler.client import Kistler9257B
from drivers.operator.screw import ScrewClient
from drivers.ur10e.client import Ur10e
from rig.emulation import emulated
from rig.emulation.emulated import EmulatedRig, serve_by_hand
from rig.errors import InputError
from rig.procedure.devices import Devices, make_devices, refuse_emulators, station_clock
from rig.station import Emulation, FaultPlan, Station, load_station
from rig.worlds import make_world
from rig.worlds.linear import REFERENCE_Q_RAD
from tests.true_curves import true_curve

ROOT = Path(__file__).parents[2]
Y = [0.0, 1.0, 0.0]
BUSY_S = 10.0  # that a machine which does other work may be late by
OTHER_Q = (0.0, -1.5, -1.9, -1.3, 1.57, -1.3)


def station(**emulation_changes: object) -> Station:
    found = load_station("emulated")
    assert found.emulation is not None
    changed: Emulation = replace(found.emulation, **{"speed": 20.0, **emulation_changes})  # type: ignore[arg-type]
    return replace(found, emulation=changed)


def eventually(condition: Callable[[], bool], deadline_s: float = 60.0) -> bool:
    end = time.monotonic() + deadline_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return condition()


def gone(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


@pytest.fixture
def rig() -> Iterator[EmulatedRig]:
    rig = EmulatedRig(station(), {"P1": REFERENCE_Q_RAD, "P2": OTHER_Q}, {"hold": OTHER_Q})
    yield rig
    rig.stop()


def test_every_address_is_filled_in(rig: EmulatedRig) -> None:
    given = station()
    with rig as running:
        assert running.robot and running.dynamometer and running.laser  # noqa: PT018
        assert running.robot.host.startswith("127.")
        assert str(running.dynamometer.grpc_server).startswith("127.0.0.1:")
        assert Path(running.laser.port).exists()
        assert str(running.operator.screw).startswith("127.0.0.1:")
        assert replace(running.robot, host="emulated") == given.robot
        assert running.emulation == given.emulation


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("robot", 'serial number "0000000000-EMULATED"'),
        ("dynamometer", 'daq product type "emulated NI DAQ"'),
        ("laser", 'info "ILD2200 emulator '),
    ],
)
def test_an_emulator_at_the_address_of_a_real_device_is_refused(
    rig: EmulatedRig, name: str, said: str
) -> None:
    quiet = SimpleNamespace(identity=dict)
    with rig as running, ExitStack() as stack:
        devices = make_devices(replace(running, emulation=None), station_clock(running))
        device = getattr(devices, name)
        stack.callback(device.close)
        device.open()
        found = Devices(**{**dict.fromkeys(("robot", "dynamometer", "laser"), quiet), name: device})
        refuse_emulators(running, found)
        words = f"{running.path}: the {name} calls itself emulated ({said}"
        with pytest.raises(InputError, match=re.escape(words)):
            refuse_emulators(replace(running, emulation=None), found)


def test_a_person_at_the_console_gets_no_screw() -> None:
    given = station()
    console = replace(given, operator=replace(given.operator, driver="console", screw=None))
    endpoints = {"robot": "127.1.2.3", "dynamometer": "127.0.0.1:1", "laser": "/dev/pts/0"}
    filled = emulated._with_endpoints(console, {**endpoints, "operator": "127.0.0.1:2"})
    assert filled.operator.screw is None


def test_the_real_clients_see_the_world(rig: EmulatedRig) -> None:
    world = make_world("paper", 1)
    with ExitStack() as stack:
        running = stack.enter_context(rig)
        clock = Clock(20.0)
        assert running.robot and running.dynamometer and running.laser  # noqa: PT018
        robot = Ur10e(replace(running.robot, stale_after_s=BUSY_S), clock, emulated=True)
        dynamometer = Kistler9257B(
            replace(running.dynamometer, stale_after_s=BUSY_S), clock, emulated=True
        )
        laser = Ild2200(replace(running.laser, stale_after_s=BUSY_S), clock, emulated=True)
        for device in (robot, dynamometer, laser):
            stack.callback(device.close)
            device.open()
        assert robot.state().q == pytest.approx(REFERENCE_Q_RAD, abs=1e-3)
        screw = ScrewClient(str(running.operator.screw))
        stack.callback(screw.close)
        screw.mount(Y, None)
        dynamometer.reset()
        dynamometer.operate()
        dynamometer.collect()
        clock.sleep(2.0)
        dynamometer.tare(dynamometer.collect())
        start = laser.collect().values[0]
        screw.turn(1.5e-3)
        clock.sleep(15.0)
        for device in (dynamometer, laser):
            device.collect()
        clock.sleep(2.0)
        force = dynamometer.collect().values[:3]
        moved_mm = laser.collect().values[0] - start
        q1 = robot.state().q[0]
    # 1.2 mm shared by screw (5000 N/mm) and arm (57.4 N/mm); gains and drift within 3 %
    assert force[1] == pytest.approx(1.2 / (1 / 57.4 + 1 / 5000), rel=0.03)
    assert abs(force[0]) < 1.0
    true_mm = 1e3 * true_curve(world, Y, [force[1] / world.force_gain])[0]
    assert moved_mm / world.displacement_gain == pytest.approx(true_mm, rel=0.025)
    assert (q1 - REFERENCE_Q_RAD[0]) == pytest.approx(force[1] * 0.75 / 36840, rel=0.05)


def test_the_screw_moves_the_arm_to_another_pose(rig: EmulatedRig) -> None:
    with ExitStack() as stack:
        running = stack.enter_context(rig)
        assert running.robot
        robot = Ur10e(running.robot, Clock(20.0), emulated=True)
        stack.callback(robot.close)
        robot.open()
        screw = ScrewClient(str(running.operator.screw))
        stack.callback(screw.close)
        screw.mount(Y, OTHER_Q)
        assert eventually(lambda: robot.state().q == pytest.approx(OTHER_Q, abs=1e-3), 5.0)


def test_the_switch_of_the_amplifier_is_turned_at_the_screws_port() -> None:
    given = station()
    assert given.dynamometer
    by_hand = replace(given, dynamometer=replace(given.dynamometer, reset_line=None))
    with ExitStack() as stack:
        running = stack.enter_context(EmulatedRig(by_hand, {"P1": REFERENCE_Q_RAD}))
        assert running.dynamometer
        dynamometer = Kistler9257B(running.dynamometer, Clock(20.0), emulated=True)
        stack.callback(dynamometer.close)
        dynamometer.open()
        screw = ScrewClient(str(running.operator.screw))
        stack.callback(screw.close)
        screw.mount(Y, None)
        screw.turn(1.5e-3)
        with pytest.raises(NotDischarged, match="switch does not stand at Reset"):
            dynamometer.reset()
        screw.request(amplifier="reset")
        dynamometer.reset()
        with pytest.raises(BadReply, match='turned to "reset" or "operate"'):
            screw.request(amplifier="off")


# --- faults ----------------------------------------------------------------------------------


def _laser_fails(running: Station, deadline_s: float) -> str:
    """The laser's error within the deadline, or an empty text."""
    assert running.laser
    laser = Ild2200(running.laser, Clock(20.0), emulated=True)
    failure: list[str] = []

    def failed() -> bool:
        try:
            laser.collect()
        except DeviceError as error:
            failure.append(str(error))
        return bool(failure)

    try:
        laser.open()
        eventually(failed, deadline_s)
    except DeviceError as error:
        return str(error)
    finally:
        laser.close()
    return failure[0] if failure else ""


def test_a_fault_at_the_start_is_there_before_anyone_connects() -> None:
    fault = FaultPlan(device="laser", kind="no_object", at="start")
    with EmulatedRig(station(faults=(fault,))) as running:
        assert "laser" in _laser_fails(running, 10.0)


def test_a_scheduled_fault_waits_for_the_operator() -> None:
    fault = FaultPlan(device="laser", kind="no_object", after_s=10.0)
    with EmulatedRig(station(faults=(fault,))) as running:
        assert _laser_fails(running, 1.5) == ""  # 30 s of the scene
        screw = ScrewClient(str(running.operator.screw))
        screw.mount(Y, None)
        screw.close()
        assert "laser" in _laser_fails(running, 10.0)


def test_a_fault_on_demand(rig: EmulatedRig) -> None:
    with rig as running:
        rig.fault("laser", "no_object")
        assert "laser" in _laser_fails(running, 10.0)


def test_unknown_faults_name_the_known(rig: EmulatedRig) -> None:
    with rig:
        with pytest.raises(InputError, match=r'the laser has no fault "silense".*"silence"\?'):
            rig.fault("laser", "silense")
        with pytest.raises(InputError, match=r'no emulated device "screw".*dynamometer, laser'):
            rig.fault("screw", "silence")
        rig.fault("laser", "silence")  # it still answers


def test_an_unknown_scheduled_fault_is_refused_at_the_start() -> None:
    fault = FaultPlan(device="robot", kind="melted", after_s=3.0)
    given = station(faults=(fault,))
    with pytest.raises(InputError, match=r'emulation\.faults\[0\]: the robot has no fault "melt'):
        EmulatedRig(given).start()
    written = "faults: [{device: robot, kind: melted, after_s: 3}]"
    text = given.text.replace("faults: []", written)
    line = 1 + text[: text.index("kind: melted")].count("\n")
    place = re.escape(f"{given.path}:{line}:") + r"\d+: emulation\.faults\[0\]: "
    with pytest.raises(InputError, match=place):
        EmulatedRig(replace(given, text=text)).start()


def test_an_unknown_world_is_refused_at_the_start() -> None:
    with pytest.raises(InputError, match='"papr" is not known'):
        EmulatedRig(station(world="papr")).start()


def test_a_station_with_hardware_is_refused() -> None:
    with pytest.raises(InputError, match=r"ur10e_lab\.yaml: the station has no emulation"):
        serve_by_hand(load_station("ur10e_lab"))


# --- its end ---------------------------------------------------------------------------------


def test_stop_leaves_no_process(rig: EmulatedRig) -> None:
    rig.start()
    pid = rig.pid
    assert pid is not None
    rig.stop()
    assert gone(pid)
    rig.stop()


def test_it_ends_when_the_measuring_process_is_killed() -> None:
    code = (
        "import time\n"
        "from rig.emulation.emulated import EmulatedRig\n"
        "from rig.station import load_station\n"
        "rig = EmulatedRig(load_station('emulated')); rig.start()\n"
        "print(rig.pid, flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE)
    assert parent.stdout
    pid = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    assert eventually(lambda: gone(pid))


def test_sigterm_ends_it_and_the_next_request_says_so(rig: EmulatedRig) -> None:
    rig.start()
    assert rig.pid
    os.kill(rig.pid, signal.SIGTERM)
    pid = rig.pid
    assert eventually(lambda: gone(pid))
    with pytest.raises(CannotConnect, match="the process of the emulators has ended, status 0"):
        rig.fault("laser", "silence")


def test_quit_at_the_screws_port_ends_it(rig: EmulatedRig) -> None:
    running, pid = rig.start(), rig.pid
    assert pid
    screw = ScrewClient(str(running.operator.screw))
    with suppress(DeviceError):  # it may be gone before it has answered
        screw.request(quit=True)
    screw.close()
    assert eventually(lambda: gone(pid))


def _stand_in(folder: Path, code: str) -> str:
    script = folder / "interpreter"
    script.write_text(f"#!/bin/sh\nexec {sys.executable} -c '{code}'\n")
    script.chmod(0o755)
    return str(script)


def test_a_child_that_dies_is_reported_with_its_last_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dying = _stand_in(tmp_path, 'import sys; sys.exit("no room")')
    monkeypatch.setattr(sys, "executable", dying)
    with pytest.raises(CannotConnect, match=r"emulation: .* ended, status 1: no room\. Start"):
        EmulatedRig(station()).start()


def test_a_child_that_stays_mute_is_given_up_and_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", _stand_in(tmp_path, "import time; time.sleep(100)"))
    monkeypatch.setattr(emulated, "ENDING_S", 0.1)
    rig, spawned = EmulatedRig(station()), []
    stop = rig.stop
    monkeypatch.setattr(rig, "stop", lambda: (spawned.append(rig.pid), stop()))
    with pytest.raises(CannotConnect, match=r"not answered within 0\.5 s"):
        rig.start(deadline_s=0.5)
    assert rig.pid is None
    assert gone(spawned[0])


# --- by hand ---------------------------------------------------------------------------------


def test_the_child_by_hand_prints_its_addresses_and_ends_with_its_input() -> None:
    files = ["protocols/stations/emulated.yaml", "protocols/load_unload_hold.yaml"]
    child = subprocess.Popen(
        [sys.executable, "-m", "rig.emulation.emulated", *files],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    assert child.stdin
    assert child.stdout
    endpoints = json.loads(child.stdout.readline())["endpoints"]
    assert sorted(endpoints) == ["dynamometer", "laser", "operator", "robot"]
    child.stdin.close()
    assert child.wait(timeout=20) == 0
    child.stdout.close()


def test_the_child_by_hand_with_a_wrong_file() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rig.emulation.emulated", "nowhere.yaml"],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 2
    assert "nowhere.yaml" in done.stderr
    assert "Traceback" not in done.stderr


def test_rig_emulate_shows_all_and_ends_by_ctrl_c() -> None:
    code = (
        "import signal\n"
        "from rig.emulation.emulated import serve_by_hand\n"
        "from rig.station import load_station\n"
        # a test run in the background of a shell hands down that Ctrl-C is ignored
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "serve_by_hand(load_station('emulated'))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout
    table = []
    while not table or "Ctrl-C" not in table[-1]:
        line = process.stdout.readline()
        assert line, "it ended early"
        table.append(line)
    process.send_signal(signal.SIGINT)
    rest, complaints = process.communicate(timeout=20)
    text = "".join(table)
    assert text.startswith("EMULATED station emulated: world paper")
    for word in ("robot ", "dynamometer ", "laser ", "screw ", "frozen_timestamp", "no_reset"):
        assert word in text
    assert text.count("does not simulate:") == 4
    assert max(map(len, table)) <= 101
    assert rest == "\nemulators stopped\n"
    assert complaints == ""
    assert process.returncode == 0
