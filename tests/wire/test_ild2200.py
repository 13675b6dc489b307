"""The laser's client against its emulator: real bytes over a pseudo terminal, real pyserial."""

from __future__ import annotations

import errno
import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import serial

from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect, DeviceError, OutOfRange, ReadTimeout
from drivers.ild2200 import commands, complaints
from drivers.ild2200.client import Ild2200
from drivers.ild2200.commands import Command
from drivers.ild2200.emulator import FAULTS, Ild2200Emulator
from drivers.ild2200.settings import Ild2200Settings
from tests.wire.conftest import FaultTable
from tests.wire.scene import StillScene

RATE_HZ = 2500
STALE_S, CONNECT_S = 1.0, 5.0
SOON = {"stale_after_s": 0.5, "connect_deadline_s": 1.2}  # where an error is expected


class Bench:
    """An emulator, and clients that are closed at the end."""

    def __init__(self) -> None:
        self.scene = StillScene()
        self.emulators: list[Ild2200Emulator] = []
        self.clients: list[Ild2200] = []

    def emulator(self, **options: object) -> tuple[Ild2200Emulator, str]:
        options = {"output_rate_Hz": RATE_HZ, "serial_number": "04711", **options}
        emulator = Ild2200Emulator(self.scene, **options)  # type: ignore[arg-type]
        self.emulators.append(emulator)
        return emulator, emulator.start()

    def client(self, port: str, **changes: object) -> Ild2200:
        settings = {
            "driver": "ild2200",
            "port": port,
            "output_rate_Hz": RATE_HZ,
            "connect_deadline_s": CONNECT_S,
            "stale_after_s": STALE_S,
        }
        client = Ild2200(
            Ild2200Settings(**{**settings, **changes}),  # type: ignore[arg-type]
            Clock(self.scene.speed),
            emulated=True,
        )
        self.clients.append(client)
        return client

    def close(self) -> None:
        for client in self.clients:
            client.close()
        for emulator in self.emulators:
            emulator.stop()


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.close()
    left = [t.name for t in threading.enumerate() if t.name.startswith("ild2200")]
    assert left == []


def until(condition: Callable[[], bool], seconds: float = 10.0) -> bool:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.02)
    return False


def test_a_port_in_use_is_refused_and_left_alone(bench: Bench) -> None:
    _, port = bench.emulator()
    first, second = bench.client(port), bench.client(port)
    first.open()
    words = "another program has it open.*End the other program"
    with pytest.raises(CannotConnect, match=words):
        second.open()
    time.sleep(2 * STALE_S)  # nobody took its values
    assert first.latest().count > 0


def test_identifies_itself_and_measures(bench: Bench) -> None:
    _, port = bench.emulator(linearity_um=0.0)
    laser = bench.client(port)
    laser.open()
    identity = laser.identity()
    assert identity["serial_number"] == "04711"
    assert identity["range_mm"] == "10"
    assert identity["output_rate_Hz"] == "2500"
    assert identity["source"].startswith("emulated")
    assert until(lambda: laser.latest().count > 0)
    time.sleep(0.5)
    reading = laser.collect()
    assert reading.source.startswith("emulated")
    assert reading.count > 100
    assert reading.invalid == 0
    assert reading.values[0] == pytest.approx(5.0, abs=5e-3 / math.sqrt(reading.count) + 1e-4)
    assert 0.7e-3 < reading.sd[0] < 1.3e-3
    assert reading.age_s < STALE_S
    assert reading.problems == ()


@pytest.mark.parametrize("sign", [1, -1])
def test_follows_the_target(bench: Bench, sign: int) -> None:
    _, port = bench.emulator(sign=sign)
    laser = bench.client(port)
    laser.open()
    for step in range(1, 9):
        bench.scene.displacement = 0.25e-3 * step
        time.sleep(0.03)
    assert until(lambda: abs(laser.latest().values[0] - (5.0 + sign * 2.0)) < 2e-3)


def test_every_value_is_collected_once(bench: Bench) -> None:
    _, port = bench.emulator()
    laser = bench.client(port)
    laser.open()
    laser.collect()
    begin = time.monotonic()
    count, last_end = 0, -math.inf
    while time.monotonic() - begin < 0.7:
        reading = laser.collect()
        assert reading.start >= last_end
        last_end = reading.end
        count += reading.count
    sent = RATE_HZ * (time.monotonic() - begin) + 4095 / 3  # and what waited in the port
    assert 0 < count <= sent


def test_a_target_out_of_range_is_told_by_its_side_and_comes_back(bench: Bench) -> None:
    _, port = bench.emulator(start_mm=9.9)
    laser = bench.client(port)
    laser.open()
    bench.scene.displacement = 0.3e-3
    with pytest.raises(OutOfRange, match="beyond the range"):
        keep_reading(laser)
    bench.scene.displacement = 0.0
    assert until(lambda: measures(laser))


def measures(laser: Ild2200) -> bool:
    with suppress(DeviceError):
        return laser.latest().count > 0
    return False


def keep_reading(laser: Ild2200, seconds: float = 4.0) -> tuple[str, ...]:
    """Collects as a procedure does; the problems that were named."""
    problems: dict[str, None] = {}
    begin = time.monotonic()
    while time.monotonic() - begin < seconds:
        problems |= dict.fromkeys(laser.collect().problems)
        laser.latest()
        time.sleep(0.05)
    return tuple(problems)


Outcome = tuple[type[DeviceError] | None, str]
MEASURES: Outcome = (None, "")

AT_START: dict[str, Outcome] = {
    "silence": (CannotConnect, "no answer to INFO .*, and no values either"),
    "close": (CannotConnect, "cannot open the serial port"),
    "garbage": (CannotConnect, "the bytes that come are no values"),
    "lost_bytes": MEASURES,
    "bit_flips": MEASURES,
    "no_object": (OutOfRange, r"no object \(65522\)"),
    "before_range": (OutOfRange, r"before the range \(65524\)"),
    "beyond_range": (OutOfRange, r"beyond the range \(65526\)"),
    "poor_target": (BadReply, r"poor target \(65528\)"),
    "laser_off": (BadReply, r"the laser is switched off\. .*, then start again\."),
    "unknown_error_value": (BadReply, r"unknown error value \(65532\)"),
    "relative_zero": (BadReply, r"relative zero.*, then start again\."),
    "wrong_range": (BadReply, "range of 50 mm"),
    "wrong_rate": (BadReply, "sends 5000 values/s"),
    "mute_to_commands": (CannotConnect, "no answer to INFO .*, although values come"),
}
IN_MID_RUN: dict[str, Outcome] = {
    **AT_START,
    "silence": (ReadTimeout, r"has sent nothing for .*, then go on with --resume\."),
    "close": (ReadTimeout, r"has gone .*, then go on with --resume\."),
    "garbage": (BadReply, "bytes that are no values"),
    "laser_off": (BadReply, r"laser off \(65530\)\. .*, then go on with --resume\."),
    "relative_zero": (BadReply, r"relative zero.*, then go on with --resume\."),
    "mute_to_commands": MEASURES,
}


def test_every_fault_is_tried() -> None:
    assert set(AT_START) == set(IN_MID_RUN) == set(FAULTS)


def record(table: FaultTable, fault: str, when: str, error: DeviceError | None) -> None:
    kind = "measures on" if error is None else type(error).__name__
    text = "bad values are left out and counted" if error is None else str(error)
    if error is None and fault == "mute_to_commands":
        text = "commands are given at start only"
    table("laser", fault, when, kind, text)


def test_a_port_that_vanishes_before_anything_was_measured_is_not_resumed() -> None:
    said = complaints.unplugged("/dev/ttyUSB0", OSError("gone"), connecting=True)
    assert said.remedy == "Plug the adapter in again, check the cable, then start again."


@pytest.mark.parametrize("fault", sorted(AT_START))
def test_fault_at_start(bench: Bench, fault: str, fault_table: FaultTable) -> None:
    emulator, port = bench.emulator()
    emulator.inject(fault)
    if fault == "close":
        emulator.stop()
    kind, message = AT_START[fault]
    # On a line that loses bytes replies may have to be asked for again.
    laser = bench.client(port, **({"connect_deadline_s": 15.0} if kind is None else SOON))
    if kind is None:
        laser.open()
        assert until(lambda: laser.collect().invalid > 0)
        assert laser.latest().values[0] == pytest.approx(5.0, abs=0.1)
        record(fault_table, fault, "at start", None)
        return
    begin = time.monotonic()
    with pytest.raises(kind, match=message) as caught:
        laser.open()
    assert time.monotonic() - begin < SOON["connect_deadline_s"] + 3.0
    assert caught.value.device == "laser"
    assert caught.value.remedy.endswith(".")
    record(fault_table, fault, "at start", caught.value)


@pytest.mark.parametrize("fault", sorted(IN_MID_RUN))
def test_fault_in_mid_run(bench: Bench, fault: str, fault_table: FaultTable) -> None:
    emulator, port = bench.emulator()
    kind, message = IN_MID_RUN[fault]
    laser = bench.client(port, stale_after_s=STALE_S if kind is None else SOON["stale_after_s"])
    laser.open()
    laser.collect()
    emulator.inject(fault)
    if kind is None:
        if fault == "mute_to_commands":
            keep_reading(laser, 0.3)
        else:
            assert until(lambda: laser.collect().invalid > 0)
        assert laser.latest().values[0] == pytest.approx(5.0, abs=0.1)
        record(fault_table, fault, "in mid-run", None)
        return
    with pytest.raises(kind, match=message) as caught:
        keep_reading(laser)
    assert caught.value.device == "laser"
    assert caught.value.remedy.endswith(".")
    record(fault_table, fault, "in mid-run", caught.value)
    begin = time.monotonic()
    laser.close()
    assert time.monotonic() - begin < 3.0


def test_a_jump_of_the_target_is_named_and_measured_on(bench: Bench) -> None:
    _, port = bench.emulator()
    laser = bench.client(port)
    laser.open()
    bench.scene.displacement = 1.0e-3
    problems = keep_reading(laser, 0.6)
    assert [p for p in problems if p.startswith("the distance jumped by +")]
    assert laser.latest().values[0] == pytest.approx(6.0, abs=5e-3)


def test_a_target_set_up_anew_out_of_sight_is_no_jump(bench: Bench) -> None:
    emulator, port = bench.emulator()
    laser = bench.client(port, stale_after_s=5.0)
    laser.open()
    emulator.inject("no_object")
    assert until(lambda: laser.latest().count == 0)
    bench.scene.displacement = 2.0e-3
    emulator.clear()
    problems: list[str] = []

    def arrived() -> bool:
        problems.extend(laser.collect().problems)
        return abs(laser.latest().values[0] - 7.0) < 5e-3

    assert until(arrived)
    assert "no object (65522)" in problems
    assert not [p for p in problems if "jumped" in p]


@pytest.mark.parametrize("fault", ["no_object", "silence"])
def test_measures_again_when_a_fault_has_passed(bench: Bench, fault: str) -> None:
    emulator, port = bench.emulator()
    laser = bench.client(port)
    laser.open()
    emulator.inject(fault)
    with pytest.raises(DeviceError):
        keep_reading(laser)
    emulator.clear()
    assert until(lambda: measures(laser))


def test_closes_twice_and_opens_again(bench: Bench) -> None:
    _, port = bench.emulator()
    laser = bench.client(port)
    laser.close()
    for _ in range(2):
        laser.open()
        assert laser.collect().count > 0
        laser.close()
        laser.close()


def test_a_port_that_does_not_exist(bench: Bench) -> None:
    laser = bench.client("/dev/does-not-exist")
    with pytest.raises(CannotConnect) as caught:
        laser.open()
    assert str(caught.value).startswith(
        "laser: cannot open the serial port /dev/does-not-exist at 691200 baud (there is no such "
        "port). Plug the adapter in, or correct `port` in the station file. Ports of this computer:"
    )


def test_a_file_that_is_no_port(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "tty").write_text("")
    for path in (tmp_path / "tty", tmp_path):
        with pytest.raises(CannotConnect, match=r"\(that is no serial port\)\. Correct `port`"):
            bench.client(str(path)).open()


@pytest.mark.parametrize(
    ("error", "reason"),
    [  # as pyserial words them
        (serial.SerialException(errno.EBUSY, "could not open port"), "another program has it open"),
        (serial.SerialException(errno.EACCES, "could not open port"), "you may not use it"),
        (
            serial.SerialException(
                "could not open port 'COM7': FileNotFoundError(2, 'The system cannot find the file "
                "specified.', None, 2)"
            ),
            "there is no such port",
        ),
        (
            serial.SerialException("Could not configure port: (22, 'Invalid argument')"),
            "the adapter does not take this rate",
        ),
        (ValueError("Failed to set custom baud rate"), "the adapter does not take this rate"),
        (serial.SerialException(errno.EIO, "could not open port"), os.strerror(errno.EIO)),
        (serial.SerialException("the driver is asleep"), "the driver is asleep"),
    ],
)
def test_what_the_serial_library_says_is_put_in_words(error: Exception, reason: str) -> None:
    said = str(complaints.no_port("COM7", 691200, error))
    assert said.startswith(f"laser: cannot open the serial port COM7 at 691200 baud ({reason}). ")
    assert said.count("COM7") == 1


def test_a_port_that_has_gone_is_told_without_the_librarys_words() -> None:
    words = "device reports readiness to read but returned no data"
    gone = complaints.unplugged("COM7", serial.SerialException(words), connecting=True)
    assert str(gone).startswith("laser: the serial port COM7 has gone. Plug the adapter in again")


def test_a_stopped_output_is_started(bench: Bench) -> None:
    _, port = bench.emulator()
    with serial.Serial(port, 691200, timeout=0.05) as line:
        commands.exchange(line, Command.OUTPUT_STOP, time.monotonic() + 3)
    laser = bench.client(port)
    laser.open()
    assert laser.collect().count > 0


def test_the_emulator_obeys_and_refuses_commands(bench: Bench) -> None:
    _, port = bench.emulator()
    with serial.Serial(port, 691200, timeout=0.05) as line:

        def ask(command: int, *data: int) -> bytes | None:
            line.write(commands.pack(command, data))
            received, end = b"", time.monotonic() + 3
            while time.monotonic() < end:
                received += line.read(max(1, line.in_waiting))
                reply = commands.find_reply(received, Command(command))
                if reply is not None:
                    return reply
            return None

        ask(Command.AVERAGE_N, 5)
        ask(Command.AVERAGING_TYPE, 0)
        settings = commands.parse_settings(ask(Command.GET_SETTINGS) or b"")
        assert (settings.averaging, settings.averaging_type) == (32, "recursive")
        ask(Command.AVERAGE_128)
        assert commands.parse_settings(ask(Command.GET_SETTINGS) or b"").averaging == 128
        ask(Command.ZERO)
        assert commands.parse_settings(ask(Command.GET_SETTINGS) or b"").relative_zero
        ask(Command.RESET)
        assert not commands.parse_settings(ask(Command.GET_SETTINGS) or b"").relative_zero
        with pytest.raises(commands.Refused, match=r"incorrect value \(code 2\)"):
            ask(Command.AVERAGE_N, 99)
        ask(Command.AVERAGING_TYPE, 2)
        with pytest.raises(commands.Refused, match=r"command failed \(code 5\)"):
            ask(Command.AVERAGE_N, 3)


def test_twenty_kilohertz_arrive(bench: Bench) -> None:
    _, port = bench.emulator(output_rate_Hz=20000)
    laser = bench.client(port, output_rate_Hz=20000)
    laser.open()
    laser.collect()
    time.sleep(0.5)
    reading = laser.collect()
    assert reading.count > 10 * reading.invalid
    assert reading.count > 2000
    assert reading.values[0] == pytest.approx(5.0, abs=1e-3)


def test_an_unknown_fault_is_refused(bench: Bench) -> None:
    emulator, _ = bench.emulator()
    with pytest.raises(ValueError, match="no fault 'fire'; it has silence"):
        emulator.inject("fire")
