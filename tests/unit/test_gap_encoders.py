"""Joint readings that are off from run to run, and from setup to setup: seen, and no effect."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bench.dense_model import dense
from bench.nested_cases import case_data
from identification.arrays import Array
from identification.gap.data import ZERO, GapData
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.fit import weighed
from identification.gap.model import encoders
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.encoders import RESTS_RAD, Readings, _beyond, readings_of
from identification.gap.recording.holds import hold_ids, rest_ids
from identification.gap.recording.rows import reduce_rows
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import Design, imported, meta, noisy
from tests.explained import explained

RUN, SETUP = 4e-6, 2e-5  # rad; a reading scatters by 1e-5
DESIGN = Design(("P1", "P2"), repetitions=4, steps=4, hold=8)


@cache
def plain(seed: int = 0) -> GapData:
    return gap_data(imported(noisy(DESIGN, seed=seed), meta(DESIGN)))


def off(data: GapData, run: float = 0.0, setup: float = 0.0, seed: int = 0) -> GapData:
    """With readings that are off by so much, every joint by its own."""
    assert data.q is not None
    rng = np.random.default_rng(seed)
    of_run = rng.normal(0, 1, (int(data.run.max()) + 1, data.joints))
    of_setup = rng.normal(0, 1, (len(data.setups), data.joints))
    return replace(data, q=data.q + run * of_run[data.run] + setup * of_setup[data.setup])


def found_in(data: GapData) -> Readings:
    return readings_of(data, reduce_rows(data), rest_ids(data, hold_ids(data)))


@pytest.mark.parametrize("seed", range(4))
def test_what_readings_of_a_run_and_of_a_setup_have_in_common_is_found(seed: int) -> None:
    found = found_in(off(plain(seed), RUN, SETUP, seed))
    np.testing.assert_allclose(found.one, 1e-5, rtol=0.15)
    assert found.run == pytest.approx(RUN, rel=0.4)
    assert found.setup == pytest.approx(SETUP, rel=0.7)


def test_levels_that_were_read_but_once_say_nothing_of_readings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No load but zero is met again; from three readings there nobody tells their noise, from those
    of all setups one does."""
    monkeypatch.setattr(encoders, "ENOUGH", 8)
    design = Design(("P1", "P2"), repetitions=1, steps=4, hold=3)
    rows = noisy(design)
    once = rows[(rows["branch"] == "zero") | (rows["time_s"].diff() > 1.5)]
    read = gap_data(imported(once, meta(design)))
    assert sorted(np.unique(np.bincount(hold_ids(read)))) == [1, 3]
    np.testing.assert_allclose(found_in(read).one, 1e-5, rtol=0.6)


def test_it_is_none_where_readings_alone_explain_it() -> None:
    """By chance once in a hundred times; then less than readings that are off by themselves. A
    setup is left what few readings without load don't show."""
    each = [found_in(plain(seed)) for seed in range(8)]
    assert sorted(r.run for r in each)[6] == 0
    assert max(r.run for r in each) < RUN
    assert {r.setup for r in each} == {RESTS_RAD}


def test_runs_that_differ_are_no_setups_that_do() -> None:
    each = [found_in(off(plain(seed), 3 * RUN, seed=seed)) for seed in range(8)]
    assert min(r.run for r in each) > RUN
    assert sorted(r.setup for r in each)[6] == RESTS_RAD


def test_a_trouble_of_two_joints_is_none_of_the_readings() -> None:
    """What gave way in one run stays there in all later ones, and is of the joint."""
    data = plain()
    assert data.q is not None
    later = (data.run >= 3).astype(float)[:, None]
    q = data.q + 2e-4 * later * np.array([1.0, 0, 0.5, 0, 0, 0])
    assert found_in(replace(data, q=q)).run < 0.5 * RUN


def test_a_force_that_drifts_is_none_of_the_readings() -> None:
    """It reads what the joints don't feel."""
    data = plain()
    assert data.session is not None
    found = found_in(replace(data, force=data.force + 8.0 * data.session / data.session.max()))
    assert found.run < 0.5 * RUN


def test_a_load_that_is_left_in_some_runs_is_none_of_the_readings() -> None:
    """The force shows what the joints feel."""
    data = plain()
    assert data.q is not None
    left = 3.0 * np.random.default_rng(5).normal(size=int(data.run.max()) + 1)[data.run]
    lever = np.stack([s.lever for s in data.setups])[data.setup]
    q = data.q + left[:, None] * lever * data.compliance
    assert found_in(replace(data, q=q, force=data.force + left)).run < 0.5 * RUN


@pytest.mark.parametrize("precise", [0.1, 0.3])
def test_joints_that_are_read_better_than_others_are_off_by_as_much(precise: float) -> None:
    data = plain()
    assert data.q is not None
    few = np.array([1.0, precise, 1.0, precise, 1.0, precise])
    rows = reduce_rows(data)
    means = np.stack([np.bincount(data.run, v) for v in data.q.T], axis=1)
    means = (means / np.bincount(data.run)[:, None])[data.run]
    assert rows.q is not None
    found = found_in(off(replace(data, q=means + (data.q - means) * few), RUN, 0.0, 3))
    assert found.run == pytest.approx(RUN, rel=0.4)


def test_what_scatters_beyond_unequal_variances_is_found() -> None:
    """Means of few readings beside those of many (DerSimonian and Laird 1986)."""
    rng, variance = np.random.default_rng(0), np.array([0.02] * 4 + [1.0] * 4)
    sd = np.sqrt(variance + 0.5)[:, None]
    found = [
        _beyond(sd * rng.normal(size=(8, 6)), np.zeros(8, int), variance, np.ones(6))
        for _ in range(60)
    ]
    assert np.mean(found) == pytest.approx(0.5, rel=0.3)


def test_of_few_elements_nothing_is_said() -> None:
    rng = np.random.default_rng(0)
    assert _beyond(9 * rng.normal(size=(8, 3)), np.zeros(8, int), np.ones(8), np.ones(3)) == 0


@pytest.mark.slow
def test_readings_that_are_off_together_are_no_effect() -> None:
    """Thousands of readings tell that to many standard deviations, in every joint."""
    found = explained(off(plain(1), RUN, SETUP, 1))
    assert found.verdict == "none"
    assert found.probabilities["none"] > 0.8


@cache
def read_badly() -> Bench:
    small = Design(("P1",), repetitions=3, steps=3, hold=6)
    data = gap_data(imported(noisy(small), meta(small)))
    bench = make_bench(off(data, RUN, SETUP, 2))
    return replace(bench, noise=replace(bench.noise, q_run=RUN, q_setup=SETUP))


def test_the_evidence_at_every_imperfection_is_that_of_one_dense_covariance() -> None:
    plainly = make_bench(case_data("yield"))
    bench = replace(plainly, noise=replace(plainly.noise, q_run=RUN, q_setup=SETUP))
    etas = np.array([0.0, 1e-6, 2e-5, 1e-4])
    engine = Engine(bench, base_columns(bench), bench.observed - prediction(bench), etas)
    model = dense(bench)
    constant = float(np.sum(np.log(bench.sigma))) + 0.5 * bench.layout.size * np.log(2 * np.pi)
    nothing = np.zeros(len(model.target))
    for level in engine.levels:
        exact = model.log_density(nothing, level.eta)
        assert level.log_base - constant == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize("eta", [0.0, 2e-6])
def test_fits_weigh_them_with_the_same_covariance(eta: float) -> None:
    bench = read_badly()
    engine = Engine(bench, base_columns(bench), bench.observed - prediction(bench), np.zeros(1))
    q, size = bench.layout.q, bench.layout.size
    X: Array = np.zeros((size, 3))
    X[q] = np.random.default_rng(3).normal(0, 1e-5, (q.stop - q.start, 3))
    run = np.tile(bench.rows.run[bench.rows.edges], 6)
    joint = np.repeat(np.arange(6), len(bench.rows.edges))
    alike = (run[:, None] == run) & (joint[:, None] == joint)
    V = RUN**2 * alike + np.diag(bench.sigma[q] ** 2 + (eta / 0.3) ** 2)
    found = weighed(engine, X, eta, np.ones(size, dtype=bool))
    np.testing.assert_allclose(found[q], np.linalg.solve(V, X[q]), rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_what_setups_are_off_by_is_no_effect_where_few_readings_without_load_show_it(
    seed: int,
) -> None:
    few = Design(repetitions=3, steps=6, hold=10)
    data = gap_data(imported(noisy(few, seed=seed), meta(few)))
    once = np.flatnonzero(np.diff(data.branch, prepend=-1) != 0)  # one of each zero level
    kept = np.union1d(np.flatnonzero(data.branch != ZERO), once)
    names = ("time", "run", "setup", "repetition", "branch", "step", "force", "displacement")
    assert data.q is not None
    few_zeros = {n: getattr(data, n)[kept] for n in names}
    thin = replace(data, **few_zeros, q=data.q[kept], session=None, tangential=None)
    found = explained(off(thin, setup=1.2e-5, seed=seed))
    assert found.verdict == "none"
    assert found.probabilities["none"] > 0.8
