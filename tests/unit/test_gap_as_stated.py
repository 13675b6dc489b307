"""Springs and gains within what is stated: no fault, whatever linear effect would bring them nearer
to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.judging.leftover import ARM_AS_STATED, AS_STATED, FOR_NOTHING, looked_up
from identification.gap.model.base import base_columns
from identification.gap.search.search import search
from tests.unit.small_explanations import part, said, small_engine_of
from tests.unit.test_gap_evidence import small_bench

SLANT, GAIN, CURVE = "load_misalignment", "force_scale", "joint_nonlinear_stiffness"


def found_off(off: float, explanations: tuple[Explanation, ...]) -> SearchResult:
    """Explanations of an arm, one of whose springs is off by so many standard deviations."""
    bench = small_bench()
    bench.add(bench.stacked(1e-6 * np.sin(bench.load)))
    searched = search(small_engine_of(bench), library(bench, ["joint_creep"]))
    base = base_columns(bench)
    spring = base.names.index("spring1")
    target = off * base.sd[spring] * base.columns[:, spring]
    arm = replace(bench, data=replace(bench.data, arm=True))
    engine = Engine(arm, base, target, np.array([0.0, 3e-6]))
    return replace(searched, engine=engine, explanations=explanations, unknown=-800.0)


@pytest.mark.parametrize(("off", "fault"), [(AS_STATED - 0.5, False), (AS_STATED + 0.7, True)])
def test_a_linear_effect_is_named_only_where_something_is_off(off: float, fault: bool) -> None:
    each = [said((part(word, [0]),), (1e-5,), 6.0) for word in (SLANT, GAIN, CURVE)]
    both = said(tuple(part(word, [0]) for word in (SLANT, "pose_error")), (1e-5, 5e-6), 6.0)
    mixed = said(tuple(part(word, [0]) for word in (SLANT, CURVE)), (1e-5, 5e-6), 6.0)
    found = found_off(off, (*each, both, mixed, said((), ())))
    weights = {e.words: e.log_weight for e in looked_up(found).explanations}
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
        (none,) = looked_up(found_off(off, (said((), ()),))).explanations
        assert np.exp(none.log_good - none.log_weight) == pytest.approx(kept, rel=0.1)
        assert none.log_weight == said((), ()).log_weight  # the rest is nobody's
