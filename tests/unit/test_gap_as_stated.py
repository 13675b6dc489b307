"""Springs and gains within what is stated: no fault, whatever linear effect would bring them nearer
to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.judging.leftover import AS_STATED, FOR_NOTHING, looked_up
from identification.gap.model.base import base_columns
from identification.gap.search.search import search
from tests.unit.test_gap_evidence import small_bench
from tests.unit.test_gap_verdict import part, said, small_engine_of

SLANT, GAIN, CURVE = "load_misalignment", "force_scale", "joint_nonlinear_stiffness"


@pytest.mark.parametrize(("off", "fault"), [(AS_STATED - 0.5, False), (AS_STATED + 0.7, True)])
def test_a_linear_effect_is_named_only_where_something_is_off(off: float, fault: bool) -> None:
    bench = small_bench()
    bench.add(bench.stacked(1e-6 * np.sin(bench.load)))
    searched = search(small_engine_of(bench), library(bench, ["joint_creep"]))
    base = base_columns(bench)
    spring = base.names.index("spring1")
    target = off * base.sd[spring] * base.columns[:, spring]
    arm = replace(bench, data=replace(bench.data, arm=True))
    engine = Engine(arm, base, target, np.array([0.0, 3e-6]))
    each = [said((part(word, [0]),), (1e-5,), 6.0) for word in (SLANT, GAIN, CURVE)]
    both = said(tuple(part(word, [0]) for word in (SLANT, "pose_error")), (1e-5, 5e-6), 6.0)
    mixed = said(tuple(part(word, [0]) for word in (SLANT, CURVE)), (1e-5, 5e-6), 6.0)
    found = replace(
        searched, engine=engine, explanations=(*each, both, mixed, said((), ())), unknown=-800.0
    )
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
