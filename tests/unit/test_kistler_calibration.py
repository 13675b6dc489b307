"""Calibration of the dynamometer, its settings, its time line, and the emulated charge chain."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.arrays import Array
from drivers.kistler.calibration import (
    Calibration,
    channel_forces,
    channel_sums,
    drift_bound_N_per_s,
    u_type_a,
    volts_of,
)
from drivers.kistler.chain import ChargeChain
from drivers.kistler.service import NiError, Tasks
from drivers.kistler.settings import KistlerSettings, PerAxis
from drivers.kistler.timeline import Timeline


def settings(**changes: Any) -> KistlerSettings:
    values: dict[str, Any] = {
        "driver": "kistler9257b",
        "device": "Dev1",
        "full_scale_N": PerAxis(x=500, y=200, z=1000),
    }
    return KistlerSettings(**(values | changes))


def rotation(axis: tuple[float, float, float], angle: float) -> Array:
    """Rodrigues' formula; rows of the result are a right-handed frame."""
    n = np.array(axis) / np.linalg.norm(axis)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    turned: Array = np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K
    return turned


def rows(matrix: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())


def test_single_channels_by_hand() -> None:
    """1 V on one channel at a time: sums, lever arms and signs as the sensor's sheet gives them."""
    components = Calibration.from_settings(settings()).components(np.eye(8))
    a, b = 0.030, 0.0575
    x, y, z = 50.0, 20.0, 100.0  # N for 1 V
    expected = [
        [x, 0, 0, 0, 0, -b * x],  # fx12
        [x, 0, 0, 0, 0, b * x],  # fx34
        [0, y, 0, 0, 0, a * y],  # fy14
        [0, y, 0, 0, 0, -a * y],  # fy23
        [0, 0, z, b * z, -a * z, 0],  # fz1
        [0, 0, z, b * z, a * z, 0],  # fz2
        [0, 0, z, -b * z, a * z, 0],  # fz3
        [0, 0, z, -b * z, -a * z, 0],  # fz4
    ]
    np.testing.assert_allclose(components, expected, atol=1e-12)


def test_three_summed_channels_have_no_moments() -> None:
    components = Calibration.from_settings(settings(channels=3)).components(np.eye(3))
    np.testing.assert_allclose(components, np.diag([50.0, 20.0, 100.0]))


def test_moment_refers_to_the_line_of_action() -> None:
    """A force at height az0 over the origin turns about the origin, not about its own point."""
    high = settings(az0_mm=40.0)
    volts = volts_of(np.array([[100.0, -30.0, 20.0]]), high)
    at_point = Calibration.from_settings(high).components(volts)[0]
    at_origin = Calibration.from_settings(settings()).components(volts)[0]
    np.testing.assert_allclose(at_point[3:], 0, atol=1e-12)
    np.testing.assert_allclose(at_origin[3:], np.cross([0, 0, 0.04], [100, -30, 20]), atol=1e-12)


finite = st.floats(-1e4, 1e4, allow_nan=False)
directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@given(
    force=st.tuples(finite, finite, finite),
    axis=directions,
    angle=st.floats(-3.1, 3.1),
    sign=st.sampled_from([1, -1]),
    channels=st.sampled_from([3, 8]),
    az0=st.floats(-100, 100),
)
def test_force_to_volts_and_back(
    force: tuple[float, ...],
    axis: tuple[float, float, float],
    angle: float,
    sign: int,
    channels: int,
    az0: float,
) -> None:
    s = settings(
        axes_in_base=rows(rotation(axis, angle)),
        force_on_robot_sign=sign,
        channels=channels,
        az0_mm=az0,
    )
    back = Calibration.from_settings(s).components(volts_of(np.array([force]), s))[0]
    scale = 1 + np.abs(force).max()
    np.testing.assert_allclose(back[:3] / scale, np.array(force) / scale, atol=1e-9)
    np.testing.assert_allclose(back[3:] / scale, 0, atol=1e-9)


@given(wrench=st.tuples(*[finite] * 6))
def test_wrench_to_channels_and_back(wrench: tuple[float, ...]) -> None:
    s = settings(az0_mm=12.0)
    back = channel_forces(np.array([wrench]), s) @ channel_sums(s).T
    scale = 1 + np.abs(wrench).max()
    np.testing.assert_allclose(back[0] / scale, np.array(wrench) / scale, atol=1e-9)


def test_sensor_axes_are_turned_into_the_base() -> None:
    """The sensor's x axis stands along base y: volts in its x are a force along base y."""
    turned = settings(axes_in_base=((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    volts = np.array([[1.0, 1.0, 0, 0, 0, 0, 0, 0]])
    reaction = settings(axes_in_base=turned.axes_in_base, force_on_robot_sign=-1)
    along = Calibration.from_settings(turned).components(volts)[0]
    against = Calibration.from_settings(reaction).components(volts)[0]
    np.testing.assert_allclose(along[:3], [0, 100, 0], atol=1e-12)
    np.testing.assert_allclose(against, -along, atol=1e-12)


def test_drift_bound_adds_up_in_the_sums() -> None:
    """0.05 pC/s are 0.4 N/min on an x or y channel, 0.81 N/min on a z channel (2 and 4 of them)."""
    per_minute = 60 * drift_bound_N_per_s(settings())
    np.testing.assert_allclose(per_minute, [0.8, 0.8, 4 * 60 * 0.05 / 3.7])
    summed = 60 * drift_bound_N_per_s(settings(channels=3))
    np.testing.assert_allclose(summed, [0.4, 0.4, 60 * 0.05 / 3.7])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"axes_in_base": ((1, 0, 0), (0, 1, 0), (0, 0.5, 1))}, "rows 2 and 3"),
        ({"axes_in_base": ((2, 0, 0), (0, 1, 0), (0, 0, 1))}, "rows 1 and 1"),
        ({"axes_in_base": ((1, 0, 0), (0, 1, 0), (0, 0, -1))}, "left-handed"),
        ({"axes_in_base": ((math.nan, 0, 0), (0, 1, 0), (0, 0, 1))}, "rows 1 and 1"),
        ({"full_scale_N": PerAxis(x=500, y=0, z=500)}, "full_scale_N y is 0 N"),
        ({"sensitivity_pC_per_N": PerAxis(x=1, y=1, z=0)}, "sensitivity_pC_per_N z"),
        ({"first_channel": "0"}, 'first_channel is "0"'),
        ({"grpc_server": "daq.lab"}, 'grpc_server is "daq.lab"'),
        ({"grpc_server": "daq.lab:70000"}, "address:port"),
    ],
)
def test_settings_that_cannot_be(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        settings(**changes)


def test_timeline_follows_the_least_delay() -> None:
    line = Timeline(started=10.0, period=0.1)
    assert line.end_of_block(10.1 + 0.5) == pytest.approx(10.1)  # late: the start decides
    assert line.end_of_block(10.2 + 0.01) == pytest.approx(10.2)
    assert line.end_of_block(10.28) == pytest.approx(10.28)  # began earlier than was thought
    assert line.end_of_block(10.38 + 0.3) == pytest.approx(10.38)


def test_timeline_follows_a_slow_sample_clock() -> None:
    """1000 ppm slow: after 2000 s the naive line would be 2 s off."""
    line = Timeline(started=0.0, period=0.1)
    for i in range(1, 20_001):
        end = line.end_of_block(i * 0.1001)
    assert end == pytest.approx(20_000 * 0.1001, abs=0.07)


class Chain:
    """A charge chain under a force along x that a test sets as a function of time."""

    def __init__(self, force_x: Callable[[Array], Array], seed: int = 3, **changes: Any) -> None:
        self.settings = settings(**changes)

        def force(t: Array) -> Array:
            return np.column_stack([force_x(t), np.zeros_like(t), np.zeros_like(t)])

        self.chain = ChargeChain(self.settings, force, 0.0, seed, crosstalk=0.0)

    def mean_force(self, start: float) -> Array:
        """Mean components of the second from `start`."""
        volts = self.chain.volts(start + np.arange(1000) / 1000, -10, 10)
        mean: Array = Calibration.from_settings(self.settings).components(volts).mean(axis=0)
        return mean


def test_reset_takes_the_charge_away() -> None:
    rig = Chain(lambda t: np.where(t < 5020, 100.0, 130.0))
    before = rig.mean_force(5000.0)
    rig.chain.switch(5005.0, operate=False)
    in_reset = rig.mean_force(5006.0)
    rig.chain.switch(5010.0, operate=True)
    after, later = rig.mean_force(5011.0), rig.mean_force(5021.0)
    jump = np.array([2 * 2 / 7.5, 2 * 2 / 7.5, 4 * 2 / 3.7])  # 2 pC a channel, summed
    assert (np.abs(before[:3]) > jump).any()  # what has drifted in since the start
    assert (np.abs(in_reset[:3]) < 0.5).all()
    assert (np.abs(after[:3]) < jump + 0.1).all()  # drift and the 100 N from before are gone
    assert later[0] - after[0] == pytest.approx(30, abs=0.2)


def test_charge_drift_stays_within_what_is_specified() -> None:
    fastest = 0.0
    for seed in range(20):
        rig = Chain(np.zeros_like, seed=seed)
        drift = np.abs(rig.chain.drift_N_per_s)
        fastest = max(fastest, drift[0])
        assert (drift[:4] <= 0.05 / 7.5).all()
        assert (drift[4:] <= 0.05 / 3.7).all()
        slope = (rig.mean_force(100.0) - rig.mean_force(0.0))[0] / 100
        assert slope == pytest.approx(rig.chain.drift_N_per_s[:2].sum(), abs=2e-4)
    assert fastest > 0.5 * 0.05 / 7.5


def test_converter_clips_and_has_digits() -> None:
    rig = Chain(lambda t: np.where(t < 1, 0.0, 3000.0))
    volts = rig.chain.volts(np.linspace(0.0, 2.0, 400), -10, 10)
    digits = volts / (20 / 65536)
    np.testing.assert_allclose(digits, np.round(digits))
    assert volts.max() == pytest.approx(10, abs=0.001)
    assert volts.max() < 10


class Bench:
    """Hardware whose clock a test sets."""

    def __init__(self) -> None:
        self.clock = 0.0

    def now(self) -> float:
        return self.clock

    def wait_until(self, when: float, timeout_s: float, alive: Callable[[], bool]) -> bool:
        return when <= self.clock

    def volts(self, t: Array, low: float, high: float) -> Array:
        return np.tile(t[:, None], (1, 8))

    def drive_line(self, high: bool) -> None:
        raise AssertionError


def test_emulated_buffer_overflows_when_the_reader_falls_behind() -> None:
    bench = Bench()
    tasks = Tasks(bench, settings())
    task = tasks.create()
    task.channels = tasks.inputs("Dev1/ai0:7")
    task.started = 0.0
    bench.clock = 9.9
    first = tasks.read(task, 100, 0.0, lambda: True)
    np.testing.assert_allclose(first[:, 7], np.arange(100) / 1000)
    with pytest.raises(NiError) as early:
        tasks.read(task, 9900, 0.0, lambda: True)
    assert early.value.code == -200284
    bench.clock = 10.2
    with pytest.raises(NiError) as late:
        tasks.read(task, 100, 0.0, lambda: True)
    assert late.value.code == -200279


@pytest.mark.parametrize(
    ("channel", "code"), [("Dev2/ai0:7", -200220), ("Dev1/ai30:37", -200170), ("Dev1/ao0", -200170)]
)
def test_emulator_refuses_channels_it_does_not_have(channel: str, code: int) -> None:
    with pytest.raises(NiError) as refused:
        Tasks(Bench(), settings()).inputs(channel)
    assert refused.value.code == code


def test_the_uncertainty_of_a_mean() -> None:
    assert u_type_a(0.3, 900) == pytest.approx(0.01)
    assert math.isnan(u_type_a(0.3, 1))
