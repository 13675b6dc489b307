"""Springs and gains within what is stated: no fault, whatever linear effect would bring them nearer
to it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.lognormal_springs import nats_of
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.judging.residual_checks import (
    ARM_AS_STATED,
    AS_STATED,
    FOR_NOTHING,
    reweighted_by_residuals,
)
from identification.gap.model.base import base_columns
from identification.gap.search.search import search
from tests.explained import explained
from tests.unit.small_explanations import part, said, small_engine_of
from tests.unit.test_gap_evidence import small_bench
from tests.unit.test_gap_operators import bench_data

SLANT, GAIN, CURVE = "load_misalignment", "force_scale", "joint_nonlinear_stiffness"


def found_off(off: float, explanations: tuple[Explanation, ...]) -> SearchResult:
    """Explanations of an arm, one of whose springs is too stiff by so many standard deviations."""
    bench = small_bench()
    bench.add(bench.stacked(1e-6 * np.sin(bench.load)))
    searched = search(small_engine_of(bench), library(bench, ["joint_creep"]))
    base = base_columns(bench)
    spring = base.names.index("spring1")
    softer = np.exp(-off * nats_of(base.sd)[spring]) - 1
    target = softer * base.columns[:, spring]
    arm = replace(bench, data=replace(bench.data, arm=True))
    engine = Engine(arm, base, target, np.array([0.0, 3e-6]))
    return replace(searched, engine=engine, explanations=explanations, unknown=-800.0)


@pytest.mark.parametrize(("off", "fault"), [(AS_STATED - 0.5, False), (AS_STATED + 0.7, True)])
def test_a_linear_effect_is_named_only_where_something_is_off(off: float, fault: bool) -> None:
    each = [said((part(word, [0]),), (1e-5,), 6.0) for word in (SLANT, GAIN, CURVE)]
    both = said(tuple(part(word, [0]) for word in (SLANT, "pose_error")), (1e-5, 5e-6), 6.0)
    mixed = said(tuple(part(word, [0]) for word in (SLANT, CURVE)), (1e-5, 5e-6), 6.0)
    found = found_off(off, (*each, both, mixed, said((), ())))
    weights = {e.words: e.log_weight for e in reweighted_by_residuals(found).explanations}
    less = 0.0 if fault else FOR_NOTHING
    for words, lost in (
        ({SLANT}, less),
        ({SLANT, "pose_error"}, less),
        ({GAIN}, 0.0),  # has bounds of its own
        ({CURVE}, 0.0),
        ({SLANT, CURVE}, 0.0),
    ):
        assert weights[frozenset(words)] == pytest.approx(6.0 - lost)


def test_of_an_arm_nothing_is_wrong_while_springs_are_as_stated() -> None:
    for off, kept in ((2.0, 1.0), (ARM_AS_STATED, 0.5), (6.0, 0.04)):
        (none,) = reweighted_by_residuals(found_off(off, (said((), ()),))).explanations
        assert np.exp(none.log_adequate - none.log_weight) == pytest.approx(kept, rel=0.1)
        assert none.log_weight == said((), ()).log_weight  # the rest is nobody's


@pytest.mark.parametrize(("stiffer", "said"), [(1.05, False), (1.3, True), (0.8, True)])
def test_a_spring_that_is_far_off_is_said_where_nothing_else_is_wrong(
    stiffer: float, said: bool
) -> None:
    """Stated to a tenth."""
    up = np.arange(0.0, 210.0, 10.0)
    force = np.tile(np.repeat(np.append(up, up[-2::-1]), 4), 3)
    rng = np.random.default_rng(3)
    moved = force * 1e-5 / stiffer + rng.normal(0, 1e-6, len(force))
    level = np.tile(np.repeat(np.arange(2 * len(up) - 1), 4), 3)
    found = explained(bench_data(force, moved, step=level))
    assert found.verdict == "none"
    notes = [n for n in found.notes if "times as stiff as simulated" in n]
    assert bool(notes) is said
    for note in notes:
        (told,) = re.findall(r"has to be (\S+) times", note)
        assert float(told) == pytest.approx(stiffer, rel=0.01)
