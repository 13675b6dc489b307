"""Rigs without an arm that rest at levels: what noise hides, what a table without a clock tells,
and what pulls that never come back leave hidden."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.base import base_columns, prediction
from identification.gap.bench import make_bench
from identification.gap.data import Array, GapData
from identification.gap.diagnose import diagnose_gap
from identification.gap.effects import library
from identification.gap.evidence import Engine, eta_levels
from identification.gap.parts import Part
from identification.gap.penalties import _same_element
from tests.unit.test_gap_operators import bench_data


def levels(scatter: float, readings: int = 3, seed: int = 0) -> GapData:
    """Up and down in levels, each read several times and off by so many times the stated noise."""
    force = np.array([0.0, 20, 40, 60, 80, 100, 80, 60, 40, 20, 0, 30, 60, 90, 60, 30, 0])
    random = np.random.default_rng(seed)
    off = random.standard_normal(len(force)) * scatter * 1e-6
    branch = np.where(force == 0, 0, 1 + np.append(0, np.diff(force) < 0))
    each = {"force": force, "displacement": 1e-5 * force + off, "branch": branch.astype(np.int64),
            "step": np.arange(len(force))}  # fmt: skip
    given = {k: np.repeat(v, readings) for k, v in each.items()}
    moved = given.pop("displacement")
    moved = moved + random.standard_normal(len(moved)) * 0.3e-6
    return bench_data(given.pop("force"), moved, **given)


def test_what_is_stated_of_a_bench_is_known_to_a_factor_of_two() -> None:
    within = [diagnose_gap(levels(1.8, seed=seed)).verdict for seed in range(10)]
    beyond = [diagnose_gap(levels(6.0, seed=seed)).verdict for seed in range(3)]
    assert within.count("none") >= 8  # with what is stated taken at its word: 3
    assert beyond.count("none") == 0


@pytest.mark.parametrize(("repeats", "told"), [(3, False), (8, True)])
def test_many_readings_of_a_level_tell_the_time_without_a_clock(repeats: int, told: bool) -> None:
    data = levels(0.5, repeats)
    bench = make_bench(GapData(**{**vars(data), "timed": False}))
    assert bench.course.timeless is not told
    assert bool(library(bench, ["joint_creep"])) is told


@pytest.mark.parametrize(("back", "hidden"), [(False, True), (True, False)])
def test_pulls_that_never_come_back_hide_all_memory(back: bool, hidden: bool) -> None:
    way = np.linspace(0.0, 100.0, 60)
    one = np.append(way, way[::-1]) if back else way
    force = np.tile(one, 2)
    run = np.repeat([0, 1], len(one))
    data = bench_data(force, 1e-5 * force, run=run, repetition=run + 1, step=np.full(len(run), -1))
    bench = make_bench(data)
    variants = library(bench, ["joint_yield", "joint_nonlinear_stiffness"])
    base, target = base_columns(bench), bench.observed - prediction(bench)
    engine = Engine(bench, base, target, eta_levels(bench, base, target))
    words = {v.word: Part(v, v.scales[0]) for v in variants}
    assert not bench.course.once
    assert _same_element(engine, *words.values()) is hidden


def nothing_loaded(moved: Array) -> GapData:
    """A recording without load."""
    n = len(moved)
    return bench_data(np.zeros(n), moved, step=np.full(n, -1))


@pytest.mark.parametrize("seed", range(4))
def test_a_drift_on_any_path_explains_no_short_table(seed: int) -> None:
    """Readings anywhere, up to twice the stated noise or far beyond: a path through is no law."""
    anywhere = np.random.default_rng(seed).standard_normal(24) * 1e-6
    assert diagnose_gap(nothing_loaded(1.5 * anywhere)).verdict == "none"
    assert diagnose_gap(nothing_loaded(6.0 * anywhere)).verdict == "unknown"


@pytest.mark.parametrize(
    ("periods", "verdict"), [(1.3, "thermal_drift"), (3.0, "thermal_drift"), (11.0, "unknown")]
)
def test_what_rests_may_swing(periods: float, verdict: str) -> None:
    at = np.linspace(0.0, 1.0, 400)
    noise = np.random.default_rng(2).standard_normal(400) * 1e-6
    result = diagnose_gap(nothing_loaded(3e-5 * np.sin(2 * np.pi * periods * at) + noise))
    assert result.verdict == verdict
    if verdict == "unknown":
        assert result.looks_like is not None
        assert result.looks_like.period == pytest.approx(399 / periods, rel=0.01)
