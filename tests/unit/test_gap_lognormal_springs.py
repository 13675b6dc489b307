"""Springs count as lognormal, as likely so many times as stiff as so many times as soft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.lognormal_springs import (
    log_ratio,
    lognormal_prior_correction,
    nats_of,
    stated_between,
)
from identification.gap.evidence.parts import Part
from identification.gap.explanations.fit import fit
from identification.gap.judging.prior_conflict import most_off
from identification.gap.model.base import base_columns
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import variant
from identification.gap.search.search import _as_stated
from tests.conformance.gap_designs import linear
from tests.explained import explained
from tests.unit.small_explanations import said


def by_sampling(mean: Array, covariance: Array, sd: Array) -> float:
    """log of the ratio of the two integrals, each a mean of the likelihood over its own prior."""
    rng = np.random.default_rng(0)
    told = np.linalg.inv(covariance) - np.diag(sd**-2.0)
    asked = np.linalg.solve(covariance, mean)
    u = rng.normal(size=(1_000_000, len(sd)))
    logs = [
        -0.5 * np.einsum("ni,ij,nj->n", x, told, x) + x @ asked
        for x in (np.exp(nats_of(sd) * u) - 1, sd * u)
    ]
    stated, compliance = (np.log(np.mean(np.exp(v - v.max()))) + v.max() for v in logs)
    return float(stated - compliance)


@pytest.mark.parametrize("mean", [0.1, -0.15, 0.3, 0.6])
@pytest.mark.parametrize("known", [0.02, 0.1])
def test_the_ratio_is_that_of_the_integrals_over_one_spring(mean: float, known: float) -> None:
    args = np.array([mean]), np.array([[known**2]]), np.array([0.2])
    assert log_ratio(*args) == pytest.approx(by_sampling(*args), abs=0.1)


def test_the_ratio_is_that_of_the_integrals_over_springs_that_the_data_mix() -> None:
    sd = np.array([0.15, 0.1, 0.2])
    mixed = np.array([[1.0, 1.0, 0.0], [1.0, -0.4, 0.3]])  # two sums are told, a third one is not
    covariance = np.linalg.inv(np.diag(sd**-2.0) + mixed.T @ mixed / 0.05**2)
    mean = covariance @ mixed.T @ np.array([0.4, 0.25]) / 0.05**2
    found = log_ratio(mean, covariance, sd)
    assert found == pytest.approx(by_sampling(mean, covariance, sd), abs=0.1)
    assert found > 0.1


def test_half_a_stiffness_is_as_far_off_as_twice_as_much() -> None:
    """Stated to a fifth: 3.5 standard deviations each, not 5 and 2.5; the density of the compliance
    is half there, and twice as much."""
    off = 0.5 * (np.log(2.0) / nats_of(np.array(0.2))) ** 2
    for twice, before in ((1.0, 0.5 * 5.0**2), (-0.5, 0.5 * 2.5**2)):
        found = log_ratio(np.array([twice]), np.array([[1e-8]]), np.array([0.2]))
        of_width = np.log(0.2 / float(nats_of(np.array(0.2))))
        exact = before - off - np.log1p(twice) + of_width
        assert found == pytest.approx(exact, abs=1e-3)


def test_what_the_data_say_nothing_of_is_as_likely_as_before() -> None:
    assert log_ratio(np.zeros(2), np.diag([0.04, 0.01]), np.array([0.2, 0.1])) == pytest.approx(0)


def one_soft_spring(bench: Bench, softer: float) -> Array:
    """What is read where the first spring that is seen gives so much more."""
    return softer * base_columns(bench).columns[:, base_columns(bench).index("spring")[0]]


@pytest.fixture(scope="module")
def bench() -> Bench:
    return make_bench(linear("medium"))


def test_an_engine_knows_what_it_found_of_the_springs(bench: Bench) -> None:
    """As a fit does, alone and beside an effect."""
    base = base_columns(bench)
    engine = Engine(bench, base, one_soft_spring(bench, 0.4), np.array([0.0, 3e-6]))
    bends = bench.add(bench.stacked(1e-6 * bench.load**2 / bench.load.max()))
    curve = Part(variant("joint_nonlinear_stiffness", "", [bends], (1.0,)), 1.0)
    springs = base.index("spring")
    for parts in ((), (curve,)):
        whole = fit(engine, replace(said((), ()), parts=parts))
        columns = [c for p in parts for c in p.variant.columns]
        root = curve.root if parts else np.zeros((0, 0))
        mean, covariance = engine.of_base(springs, columns, root, 0)
        np.testing.assert_allclose(mean, whole.base[springs], rtol=1e-6, atol=1e-9)
        block = whole.joint_covariance[np.ix_(springs, springs)]
        np.testing.assert_allclose(covariance, block, rtol=1e-6, atol=1e-12)


def test_only_springs_of_an_arm_count_so(bench: Bench) -> None:
    target = one_soft_spring(bench, 0.4)
    without = replace(bench, data=replace(bench.data, arm=False))
    ratios = [
        lognormal_prior_correction(Engine(b, base_columns(b), target, np.array([0.0, 3e-6])), (), 0)
        for b in (bench, without)
    ]
    assert ratios[0] > 1.0
    assert ratios[1] == 0.0


def test_noise_beyond_what_is_stated_takes_no_spring_s_place(bench: Bench) -> None:
    """Springs that are far off are as far off beside a little more noise: evidence of what was
    stated is never more than where nothing is off."""
    etas = np.array([0.0, 1e-6, 2e-6, 4e-6, 8e-6])
    still, soft = (
        _as_stated(Engine(bench, base_columns(bench), one_soft_spring(bench, softer), etas))
        for softer in (0.0, 6.0)
    )
    assert soft < still - 20.0
    engine = Engine(bench, base_columns(bench), one_soft_spring(bench, 0.4), etas)
    at_a_level = engine.levels[1].log_base + lognormal_prior_correction(engine, (), 1)
    assert stated_between(engine, float(etas[1])) == pytest.approx(at_a_level, abs=1e-6)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_spring_is_off_by_its_logarithm(bench: Bench, way: float) -> None:
    base = base_columns(bench)
    sd = float(base.sd[base.index("spring")[0]])
    softer = np.exp(2.5 * way * float(nats_of(np.array(sd)))) - 1
    engine = Engine(bench, base, one_soft_spring(bench, softer), np.array([0.0, 3e-6]))
    assert most_off(engine, fit(engine, said((), ()))) == pytest.approx(2.5, abs=0.15)


def test_one_spring_two_and_a_half_deviations_soft_is_no_fault() -> None:
    data = linear("rich")
    sd = data.compliance_relative_sd.copy()
    sd[:] = 0.15
    stated = data.compliance.copy()
    stated[1] *= 1 - 2.5 * 0.15  # what was simulated is stiffer than what was measured
    found = explained(replace(data, compliance=stated, compliance_relative_sd=sd))
    assert found.verdict == "none"
    assert found.probabilities["none"] > 0.6
