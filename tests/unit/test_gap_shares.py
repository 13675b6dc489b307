"""How large each effect of an arm is, and which of two is the main one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.effects import library
from identification.gap.evidence.compare import mean_square
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from identification.gap.model.variants import variant
from identification.gap.search.shares import BOUND, measured, size_of
from tests.unit.test_gap_weights import UP, hanging

LEAST = 0.05  # of what it moves, an effect counts at least


def engine_with(*columns: Array, datum: str = "setup") -> Engine:
    """One joint, a lever of 1 m, pushed up and back, in two poses of two runs; columns (n,) m in
    the pool."""
    data = hanging(UP, poses=(1.0, 1.0)).data
    second = np.tile(np.repeat([0, 1], len(data.force) // 4), 2)
    bench = make_bench(replace(data, datum=datum, run=2 * data.setup + second))
    for column in columns:
        bench.add(bench.stacked(column))
    target = bench.observed - prediction(bench)
    return Engine(bench, base_columns(bench), target, np.array([0.0, 3e-6]))


def size(engine: Engine, word: str, pull: float = 0.0) -> float:
    """Of the first column of the pool as that word, beside a spring that is off by so many sd."""
    part = Part(variant(word, "", [0], (1.0,)), 1.0)
    fitted = fit(engine, Explanation((part,), 0.0, 0.0, (0.0,), 0.0))
    pulls = np.zeros_like(fitted.pulls)
    pulls[engine.base.index("spring")] = pull
    return size_of(engine, replace(fitted, coefficients=np.ones(1), pulls=pulls), 0)


def by_spring(engine: Engine) -> Array:
    """(n,) m that a spring does that is off by one standard deviation."""
    (spring,) = engine.base.index("spring")
    return np.asarray(engine.base.columns[: engine.bench.rows.n, spring] * engine.base.sd[spring])


def rms(engine: Engine, values: Array) -> float:
    return engine.bench.rows.rms(values)


@pytest.mark.parametrize("pull", [-8.0, -2.0, 0.0, 2.0])
@pytest.mark.parametrize("moved", [5.0, -5.0])
def test_what_a_spring_can_take_within_its_bounds_is_no_gap(pull: float, moved: float) -> None:
    """Of a stiffness three standard deviations are stated, either way."""
    engine = engine_with()
    line, (spring,) = by_spring(engine), engine.base.index("spring")
    sd = float(engine.base.sd[spring])
    softest, stiffest = (1 / (1 - BOUND * sd) - 1) / sd, (1 / (1 + BOUND * sd) - 1) / sd
    found = size(engine_with(moved * line), "link_flexibility", pull)
    room = max(softest - pull, 0.0) if moved > 0 else max(pull - stiffest, 0.0)
    left = max(abs(moved) - room, LEAST * abs(moved))
    assert found == pytest.approx(left * rms(engine, line), rel=1e-6)


def test_a_jump_of_the_datum_counts_from_the_reading_at_which_it_was_zeroed() -> None:
    run = engine_with().bench.rows.run
    assert sorted(set(run.tolist())) == [0, 1, 2, 3]
    pose, jump = 1e-5 * (run > 1), 1e-5 * (run == 3)
    assert size(engine_with(pose), "zero_shift") == 0.0
    assert size(engine_with(pose), "force_drift") > 5e-6  # the force is zeroed once
    found = size(engine_with(jump), "zero_shift")
    assert found == pytest.approx(rms(engine_with(), jump), rel=0.1)
    assert size(engine_with(jump, datum="repetition"), "zero_shift") == 0.0


def test_only_sets_that_matter_are_measured_and_the_largest_comes_first() -> None:
    engine = engine_with()
    knee = 1e-5 * np.maximum(engine.bench.load - 50, 0) / 30
    jump = 1e-5 * (engine.bench.rows.run % 2)
    engine = engine_with(knee, jump)
    two = (
        Part(variant("joint_yield", "", [0], (1.0,)), 1.0),
        Part(variant("zero_shift", "", [1], (1.0,)), 1.0),
    )
    said = Explanation(two, 0.0, 0.0, (2.0, 1.0), 0.0)
    poor, single = replace(said, log_weight=-99.0), Explanation(two[:1], 0.0, 0.0, (2.0,), 0.0)
    found = measured(engine, [said, single, poor])
    assert found[1:] == [single, poor]
    fitted: Fit = fit(engine, said)
    wanted = [size_of(engine, fitted, i) for i in (0, 1)]
    order = sorted((0, 1), key=lambda i: -wanted[i])
    assert found[0].sizes == pytest.approx([wanted[i] for i in order])
    assert [p.word for p in found[0].parts] == [two[i].word for i in order]
    bench = replace(engine.bench.data, arm=False)
    alone = Engine(make_bench(bench), engine.base, engine.target, np.array([0.0, 3e-6]))
    assert measured(alone, [said]) == [said]


@pytest.mark.parametrize("label", ["joint 1 r 0.2{}", "joint 1 Dahl{} 0.08"])
def test_what_slips_on_a_spring_is_as_imperfect_as_what_it_holds_back(label: str) -> None:
    """Friction softens a spring in one convention, stiffens a softer one in the other: two names of
    one mechanism, whose laws err by a share of the loop and not of the line."""
    engine = engine_with()
    found = {v.label: v for v in library(engine.bench, ["joint_hysteresis"])}
    named = (found[label.format(on_top)] for on_top in ("", " that slips"))
    holds, slips = (mean_square(engine, v) for v in named)
    assert slips == pytest.approx(holds)
    assert np.diag(holds).min() > 0
