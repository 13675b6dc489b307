"""Springs and gains that are off beside a mechanism that brings a mean stiffness of its own."""

from __future__ import annotations

from dataclasses import replace
from math import log

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import Curve
from identification.gap.explanations.explanation import SearchResult
from identification.gap.explanations.verdict import with_posterior
from identification.gap.judging.stated import (
    _nearest,
    led_by_springs,
    off_from_stated,
)
from identification.gap.model.bench import Bench, KnownEffects, make_bench
from identification.gap.words import LINEAR
from tests.explained import explained
from tests.unit.small_explanations import OFF as LEFT
from tests.unit.small_explanations import part, said, small_engine_of
from tests.unit.test_gap_flanks import TOP, K, a_bench, held, to_and_fro
from tests.unit.test_gap_operators import bench_data

CURVE, FRICTION, SPRINGS = "joint_nonlinear_stiffness", "joint_hysteresis", "joint_stiffness_error"
EVERYWHERE = np.ones(480, dtype=bool)
X = to_and_fro()  # of the load, -1 to 1


def a_straight(imposed: str = "force") -> Bench:
    return a_bench(X, X, imposed)


def path(response: Array, bench: Bench) -> Array:
    """A response in units of what the stated spring gives at the largest load."""
    return np.asarray(response * (bench.stated_slope * bench.load).max())


OFF = {
    "softer": (2.0 * X, 2.0),
    "stiffer": (0.4 * X, 0.4),
    "and a little curved": (2.0 * X + 0.1 * X**3, 2.0),
    "and rubbing": (2.0 * X - 0.3 * (X - held(X, 0.05)), 1.7),
}
MET = {
    "stated": X,
    "hardens from what was stated": X - 0.4 * X * np.abs(X),
    "ends as stated": X + 0.4 * np.tanh(X / 0.2),
    "as stated halfway": 0.6 * X + 0.5 * X**3,
    "sticks as stated and slips": 2.0 * X - (X - held(X, 0.1)),
}


@pytest.mark.parametrize("name", OFF)
def test_what_no_piece_meets_is_off_by_what_the_nearest_says(name: str) -> None:
    bench, (response, factor) = a_straight(), OFF[name]
    found = _nearest(bench, EVERYWHERE, [path(response, bench)])
    assert found == pytest.approx(factor, rel=0.03)


@pytest.mark.parametrize("name", MET)
def test_what_a_piece_of_the_way_meets_is_as_stated(name: str) -> None:
    bench = a_straight()
    assert _nearest(bench, EVERYWHERE, [path(MET[name], bench)]) is None


def test_what_another_simulator_says_is_met_where_its_curve_is() -> None:
    bench, ends = a_straight(), np.array([-TOP, 0.0, TOP])
    bends = Curve(ends, np.array([-2.0, 0.0, 3.0]) * TOP / K)  # softer than META says
    bench = make_bench(replace(bench.data, curves=(bends,)))
    as_said = np.where(X > 0, 3 * X, 2 * X)
    assert _nearest(bench, EVERYWHERE, [path(as_said, bench)]) is None
    assert _nearest(bench, EVERYWHERE, [path(1.6 * as_said, bench)]) == pytest.approx(1.6, rel=0.03)


def test_a_stiff_beginning_of_a_long_way_is_seen_in_what_answers() -> None:
    """A metal that yields after a hundredth of its stroke."""
    bench = a_straight("displacement")
    flows = 0.02 * np.tanh(X / 0.02) + 0.001 * X
    assert _nearest(bench, EVERYWHERE, [path(flows, bench)]) is None
    assert _nearest(bench, EVERYWHERE, [path(0.3 * flows, bench)]) is not None


def test_a_jump_is_no_stiffness_that_was_passed() -> None:
    """The flanks of a play are stiffer than stated, and what lies between them is no spring."""
    bench = a_straight()
    play = 0.4 * X + 0.3 * np.sign(X)
    found = _nearest(bench, EVERYWHERE, [path(play, bench)])
    assert found is not None
    assert found < 0.4 * 1.5**0.5  # a piece with a little of the gap is half as unlike at most
    stiffens = 0.3 * X + 0.5 * X**3  # by and by
    assert _nearest(bench, EVERYWHERE, [path(stiffens, bench)]) is None


@pytest.mark.parametrize(("imposed", "softer"), [("force", 0.76), ("displacement", 1.32)])
def test_the_stiffness_counts_by_what_was_stated_of_it(imposed: str, softer: float) -> None:
    """Three standard deviations are 0.3 of it, whatever the response is."""
    bench = a_straight(imposed)
    assert bench.data.compliance_relative_sd.tolist() == [0.1]
    assert _nearest(bench, EVERYWHERE, [path(softer * X, bench)]) is not None
    assert _nearest(bench, EVERYWHERE, [path(X / softer, bench)]) is None


def test_what_the_simulation_has_beside_its_springs_is_no_error_of_these() -> None:
    bench = bent(1.0, 0.1)
    known = path(X, bench)  # a second spring, say
    data = replace(bench, response=bench.response + known, observed=bench.observed + known)
    nothing = KnownEffects(known, np.zeros((bench.layout.size, 0)), (), 0.0)
    for case, off in ((data, True), (replace(data, known=nothing), False)):
        line, cubic = columns(case)
        curve = said((part(CURVE, [line, cubic], joint=0, joints=(0,)),), (1e-5,), -1.0)
        assert (off_from_stated(small_engine_of(case), curve) is not None) == off


def test_what_comes_late_is_met_between_what_comes_at_once_and_all() -> None:
    bench = a_straight()
    at_once, whole = path(0.6 * X, bench), path(1.6 * X, bench)
    assert _nearest(bench, EVERYWHERE, [whole]) == pytest.approx(1.6, rel=0.03)
    assert _nearest(bench, EVERYWHERE, [whole, at_once]) is None
    assert _nearest(bench, EVERYWHERE, [whole, 0.95 * whole]) == pytest.approx(1.52, rel=0.03)


def bent(spring: float, bend: float) -> Bench:
    """A spring so many times softer than stated, and what it bends, of the stated response."""
    return a_bench(X, spring * X + bend * X**3, "force")


def columns(bench: Bench) -> tuple[int, int]:
    """Of the spring and of a cubic, as large as what the stated spring gives."""
    line = bench.stated_slope * bench.load
    return bench.add_joint(0, bench.elastic[:, 0]), bench.add_joint(
        0, bench.elastic[:, 0] * (line / line.max()) ** 2
    )


@pytest.mark.parametrize(
    ("spring", "bend", "off"), [(2.0, 0.1, True), (2.0, 0.8, False), (2.0, 2.5, False)]
)
def test_springs_lead_where_they_do_far_more_than_all_the_rest(
    spring: float, bend: float, off: bool
) -> None:
    bench = bent(spring, bend)
    line, cubic = columns(bench)
    engine = small_engine_of(bench)
    curve = said((part(CURVE, [line, cubic], joint=0, joints=(0,)),), (1e-5,), -1.0)
    both = said(
        (
            part(CURVE, [cubic], joint=0, joints=(0,)),
            part(SPRINGS, [line], joint=0, joints=(0,)),
        ),
        (1e-5, 1e-6),
        -2.0,
    )
    spring_alone = said((part(SPRINGS, [line], joint=0, joints=(0,)),), (1e-4,), -50.0)
    gain = said((part("force_scale", [line]),), (1e-4,), -60.0)
    ranked = (curve, both, spring_alone, gain)
    shapes = [p.variant for e in ranked for p in e.parts]
    result = SearchResult(engine, ranked, {}, {}, -np.inf, 0.0, variants=tuple(shapes))
    found, led = off_from_stated(engine, curve), led_by_springs(result, ranked)
    assert (found is not None) == off
    assert led.representatives == ({curve.words: spring_alone} if off else {})
    pair = next(e for e in led.explanations if e.words == both.words)
    assert pair.parts[0].word == (SPRINGS if off else CURVE)
    assert {e.words for e in led.explanations} == {e.words for e in ranked}
    if off:
        assert pair.sizes[0] > 5 * pair.sizes[1]
        assert found is not None
        assert found.off == pytest.approx(pair.sizes[0], rel=0.1)


def test_the_mechanism_is_looked_for_beside_spring_and_gains_without_a_spring_of_its_own() -> None:
    bench = bent(2.0, 0.1)
    line, cubic = columns(bench)
    at = {"joint": 0, "joints": (0,)}
    curve = said((part(CURVE, [cubic, line], other_springs=True, **at),), (1e-5,), -1.0)
    spring = said((part(SPRINGS, [line], **at),), (1e-4,), -1e5, LEFT)
    gain = said((part("force_scale", [line]),), (1e-4,), -1e5 - 3, LEFT)
    far = said((part("displacement_scale", [line]),), (1e-4,), -1e5 - 8, LEFT)
    ranked = (curve, spring, gain, far)
    shapes = tuple(p.variant for e in ranked for p in e.parts)
    result = SearchResult(small_engine_of(bench), ranked, {}, {}, -np.inf, 0.0, variants=shapes)
    led = {e.words: e for e in led_by_springs(result, ranked).explanations}
    for word in (SPRINGS, "force_scale"):
        both = led[frozenset({word, CURVE})]
        assert [p.word for p in both.parts] == [word, CURVE]
        assert both.parts[1].variant.columns == (cubic,)
    assert frozenset({"displacement_scale", CURVE}) not in led


@pytest.mark.parametrize(("word", "off"), [(CURVE, True), ("joint_creep", False)])
def test_what_creeps_is_as_stiff_as_stated_at_once(word: str, off: bool) -> None:
    bench = bent(1.6, 0.0)
    law = said((part(word, [columns(bench)[0]], joint=0, joints=(0,)),), (1e-5,))
    assert (off_from_stated(small_engine_of(bench), law) is not None) == off


def two_ways(sds: tuple[float, float]) -> Bench:
    """A spring in x that is twice as soft as stated, and one in y that is as stated."""
    half = X[::2]
    one = bench_data(half, half).setups[0]
    flat = {"tangent_lever": np.zeros((2, 2)), "offset_lever": np.zeros((2, 3))}
    flat |= {"turned_lever": np.zeros((2, 2)), "gravity": np.zeros(2)}
    x, y = (replace(one, direction="xy"[k], lever=np.eye(2)[k], **flat) for k in range(2))
    run = np.repeat([0, 1], len(half))
    data = bench_data(
        TOP * np.tile(half, 2),
        TOP / K * np.concatenate([2.0 * half, half]),
        step=np.full(2 * len(half), -1),
        branch=np.full(2 * len(half), 3),
        run=run,
        setup=run,
        setups=(x, y),
        compliance=np.full(2, 1 / K),
        compliance_relative_sd=np.array(sds),
    )
    return make_bench(data)


@pytest.mark.parametrize(
    ("joint", "sds", "off"),
    [(0, (0.1, 0.1), True), (0, (0.1, 0.9), True), (0, (0.9, 0.1), False), (1, (0.1, 0.1), False)],
)
def test_every_direction_is_met_or_off_by_itself(
    joint: int, sds: tuple[float, float], off: bool
) -> None:
    bench = two_ways(sds)
    line = bench.add_joint(joint, bench.elastic[:, joint])
    spring = bench.add_joint(0, bench.elastic[:, 0])
    parts = part(CURVE, [line], joint=joint, joints=(joint,)), part(SPRINGS, [spring])
    law = said(parts, (1e-5, 1e-6))
    assert (off_from_stated(small_engine_of(bench), law) is not None) == off


def test_who_speaks_for_fewer_effects_speaks_for_more_that_bring_no_more() -> None:
    bench = a_straight()
    engine = small_engine_of(bench)
    line, cubic = columns(bench)
    curve, drift, lag = (part(w, [cubic]) for w in (CURVE, "thermal_drift", "time_lag"))
    two, three = said((curve, drift), (3e-5, 2e-5), -5.0), said((curve, drift, lag), (1e-5,) * 3)
    spring = said((part(SPRINGS, [line]),), (1e-4,), -50.0)
    none = said((), (), -log(1e30))
    found = SearchResult(
        engine,
        (three, two, spring, none),
        {},
        {},
        -np.inf,
        0.0,
        representatives={two.words: spring},
    )
    likeliest = max((p := with_posterior(found, {}).probabilities), key=lambda w: p[w])
    assert likeliest == SPRINGS


FLAWS = {
    "curved": 0.08 * X**3,
    "rubs": 0.1 * (held(X, 0.05) - X),
}


@pytest.mark.parametrize("name", FLAWS)
def test_a_spring_half_as_stiff_as_stated_is_named_beside_what_it_does_beside(name: str) -> None:
    found = explained(a_bench(X, 2.2 * X + FLAWS[name], "force").data)
    assert found.verdict in LINEAR
    assert sum(found.probabilities[w] for w in LINEAR) > 0.7
    first = found.effects[0]
    assert first.name == found.verdict
    assert first.probability >= found.probabilities[found.verdict]
    assert "displacement_scale" in {first.name, *first.indistinguishable_from}
    assert {e.name for e in found.effects} - LINEAR == {CURVE if name == "curved" else FRICTION}


@pytest.mark.parametrize(("imposed", "radius"), [("force", 0.05), ("displacement", 0.12)])
def test_friction_that_sticks_as_stated_is_friction(imposed: str, radius: float) -> None:
    force = X if imposed == "force" else 0.4 * X + 0.6 * (X - held(X, radius))
    moved = X + 2.0 * held(X, radius) if imposed == "force" else X
    assert explained(a_bench(force, moved, imposed).data).verdict == FRICTION
