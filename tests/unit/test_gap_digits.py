"""Digits that are coarser than what was stated of a channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.data import GapData
from identification.gap.model.bench import make_bench
from identification.gap.recording.digits import step_of, with_quantization_noise
from rig.diagnosis.diagnose_text import render
from tests.explained import explained
from tests.unit.arm_as_read import as_read, levels_of
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data

SPRING = 5e-7  # m/N
LEVELS_N = 47.0 * np.array([*range(10), *range(8, -1, -1)])


def read(
    laser_m: float = 0.0,
    converter_N: float = 0.0,
    *,
    noise: tuple[float, float] = (0.02, 1e-7),
    stated: tuple[float, float] = (0.02, 1e-7),
    bends: float = 0.0,
) -> GapData:
    """Three runs up and down, of a spring that may bend, read in steps where these are given."""
    rng = np.random.default_rng(3)
    load = np.tile(np.repeat(LEVELS_N, 5), 3)
    n = len(load)
    moved = SPRING * load * (1 + bends * load / LEVELS_N.max())
    force = load + rng.normal(0, noise[0], n)
    moved = moved + rng.normal(0, noise[1], n)
    force = converter_N * np.round(force / converter_N) if converter_N else force
    moved = laser_m * np.round(moved / laser_m) if laser_m else moved
    step = np.tile(np.repeat(np.r_[0:10, 8:-1:-1], 5), 3)
    run = np.repeat(np.arange(3), n // 3)
    data = bench_data(force, moved, step=step, compliance=np.array([SPRING]))
    data = replace(data, run=run, repetition=run, time=np.tile(np.arange(n // 3) * 1.0, 3))
    meter = replace(data.instruments, force=stated[0], displacement=stated[1])
    return replace(data, instruments=meter)


@pytest.mark.parametrize("step", [1e-3, 0.488, 2.0])
def test_a_lattice_is_found_by_its_least_step(step: float) -> None:
    values = step * np.random.default_rng(1).integers(-40, 400, 200)
    assert step_of(values) == pytest.approx(step)
    assert step_of(np.round(values / 9.80665, 8)) == pytest.approx(step / 9.80665, rel=1e-3)
    assert step_of(values + np.random.default_rng(2).normal(0, step, 200)) == 0


def test_few_values_that_are_evenly_spaced_tell_by_their_decimals() -> None:
    each = np.repeat(np.arange(12), 5)
    assert step_of(0.22 * each) == pytest.approx(0.01)
    assert step_of(0.2237 * each) == pytest.approx(1e-4)
    assert step_of(np.pi * each) == 0
    assert step_of(0.488 * np.repeat(np.arange(200), 3)) == pytest.approx(0.488), "at every code"


def test_what_is_read_once_at_every_place_is_a_ramp() -> None:
    assert step_of(0.22 * np.arange(12)) == 0
    assert step_of(np.linspace(0.0, 1.0, 80)) == 0


@pytest.mark.parametrize("levels", [[0, 1, 2, 5, 10, 20], [0, *range(10, 110, 10), 25]])
def test_levels_of_one_pass_are_no_lattice_however_well_they_are_met(levels: list[int]) -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        assert step_of(np.sort(levels) + rng.normal(0, 0.01, len(levels))) == 0


def test_runs_that_are_zeroed_each_are_read_in_the_same_steps() -> None:
    data = read(5e-6)
    shift = np.array([0.0, 1.7e-6, -0.9e-6])[data.run]
    found = with_quantization_noise(replace(data, displacement=data.displacement + shift))
    assert found.instruments.displacement == pytest.approx(5e-6 / 12**0.5)


def test_one_value_or_a_handful_has_no_lattice() -> None:
    assert step_of(np.zeros(50)) == 0
    assert step_of(np.repeat([0.0, 1.0, 2.0, 4.0], 20)) == 0


@pytest.mark.parametrize("levels_N", [LEVELS_N, np.array([0, 1, 2, 5, 10, 20, 50, 100, 200, 500])])
def test_levels_that_somebody_set_are_no_digits(levels_N: np.ndarray) -> None:
    rng, moved = np.random.default_rng(6), SPRING * np.tile(levels_N, 3)
    exact = bench_data(np.tile(levels_N, 3), moved + rng.normal(0, 1e-8, len(moved)))
    exact = replace(exact, instruments=replace(exact.instruments, force=1e-3, displacement=1e-9))
    assert with_quantization_noise(exact) is exact


def test_digits_finer_than_what_is_stated_change_nothing() -> None:
    data = read(3e-7, 0.06)
    assert with_quantization_noise(data) is data


@pytest.mark.parametrize(("laser_m", "converter_N"), [(5e-6, 0.0), (0.0, 0.488), (5e-6, 0.488)])
def test_what_digits_leave_is_no_gap(laser_m: float, converter_N: float) -> None:
    found = explained(read(laser_m, converter_N))
    assert found.verdict == "none"
    text = render(found)
    assert ("displacement is read in steps of 0.005 mm" in text) is (laser_m > 0)
    assert (f"force is read in steps of {converter_N:.3g} N" in text) is (converter_N > 0)


def test_readings_of_a_force_at_one_number_are_not_many() -> None:
    """A laser far better than what the converter of the force leaves."""
    fine = (0.02, 1e-8)
    assert explained(read(0.0, 0.488, noise=fine, stated=fine)).verdict == "none"


def test_a_curve_beyond_its_digits_is_still_seen() -> None:
    found = explained(read(5e-6, bends=0.4))
    assert found.verdict == "joint_nonlinear_stiffness"


def linear_arm(step_rad: float, scatter_rad: float = 0.0) -> GapData:
    """As simulated; joints are read in steps, from places of their own within one."""
    there, rng = arm_data(), np.random.default_rng(7)
    force, lever = levels_of(there)
    turned = force[:, None] * lever * there.compliance
    read = turned + rng.uniform(-0.5, 0.5, 6) * step_rad + rng.normal(0, scatter_rad, turned.shape)
    return replace(as_read(there, force, turned, rng), q=step_rad * np.round(read / step_rad))


@pytest.mark.parametrize("scatter_rad", [0.0, 2e-6, 1e-4])
def test_digits_of_joint_readings_are_no_gap(scatter_rad: float) -> None:
    """Four decimals, as an export leaves them, of which a joint passes twenty at most."""
    assert explained(linear_arm(1e-4, scatter_rad)).verdict == "none"


def test_readings_of_one_number_tell_no_more_however_often_they_are_taken() -> None:
    noise = make_bench(linear_arm(1e-4)).noise
    assert noise.q == pytest.approx(1e-4 / 12**0.5)
    assert noise.q_hold.min() > 1e-4 / 12**0.5  # every number comes at both repetitions
    assert noise.q_hold.max() <= 1e-4 / 12**0.5 * noise.q_hold.shape[1] ** 0.5
    assert not make_bench(linear_arm(1e-4, 1e-4)).noise.q_hold.any(), "these scatter over steps"
    assert not make_bench(linear_arm(1e-7, 1e-5)).noise.q_hold.any()
