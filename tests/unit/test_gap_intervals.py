"""Intervals of parameters: over the shapes that the data leave open, and what stands beside."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.gap.answer import mixing, posterior
from identification.gap.answer.mixing import SHARING, mixture, stretched, wider
from identification.gap.answer.parameters import parameters
from identification.gap.answer.posterior import (
    DEFINED,
    FLOWING,
    settled,
)
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.laws.interval import NOMINAL, Parameter, factors
from identification.gap.model.bench import make_bench
from identification.gap.model.variants import Variant
from identification.uncertainty import TWO_SIDED
from tests.unit.test_gap_evidence import small_bench, small_engine
from tests.unit.test_gap_parameters import known_of, sd


def test_a_mixture_spans_what_its_parts_span() -> None:
    each = [Parameter(10.0, 8.04, 11.96, "Nm"), Parameter(20.0, 18.04, 21.96, "Nm")]
    both = mixture(each, np.array([0.5, 0.5]))
    assert both.low == pytest.approx(8.36, abs=0.05)  # 5 % of the lower one lie below
    assert both.high == pytest.approx(21.64, abs=0.05)
    assert both.ci90 == pytest.approx((8.72, 21.28), abs=0.02)
    seldom = mixture(each, np.array([0.06, 0.94]))
    assert seldom.ci90[0] == pytest.approx(10.97, abs=0.02)  # by the normal law of its 95 %: 11.4
    more = (15 - np.hypot(6.28, 1.645 * 2), 15 + np.hypot(6.28, 1.645 * 2))
    assert wider(both, 4.0).ci90 == pytest.approx(more, abs=0.02)
    assert stretched(both).ci90[0] == pytest.approx(15 * (8.72 / 15) ** SHARING, abs=0.02)
    plain = Parameter(10.0, 8.04, 11.96, "Nm")
    assert plain.ci90 == pytest.approx((10 - 1.645, 10 + 1.645), abs=1e-3)
    almost = mixture(each, np.array([0.999, 0.001]))
    assert (almost.value, almost.high) == pytest.approx((10.0, 11.96), abs=0.02)


@pytest.mark.parametrize("other", [0, 1])
def test_an_interval_holds_all_that_fits_alike_at_whatever_joint(other: int) -> None:
    """The same column under two names of thresholds: neither the data nor the prior decide. The
    value is that of the explanation, not one between."""
    bench = small_bench()
    engine = small_engine(bench)
    common = {"radius": np.array([30.0]), "load": bench.load, "flow_s": 0.0}
    low, high = (
        Variant(
            "joint_yield",
            f"at {c}",
            (0,),
            (1.0,),
            np.eye(1),
            info={**common, "centre": c, "joint": j},
            prior=0.5,
        )
        for c, j in ((30.0, 0), (60.0, other))
    )
    chosen = Explanation((Part(low, 1.0),), 0.0, 0.0, (0.0,), 0.0)
    found = known_of(engine, [low, high], chosen)[0].parameters["threshold"]
    assert found.value == 30.0
    assert found.low < 30.0
    assert found.high > 60.0


@pytest.mark.parametrize(("nats", "open_"), [(0.0, True), (8.0, True), (40.0, False)])
def test_an_interval_holds_shapes_that_are_some_nats_less_likely(nats: float, open_: bool) -> None:
    """Four nats count as one; the likelier shape still says more."""
    bench = small_bench()
    common = {"radius": np.array([30.0]), "load": bench.load, "flow_s": 0.0, "joint": 0}
    low, high = (
        Variant(
            *("joint_yield", f"at {c}", (0,), (1.0,), np.eye(1)),
            info={**common, "centre": c},
            prior=prior,
        )
        for c, prior in ((30.0, 0.5), (60.0, 0.5 * np.exp(-nats)))
    )
    chosen = Explanation((Part(low, 1.0),), 0.0, 0.0, (0.0,), 0.0)
    found = known_of(small_engine(bench), [low, high], chosen)[0].parameters["threshold"]
    assert (found.high > 50.0) is open_
    assert found.ci90[0] < 30.0 < found.ci90[1]


def test_no_interval_of_a_threshold_reaches_below_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """However much it moves with what stands beside it; nor beyond the largest load."""
    bench = small_bench()
    engine = small_engine(bench)
    info = {"radius": np.array([30.0]), "load": bench.load, "flow_s": 0.0, "centre": 30.0}
    v = Variant("joint_yield", "at 30", (0,), (1.0,), np.eye(1), info={**info, "joint": 0})
    monkeypatch.setattr("identification.gap.answer.posterior._moves", lambda *_: 100.0**2)
    chosen = Explanation((Part(v, 1.0),), 0.0, 0.0, (0.0,), 0.0)
    found = known_of(engine, [v], chosen)[0].parameters
    threshold, top = found["threshold"], float(np.abs(bench.load).max())
    assert 0.0 < threshold.low < threshold.ci90[0] < threshold.value == 30.0
    assert 70.0 < threshold.ci90[1] < threshold.high < top
    assert threshold.cut_at == top
    slope = found["slope_beyond_over_elastic"]
    assert 0.0 < slope.low <= slope.ci90[0] <= slope.value
    assert slope.cut_at is None


def test_a_joint_that_was_looked_at_more_closely_is_no_likelier_for_that() -> None:
    """One column in two joints: of one there are forty shapes, of the other a single one."""
    bench = small_bench()
    engine = small_engine(bench)
    common = {"radius": np.array([30.0]), "load": bench.load, "flow_s": 0.0, "centre": 30.0}
    many = [
        Variant(
            "joint_yield",
            f"at {k}",
            (0,),
            (1.0,),
            np.eye(1),
            info={**common, "joint": 0},
            prior=0.5 / 40,
        )
        for k in range(40)
    ]
    one = Variant(
        "joint_yield", "at 30", (0,), (1.0,), np.eye(1), info={**common, "joint": 4}, prior=0.5
    )
    chosen = Explanation((Part(many[0], 1.0),), 0.0, 0.0, (0.0,), 0.0)
    found = known_of(engine, [*many, one], chosen)[0].places
    assert found == {"joint 1": pytest.approx(0.5), "joint 5": pytest.approx(0.5)}
    seldom = replace(one, prior=0.02)
    found = known_of(engine, [*many, seldom], chosen)[0].places
    assert found == {"joint 1": pytest.approx(0.5 / 0.52), "joint 5": pytest.approx(0.02 / 0.52)}
    far = replace(one, columns=(1,), prior=1e-6)
    assert known_of(engine, [*many, far], chosen)[0].places == {"joint 1": pytest.approx(1)}
    # what is said of it is said of where it sits most likely
    for variants, joint in (([*many, seldom], 0), ([*many, replace(one, prior=2.0)], 4)):
        said, known = settled(engine, variants, chosen)
        assert said.parts[0].variant.info["joint"] == joint
        assert next(iter(known[0].places)) == f"joint {joint + 1}"
        assert (said is chosen) == (joint == 0)


def test_an_effect_does_not_move_to_a_joint_where_it_would_do_nothing() -> None:
    """Two that share a joint are charged for that; but what leaves it must still be an effect. (Of
    an arm: a rig without one has no second joint in the same direction.)"""
    bench = make_bench(replace(small_bench().data, arm=True))
    object.__setattr__(bench, "joint_log_priors", np.zeros(5))  # of its five, one is real
    engine = small_engine(bench)
    idle = bench.add(1e-9 * engine.bench.columns[1])
    target = engine.target + 4.0 * bench.columns[0]
    engine = Engine(bench, engine.base, target, engine.etas)
    info = {"radius": np.array([30.0]), "load": bench.load, "flow_s": 0.0, "centre": 30.0}
    here, there = (
        Variant("joint_yield", "at 30", (k,), (1.0,), np.eye(1), info={**info, "joint": j})
        for k, j in ((0, 0), (idle, 4))
    )
    curve = Variant(
        "joint_nonlinear_stiffness",
        "bend",
        (0,),
        (1.0,),
        np.eye(1),
        info={
            "joint": 0,
            "kinds": ("cubic",),
            "torque": 1.0,
            "hinges": (),
        },
    )
    parts = (Part(here, 1.0), Part(curve, 1.0))
    said, known = settled(
        engine, [here, there, curve], Explanation(parts, 0.0, 0.0, (0.0,) * 2, 0.0)
    )
    assert said.parts[0].variant is here
    assert known[0].places == {"joint 1": pytest.approx(1)}


def test_where_the_grid_decides_the_step_of_the_grid_is_in_the_interval() -> None:
    """Data that exclude all thresholds of a grid but one say no more than where it stands on it."""
    bench = small_bench()
    engine = small_engine(bench)
    engine.target = engine.target + 4.0 * engine.bench.columns[0]
    family = [
        Variant(
            "joint_yield",
            f"at {c}",
            (k,),
            (1.0,),
            np.eye(1),
            prior=prior,
            info={
                "radius": np.array([c]),
                "load": bench.load,
                "flow_s": 0.0,
                "centre": c,
                "joint": 0,
            },
        )
        for k, c, prior in ((0, 30.0, 1.0), (1, 36.0, 1e-12))
    ]
    chosen = Explanation((Part(family[0], 1.0),), 0.0, 0.0, (0.0,), 0.0)
    alone = known_of(engine, family[:1], chosen)[0].parameters["threshold"]
    found = known_of(engine, family, chosen)[0].parameters["threshold"]
    assert found.value == pytest.approx(30.0, rel=0.01)
    assert sd(found) == pytest.approx(np.hypot(sd(alone), 6.0 / 12**0.5), rel=0.01)
    assert found.high - 30.0 == pytest.approx(30.0 - found.low)


def test_beside_another_effect_intervals_are_wider(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = small_engine(small_bench())
    family = [
        Variant(word, word, (k,), (1.0,), np.eye(1), info=info)
        for word, k, info in (
            ("joint_stiffness_error", 0, {"joints": [0], "joint": 0}),
            ("force_scale", 1, {}),
        )
    ]
    parts = tuple(Part(v, 1.0) for v in family)
    both = Explanation(parts, 0.0, 0.0, (1.0, 0.5), 0.0)
    wide = known_of(engine, family, both)[1].parameters["factor"]
    alone = known_of(engine, family, replace(both, parts=parts[1:], sizes=(1.0,)))
    monkeypatch.setattr(mixing, "SHARING", 1.0)
    narrow = known_of(engine, family, both)[1].parameters["factor"]
    assert SHARING > 1.2
    assert np.log(wide.high / wide.value) == pytest.approx(
        SHARING * np.log(narrow.high / narrow.value)
    )
    assert known_of(engine, family, replace(both, parts=parts[1:], sizes=(1.0,))) == alone


def test_what_stands_beside_an_effect_moves_its_parameters() -> None:
    """Beside it, two shapes of another word that the data leave alike take more or less from it."""
    engine = small_engine(small_bench())
    bench = engine.bench
    mine = Variant(
        "joint_stiffness_error",
        "joint 1",
        (0,),
        (10.0,),
        np.eye(1),
        info={"joints": [0], "joint": 0},
    )
    rival = Variant(
        "joint_creep", "T 3", (1,), (1.0,), np.eye(1), info={"joint": 0, "times_s": [3.0]}
    )
    place = bench.add(bench.columns[1] + 0.2 * bench.columns[0])
    twice = replace(rival, label="T 4", columns=(place,))
    engine.target = engine.target + 4.0 * bench.columns[0] + 2.0 * bench.columns[1]
    engine = Engine(bench, engine.base, engine.target, engine.etas)
    chosen = Explanation((Part(mine, 10.0), Part(rival, 1.0)), 0.0, 0.0, (1.0, 0.5), 0.0)
    alone = known_of(engine, [mine, rival], chosen)[0].parameters["factor_x"]
    both = known_of(engine, [mine, rival, twice], chosen)[0].parameters["factor_x"]
    assert both.value == pytest.approx(alone.value)
    assert both.high - both.low > 1.02 * (alone.high - alone.low)


@pytest.mark.parametrize("by_factors", [False, True])
def test_intervals_are_quantiles_of_what_is_possible(by_factors: bool) -> None:
    """Of draws that are above zero and below the largest load; where none is near, as before."""
    value, half, most = 2.0, 1.5 * 1.959964, 3.0
    p = Parameter(value, value - half, value + half, "Nm", most=most)
    drawn = value + 1.5 * np.random.default_rng(0).normal(size=200_000)
    if by_factors:
        p = replace(factors(value, np.exp(half), "Nm"), most=most)
        drawn = value * np.exp(drawn - value)
    drawn = drawn[(drawn > 0) & (drawn < most)]
    found = p.possible(0.0)
    wanted = np.quantile(drawn, [0.025, 0.05, 0.95, 0.975])
    ends = [found.low, *found.ci90, found.high]
    assert ends == pytest.approx(wanted, rel=0.02)
    assert (found.value, found.cut_at) == (value, most)
    far = replace(p, value=200.0, low=199.0, high=201.0, most=1e3)
    assert (far.possible(0.0).low, far.possible(0.0).high) == pytest.approx((199.0, 201.0))
    assert far.possible(0.0).cut_at is None


def test_a_shape_beside_which_a_parameter_is_none_says_nothing_of_it() -> None:
    """A threshold that the data hardly pass has an onset beside one shape, beside another none."""
    each = [{"onset_y": Parameter(value, value - 1, value + 1, "N")} for value in (80.0, 86.0)]
    read = [[each[0], {}], [{}, {}], [each[1], {}]]
    beside = SimpleNamespace(index=1, read=read, share=np.array([1.0, 0.5, 0.5]))
    mine = each[0]["onset_y"]
    moves = posterior._moves("onset_y", mine, 0, [cast("posterior._Shapes", beside)], [])
    assert moves == pytest.approx(0.5 / 1.5 * 6.0**2)


def test_what_is_known_to_a_factor_moves_by_factors() -> None:
    """Beside another effect half as stiff, or as good as rigid."""
    mine = factors(2.0, 3.0, "1")
    for other, nats in ((1.0, np.log(2.0)), (1e6, 3.0), (1e-9, 3.0)):
        moves = posterior._moves(
            "factor_joint1", mine, 0, [], [({"factor_joint1": factors(other, 2.0, "1")}, 1.0)]
        )
        assert moves == pytest.approx(nats**2 / 2)
    wide = wider(mine, 0.5)
    spread = np.exp(np.hypot(np.log(3.0), TWO_SIDED * 0.5**0.5))
    assert (wide.low, wide.high) == pytest.approx((2.0 / spread, 2.0 * spread))


def test_intervals_of_effects_that_share_a_gap_are_wider() -> None:
    above, across = Parameter(2.0, 1.0, 3.0, "1"), Parameter(1.0, -1.0, 3.0, "1")
    assert stretched(above).low == pytest.approx(2 * 0.5**SHARING)
    assert stretched(above).high == pytest.approx(2 * 1.5**SHARING)
    assert (stretched(across).low, stretched(across).high) == (1 - 2 * SHARING, 1 + 2 * SHARING)


def test_explanations_by_other_words_move_parameters_as_far_as_they_are_likely() -> None:
    engine = small_engine(small_bench())
    bench = engine.bench
    engine.target = engine.target + 4.0 * bench.columns[0]
    engine = Engine(bench, engine.base, engine.target, engine.etas)
    mine, other = (
        Variant(word, word, (k,), (10.0,), np.eye(1), info=info)
        for word, k, info in (
            ("joint_stiffness_error", 0, {"joints": [0], "joint": 0}),
            ("joint_creep", 1, {"joint": 0, "times_s": [3.0]}),
        )
    )
    chosen = Explanation((Part(mine, 10.0),), 0.0, 0.0, (1.0,), 0.0)

    def width(rival_weight: float) -> float:
        rival = Explanation((Part(mine, 0.3), Part(other, 1.0)), rival_weight, 0.0, (1.0, 0.5), 0.0)
        found = known_of(engine, [mine, other], chosen, [chosen, rival])[0].parameters
        return found["factor_x"].high - found["factor_x"].low

    assert width(0.0) > width(-2.0) > width(-9.0)
    assert width(-9.0) == width(-20.0)  # what hardly counts does not


@pytest.mark.parametrize(("flow", "share"), [(0.0, DEFINED), (10.0, FLOWING)])
def test_nobody_sees_begin_what_gives_way_slowly(flow: float, share: float) -> None:
    """A threshold means what it does to so much of itself, if nothing else is unsure."""
    bench = small_bench()
    engine = small_engine(bench)
    info = {"radius": np.array([30.0]), "load": bench.load, "flow_s": flow, "centre": 30.0}
    v = Variant("joint_yield", "at 30", (0,), (1.0,), np.eye(1), info={**info, "joint": 0})
    part = Part(v, 1.0)
    found = known_of(engine, [v], Explanation((part,), 0.0, 0.0, (0.0,), 0.0))[0].parameters
    alone = parameters(bench, part, np.ones(1), np.zeros((1, 1)), NOMINAL)["threshold"]
    wanted = np.hypot(sd(alone), share * 30.0)
    assert sd(found["threshold"]) == pytest.approx(wanted, rel=1e-3)
