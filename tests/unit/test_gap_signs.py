"""Limits of coefficients, evidence between the levels, and the prior of the imperfection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
from scipy.optimize import minimize
from scipy.special import log_ndtr

from bench.dense_model import dense
from bench.nested_cases import case_data
from identification.arrays import Array
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.finer import gained
from identification.gap.evidence.imperfection import least_size, log_share
from identification.gap.evidence.parts import Part, log_joint_between, log_joints, signs_kept
from identification.gap.evidence.signs import (
    Kept,
    Limits,
    all_kept,
    distance,
    log_odds,
    log_odds_together,
)
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from identification.gap.model.variants import Variant, variant
from tests.unit.test_gap_evidence import small_bench, small_engine


def test_a_distance_is_found_where_its_first_solver_gives_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After three turns a limit, as it does now and then; a diagnosis had ended by that."""
    rng, cases = np.random.default_rng(8), []
    for _ in range(200):
        m, r = rng.integers(1, 24, 2)
        unit = rng.normal(size=(m, r)) + rng.choice([0.0, 2.0])
        unit /= np.linalg.norm(unit, axis=1)[:, None]
        z = unit @ rng.normal(0, 3, r) + rng.choice([0.0, 0.3]) * rng.uniform(0, 1, m)
        cases.append((z, unit, distance(z, unit)))

    def gives_up(*_: Array, **__: int) -> None:
        raise RuntimeError("Maximum number of iterations reached.")

    monkeypatch.setattr(scipy.optimize, "nnls", gives_up)
    for z, unit, known in cases:
        assert distance(z, unit) == pytest.approx(known, rel=1e-6, abs=1e-6)


def odds(mean: Array, covariance: Array, prior: Array, **limits: object) -> float:
    v = variant("joint_yield", "v", list(range(len(mean))), (1.0,), **limits)  # type: ignore[arg-type]
    found = Limits.of([v])
    before = np.sqrt(np.einsum("vmi,ij,vmj->vm", found.rows, prior, found.rows))
    roots = found.rows @ np.linalg.cholesky(covariance)
    return float(log_odds(found, np.zeros(1, int), before, found.rows @ mean, roots)[0])


def sampled(mean: Array, covariance: Array, prior: Array, rows: Array, least: float) -> float:
    """log of the share that keeps `rows w > (least, 0, 0 ...)`, over that of the prior."""
    draw = np.random.default_rng(2)
    limit = np.append(least, np.zeros(len(rows) - 1))
    share = [
        np.mean(np.all(draw.multivariate_normal(m, c, 2_000_000) @ rows.T > limit, axis=1))
        for m, c in ((mean, covariance), (np.zeros(len(mean)), prior))
    ]
    return float(np.log(share[0] / share[1]))


ALONE = np.array([[1.0]])
TINY = (-1e-9, 1e-9)
UNIT = np.ones((1, 1))  # how far sums went in the prior, where half of it keeps them anyway


def test_a_sum_may_be_below_zero_where_its_floor_is() -> None:
    """Far above the floor costs nothing, below it as much as the share that is left of all that
    the prior had there."""
    floor, rows = np.array([-0.9]), np.array([[1.0, 1.0]])
    free = {"positive": False, "within": rows, "floor": floor}
    covariance = 0.02 * np.eye(2)  # of the sum 0.2^2
    assert odds(np.array([0.3, 0.3]), covariance, np.eye(2), **free) == 0.0
    either = [odds(np.array([d - 0.45, -0.45]), covariance, np.eye(2), **free) for d in TINY]
    assert either[0] == pytest.approx(either[1], abs=1e-6)  # as much just above as just below
    found = odds(np.array([-1.0, -0.3]), covariance, np.eye(2), **free)
    assert found == pytest.approx(log_ndtr(-0.4 / 0.2) - log_ndtr(0.9 / 2**0.5))


def test_one_coefficient_and_its_sign_are_exact() -> None:
    for mean in (-3.0, -0.4, 0.0, 2.0):
        found = odds(np.array([mean]), 0.25 * ALONE, ALONE, least=0.3)
        assert found == pytest.approx(log_ndtr((mean - 0.3) / 0.5) - log_ndtr(-0.3))


def test_no_limit_costs_nothing() -> None:
    free = Limits.of([variant("joint_yield", "v", [0, 1], (1.0,), positive=False)])
    sums, roots = np.full((1, 1), -9.0), np.ones((1, 1, 2))
    assert log_odds(free, np.zeros(1, dtype=int), np.ones((1, 1)), sums, roots) == 0.0


def test_one_coefficient_may_not_pay_for_another_with_the_wrong_sign() -> None:
    """Data see `2 w0 + w1 = 0` only; `w0 + w1` is wanted above a limit, and neither below zero."""
    along, across = np.array([2.0, 1.0]) / 5**0.5, np.array([-1.0, 2.0]) / 5**0.5
    covariance = 1e-4 * np.outer(along, along) + np.outer(across, across)
    prior = np.eye(2)
    found = odds(np.zeros(2), covariance, prior, least=0.15, each=True)
    free = odds(np.zeros(2), covariance, prior, least=0.15)
    assert free > -1.0  # the sum alone is easily met
    assert found < -15.0  # but not with both above zero: 0.15 / 5**0.5 is 6.7 standard deviations


def test_a_floor_that_most_of_the_prior_keeps_is_dearer_to_break() -> None:
    """Also of all limits together: two that data see as one sum, each far below its floor."""
    covariance = np.eye(2) - (1 - 1e-4) * np.full((2, 2), 0.5)
    found = []
    for floor in (0.0, -2.0):
        free = {"positive": False, "within": np.eye(2), "floor": floor}
        v = variant("joint_yield", "v", [0, 1], (1.0,), **free)  # type: ignore[arg-type]
        limits, which = Limits.of([v]), np.zeros(1, int)
        sums = limits.rows @ np.full(2, floor - 0.1)
        roots = limits.rows @ np.linalg.cholesky(covariance)
        found.append(log_odds_together(limits, which, np.ones((1, 3)), sums, roots)[0])
    half, most = 2 * np.log(0.5), 2 * log_ndtr(2.0)
    assert found[1] - found[0] == pytest.approx(half - most, abs=1e-6)


def test_a_shape_of_any_sign_is_charged_for_its_floors() -> None:
    """In the table of all shapes as well: alike but for a floor that the data are far below."""
    engine = small_engine(small_bench())
    engine.target[: engine.bench.rows.n] -= 3.0 * engine.bench.columns[0][: engine.bench.rows.n]
    engine = Engine(engine.bench, engine.base, engine.target, engine.etas)
    free = variant("joint_creep", "free", [0], (3.0,), positive=False)
    held = replace(free, label="held", within=np.ones((1, 1)), floor=np.full(1, -0.5))
    found = [score(engine, engine.levels[:1], [v])[0].log_evidence for v in (free, held)]
    assert found[1] < found[0] - 5.0


def test_limits_that_the_data_keep_cost_little() -> None:
    mean, covariance = np.array([0.6, 0.8]), np.array([[0.04, -0.03], [-0.03, 0.04]])
    exact = sampled(mean, covariance, np.eye(2), np.array([[1.0, 1.0], [1, 0], [0, 1]]), 0.15)
    found = odds(mean, covariance, np.eye(2), least=0.15, each=True)
    # signs that are kept earn nothing here; truly each is worth up to log 2
    assert exact - 2 * np.log(2) - 0.2 < found < exact + 0.2


def test_every_coefficient_with_the_wrong_sign_is_charged() -> None:
    """Three of them, each two standard deviations off, under a sum that is kept."""
    mean, covariance = np.array([9.0, -2.0, -2.0, -2.0]), np.eye(4)
    found = odds(mean, covariance, 9 * np.eye(4), each=True)
    one = log_ndtr(-2.0) - np.log(0.5)
    assert found == pytest.approx(3 * one + np.log(2), abs=0.15)  # log 2: the sum is kept


def test_limits_that_two_by_two_are_near_may_be_far_together() -> None:
    """Data see the sum of three alone: any two can be above zero, all three can't."""
    ones = np.ones(3) / 3**0.5
    covariance = np.eye(3) - (1 - 1e-4) * np.outer(ones, ones)
    mean = np.full(3, -1.2)
    v = variant("joint_yield", "v", [0, 1, 2], (1.0,), each=True, positive=np.array([1.0, 0, 0]))
    limits = Limits.of([v])
    roots = limits.rows @ np.linalg.cholesky(covariance)
    found = log_odds_together(limits, np.zeros(1, int), UNIT, limits.rows @ mean, roots)[0]
    assert found == pytest.approx(log_ndtr(-minimum(mean, covariance)) + 4 * np.log(2))
    assert found < -1000.0
    more = Limits(limits.rows, limits.floor + np.array([0.5, 0, 0, 0]), limits.asked)
    sums = limits.rows @ mean
    assert log_odds_together(more, np.zeros(1, int), UNIT, sums, roots)[0] < found - 10.0


def test_limits_each_hardly_broken_may_be_far_from_all_kept() -> None:
    """A knee that bends below all of its thresholds: data know the sum of five coefficients, and
    about which threshold it lies, but none of them; negative ones put it where none is."""
    radius = np.array([-2.0, -1, 0, 1, 2])
    known = np.linalg.qr(np.column_stack([np.ones(5), radius]))[0]
    covariance = 100.0 * (np.eye(5) - (1 - 1e-8) * known @ known.T)
    v = variant("joint_yield", "v", list(range(5)), (1.0,), each=True)
    limits = Limits.of([v])
    roots = limits.rows @ np.linalg.cholesky(covariance)
    for centre, free in ((-4.0, False), (-1.0, True)):
        mean = np.linalg.lstsq(np.vstack([np.ones(5), radius]), np.array([3.0, 3 * centre]))[0]
        sums = limits.rows @ mean
        assert (sums / np.linalg.norm(roots, axis=2)).min() > -0.5
        found = log_odds_together(limits, np.zeros(1, int), UNIT, sums, roots)[0]
        assert (found > 0) == free
        assert free or found < -1000.0


@pytest.mark.parametrize(("first", "looks"), [(-6.0, True), (-0.1, True), (0.1, False)])
def test_one_limit_that_is_broken_may_ask_others_to_be_so(first: float, looks: bool) -> None:
    """Data see the difference of two alone: the first is far below zero, the second just above, and
    can follow it no further than to there."""
    apart = np.array([1.0, -1.0]) / 2**0.5
    covariance = np.eye(2) - (1 - 1e-4) * np.outer(apart, apart)
    mean = np.array([first, 0.2])
    v = variant("joint_yield", "v", [0, 1], (1.0,), each=True, positive=np.array([0.0, 1]))
    limits = Limits.of([v])
    roots = limits.rows @ np.linalg.cholesky(covariance)
    found = log_odds_together(limits, np.zeros(1, int), UNIT, limits.rows @ mean, roots)[0]
    assert np.isfinite(found) == looks
    assert first > -1 or found < -15.0


def test_parts_are_asked_what_they_keep_together(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[Kept]] = []

    def kept(limits: list[Kept]) -> float:
        asked.append(limits)
        return -1e6

    monkeypatch.setattr("identification.gap.evidence.parts.all_kept", kept)
    engine = small_engine(small_bench())
    parts = [Part(variant("joint_creep", "v", [k], (1.0,), least=k + 0.5), 1.0) for k in (0, 1)]
    free = Part(variant("joint_creep", "free", [1], (1.0,), positive=False), 1.0)
    assert signs_kept(engine.levels[0], (parts[0], parts[1])) == -1e6
    below = [replace(p, variant=replace(p.variant, least=0.0)) for p in parts]
    signs_kept(engine.levels[0], (below[0], below[1]))
    first, second = ([float(kept.sums[0]) for kept in limits] for limits in asked)
    assert np.subtract(second, first) == pytest.approx([0.5, 1.5])
    first, second = ([float(kept.log_shares[0]) for kept in limits] for limits in asked)
    assert second == pytest.approx([-np.log(2)] * 2)  # of the prior half is above zero
    assert max(first) < -np.log(2) - 0.1
    assert signs_kept(engine.levels[0], (free,)) == 0.0


def minimum(mean: Array, covariance: Array) -> float:
    """Mahalanobis distance of the mean from the positive orthant, by another way."""
    precision = np.linalg.inv(covariance)
    best = minimize(
        lambda w: (w - mean) @ precision @ (w - mean),
        np.ones(3),
        jac=lambda w: 2 * precision @ (w - mean),
        bounds=[(0, None)] * 3,
        options={"ftol": 1e-15, "gtol": 1e-12},
    )
    return float(best.fun**0.5)


def test_parts_that_keep_their_limits_alone_may_not_together() -> None:
    """Two parts share a sum: one can be positive, or the other."""
    off = -0.5 * np.ones(1)
    half = np.log(0.5) * np.ones(1)
    limits = [Kept(off, np.array([root]), half) for root in ([1.0, 0.0], [-1.0, 0.01])]
    assert min(all_kept([one]) for one in limits) > -2.0
    assert all_kept(limits) < -1000.0


def test_a_place_lies_within_its_play() -> None:
    """w1 beyond half of w0, to either side, by ten standard deviations of it."""
    covariance = np.diag([0.01, 1e-4])
    rows = np.array([[0.5, 1.0], [0.5, -1.0]])
    for side in (1.0, -1.0):
        inside = odds(np.array([1.0, side * 0.4]), covariance, np.eye(2), within=rows)
        outside = odds(np.array([1.0, side * 1.0]), covariance, np.eye(2), within=rows)
        assert inside > 0.0
        assert outside < -25.0


def test_what_two_parts_keep_together_is_asked_part_by_part() -> None:
    engine = small_engine(small_bench())
    engine.target[: engine.bench.rows.n] -= 3.0 * engine.bench.columns[0][: engine.bench.rows.n]
    engine = Engine(engine.bench, engine.base, engine.target, engine.etas)
    kept = Part(variant("joint_creep", "free", [1], (1.0,), positive=False), 1.0)
    wrong = Part(variant("joint_creep", "signed", [0], (1.0,)), 1.0)
    right = Part(variant("joint_creep", "minus", [0], (1.0,), positive=-np.ones(1)), 1.0)
    assert signs_kept(engine.levels[0], (kept, wrong)) < -5.0
    assert signs_kept(engine.levels[0], (kept, right)) == 0.0


def test_limits_of_a_part_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    of = Limits.of

    def noted(variants: Sequence[Variant]) -> Limits:
        made.extend(v.label for v in variants)
        return of(variants)

    monkeypatch.setattr(Limits, "of", noted)
    engine = small_engine(small_bench())
    a, b = variant("joint_creep", "a", [0], (1.0,)), variant("joint_creep", "b", [1], (1.0,))
    for scale in (1.0, 2.0):
        signs_kept(engine.levels[0], (Part(a, scale), Part(b, scale)))
    assert made == ["a", "b"]


# --- between the levels --------------------------------------------------------------------------


def test_evidence_at_every_size_of_imperfection_is_that_of_one_dense_covariance() -> None:
    """Nuisances and imperfection built anew by `bench/dense_model.py`, as one matrix."""
    bench = make_bench(case_data("yield"))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    engine = Engine(bench, base, target, np.array([0.0, 1e-6, 2e-5, 1e-4]))
    model = dense(bench)
    offset = -float(np.sum(np.log(engine.sigma))) - 0.5 * bench.layout.size * np.log(2 * np.pi)
    nothing = np.zeros(len(model.target))
    for level in engine.levels:
        exact = model.log_density(nothing, level.eta)
        assert level.log_base + offset == pytest.approx(exact, rel=1e-8)
    between = log_joint_between(engine, (), 5e-5) + offset
    assert between == pytest.approx(model.log_density(nothing, 5e-5), rel=1e-8)


def test_between_two_levels_is_what_a_level_there_would_give() -> None:
    bench = small_bench()
    engine = small_engine(bench, (0.0, 3e-6, 7.5e-6))
    finer = Engine(bench, engine.base, engine.target, np.array([0.0, 3e-6, 4.7e-6, 7.5e-6]))
    parts = (Part(variant("joint_creep", "a", [0, 1], (0.5,)), 0.5),)
    found = log_joint_between(engine, parts, 4.7e-6)
    assert found == pytest.approx(log_joints(finer, parts)[2], rel=1e-12)


def test_steps_between_levels_lose_nothing_that_finer_ones_show() -> None:
    """An effect met to 4 %: levels by 2.5 beside levels by 1.1 of the same range."""
    bench = small_bench()
    engine = small_engine(bench)
    shape = bench.columns[0][: bench.rows.n]
    bent = shape * (1 + 0.1 * np.sin(40 * bench.load / np.ptp(bench.load)))
    target = engine.target.copy()
    target[: bench.rows.n] += 400.0 * bent
    steps = 5e-7 * 2.5 ** np.arange(8)
    fine = np.geomspace(steps[0], steps[-1], 1 + round(np.log(steps[-1] / steps[0]) / np.log(1.1)))
    v = variant("joint_creep", "a", [0], (400.0,))
    total, more, energy = [], [], float(np.mean((400.0 * (shape - shape.mean())) ** 2))
    for etas in (steps, fine):
        e = Engine(bench, engine.base, target, np.concatenate([[0.0], etas]))
        total.append(score(e, e.levels, [v])[0].log_evidence)
        more.append(gained(e, (Part(v, 400.0),), energy))
    total[0] += more[0]
    assert more[1] == pytest.approx(0.0, abs=0.3)  # between fine ones little is left to gain
    assert total[0] == pytest.approx(total[1], abs=0.3)


def test_no_law_is_met_more_closely_than_its_least_imperfection() -> None:
    """To the edge of the level that it falls into, so that the grid gives all the same room."""
    energy, edges = 1e-8, np.log(np.geomspace(1e-8, 1e-3, 400))
    etas = np.concatenate([[0.0], 4e-7 * 2.5 ** np.arange(6)])  # 1e-6, 1 % of it, is the second
    share = log_share(etas, edges, energy)
    least = np.exp(least_size(etas, energy))
    assert pytest.approx(least) == 4e-7 * 2.5**0.5
    assert np.all(share[np.exp(edges[1:]) < least] < -600)
    assert np.all(share[np.exp(edges[:-1]) > 1.1 * least] > -40)
    assert least_size(etas, 1e-14) == -np.inf  # so small that any will do


def test_limits_that_no_mean_keeps_are_far_away() -> None:
    with np.errstate(all="raise"):
        away = distance(np.array([-1.0, -1.0]), np.array([[1.0], [-1.0]]))
    assert 1e8 < away < np.inf


def test_many_means_at_once_are_as_far_as_each_alone() -> None:
    """Of few and of many sums that are in the way, some of which are free."""
    draw = np.random.default_rng(7)
    n, m = 200, 9
    asked = draw.random((n, m)) < 0.8
    roots = draw.normal(size=(n, m, m))
    roots[:, 1] = roots[:, 0] + 1e-3 * roots[:, 1]  # two are nearly one
    sums = draw.normal(-0.5, 2.0, (n, m))
    limits = Limits(np.zeros((n, m, m)), np.zeros((n, m)), asked)
    found = log_odds_together(limits, np.arange(n), UNIT.repeat(n, axis=0), sums, roots)
    looked = np.flatnonzero(np.isfinite(found))
    assert len(looked) > n / 2
    for i in looked:
        half = np.full(asked[i].sum(), np.log(0.5))
        alone = all_kept([Kept(sums[i, asked[i]], roots[i, asked[i]], half)])
        assert found[i] == pytest.approx(alone, rel=1e-5, abs=1e-5)
