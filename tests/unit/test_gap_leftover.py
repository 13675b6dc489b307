"""How much an explanation of an arm may leave, and who is asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import REMAINDER, Explanation, SearchResult
from identification.gap.judging.leftover import OF_ANY_PATH, _allowed, looked_up
from identification.gap.model.base import base_columns
from identification.gap.search.search import search
from tests.unit.test_gap_evidence import small_bench
from tests.unit.test_gap_verdict import part, said, small_engine_of

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
    best, other = looked_up(found_with((whole, poor))).explanations
    assert best.good
    assert other.good is not asked
