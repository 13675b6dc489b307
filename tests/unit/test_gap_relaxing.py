"""Loads that relax while they stand, by less than the force scatters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.recording.relaxing import relaxed
from identification.gap.recording.rows import reduce_rows
from tests.unit.test_gap_operators import bench_data

SPRING, SD, HOLD, RELAXES = 1e-5, 0.15, 10, 0.0008  # m/N; N; readings; per unit of log time
LEVEL = np.repeat(np.tile([20.0, 60.0, 120.0, 200.0, 120.0, 60.0], 6), HOLD)
SINCE = np.arange(len(LEVEL)) % HOLD
LOAD = LEVEL * (1 - RELAXES * np.log1p(SINCE))


def read(values: Array, sd: float) -> Array:
    return np.asarray(values + np.random.default_rng(6).normal(0, sd, len(values)))


def share(force: Array, displacement: Array, still: Array | None = None) -> Array:
    hold = (np.arange(len(LEVEL)) // HOLD).astype(np.int64)
    stands = np.ones(len(LEVEL), dtype=bool) if still is None else still
    time = np.arange(len(LEVEL), dtype=float)
    return relaxed(force, displacement, time, hold, np.ones(len(LEVEL)), stands)


def test_what_both_channels_say_of_a_load_that_relaxes_is_known() -> None:
    found = share(read(LOAD, SD), read(SPRING * LOAD, 1e-6))
    true = LOAD / LEVEL - 1
    true -= np.repeat(true.reshape(-1, HOLD).mean(axis=1), HOLD)
    np.testing.assert_allclose(found, true, atol=0.1 * np.abs(true).max())
    # where it does not stand, or for two readings only, nothing is said
    sharp = read(LOAD, 0.01), read(SPRING * LOAD, 1e-7)
    some = share(*sharp, SINCE < 6)
    assert some[SINCE < 6].all()
    assert not some[SINCE >= 6].any()
    assert not share(*sharp, SINCE < 2).any()


@pytest.mark.parametrize(
    "what", ["nothing", "the force drifts", "it creeps", "grows", "one alone", "some of both"]
)
def test_one_channel_alone_tells_of_no_load(what: str) -> None:
    force, moved = {
        "nothing": (LEVEL, SPRING * LEVEL),
        "the force drifts": (LOAD, SPRING * LEVEL),
        "it creeps": (LOAD, SPRING * LEVEL * (1 + RELAXES * np.log1p(SINCE))),
        "grows": (2 * LEVEL - LOAD, SPRING * (2 * LEVEL - LOAD)),
        "one alone": (LEVEL, SPRING * LOAD),
        "some of both": (4 * LOAD - 3 * LEVEL, SPRING * LOAD),
    }[what]
    assert not share(read(force, SD), read(moved, 1e-6)).any()


def test_rows_bear_the_load_that_relaxes() -> None:
    step = np.searchsorted(np.unique(LEVEL), LEVEL) + 1
    data = bench_data(read(LOAD, SD), read(SPRING * LOAD, 1e-6), step=step.astype(int))
    data = replace(data, instruments=replace(data.instruments, force=SD, displacement=1e-6))
    rows = reduce_rows(data)
    single = rows.weight == 1  # the first readings of a hold
    at = np.searchsorted(data.time, rows.time[single])
    means = np.repeat(LOAD.reshape(-1, HOLD).mean(axis=1), HOLD)
    within = (rows.force - rows.hold_means(rows.force)[rows.hold])[single]
    assert np.corrcoef(within, (LOAD - means)[at])[0, 1] > 0.99
