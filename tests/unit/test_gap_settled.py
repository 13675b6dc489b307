"""Noise of holds that settle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array, Ints
from identification.gap.model.bench import make_bench
from identification.gap.recording.holds import scatter_within, swing_within
from tests.unit.test_gap_operators import bench_data

SD, HOLDS = 2.0, 80


def held(samples: int, settles_by: float, lag: float = 1.2) -> tuple[Array, Ints]:
    """Holds of so many samples that are come to with a lag, in samples."""
    hold = np.repeat(np.arange(HOLDS), samples)
    place = np.tile(np.arange(float(samples)), HOLDS)
    noise = np.random.default_rng(4).normal(0, SD, len(hold))
    return 50.0 * hold - settles_by * np.exp(-place / lag) + noise, hold


@pytest.mark.parametrize("samples", [7, 8, 12, 30])
def test_what_settles_for_two_samples_is_no_noise_and_no_swing(samples: int) -> None:
    values, hold = held(samples, 100.0)
    assert scatter_within(values, hold) == pytest.approx(SD, rel=0.2)
    assert swing_within(values, hold) < SD


@pytest.mark.parametrize("samples", [4, 5, 7, 12, 30])
def test_of_what_only_scatters_the_whole_holds_are_looked_at(samples: int) -> None:
    """Half of them would tell it less well, and by chance as too little."""
    values, hold = held(samples, 0.0)
    second = values[3:] - 2 * values[2:-1] + values[1:-2]
    unit = np.sort(np.abs(second[hold[3:] == hold[:-3]])) / 6**0.5
    rms = np.sqrt(np.mean(unit[: int(0.95 * len(unit))] ** 2)) / 0.8713
    assert scatter_within(values, hold) == pytest.approx(rms)
    assert swing_within(values, hold) < 0.3 * SD


def test_what_trembles_to_the_end_of_its_holds_swings() -> None:
    values, hold = held(12, 100.0)
    trembles = 40.0 * np.sin(2 * np.pi * np.tile(np.arange(12.0), HOLDS) / 5)
    for each in (trembles, values + trembles):
        assert swing_within(each, hold) > 4 * SD


@pytest.mark.parametrize("samples", [4, 5])
def test_short_holds_that_settle_all_the_time_tell_no_noise(samples: int) -> None:
    values, hold = held(samples, 100.0, lag=2.0)
    assert scatter_within(values, hold) is None


def test_a_channel_that_lags_in_short_holds_is_not_said_to_scatter() -> None:
    """What was stated of it stands, and nothing is said of vibrations."""
    values, hold = held(4, 100.0, lag=2.0)
    force = hold.astype(float)
    data = replace(bench_data(force, 1e-6 * values, step=hold + 1), arm=True)
    assert make_bench(data).noise.raised == 1.0
