"""What one channel alone does, and what of it the other one says."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.effects import joint_hysteresis, time_lag
from identification.gap.laws.curves import from_level_to_level, hinge
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import running

SPRING = 1e-5  # m/N
HOLD = 12  # samples


def held(read: Array, level: Array, seed: int = 3) -> GapData:
    """Levels that last HOLD samples each, as an instrument reads them."""
    rng = np.random.default_rng(seed)
    n = len(level)
    data = bench_data(
        read + rng.normal(0, 0.02, n),
        SPRING * level + rng.normal(0, 1e-7, n),
        step=np.repeat(np.arange(n // HOLD), HOLD),
        imposed="force",
    )
    return replace(data, instruments=replace(data.instruments, force=0.02, displacement=1e-7))


LEVELS = np.repeat([0.0, 20, 40, 60, 80, 60, 40, 20, 0], HOLD)


def lagging(level: Array, seconds: float) -> Array:
    out = level.copy()
    for i in range(1, len(level)):
        out[i] = level[i] + (out[i - 1] - level[i]) * np.exp(-1.0 / seconds)
    return out


@pytest.mark.parametrize("lags", [True, False])
def test_a_force_that_ripples_while_it_stands_does_not_lag(lags: bool) -> None:
    """The displacement stands still in both: of a lag the force comes to where it goes, a gain that
    beats swings on."""
    t = np.arange(len(LEVELS))
    rippling = LEVELS * (1 + 0.05 * np.sin(2 * np.pi * t / 11.3))
    bench = make_bench(held(lagging(LEVELS, 1.0) if lags else rippling, LEVELS))
    channels = {v.info["channel"] for v in time_lag.variants(bench)}
    assert channels == ({"displacement", "force"} if lags else {"displacement"})


def test_what_a_hand_did_on_the_way_to_a_level_is_no_ripple() -> None:
    """A force that is a second and a half late shows at the first readings how far it went."""
    beyond = np.array([0.0, 6, -9, 4, -7, 8, -5, 9, -6])
    first = np.arange(len(LEVELS)) % HOLD == 0
    second = np.arange(len(LEVELS)) % HOLD == 1
    read = LEVELS + np.repeat(beyond, HOLD) * (first + 0.5 * second)
    bench = make_bench(held(read, LEVELS))
    assert {v.info["channel"] for v in time_lag.variants(bench)} == {"displacement", "force"}


def cycling(of_force: Array | float = 0.0, of_laser: Array | float = 0.0) -> GapData:
    """Sixteen cycles of 50 N to and fro; what force and displacement read beside that."""
    t = np.arange(1600)
    force = 50 * np.sin(2 * np.pi * t / 100)
    rng = np.random.default_rng(5)
    return running(
        force + of_force + rng.normal(0, 0.1, 1600),
        SPRING * force + of_laser + rng.normal(0, 1e-6, 1600),
        imposed="force",
    )


@pytest.mark.slow
@pytest.mark.parametrize("drifts", ["force", "displacement"])
def test_a_force_that_turns_where_it_turned_before_hardly_drifts(drifts: str) -> None:
    path = np.sin(np.linspace(0, 2.5, 1600))
    in_force = drifts == "force"
    data = cycling(of_force=5.0 * path) if in_force else cycling(of_laser=5.0 * SPRING * path)
    assert make_bench(data).load_history.turns_alike != in_force
    found = explained(data)
    assert found.verdict == ("force_drift" if in_force else "thermal_drift")
    other = "thermal_drift" if in_force else "force_drift"
    assert any(e.words == {other} for e in found.found.explanations)  # it is weighed all the same


def pulled(knee: bool, imposed: str = "force") -> GapData:
    """A specimen loaded from one side, further each time. knee: it holds 60 N and then gives way;
    else friction of strengths from 5 to 90 N slips, one after the other."""
    ends = [0.0, 40.0, 10.0, 75.0, 20.0, 100.0, 0.0]
    force = np.concatenate([np.linspace(a, b, 60, endpoint=False) for a, b in pairwise(ends)])
    radii = np.array([60.0]) if knee else np.linspace(5, 90, 18)
    weight = np.full(len(radii), 1.5 / len(radii) if not knee else 1.5)
    slips, state = np.zeros(len(force)), np.zeros(len(radii))
    for i, f in enumerate(force):
        state = np.clip(state, f - radii, f + radii)
        slips[i] = weight @ state
    rng = np.random.default_rng(6)
    n = len(force)
    return running(
        force + rng.normal(0, 0.1, n),
        SPRING * (force + slips) + rng.normal(0, 1e-6, n),
        imposed=imposed,
    )


@pytest.mark.slow
@pytest.mark.parametrize("imposed", ["force", pytest.param("displacement", marks=pytest.mark.slow)])
@pytest.mark.parametrize("knee", [True, False])
def test_what_holds_half_the_load_before_it_gives_way_has_yielded(knee: bool, imposed: str) -> None:
    data = pulled(knee, imposed)
    assert explained(data).verdict == ("joint_yield" if knee else "joint_hysteresis")
    if imposed == "displacement":
        return
    bench = make_bench(data)
    spectrum = next(v for v in joint_hysteresis.variants(bench) if "spectrum" in v.label)
    radius = np.asarray(spectrum.info["radius"])
    kept = spectrum.within @ ((radius > 55) & (radius < 80))
    assert (kept < 0).all()
    assert (spectrum.within @ np.where(radius < 101, 1.0, 0.0) > 0).all()
    pairs = [v for v in joint_hysteresis.variants(bench) if v.label.startswith("joint 1 r ")]
    assert pairs
    assert all(len(v.within) for v in pairs)
    worked = next(v for v in joint_hysteresis.variants(bench) if "worked in spectrum" in v.label)
    assert (worked.within @ ((radius > 26) & (radius < 45)) < 0).all()  # after twice that way
    to_and_fro = make_bench(running(bench.load - 50.0, bench.response - 50 * SPRING))
    assert not any(len(v.within) for v in joint_hysteresis.variants(to_and_fro))


def read_once(moved: Array) -> GapData:
    force = np.arange(len(moved)) * 10.0
    data = bench_data(force, moved, imposed="force")
    return replace(data, instruments=replace(data.instruments, force=0.01, displacement=2e-6))


@pytest.mark.parametrize("size", [1e-5, 2e-6])
def test_a_table_that_was_read_once_shows_a_curve_whatever_its_form(size: float) -> None:
    """Slow, sudden, slow again: no formula gives that, and yet it is a curve of the load; a bend
    that leaves something of it says the same."""
    moved = np.cumsum([0, 1, 4, 2, 9, 38, 16, 14, 6, 12, 9, 5, 3, 1]) * size
    found = explained(read_once(moved))
    assert found.verdict == "joint_nonlinear_stiffness"
    (effect,) = found.effects
    assert ("level to level" in effect.label) == (size == 1e-5)
    back = moved.copy()
    back[7] -= 25 * size  # a curve of a load does not go back
    labels = [v.label for v in explained(read_once(back)).fit.parts]
    assert not any("level to level" in p for p in labels)


def test_a_table_that_scatters_is_no_curve() -> None:
    """A straight spring, every reading off by fifteen times what is stated, each further all the
    same."""
    off = 3e-5 * np.random.default_rng(12).normal(0, 1, 14)
    data = read_once(np.arange(14) * 1e-4 + off)
    assert np.all(np.diff(data.displacement) > 0)
    assert not make_bench(data).load_history.only_a_curve
    assert explained(data).verdict == "unknown"


def test_the_curvefrom_level_to_level_is_as_rough_everywhere() -> None:
    """Simulated from its prior, line and hinges give `exp(-|dx|/0.25)` between any two places."""
    places = np.array([0.0, 0.05, 0.2, 0.5, 0.6, 1.0])
    basis = np.column_stack([places, *(hinge(places, b) for b in places[1:-1])])
    curve = basis @ from_level_to_level(places)
    covariance = curve @ curve.T
    between = np.diag(covariance)[:, None] + np.diag(covariance) - 2 * covariance
    expected = 2 * (1 - np.exp(-np.abs(places[:, None] - places) / 0.25))
    np.testing.assert_allclose(between, expected, atol=1e-6)
    assert covariance[0, 0] == 0


def test_noise_that_is_not_white_may_be_as_wrong_as_anything_stated() -> None:
    """A straight spring, and a laser that wanders over some samples by half more than is stated:
    second differences show the white part alone, which is less."""
    rng = np.random.default_rng(11)
    colour, n = np.zeros(1800), 1800
    for i in range(1, n):
        colour[i] = 0.85 * colour[i - 1] + rng.normal(0, 0.53)
    force = 40 * np.abs((np.arange(n) / 150) % 2 - 1)
    off = 1.4e-6 * colour + rng.normal(0, 0.65e-6, n)
    data = running(force + rng.normal(0, 0.01, n), SPRING * force + off, imposed="force")
    data = replace(data, instruments=replace(data.instruments, force=0.01))
    assert not make_bench(data).noise.sure
    assert explained(data).verdict == "none"
    white = replace(data, displacement=SPRING * force + rng.normal(0, 1.5e-6, n))
    assert make_bench(white).noise.sure
