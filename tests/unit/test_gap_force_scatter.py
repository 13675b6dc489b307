"""A force that scatters more than was stated of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.data import GapData
from identification.gap.recording.force_scatter import with_observed_force_noise
from rig.diagnosis.diagnose_text import render
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

SPRING, LASER_M = 1e-5, 2e-6  # m/N
LEVELS = [*range(10), *range(8, -1, -1)]


def stepped(
    samples: int, scatter_N: float, trembles_N: float = 0.0, *, seed: int = 1, reps: int = 3
) -> GapData:
    """Up and down, again and again; the force is stated to 0.1 N, the load itself may tremble."""
    rng = np.random.default_rng(seed)
    step = np.tile(np.repeat(LEVELS, samples), reps)
    load = 10.0 * step + rng.normal(0, trembles_N, len(step))
    force = load + rng.normal(0, scatter_N, len(step))
    moved = SPRING * load + rng.normal(0, LASER_M, len(step))
    run = np.repeat(np.arange(reps), len(LEVELS) * samples)
    data = bench_data(force, moved, step=step)
    once = np.arange(len(LEVELS) * samples, dtype=float)
    data = replace(data, run=run, repetition=run, time=np.tile(once, reps))
    meter = replace(data.instruments, force=0.1, displacement=LASER_M)
    return replace(data, instruments=meter)


@pytest.mark.parametrize("samples", [3, 4, 5, 12])
@pytest.mark.parametrize("times", [2.5, 5.0, 20.0])
def test_what_nothing_follows_is_noise_of_the_force(samples: int, times: float) -> None:
    told = with_observed_force_noise(stepped(samples, 0.1 * times))
    assert told.force_scatters == pytest.approx(times, rel=0.25)
    assert told.instruments.force == pytest.approx(0.1 * told.force_scatters)


@pytest.mark.parametrize("samples", [3, 5, 12])
def test_a_load_that_trembles_is_no_noise(samples: int) -> None:
    """The displacement goes along."""
    data = stepped(samples, 0.1, 2.0)
    assert with_observed_force_noise(data) is data


@pytest.mark.parametrize("samples", [1, 2, 3, 5, 12])
def test_a_force_about_as_good_as_stated_is_left_as_it_is(samples: int) -> None:
    data = stepped(samples, 0.11)
    assert with_observed_force_noise(data) is data


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_the_force_is_no_lag(seed: int) -> None:
    """A lag averages two readings, and meets the displacement better."""
    found = explained(stepped(3, 0.5, seed=seed))
    assert found.verdict == "none"
    assert any("force scatters" in n for n in found.notes)
    quiet = explained(stepped(3, 0.1, seed=seed))
    assert not any("scatter" in n for n in quiet.notes)


@pytest.mark.slow
def test_where_readings_scatter_far_more_than_stated_no_gap_is_said_to_be_there() -> None:
    data = stepped(5, 0.1)
    noise = np.random.default_rng(5).normal(0, 9 * LASER_M, len(data.force))
    found = explained(replace(data, displacement=data.displacement + noise))
    assert found.verdict == "unknown"
    assert found.hidden
    assert found.looks_like is None
    text = render(found)
    assert "scatter far more than META states" in text
    assert "there is a gap" not in text
    gap = np.where(data.step % 2 == 1, 60 * LASER_M, 0.0)  # more than it hides
    seen = explained(replace(data, displacement=data.displacement + noise + gap))
    assert not seen.hidden
