"""Effects in absolute units: on the bench they come from, they are what the library made of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.bench import Bench, make_bench
from identification.gap.data import GapData
from identification.gap.effects import WORDS, library
from identification.gap.effects.joint_yield import refined
from identification.gap.forms import law_of, rows_of
from tests.unit.test_gap_operators import bench_data


def arm_data(seed: int = 0, stretch: float = 1.0) -> GapData:
    """Two poses, x and y, twice loaded and unloaded; readings, force across, temperatures.
    stretch: all loads and times that much larger."""
    from rig.gap_data import arm_setup
    from rig.model import load_robot

    arm, rng = load_robot("ur10e"), np.random.default_rng(seed)
    poses = {"P1": [0.256, -1.664, -1.684, -1.365, 1.571, -1.336],
             "P2": [0.554, -1.480, -1.948, -1.284, 1.371, -1.036]}  # fmt: skip
    setups = tuple(
        arm_setup(arm, name, np.array(q), np.array([0, 0, 0.1]), d, np.array(n))
        for name, q in poses.items()
        for d, n in (("x", [1.0, 0, 0]), ("y", [0, 1.0, 0]))
    )
    rows, clock = [], 0.0
    for s in range(len(setups)):
        for repetition in (1, 2):
            clock, start = clock + 60, clock + 60
            steps = [(0, 0), (1, 1), (1, 2), (1, 3), (1, 4), (2, 3), (2, 2), (2, 1), (0, 0)]
            for branch, step in steps:
                clock += 7
                for _ in range(4):
                    clock += 1
                    rows.append((clock - start, clock, s, repetition, branch, step))
    time, session, setup, repetition, branch, step = np.array(rows).T
    n, whole = len(rows), np.int64
    force = (40.0 * step + rng.normal(0, 0.02, n)) * stretch
    run = (2 * setup + repetition - 1).astype(whole)
    return GapData(
        arm=True, setups=setups, time=time * stretch, session=session * stretch, run=run,
        setup=setup.astype(whole), repetition=repetition.astype(whole),
        branch=branch.astype(whole), step=step.astype(whole), force=force,
        displacement=1.1e-5 * force + rng.normal(0, 1e-6, n), compliance=1 / arm.joint_stiffness,
        compliance_relative_sd=np.full(6, 0.1), tangential=rng.normal(0, 0.1, (n, 2)),
        instruments=replace(bench_data(force, force).instruments), q=rng.normal(0, 1e-5, (n, 6)),
        temperature=26 + np.outer(session / session.max(), np.arange(1, 7)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def bench() -> Bench:
    return make_bench(arm_data())


def bench_without_arm(imposed: str | None = None) -> Bench:
    t = np.arange(240.0)
    force = 100 * np.sin(t / 15) * np.minimum(1, t / 100)
    data = bench_data(force, 1.05e-5 * force, time=t, session=t, step=np.full(240, -1),
                      branch=np.full(240, 3), run=np.repeat([0, 1, 2], 80).astype(np.int64),
                      repetition=np.repeat([1, 2, 3], 80).astype(np.int64),
                      imposed=imposed)  # fmt: skip
    return make_bench(data)


def assert_same(bench: Bench, words: tuple[str, ...]) -> int:
    """Every variant of the words, with coefficients of one, against its law; how many."""
    variants = library(bench, words)
    for v in list(variants):
        if v.word in ("joint_yield", "base_slip") and v.label.endswith("sharp") and v.prior > 0:
            variants += refined(bench, v)[:6]
            break
    pool = np.column_stack(bench.columns)
    for v in variants:
        law, scale = law_of(bench, v)
        made = rows_of(bench, v.word, law) * scale
        wanted = pool[:, list(v.columns)]
        size = np.abs(wanted).max(axis=0) + 1e-300
        assert np.abs((made - wanted) / size).max() < 1e-9, v.label
    return len(variants)


@pytest.mark.parametrize("word", WORDS)
def test_every_shape_of_the_library_is_its_law_on_an_arm(bench: Bench, word: str) -> None:
    assert assert_same(replace(bench, columns=[]), (word,)) > 0


@pytest.mark.parametrize("imposed", [None, "displacement"])
def test_every_shape_of_the_library_is_its_law_on_a_bench(imposed: str | None) -> None:
    assert assert_same(bench_without_arm(imposed), WORDS) > 100
