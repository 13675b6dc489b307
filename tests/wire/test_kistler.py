"""The dynamometer through the real nidaqmx client and real gRPC bytes on loopback."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import nidaqmx.errors
import numpy as np
import pytest

from drivers.arrays import Array
from drivers.errors import (
    BadReply,
    CannotConnect,
    DeviceError,
    NotDischarged,
    Overload,
    ReadTimeout,
)
from drivers.kistler.calibration import u_type_a
from drivers.kistler.client import Kistler9257B
from drivers.kistler.daq import probe
from drivers.kistler.emulator import KistlerEmulator
from drivers.kistler.explain import device_error
from drivers.kistler.settings import KistlerSettings, PerAxis
from drivers.readings import Reading
from tests.wire.conftest import FaultTable
from tests.wire.scene import StillScene

pytestmark = pytest.mark.timeout(30)

SETTINGS = KistlerSettings(
    driver="kistler9257b",
    device="Dev1",
    full_scale_N=PerAxis(x=500, y=500, z=1000),
    # Turned by 90 degrees about z and showing the reaction: a lost frame or sign shows.
    axes_in_base=((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    force_on_robot_sign=-1,
    stale_after_s=1.5,
)
FORCE = np.array([30.0, -20.0, 50.0])


class Rig:
    """Scene, emulator and client; everything is closed at the end, and no thread may be left."""

    def __init__(self) -> None:
        self._before = set(threading.enumerate())
        self._open: list[Any] = []

    def build(
        self,
        speed: float = 40.0,
        seed: int = 1,
        scene: type[StillScene] = StillScene,
        **changes: Any,
    ) -> Rig:
        self.settings = replace(SETTINGS, **changes)
        self.scene = scene(speed)
        self.emulator = KistlerEmulator(self.scene, self.settings, seed)
        self.address = self.emulator.start()
        self._open.append(self.emulator.stop)
        self.connect(self.address)
        return self

    def connect(self, address: str | None, **changes: Any) -> Kistler9257B:
        settings = replace(self.settings, grpc_server=address, **changes)
        self.device = Kistler9257B(settings, self.scene.clock, emulated=True)
        self._open.append(self.device.close)
        return self.device

    def ready(self) -> Rig:
        """Opened, reset, operating, tared over two seconds without load."""
        self.device.open()
        self.device.reset()
        self.device.operate()
        self.device.tare(self.mean())
        return self

    def mean(self, seconds: float = 2.0) -> Reading:
        """So many seconds of samples that were all taken from now on."""
        now = self.scene.now()
        while (reading := self.device.collect()).start < now:
            pass
        readings = [reading]
        while sum(r.count for r in readings) < 1000 * seconds:
            readings.append(self.device.collect())
        counts = [r.count for r in readings]
        values = np.average([r.values for r in readings], axis=0, weights=counts)
        start, invalid = readings[0].start, sum(r.invalid for r in readings)
        return replace(
            readings[-1], start=start, values=tuple(values), count=sum(counts), invalid=invalid
        )

    def close(self) -> None:
        for close in reversed(self._open):
            close()
        deadline = time.monotonic() + 5
        while left := set(threading.enumerate()) - self._before:
            assert time.monotonic() < deadline, f"threads left: {left}"
            time.sleep(0.01)


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    yield rig
    rig.close()


def column(device: Kistler9257B, name: str) -> int:
    return [s.name for s in device.signals].index(name)


# ---------------------------------------------------------------------- the healthy path


@pytest.mark.parametrize("channels", [8, 3])
def test_force_through_the_whole_path(rig: Rig, channels: int) -> None:
    rig.build(channels=channels).ready()
    zero = rig.mean()
    rig.scene.force = FORCE
    loaded = rig.mean()
    force = np.array(loaded.values[:3]) - zero.values[:3]
    np.testing.assert_allclose(force, FORCE, atol=0.3)  # drift between the two: 0.05 N/s at most
    np.testing.assert_allclose(zero.values[:3], 0, atol=0.3)
    assert loaded.count >= 2000
    assert loaded.invalid == 0
    assert loaded.source.startswith("emulated")
    # Blocks are stamped as late as they were delivered, until one comes sooner (`Timeline`): on a
    # busy machine that may take a while.
    for _ in range(10):
        late = loaded.count / 1000 - (loaded.end - loaded.start)
        if abs(late) < 0.01:
            break
        loaded = rig.mean()
    assert late == pytest.approx(0.0, abs=0.01)
    names = [s.name for s in rig.device.signals]
    assert (
        len(names) == len(loaded.values) == len(loaded.sd) == channels + (3 if channels == 3 else 6)
    )
    assert names[:3] == ["force_x_N", "force_y_N", "force_z_N"]
    assert names[-1] == f"dynamometer{channels}_V"
    if channels == 8:
        np.testing.assert_allclose(loaded.values[3:6], 0, atol=0.02)
        share = {"fx12": 1, "fx34": 2}  # sensor x = reaction along base y: +20 N on two channels
        for i in share.values():
            volts = loaded.values[column(rig.device, f"dynamometer{i}_V")]
            assert volts == pytest.approx(20 / 2 / 50, abs=0.06)


def test_identity_names_device_and_calibration(rig: Rig) -> None:
    rig.build().device.open()
    identity = rig.device.identity()
    assert identity["daq_product_type"] == "emulated NI DAQ"
    assert identity["daq_driver_version"] == "24.8.0"
    assert identity["full_scale_N"] == "x 500, y 500, z 1000"
    assert identity["source"].startswith("emulated")
    assert all(isinstance(v, str) for v in identity.values())


def test_tare_counts_at_once_for_blocks_under_way(rig: Rig) -> None:
    rig.build().ready()
    rig.scene.force = FORCE
    rig.device.tare(rig.mean())
    np.testing.assert_allclose(rig.device.latest().values[:3], 0, atol=0.3)
    np.testing.assert_allclose(rig.device.collect().values[:3], 0, atol=0.3)


def test_reset_takes_the_load_as_zero_and_forgets_the_tare(rig: Rig) -> None:
    rig.build().ready()
    rig.scene.force = FORCE
    rig.device.tare(rig.mean())
    rig.device.reset()
    in_reset = rig.device.latest()
    assert in_reset.count == 0
    assert np.isnan(in_reset.values).all()
    assert "amplifier in Reset or settling" in in_reset.problems
    rig.device.operate()
    first = rig.device.collect()
    assert first.count > 0
    np.testing.assert_allclose(first.values[:3], 0, atol=2.5)  # jumps of 2 pC a channel
    rig.scene.force = np.zeros(3)
    unloaded = np.array(rig.mean().values[:3]) - first.values[:3]
    np.testing.assert_allclose(unloaded, -FORCE, atol=0.4)


def test_operate_leaves_only_settled_samples(rig: Rig) -> None:
    rig.build().device.open()
    rig.device.reset()
    rig.device.operate()
    reading = rig.device.collect()
    assert reading.count > 0
    assert reading.invalid == 0
    assert reading.problems == ()


def test_charge_drift_shows_as_a_straight_line(rig: Rig) -> None:
    rig.build(speed=50, full_scale_N=PerAxis(x=200, y=200, z=500)).ready()
    rig.device.collect()
    readings: list[Reading] = []
    while sum(r.count for r in readings) < 40_000:
        readings.append(rig.device.collect())
    t = np.array([(r.start + r.end) / 2 for r in readings])
    force = np.array([r.values[:3] for r in readings])
    slope = np.polyfit(t, force, 1)[0]
    fx, fy, fz = (
        rig.emulator.drift_N_per_s[i].sum() for i in (slice(0, 2), slice(2, 4), slice(4, 8))
    )
    # base x = reaction of sensor -y, base y = of sensor x, base z = of sensor z
    np.testing.assert_allclose(slope, [fy, -fx, -fz], atol=1e-4)
    assert np.abs(slope).max() > 1e-3


def test_spread_gives_an_honest_type_a_uncertainty(rig: Rig) -> None:
    """Means of one second scatter no more than their stated uncertainty; hum makes it cautious."""
    rig.build().ready()
    rig.device.collect()
    readings: list[Reading] = []
    while len(readings) < 40:
        readings += [r for r in [rig.device.collect()] if r.count == 1000]
    force = np.array([r.values[:3] for r in readings])
    t = np.array([r.start for r in readings])
    noise: Array = force - np.array([np.polyval(np.polyfit(t, f, 1), t) for f in force.T]).T
    stated = np.array([[u_type_a(s, r.count) for s in r.sd[:3]] for r in readings]).mean(axis=0)
    scatter = noise.std(axis=0, ddof=2)
    assert (scatter < 1.4 * stated).all()
    assert (scatter > 0.05 * stated).all()


def test_settings_reach_the_task(rig: Rig) -> None:
    """Range, rate and channel range as asked; one call creates all channels."""
    rig.build(first_channel="ai8").ready()
    assert rig.emulator.calls.count("CreateAIVoltageChan") == 1
    task = rig.emulator.tasks.all()[0]
    assert task.channels == [f"Dev1/ai{i}" for i in range(8, 16)]
    assert (task.low, task.high, task.rate) == (-10, 10, 1000)
    assert task.terminal == 10083  # RSE in NI's header
    assert task.buffer == 10_000 * 40


def test_without_a_line_nothing_is_driven(rig: Rig) -> None:
    rig.build(reset_line=None).ready()
    assert rig.device.reset_by_hand
    assert not {"CreateDOChan", "WriteDigitalLines"} & set(rig.emulator.calls)


def test_a_switch_that_nobody_turned_is_noticed(rig: Rig) -> None:
    rig.build(reset_line=None).ready()
    rig.scene.force = np.array([100.0, 0.0, 0.0])
    with pytest.raises(NotDischarged) as caught:
        rig.device.reset()
    wanted = "the amplifier's switch does not stand at Reset", "Turn the charge amplifier's switch"
    check(caught.value, (NotDischarged, *wanted))
    assert "line" not in str(caught.value)
    rig.emulator.turn_switch(reset=True)
    rig.device.reset()


def test_inverted_line(rig: Rig) -> None:
    rig.build(reset_active_high=False).ready()
    rig.scene.force = FORCE
    np.testing.assert_allclose(rig.mean().values[:3], FORCE, atol=0.4)


def test_closed_twice_and_opened_again(rig: Rig) -> None:
    rig.build().ready()
    rig.device.close()
    rig.device.close()
    with pytest.raises(ReadTimeout, match="not open"):
        rig.device.latest()
    rig.ready()
    assert rig.device.latest().count > 0
    rig.device.close()
    assert rig.emulator.tasks.all() == []


# ---------------------------------------------------------------------- overload


def collect_until_failure(device: Kistler9257B) -> None:
    for _ in range(1000):
        device.collect()


def test_overload_is_no_force_until_reset(rig: Rig) -> None:
    rig.build().ready()
    rig.scene.force = np.array([0.0, -1200.0, 0.0])  # 600 N on fx12 and fx34: 12 V
    with pytest.raises(Overload):
        collect_until_failure(rig.device)
    rig.scene.force = np.zeros(3)
    rig.scene.clock.sleep(3)
    for read in (rig.device.collect, rig.device.latest, rig.device.collect):
        with pytest.raises(Overload) as overload:
            read()
        assert overload.value.fault == (
            "channel 1 (Dev1/ai0) stood at 10.00 V, beyond 9.9 V: the amplifier is saturated"
            " and its value no force"
        )
        assert "Reset" in overload.value.remedy
        assert "larger full scale" in overload.value.remedy
    rig.device.reset()
    rig.device.operate()
    assert rig.mean().count > 0


class SpikyScene(StillScene):
    """6000 N along z for 3 ms of every 10 s: beyond the span, and 2 N in the mean of a second."""

    def force_N(self, t: Array) -> Array:
        force = super().force_N(t)
        force[t % 10 < 0.003, 2] = 6000.0
        return force


def test_a_single_overloaded_sample_counts(rig: Rig) -> None:
    rig.build(scene=SpikyScene).device.open()
    with pytest.raises(Overload, match=r"ai[4-7]"):
        collect_until_failure(rig.device)


# ---------------------------------------------------------------------- faults

AT_START = {
    "silence": (CannotConnect, "does not answer within 2 s", "Restart the server"),
    "mute": (CannotConnect, "does not answer within 2 s", "Restart the server"),
    "close": (CannotConnect, "no gRPC device server answers", "grpc_server"),
    "refuse": (CannotConnect, "nothing listens", "Start the server"),
    "wrong_server": (CannotConnect, "no gRPC device server answers", "grpc_server"),
    "garbage": (BadReply, "make no sense", "grpc_server"),
    "nonsense": (BadReply, "1e+30 V", "restart"),
    "short_reply": (BadReply, "samples per channel came instead of 1000", "restart"),
    "long_reply": (BadReply, "more than 1000 samples per channel came", "restart"),
    "unplugged": (CannotConnect, '"Dev1" is not accessible', "cable"),
    "unknown_device": (CannotConnect, 'no DAQ device named "Dev1"', "`device`"),
    "aborted": (CannotConnect, "aborted", "Replug"),
    "overwritten": (CannotConnect, "overwritten", "sample_rate_Hz"),
    "fifo_overflow": (CannotConnect, "FIFO", "USB port"),
    "no_samples": (CannotConnect, "sample clock", "NI MAX"),
}
IN_MID_RUN = AT_START | {
    "silence": (ReadTimeout, "no samples for 1.5 s", "cable"),
    # on a busy machine the watch over the samples may notice before the connection's own deadline
    "mute": (ReadTimeout, "was lost|no samples for 1.5 s", "network"),
    "close": (ReadTimeout, "was lost", "network"),
    "refuse": (ReadTimeout, "was lost", "network"),
    "wrong_server": (ReadTimeout, "was lost", "network"),
    "unplugged": (ReadTimeout, '"Dev1" is not accessible', "cable"),
    "unknown_device": (ReadTimeout, 'no DAQ device named "Dev1"', "`device`"),
    "aborted": (ReadTimeout, "aborted", "Replug"),
    "overwritten": (BadReply, "overwritten", "sample_rate_Hz"),
    "fifo_overflow": (BadReply, "FIFO", "USB port"),
    "no_samples": (ReadTimeout, "sample clock", "NI MAX"),
    "overload": (Overload, "channel 1", "Unload"),
}


def check(error: DeviceError, expected: tuple[type[DeviceError], str, str]) -> None:
    kind, fault, remedy = expected
    assert type(error) is kind, str(error)
    assert any(one in error.fault for one in fault.split("|")), error.fault
    assert remedy in error.remedy
    text = str(error)
    assert text.startswith("dynamometer: ")
    assert "Traceback" not in text
    assert "{" not in text
    assert "\n" not in text


def test_remedy_says_start_before_the_first_sample_and_resume_after() -> None:
    """Nothing to resume before the first sample."""
    gone = nidaqmx.errors.DaqError("gone", -201003)
    first = device_error(gone, SETTINGS, connecting=True)
    later = device_error(gone, SETTINGS, connecting=False)
    assert first.remedy == "Check its cable and power, then start again."
    assert later.remedy == "Check its cable and power, then go on with --resume."


def test_unknown_code_keeps_number_and_text() -> None:
    """Braces in NI's text are no placeholders."""
    error = nidaqmx.errors.DaqError("Odd {thing} happened.\n\nMore", -987654)
    said = device_error(error, SETTINGS, connecting=False)
    assert type(said) is BadReply
    assert said.fault == "NI-DAQmx reports error -987654: Odd {thing} happened"


@pytest.mark.parametrize("fault", AT_START)
def test_fault_at_start(rig: Rig, fault: str, fault_table: FaultTable) -> None:
    rig.build()
    rig.connect(rig.address, connect_deadline_s=2.0)
    rig.emulator.inject(fault)
    with pytest.raises(DeviceError) as caught:
        rig.device.open()
    fault_table("dynamometer", fault, "at start", type(caught.value).__name__, str(caught.value))
    check(caught.value, AT_START[fault])


def test_failed_open_releases_the_device(rig: Rig) -> None:
    """Tasks left behind would keep the channels reserved on the server."""
    rig.build().emulator.inject("overwritten")
    with pytest.raises(CannotConnect):
        rig.device.open()
    assert rig.emulator.calls.count("CreateTask") == 2
    assert rig.emulator.tasks.all() == []


@pytest.mark.parametrize("fault", IN_MID_RUN)
def test_fault_in_mid_run(rig: Rig, fault: str, fault_table: FaultTable) -> None:
    rig.build().ready()
    kept = rig.mean(1.0)
    rig.emulator.inject(fault)
    with pytest.raises(DeviceError) as caught:
        collect_until_failure(rig.device)
    fault_table("dynamometer", fault, "in mid-run", type(caught.value).__name__, str(caught.value))
    check(caught.value, IN_MID_RUN[fault])
    with pytest.raises(type(caught.value)):
        rig.device.latest()
    assert kept.count > 0
    rig.device.close()


def test_overload_at_start_shows_after_operate(rig: Rig, fault_table: FaultTable) -> None:
    """A channel that is saturated from before lets the DAQ open; it shows at the first reading."""
    rig.build().emulator.inject("overload")
    rig.device.open()
    with pytest.raises(Overload) as caught:
        rig.device.latest()
    check(caught.value, IN_MID_RUN["overload"])
    rig.device.reset()
    with pytest.raises(Overload, match="channel 1"):
        rig.device.operate()
    fault_table("dynamometer", "overload", "at start", "Overload", str(caught.value))


@pytest.mark.parametrize("when", ["at start", "in mid-run"])
def test_reset_line_without_effect(rig: Rig, when: str, fault_table: FaultTable) -> None:
    rig.build()
    if when == "at start":
        rig.emulator.inject("no_reset")
        rig.device.open()
    else:
        rig.ready().emulator.inject("no_reset")
    rig.scene.force = np.array([100.0, 0.0, 0.0])
    with pytest.raises(BadReply) as caught:
        rig.device.reset()
    fault_table("dynamometer", "no_reset", when, "NotDischarged", str(caught.value))
    wanted = "Reset line port0/line0 has no effect", "reset_active_high"
    check(caught.value, (NotDischarged, *wanted))


def test_line_that_the_device_lacks(rig: Rig) -> None:
    rig.build()
    rig.connect(rig.address, reset_line="port7/line0")
    with pytest.raises(CannotConnect, match=r"lacks a channel or line .*port7/line0"):
        rig.device.open()


def test_no_nidaqmx_driver_on_this_computer(rig: Rig) -> None:
    """Where a driver is installed there is still no device of this name."""
    rig.build()
    rig.connect(None, device="NoSuchDevice")
    with pytest.raises(CannotConnect, match=r"driver is not installed|no DAQ device named"):
        rig.device.open()


def test_a_host_that_is_not_there(rig: Rig) -> None:
    rig.build()
    rig.connect("no-such-host.invalid:31763", connect_deadline_s=2.0)
    with pytest.raises(CannotConnect, match=r"no-such-host\.invalid:31763"):
        rig.device.open()


def test_a_name_service_that_stays_mute(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()

    def mute(*_: object) -> list[object]:
        released.wait(50)
        raise OSError

    rig.build()
    monkeypatch.setattr("socket.getaddrinfo", mute)
    rig.connect("daq.lab:31763", connect_deadline_s=0.3)
    began = time.monotonic()
    try:
        with pytest.raises(CannotConnect, match=r"daq\.lab:31763 does not answer"):
            rig.device.open()
        assert time.monotonic() - began < 5
    finally:
        released.set()


def test_an_address_of_ip_version_6() -> None:
    with socket.socket(socket.AF_INET6) as server:
        try:
            server.bind(("::1", 0))
        except OSError:
            pytest.skip("this computer has no IPv6")
        server.listen()
        probe(f"[::1]:{server.getsockname()[1]}", time.monotonic() + 5)


def test_every_fault_is_tried_and_unknown_ones_are_refused(rig: Rig) -> None:
    assert set(IN_MID_RUN) | {"no_reset"} == set(KistlerEmulator.faults)
    with pytest.raises(ValueError, match="unplugged"):
        rig.build().emulator.inject("unpluged")


def test_emulator_frees_its_port(rig: Rig) -> None:
    rig.build().emulator.inject("close")
    rig.emulator.stop()
    rig.emulator.stop()
    host, _, port = rig.address.partition(":")
    with socket.socket() as probe:
        assert probe.connect_ex((host, int(port))) != 0
