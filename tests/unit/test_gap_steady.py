"""What drifts steadily over a session of many runs: which word, and which channel was driven."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, _beyond_scatter, part_sizes
from identification.gap.judging.prior_conflict import JUMP, _jumps
from identification.gap.laws.drift import FreePath
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import displacement_imposed, make_bench
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

RUNS, LENGTH, GAP = 7, 500, 400.0  # samples at 10 Hz; s between starts
NOISE = 1e-6


def session() -> Array:
    return np.concatenate([r * GAP + np.arange(LENGTH) / 10 for r in range(RUNS)])


def measured(drift: Array, seed: int = 2) -> GapData:
    """Seven runs of three strokes each, from a rest at zero, on a spring as stated."""
    rng = np.random.default_rng(seed)
    one = np.concatenate(
        [np.zeros(50), 300 * np.abs(np.sin(np.linspace(0, 3 * np.pi, LENGTH - 50)))]
    )
    force, n = np.tile(one, RUNS), RUNS * LENGTH
    run = np.repeat(np.arange(RUNS), LENGTH)
    rests = np.tile(np.arange(LENGTH) < 50, RUNS)
    return bench_data(
        force + rng.normal(0, 0.05, n),
        1e-5 * force + drift + rng.normal(0, NOISE, n),
        time=session() - run * GAP,
        session=session(),
        run=run,
        repetition=run + 1,
        branch=np.where(rests, 0, 3),
        step=np.full(n, -1),
        imposed="force",
    )


def wave(rise: float = 12.0) -> Array:
    return np.asarray(rise * NOISE * np.sin(2 * np.pi * session() / (RUNS * GAP)))


def stepped(drift: Array) -> Array:
    """The same from run to run, standing still within each."""
    return np.repeat(drift[::LENGTH], LENGTH)


def test_what_goes_on_between_runs_as_it_went_in_them_is_a_drift() -> None:
    assert explained(measured(wave())).verdict == "thermal_drift"


def test_what_stands_within_runs_and_jumps_between_is_the_datum() -> None:
    rng = np.random.default_rng(3)
    jumps = np.repeat(rng.normal(0, 12 * NOISE, RUNS), LENGTH)
    assert explained(measured(jumps)).verdict == "zero_shift"


@pytest.mark.parametrize("swap", [False, True])
def test_the_channel_that_comes_back_in_every_run_was_driven(swap: bool) -> None:
    """Whatever its answer drifts; pieces of a path can't tell which of two alike it was."""
    drift = wave(60.0)
    data = replace(measured(drift), imposed=None)
    if swap:
        force = data.force + (drift - drift[0]) / 1e-5
        data = replace(data, force=force, displacement=data.displacement - drift)
    assert displacement_imposed(data) == swap


def test_a_path_of_steady_rate_is_smoother_than_one_that_wanders() -> None:
    rng = np.random.default_rng(0)
    draws = {steady: FreePath(40, steady).root() @ rng.normal(size=(40, 400)) for steady in (0, 1)}
    assert all(0.5 < float(np.sqrt(np.mean(d[-1] ** 2))) < 5 for d in draws.values())
    rough = {
        k: np.abs(np.diff(d, 2, axis=0)).mean() / np.ptp(d, axis=0).mean() for k, d in draws.items()
    }
    assert rough[1] < 0.3 * rough[0]
    steps = np.abs(np.diff(draws[1], axis=0)).mean(axis=1)
    assert steps[0] > 0.2 * steps.mean()  # it may come with any rate


@pytest.mark.parametrize(("steady", "stands_out"), [(True, False), (False, True)])
def test_the_place_and_the_rate_of_a_steady_path_are_no_jumps(
    steady: bool, stands_out: bool
) -> None:
    bench = make_bench(measured(wave()))
    label = "steady path" if steady else "free path"
    path = next(v for v in library(bench, ["thermal_drift"]) if v.label == label)
    target = bench.observed - prediction(bench)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, NOISE]))
    pulls = np.ones(len(path.columns))
    pulls[1] = 40.0  # the rate of one, a step of the other
    assert (_jumps(engine, Part(path, NOISE), pulls).max() > JUMP) == stands_out


def test_offsets_far_beyond_the_scatter_of_runs_count_as_they_move() -> None:
    bench = make_bench(measured(stepped(wave())))
    target = bench.observed - prediction(bench)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, NOISE]))
    found = next(v for v in library(bench, ["zero_shift"]) if v.label == "every run")
    sizes = part_sizes(engine, (Part(found, 10 * NOISE),), 0)
    assert sizes.gap[0] > 0.6 * sizes.moved[0]
    drift = next(v for v in library(bench, ["thermal_drift"]) if v.label == "steady path")
    undone = part_sizes(engine, (Part(found, 10 * NOISE), Part(drift, 10 * NOISE)), 0)
    assert undone.gap[0] < 0.5 * undone.moved[0]
    small = np.linspace(-1, 1, RUNS)[bench.rows.run] * bench.noise.run
    assert _beyond_scatter(engine, small) == 0.0
    assert _beyond_scatter(engine, 30 * small) == pytest.approx(0.9 * 30 * bench.rows.rms(small))
