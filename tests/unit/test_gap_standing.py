"""Noise of the channels, and what is driven where it stands still."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import Instruments
from identification.gap.model.bench import make_bench
from identification.gap.model.driven import driven, with_dwell_means
from identification.gap.model.history import sampling_time
from identification.gap.recording.rows import reduce_rows
from identification.gap.recording.white import white_noise
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running, triangle


def test_white_noise_of_a_dense_recording_is_found_and_motion_is_not_taken_for_it() -> None:
    rng = np.random.default_rng(1)
    slow = np.sin(np.linspace(0, 12, 4000))
    assert white_noise(slow + rng.normal(0, 1e-3, 4000)) == pytest.approx(1e-3, rel=0.1)
    assert white_noise(np.sin(np.linspace(0, 600, 4000))) == 0.0  # seven samples a radian
    assert white_noise(rng.normal(0, 1.0, 50)) == 0.0  # too short to tell


def test_noise_of_turning_points_alone_is_told_by_every_second_one() -> None:
    rng = np.random.default_rng(3)
    peaks = np.where(np.arange(400) % 2, 1.0, -1.0)
    assert white_noise(peaks + rng.normal(0, 1e-3, 400)) == pytest.approx(1e-3, rel=0.2)


def test_readings_that_come_unevenly_are_no_noise() -> None:
    """Force and displacement are read together, so both are off their course together."""
    rng = np.random.default_rng(6)
    at = 0.5 * np.arange(1200) + rng.uniform(-0.15, 0.15, 1200)
    course = 400 * np.abs((at / 40) % 2 - 1)
    force = course + rng.normal(0, 0.1, 1200)
    u = course / SPRING + rng.normal(0, 1e-6, 1200)
    assert white_noise(force) > 0.7
    assert white_noise(force, u) == pytest.approx(0.1 * 2**0.5, rel=0.3)  # and what u adds to it
    assert white_noise(u, force) == pytest.approx(1e-6 * 2**0.5, rel=0.3)
    assert make_bench(running(force, u, imposed="force")).noise.raised < 2.0
    still = rng.normal(0, 1e-3, 1200)
    assert white_noise(still, rng.normal(0, 5.0, 1200)) == pytest.approx(1e-3, rel=0.1)


def test_the_time_between_samples_is_that_within_a_hold_or_that_of_most_rows() -> None:
    force = 100 * triangle(60, 3)
    hold = np.arange(60) // 3
    held = bench_data(force, force / SPRING, step=hold, time=0.5 * np.arange(60) + 7.0 * hold)
    assert sampling_time(make_bench(held).rows) == pytest.approx(0.5)
    time = 0.5 * np.arange(60) + 7.0 * (np.arange(60) > 30)  # it stood still once
    runs_on = replace(running(force, force / SPRING), time=time)
    assert sampling_time(make_bench(runs_on).rows) == pytest.approx(0.5)


def test_an_understated_uncertainty_is_raised_to_what_the_samples_show() -> None:
    rng = np.random.default_rng(2)
    force = 100 * triangle(3000, 3)
    data = running(force, force / SPRING + rng.normal(0, 5e-6, 3000), imposed="force")
    assert make_bench(data).noise.stated == pytest.approx(5e-6, rel=0.25)  # 1e-6 was stated


@pytest.mark.parametrize(("times", "seen"), [(0.7, 1.0), (1.0, 1.0), (1.5, 1.5)])
def test_holds_of_three_readings_tell_of_an_arm_what_is_more_than_stated(
    times: float, seen: float
) -> None:
    """A scatter that META states too small had been a gap that no law explains."""
    rng, data = np.random.default_rng(3), arm_data()
    stated, three = data.instruments.displacement, np.arange(len(data.force)) % 4 < 3
    per_row = {name: getattr(data, name)[three] for name in PER_ROW}
    moved = 1.1e-5 * per_row["force"] + times * stated * rng.standard_normal(three.sum())
    kept = replace(data, **per_row | {"displacement": moved}, q=None, tangential=None)
    noise = make_bench(replace(kept, temperature=None)).noise
    one = float(noise.response.max())  # of a first reading, which is a row of its own
    assert one == pytest.approx(seen * stated, rel=0.12)


PER_ROW = ("time", "session", "run", "setup", "repetition", "branch", "step", "force")


@pytest.mark.parametrize(("times", "verdict"), [(1.0, "none"), (5.0, "none"), (9.0, "unknown")])
def test_levels_that_shake_more_than_stated_are_not_explained(times: float, verdict: str) -> None:
    """What is stated of a bench is known to a factor of two, and three times that is too much."""
    rng, step = np.random.default_rng(7), np.repeat(np.tile([0, 1, 2, 3, 2, 1, 0], 3), 12)
    force = 30.0 * step
    off = rng.normal(0, 1e-6 * times, len(step))
    data = bench_data(force, force / SPRING + off, step=step, branch=np.where(step > 0, 1, 0))
    found = explained(replace(data, imposed="force"))
    assert found.verdict == verdict
    assert any("times as much as stated" in n for n in found.notes) == (times > 3)


@pytest.mark.parametrize(("times", "verdict"), [(1.0, "none"), (10.0, "unknown")])
def test_a_spring_that_shakes_more_than_stated_is_not_explained(times: float, verdict: str) -> None:
    rng = np.random.default_rng(4)
    force = 100 * triangle(1200, 3)
    data = running(force, force / SPRING + rng.normal(0, 1e-6 * times, 1200), imposed="force")
    found = explained(data)
    assert found.verdict == verdict
    assert any("10 times as much as stated" in n for n in found.notes) == (verdict == "unknown")


def test_on_a_plateau_an_imposed_displacement_adds_no_noise() -> None:
    """5 mm of plateau: 1 um of uncertainty is 0.1 N on the flank and nothing on the plateau."""
    u = 5e-3 * triangle(2000, 1)
    force = np.minimum(SPRING * u, 50.0)
    meter = Instruments(0.01, 1e-6, 0.005, 0.003)
    noise = make_bench(running(force, u, imposed="displacement", instruments=meter)).noise
    plateau = np.median(noise.response) * SPRING
    assert plateau == pytest.approx(0.01, rel=0.01)
    assert noise.response.max() * SPRING > 0.05  # the flank


def test_what_is_driven_stands_where_it_stands_and_moves_where_it_moves() -> None:
    rng = np.random.default_rng(3)
    path = np.concatenate([np.linspace(0, 1, 60), np.ones(80), np.linspace(1, 0, 60)])
    noisy = path + rng.normal(0, 1e-3, 200)
    rows = reduce_rows(running(noisy, noisy))
    out = with_dwell_means(rows, noisy, 1e-3)
    held = slice(65, 135)
    assert np.ptp(out[held]) < 0.2 * np.ptp(noisy[held])
    assert out[held].mean() == pytest.approx(1.0, abs=1e-3)
    assert np.array_equal(out[:55], noisy[:55])
    assert np.array_equal(out[150:], noisy[150:])


def test_a_path_that_goes_slowly_against_its_noise_is_read_from_its_means() -> None:
    rng = np.random.default_rng(3)
    path = np.linspace(0, 0.05, 200)  # a quarter of the noise a row
    noisy = path + rng.normal(0, 1e-3, 200)
    rows = reduce_rows(running(noisy, noisy))
    out = with_dwell_means(rows, noisy, 1e-3)
    assert np.std(out - path) < 0.5e-3
    assert np.diff(out)[10:-10].min() > -0.6e-3  # no steps, and no way back as in the readings
    jump = np.where(path > 0.025, path + 0.1, path) + (noisy - path)
    assert np.mean(with_dwell_means(rows, jump, 1e-3) != jump) < 0.2  # which means would smear


def test_where_a_straight_path_turns_its_means_stay_within_its_legs() -> None:
    """Rounded tips would make every spring stiffer near the largest stroke."""
    path = 1e-3 * triangle(400, 6)
    noise = np.random.default_rng(8).normal(0, 2e-5, 400)
    rows = reduce_rows(running(SPRING * path, path + noise))
    off = with_dwell_means(rows, rows.displacement, 2e-5) - path
    assert np.std(off) < 0.7 * np.std(noise)  # they are means
    tips = path > 0.97e-3
    assert tips.sum() > 10
    assert np.mean(off[tips]) == pytest.approx(np.mean(noise[tips]), abs=1e-5)


def test_what_goes_straight_on_is_read_from_its_means_however_fast() -> None:
    """Else an effect that smooths it explains its noise; where it turns, means would blunt it."""
    rng = np.random.default_rng(8)
    n, noise = 240, 1e-3 * rng.normal(0, 1, 240)
    pull = np.linspace(0, 0.7, n)  # three times the noise a row
    rows = reduce_rows(running(pull, pull))
    assert np.std(with_dwell_means(rows, pull + noise, 1e-3) - pull) < 0.5e-3
    turns = np.minimum(pull, 0.7 - pull)
    assert np.array_equal(with_dwell_means(rows, turns + noise, 1e-3), turns + noise)


def test_steps_of_a_coarse_reading_are_its_noise() -> None:
    """A pull whose force is read in steps of a hundredth: a filter would explain the stairs."""
    rng = np.random.default_rng(9)
    true = np.linspace(0, 100, 300)
    force = np.round(true)
    meter = Instruments(0.5, 2e-7, 0.005, 0.003)
    moved = true / SPRING + rng.normal(0, 1e-7, 300)
    data = running(force, moved, imposed="force", instruments=meter)
    rows = reduce_rows(data)
    assert np.std(driven(data, rows, imposed=False) - true) < 0.5 * np.std(force - true)
    assert explained(data).verdict == "none"


def test_a_dense_pull_is_as_uncertain_as_its_displacement_makes_it() -> None:
    """Readings so dense that a few of them hardly tell the motion from its noise: the slope of the
    pull says what that noise does to the force, not how far it throws neighbours apart."""
    rng = np.random.default_rng(4)
    path = np.linspace(0, 50e-6, 200)
    force, moved = SPRING * path, path + rng.normal(0, 1e-6, 200)
    meter = Instruments(0.001, 1e-6, 0.005, 0.003)
    data = running(force, moved, imposed="displacement", instruments=meter)
    assert np.median(make_bench(data).noise.response) == pytest.approx(1e-6, rel=0.15)
    found = explained(data)
    assert found.verdict == "none"


def test_a_displacement_that_rests_in_holds_drives_without_its_noise() -> None:
    """Else an effect that smooths it, as a lag, explains the noise; where it creeps, it counts."""
    step, rng = np.repeat(np.arange(1, 5), 20), np.random.default_rng(3)
    u = step * 10.0 / SPRING
    data = bench_data(10.0 * step, u + rng.normal(0, 2e-6, 80), step=step, imposed="displacement")
    data = replace(data, instruments=Instruments(0.001, 2e-6, 0.005, 0.003))
    rows = reduce_rows(data)
    bench = make_bench(data)
    assert bench.imposed
    for mine in (rows.step == s for s in range(1, 5)):
        assert np.ptp(bench.load[mine]) == 0.0
        assert bench.noise.hold[mine].min() >= 2e-6 / 20**0.5
    assert bench.noise.response.max() < 1e-6  # what is left is the force's
    creeps = replace(data, displacement=data.displacement + 4e-7 * np.tile(np.arange(20), 4))
    assert np.ptp(make_bench(creeps).load[rows.step == 1]) > 0.0
    forced = replace(data, imposed="force")
    assert driven(forced, rows, imposed=False) is rows.force


def test_noise_of_a_force_that_drowns_in_it_counts_by_the_simulated_slope() -> None:
    """Its motion over a few rows says nothing of the slope: far less than there is."""
    rng = np.random.default_rng(5)
    n, noise = 120, 0.4
    true = np.linspace(15.0, 17.0, n)
    force = true + rng.normal(0, noise, n)
    data = running(force, true / SPRING)
    data = replace(data, instruments=replace(data.instruments, force=noise))
    bench = make_bench(data)
    assert np.median(bench.noise.response) == pytest.approx(noise * bench.slope[0], rel=0.2)
    standing_still = running(force - true + 16.0, true / SPRING)
    standing_still = replace(standing_still, instruments=data.instruments)
    assert np.median(make_bench(standing_still).noise.response) < 0.5 * noise * bench.slope[0]


def rack(hold: int, seed: int = 6) -> tuple[Array, Array, Array]:
    """A creep rack: no load for a while, then weights, each put on between two readings; time,
    force and displacement, by a power law of the time under every load."""
    rng = np.random.default_rng(seed)
    time = np.arange(4.0 * hold)
    moved, force = np.zeros(4 * hold), np.zeros(4 * hold)
    for begins in (hold, 2 * hold, 3 * hold):
        late = np.maximum(time - begins + 0.5, 0.0)
        force += 20.0 * (time >= begins)
        moved += 20.0 / SPRING * np.where(time >= begins, 1 + 0.1 * late**0.3, 0.0)
    noise = rng.normal(0, 1.0, (2, 4 * hold))
    return time, force + 0.02 * noise[0], moved + 2e-7 * noise[1]


METER = Instruments(0.02, 2e-7, 0.005, 0.003)


def test_what_creeps_under_a_force_that_stands_is_as_sure_as_its_reading() -> None:
    """Its motion is no answer to the noise of that force."""
    _, force, moved = rack(80)
    bench = make_bench(running(force, moved, imposed="force", instruments=METER))
    rests = np.abs(bench.rows.time[:, None] - [80.0, 160.0, 240.0]).min(axis=1) > 6
    sd = np.hypot(2e-7, 0.02 / SPRING)
    assert np.median(bench.noise.response[rests]) == pytest.approx(sd, rel=0.3)
    assert bench.noise.response[rests].max() < 2 * sd


def test_what_relaxes_while_the_displacement_stands_is_as_sure_as_its_reading() -> None:
    _, stands, goes_on = rack(80)
    u, relaxing = stands / SPRING, goes_on * SPRING  # the roles of the two turned round
    meter = Instruments(2e-7 * SPRING, 0.02 / SPRING, 0.005, 0.003)
    bench = make_bench(running(relaxing, u, imposed="displacement", instruments=meter))
    rests = np.abs(bench.rows.time[:, None] - [80.0, 160.0, 240.0]).min(axis=1) > 6
    sd = np.hypot(2e-7, 0.02 / SPRING)
    assert np.median(bench.noise.response[rests]) == pytest.approx(sd, rel=0.3)


def test_a_creep_rack_is_driven_by_its_weight_and_creeps() -> None:
    """Nothing was felt for a while, and by the first force that was it had given way: that is no
    platen that comes nearer."""
    rng = np.random.default_rng(7)
    late = np.arange(162.0) - 11.5
    force = np.where(late > 0, 20.0, 0.0) + rng.normal(0, 0.02, 162)
    moved = np.where(late > 0, 20.0 / SPRING * (1 + 0.1 * np.maximum(late, 0.1) ** 0.3), 0.0)
    data = running(force, moved + rng.normal(0, 2e-7, 162), instruments=METER)
    bench = make_bench(data)
    assert not bench.load_history.approaches
    assert not bench.imposed
    found = explained(data)
    assert found.verdict == "joint_creep"
    assert found.after < 0.1 * found.before


def test_steps_that_what_is_stated_has_no_room_for_are_steps() -> None:
    """Levels that were set, not read: each stands as it was set."""
    force = np.repeat(np.arange(0.0, 100.0, 5.0), 12)
    rows = reduce_rows(running(force, force / SPRING, imposed="force"))
    assert np.array_equal(with_dwell_means(rows, force, 0.5), force)
