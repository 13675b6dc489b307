"""A lag of a record that is driven fast is no creep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import CYCLE, GapData
from identification.gap.laws.in_swing import steady_way
from identification.gap.laws.lags import late as lagged
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

HZ, LAG_S, SPRING = 1000, 0.005, 4e-6  # m/N
NOISE_N, NOISE_M = 0.2, 1e-6


def driven(time: Array) -> Array:
    """A sine of 3 Hz that begins from rest."""
    ramp = np.clip(time - 0.5, 0.0, 1.0)
    return np.asarray(100.0 * ramp * np.sin(2 * np.pi * 3.0 * (time - 0.5)))


def recorded(moved: Array, load: Array) -> GapData:
    rng = np.random.default_rng(2)
    n = len(load)
    force, read = load + rng.normal(0, NOISE_N, n), moved + rng.normal(0, NOISE_M, n)
    data = bench_data(force, read, step=np.full(n, -1), branch=np.full(n, CYCLE))
    meter = replace(data.instruments, force=NOISE_N, displacement=NOISE_M)
    time = np.arange(n) / HZ
    return replace(
        data, time=time, compliance=np.array([SPRING]), instruments=meter, imposed="force"
    )


@pytest.mark.parametrize("lag", [0.003, 0.005, 0.008])
def test_a_laser_that_is_late_by_milliseconds_lags(lag: float) -> None:
    """Fast creep beside a spring twice as stiff would show the load without its noise."""
    time = np.arange(6000) / HZ
    found = explained(recorded(SPRING * driven(time - lag), driven(time)))
    assert found.verdict == "time_lag"
    effect = found.effects[0]
    assert effect.probability > 0.9
    assert effect.parameters["lag"].value == pytest.approx(lag, rel=0.15)


def test_what_creeps_beside_the_spring_that_was_stated_creeps() -> None:
    time = np.arange(6000) / HZ
    load = driven(time)
    late, tau = np.zeros(len(time)), 0.03
    for i in range(1, len(time)):
        late[i] = late[i - 1] + (load[i - 1] - late[i - 1]) / (HZ * tau)
    found = explained(recorded(SPRING * (load + 0.3 * late), load))
    assert found.verdict != "time_lag"


@pytest.mark.parametrize("begins", ["at rest", "in full swing"])
def test_what_a_late_channel_showed_before_is_told_by_its_first_readings(begins: str) -> None:
    """As far behind as later on where the rig swung already: first readings are no drift."""
    time = np.arange(6000) / 100.0
    shift = 20.0 if begins == "in full swing" else 0.0

    def load(t: Array) -> Array:
        ramp = np.clip((t + shift - 5.0) / 5.0, 0.0, 1.0)
        return np.asarray(100.0 * ramp * np.sin(2 * np.pi * 0.3 * (t + shift - 5.0)))

    data = replace(recorded(SPRING * load(time - 0.03), load(time)), time=time)
    bench = make_bench(data)
    way, speed = steady_way(bench, bench.line)
    swings = begins == "in full swing"
    assert bool(np.any(speed != 0)) is swings
    assert bool(np.any(way != 0)) is swings
    n = bench.rows.n
    shown = SPRING * bench.load + lagged(bench, "displacement", "delay", 0.03)[:n]
    left = bench.response - shown
    assert np.abs((left - left.mean())[:10]).max() < 5 * NOISE_M
