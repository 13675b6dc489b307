"""How much explanations may leave, and who is asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import (
    REMAINDER,
    REMAINDER_ARMLESS,
    Explanation,
    SearchResult,
    tolerated_residual,
)
from identification.gap.judging.residual_checks import (
    OF_ANY_PATH,
    _allowed,
    reweighted_by_residuals,
)
from identification.gap.model.base import base_columns, prediction
from identification.gap.search.search import search
from tests.unit.small_explanations import part, replace_bench, said, small_engine_of
from tests.unit.test_gap_evidence import small_bench, small_engine

LARGE = 1e-4  # m


def found_with(explanations: tuple[Explanation, ...]) -> SearchResult:
    """Of an arm whose gap is column 0 of its pool; column 1 does nothing to it."""
    bench = small_bench()
    for wave in (np.sin(bench.load), np.cos(3 * bench.load)):
        bench.add(bench.stacked(LARGE * wave))
    searched = search(small_engine_of(bench), library(bench, ["joint_creep"]))
    arm = replace(bench, data=replace(bench.data, arm=True))
    engine = Engine(arm, base_columns(bench), bench.columns[0], np.array([0.0, 3e-6]))
    return replace(searched, engine=engine, explanations=explanations, unknown=-9000.0)


def test_what_takes_any_path_may_leave_less_than_what_has_a_law() -> None:
    law = said((part("joint_yield", [0]),), (LARGE,))
    path = said((part("thermal_drift", [0], path="free", pieces=4),), (LARGE,))
    engine = found_with((law,)).engine
    assert engine.structural > LARGE / 10
    for explanation, share in ((law, REMAINDER), (path, OF_ANY_PATH)):
        assert _allowed(engine, explanation, 0.0) == pytest.approx(share * engine.structural)
        assert _allowed(engine, explanation, LARGE) == LARGE  # noise may be more
    beside = said((*law.parts, *path.parts), (LARGE, LARGE / 2))
    assert _allowed(engine, beside, 0.0) == pytest.approx(REMAINDER * engine.structural)


@pytest.mark.parametrize(("eta", "asked"), [(1e-6, True), (LARGE, False)])
def test_whoever_may_inherit_is_asked_what_it_leaves(eta: float, asked: bool) -> None:
    """Also from what is good: it may fail on withheld data yet."""
    parts = part("joint_yield", [0]), part("thermal_drift", [1])
    whole, poor = said(parts, (LARGE, 1e-6)), said(parts[1:], (1e-6,), -500.0, eta)
    best, other = reweighted_by_residuals(found_with((whole, poor))).explanations
    assert best.adequate
    assert other.adequate is not asked


def test_what_levels_without_an_arm_really_leave_is_looked_up() -> None:
    """The grid of imperfections says that too much is left; the rows say that nothing is."""
    bench = small_bench()
    bench.add(bench.stacked(1e-4 * (bench.load / np.ptp(bench.load)) ** 2))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    engine = Engine(bench, base, target + bench.columns[0], np.array([0.0, 3e-6]))
    variants = library(bench, ["joint_creep"])
    found = search(small_engine_of(bench), variants)
    poor = replace(said((part("joint_creep", [0]),), (3e-5,)), log_adequate=-30.0)
    other = replace(said((part("zero_shift", [0]),), (3e-5,), -50.0), log_adequate=-80.0)
    one = replace(found, engine=engine, explanations=(poor, other), unknown=-800.0)
    first, second = reweighted_by_residuals(one).explanations
    assert first.log_adequate > -0.1
    assert second is other  # so far down nobody looks


def test_laws_of_a_rig_without_an_arm_may_leave_more() -> None:
    """A spring or gain that is off by more than what springs leave counts as what it is."""
    bench = small_bench()
    plain = small_engine(bench)
    arm = replace_bench(plain, replace(bench, data=replace(bench.data, arm=True)))
    large, left = 9.0 * plain.structural, plain.structural
    for engine, troubles, most in (
        (plain, {"joint_creep": large}, REMAINDER_ARMLESS * left),
        (arm, {"joint_creep": large}, REMAINDER * left),
        (plain, {"force_scale": large, "joint_creep": left}, REMAINDER_ARMLESS * large),
        (plain, {"joint_creep": large, "force_scale": large}, REMAINDER_ARMLESS * left),
        (plain, {"force_scale": 0.1 * left}, REMAINDER_ARMLESS * left),
        (arm, {"force_scale": large}, REMAINDER * left),
        (plain, {}, REMAINDER_ARMLESS * left),
    ):
        assert tolerated_residual(engine, troubles) == pytest.approx(most)


def test_an_arm_s_explanation_that_leaves_much_of_the_gap_in_the_rows_is_none() -> None:
    """Whatever the levels say; nor are those with fewer of its effects, however far down."""
    bench = small_bench()
    bench.add(bench.stacked(1e-4 * (bench.load / np.ptp(bench.load)) ** 2))
    bench = replace(bench, data=replace(bench.data, arm=True))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    bumps = bench.stacked(1e-4 * np.sin(bench.load / 4.0))
    column, one = bench.columns[0], part("joint_creep", [0])
    two = said((one, part("contact_seating", [0])), (3e-5, 1e-5))
    few, other = said((one,), (3e-5,), -60.0), said((part("zero_shift", [0]),), (3e-5,), -60.0)
    poor = replace(two, log_adequate=-30.0)
    variants = library(bench, ["joint_creep"])
    searched = search(small_engine_of(bench), variants)
    for left, kept in ((0.0, True), (1.0, False)):
        engine = Engine(bench, base, target + column + left * bumps, np.array([0.0, 3e-6]))
        found = replace(searched, engine=engine, unknown=-800.0)
        out = reweighted_by_residuals(replace(found, explanations=(two, few, other))).explanations
        assert [e.adequate for e in out] == [kept, kept, True]
        assert out[2] is other  # so far down nobody looks
        seen = reweighted_by_residuals(replace(found, explanations=(poor,))).explanations[0]
        assert seen.adequate is kept  # whatever the levels said
    left = 0.12 * bumps
    engine = Engine(bench, base, target + column + left, np.array([0.0, 3e-6]))
    found = replace(searched, engine=engine, unknown=-800.0)
    out = reweighted_by_residuals(replace(found, explanations=(two, few))).explanations
    assert [e.adequate for e in out] == [False, True]  # two words have to explain better than one
