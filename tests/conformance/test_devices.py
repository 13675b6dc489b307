"""What every device must do, whichever it is: on the emulators by default, on a real station with

RIG_STATION=ur10e_lab pytest tests/conformance -m hardware
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.clock import Clock
from drivers.interfaces import Device, Dynamometer, Robot
from rig.emulation.emulated import EmulatedRig
from rig.procedure.devices import Devices, make_devices
from rig.station import Station, load_station, parse_station
from tests.wire.short import station as emulated_station

NAMES = ("robot", "dynamometer", "laser")


@pytest.fixture(
    scope="module", params=["emulated", pytest.param("hardware", marks=pytest.mark.hardware)]
)
def station(request: pytest.FixtureRequest) -> Iterator[Station]:
    if request.param == "hardware":
        yield load_station(os.environ["RIG_STATION"])
        return
    with EmulatedRig(parse_station(emulated_station(speed=1), Path("test.yaml"))) as live:
        yield live


@pytest.fixture(params=NAMES)
def device(request: pytest.FixtureRequest, station: Station) -> Iterator[Device]:
    """An open device of the station; it must leave no thread behind."""
    threads = set(threading.enumerate())
    devices = make_devices(station, Clock(1.0))
    chosen: Device = getattr(devices, request.param)
    chosen.open()
    yield chosen
    chosen.close()
    chosen.close()
    deadline = time.monotonic() + 5
    while time.monotonic() < deadline and set(threading.enumerate()) - threads:
        time.sleep(0.05)
    assert not set(threading.enumerate()) - threads


def test_it_has_the_name_of_its_section_and_says_who_it_is(device: Device) -> None:
    assert device.name in NAMES
    identity = device.identity()
    assert identity
    assert all(isinstance(k, str) and isinstance(v, str) for k, v in identity.items())
    assert device.identity()["source"] == device.collect().source


def test_readings_fit_the_signals(device: Device) -> None:
    names = [signal.name for signal in device.signals]
    assert len(set(names)) == len(names)
    assert all(signal.unit is not None and signal.long_name for signal in device.signals)
    time.sleep(0.5)
    for reading in (device.collect(), device.latest()):
        assert len(reading.values) == len(reading.sd) == len(names)
        assert reading.count > 0
        assert reading.end >= reading.start
        assert 0 <= reading.age_s < 1.0
        assert all(math.isfinite(v) for v in reading.values)


def test_each_value_is_collected_once(device: Device) -> None:
    device.collect()
    time.sleep(0.6)
    first = device.collect()
    time.sleep(0.6)
    second = device.collect()
    # Times of a sample clock are estimated from arrivals, to some milliseconds; a block is 100.
    assert second.start >= first.end - 0.02
    assert 0.2 < second.count / first.count < 5


def test_what_is_older_than_asked_for_is_left_out(device: Device) -> None:
    device.collect()
    time.sleep(0.6)
    until = device.latest().end
    time.sleep(0.3)
    late = device.collect(until)
    assert late.end >= until
    assert late.start > until - 0.25  # the block that ends there, of about a tenth of a second


def test_peeking_takes_nothing_away(device: Device) -> None:
    device.collect()
    time.sleep(0.5)
    device.latest()
    device.latest()
    assert device.collect().count > device.latest().count


def test_stand_ins_say_so(device: Device, station: Station) -> None:
    emulated = station.emulation is not None
    assert device.collect().source.startswith("emulated") == emulated


def test_it_opens_again_after_closing(device: Device) -> None:
    device.close()
    device.open()
    assert device.collect().count > 0


@pytest.fixture
def devices(station: Station) -> Iterator[Devices]:
    made = make_devices(station, Clock(1.0))
    yield made
    for each in made.all():
        each.close()


def test_a_robot_gives_its_state(devices: Devices) -> None:
    robot: Robot = devices.robot
    robot.open()
    state = robot.state()
    assert len(state.q) == len(state.q_target) == len(state.temperatures_C) == 6
    assert state.age_s < 1.0


def test_a_dynamometer_is_zero_after_taring(devices: Devices) -> None:
    dynamometer: Dynamometer = devices.dynamometer
    dynamometer.open()
    dynamometer.reset()
    dynamometer.operate()
    dynamometer.collect()
    time.sleep(1.0)
    dynamometer.tare(dynamometer.collect())
    time.sleep(1.0)
    names = [signal.name for signal in dynamometer.signals]
    assert names[:3] == ["force_x_N", "force_y_N", "force_z_N"]
    reading = dynamometer.collect()
    # Hum and noise average out within a second; drift adds less than 0.06 N/s on z.
    assert reading.values[:3] == pytest.approx((0.0, 0.0, 0.0), abs=0.5)
