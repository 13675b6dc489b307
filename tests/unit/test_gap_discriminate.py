"""Expected discrimination: on one engine as on many, and the worse of the two cases counts."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from identification.gap.answer import discriminate
from identification.gap.answer.designs import (
    Candidate,
    Design,
    candidates,
    planned,
    present_design,
    reverse,
)
from identification.gap.answer.discriminate import (
    ENOUGH,
    NextMeasurement,
    Option,
    _calibrated,
    _discrimination,
    _proposal,
    _reached,
    _told,
    next_measurement,
)
from identification.gap.answer.forms import Form, law_of
from identification.gap.answer.rivals import Rival, _shapes
from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.laws.law import Law
from identification.gap.model.base import base_columns
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.pool import Pool
from identification.gap.search.search import search
from rig.diagnosis.gap_data import arm_setup
from rig.models.robot import load_robot
from tests.unit.test_gap_evidence import small_bench, small_engine
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data


def test_a_place_loaded_the_other_way_is_the_setup_of_that_direction() -> None:
    """All that is linear in the direction changes its sign; lengths, weights and squares stay."""
    q, tcp = np.array([0.3, -1.2, 1.5, -0.4, 1.0, 0.2]), np.array([0.02, 0.0, 0.1])
    n = np.array([0.6, 0.0, 0.8])
    arm = load_robot("ur10e")
    there = asdict(reverse(arm_setup(arm, "P1", q, tcp, "x", n)))
    wanted = asdict(arm_setup(arm, "P1", q, tcp, "-x", -n))
    assert (there["pose"], there["direction"]) == ("P1", "-x")
    for name in wanted.keys() - {"pose", "direction", "tangents", "tangent_lever"}:
        np.testing.assert_allclose(there[name], wanted[name], atol=1e-12, err_msg=name)


def test_a_truth_in_the_pool_is_a_measurement_of_it() -> None:
    bench = make_bench(arm_data())
    library(bench, ("contact_seating",))
    truth = 3e-5 * np.sin(np.arange(bench.layout.size))
    place = bench.add(truth)
    base, etas = base_columns(bench), np.array([0.0, 3e-6, 2e-5])
    nothing = Engine(bench, base, np.zeros(bench.layout.size), etas)
    measured = Engine(bench, base, truth, etas)
    for level, wanted in zip(nothing.levels, measured.levels, strict=True):
        told = _told(level, place)
        np.testing.assert_allclose(told.moment, wanted.moment, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(told.log_base, wanted.log_base, rtol=1e-9)


def rival(bench: Bench, word: str, size: float) -> Rival:
    fresh = replace(bench, columns=Pool())
    v = library(fresh, (word,))[0]
    law, unit = law_of(fresh, v)
    values = np.full(len(v.columns), size) * unit
    form = Form(word, law, values, np.diag(values**2))
    return Rival(word, (form,), {}, ((v, law, unit, 0.0),))


def test_an_effect_too_small_to_be_seen_is_told_from_nothing() -> None:
    """If the large effect is true the data would say so at once; if the invisible one is, they
    would say little: the second case is what may be expected."""
    bench = make_bench(arm_data())
    design = present_design(bench)
    large, small = rival(bench, "contact_seating", 1e-4), rival(bench, "joint_creep", 1e-6)
    as_large = rival(bench, "joint_creep", 0.5)
    both_seen = _discrimination(bench, design, (large, as_large))
    one_hidden = _discrimination(bench, design, (large, small))
    assert both_seen > 20
    assert one_hidden < 12
    assert one_hidden == _discrimination(bench, design, (small, large))


def test_what_sits_in_two_joints_is_followed_in_both() -> None:
    """A truth that its own word can't follow wins too little, or loses to any other."""
    bench = make_bench(arm_data())
    fresh = replace(bench, columns=Pool())
    cubic = [v for v in library(fresh, ("joint_nonlinear_stiffness",)) if "cubic" in v.label]
    one, other = (next(v for v in cubic if v.joint == j) for j in (1, 2))
    laws = [law_of(fresh, v) for v in (one, other)]
    forms = [Form(one.word, law, 0.4 * unit, 0.01 * np.diag(unit**2)) for law, unit in laws]
    shapes = ((one, *laws[0], 0.0),)
    both = Rival(one.word, tuple(forms), {}, shapes, ((Part(other, 0.4), *laws[1]),))
    seat = rival(bench, "contact_seating", 1e-4)
    design = present_design(bench)
    followed = _discrimination(bench, design, (both, seat))
    assert followed > 20 + _discrimination(bench, design, (replace(both, further=()), seat))


def test_laws_are_no_better_next_time_than_they_are_seen_to_be() -> None:
    """What differs by less than the laws' imperfection will not decide there either."""
    bench = make_bench(arm_data())
    design = present_design(bench)
    pair = rival(bench, "contact_seating", 3e-6), rival(bench, "joint_creep", 0.01)
    exact, rough = pair, (replace(pair[0], eta=2e-5), replace(pair[1], eta=2e-5))
    assert _discrimination(bench, design, exact) > 3 * abs(_discrimination(bench, design, rough))


def test_shapes_are_weighed_beside_the_rest_of_the_explanation() -> None:
    """Alone, the shapes of a small effect stand in for a large one, and its own weighs nothing."""
    bench = make_bench(arm_data())
    words = ("joint_nonlinear_stiffness", "joint_creep")
    variants = library(bench, words)
    curves, creeps = ([v for v in variants if v.word == w] for w in words)
    creep, curve = creeps[0], next(v for v in curves if v.label == "joint 3 cubic")
    large = 0.5 * bench.columns[creep.columns[0]]
    target = large + 0.1 * bench.columns[curve.columns[0]]
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 3e-6, 2e-5]))
    shapes = _shapes(engine, curves, Part(curve, 0.15), (Part(creep, 0.5),))
    assert shapes[0][0] is curve
    assert shapes[0][-1] > max(weight for *_, weight in shapes) - 1
    assert {v.joint for v, *_ in shapes} == {2}
    far = next(v for v in curves if v.label == "joint 1 cubic")  # the truth, for all that
    (drawn, *_, own), *near = _shapes(engine, curves, Part(far, 0.15), (Part(creep, 0.5),))
    assert drawn is far
    assert own > max(weight for *_, weight in near) - 13


def proposed(pair: tuple[str, str], *nats: float) -> NextMeasurement | None:
    """From candidates that take ever longer, to calibrate the last one."""
    design = present_design(small_bench())
    kinds = [*(f"way {k}" for k in range(1, len(nats))), "calibrate"]
    rated = [
        (Option(kind, kind, value, float(k)), Candidate(kind, kind, design))
        for k, (kind, value) in enumerate(zip(kinds, nats, strict=True))
    ]
    return _proposal(rated, pair)


def test_where_nothing_helps_nothing_is_proposed() -> None:
    assert proposed(("joint_creep", "zero_shift"), 0.0, 0.0) is None
    assert proposed(("joint_creep", "force_scale"), 0.0) is not None
    gain = proposed(("force_scale", "zero_shift"), 0.0, 0.0)
    assert gain is not None
    assert (gain.kind, gain.design) == ("none", None)
    assert gain.alternatives[0].kind == "calibrate"
    some = proposed(("joint_creep", "zero_shift"), 2.0, 0.0)
    assert some is not None
    assert "The best of 2: way 1" in some.text


def test_where_no_procedure_helps_a_stand_can_be_looked_at() -> None:
    """Joint 1 and a stand that turns move the arm alike in every pose."""
    for pair in (("joint_yield", "base_slip"), ("base_compliance", "joint_stiffness_error")):
        look = proposed(pair, 0.0, 0.0)
        assert look is not None
        assert (look.kind, look.design, look.separates) == ("none", None, pair)
        assert "dial gauge" in look.text
    assert proposed(("base_compliance", "base_slip"), 0.0, 0.0) is None


@pytest.mark.parametrize("gain", [0.02, 0.1])
def test_what_a_calibration_gives_is_what_its_readings_give_on_average(gain: float) -> None:
    """Log odds of a gain of about this size against none, over all readings of it, which scatter by
    u, whichever is true."""
    u, design = 0.01, present_design(small_bench())
    design = replace(design, instruments=replace(design.instruments, force_gain=u))
    wide = float(np.hypot(gain, u))
    read = np.linspace(-8 * wide, 8 * wide, 4001)
    none = np.exp(-0.5 * (read / u) ** 2)
    odds = 0.5 * (read / u) ** 2 - 0.5 * (read / wide) ** 2 - np.log(wide / u)
    won = [
        np.average(odds, weights=np.exp(-0.5 * ((read - gain) / u) ** 2)),
        np.average(-odds, weights=none),
    ]
    law = Law({}, ())
    scale = Form("force_scale", law, np.array([gain]), np.zeros((1, 1)))
    rivals = (Rival("force_scale", (scale,), {}, ()), Rival("joint_creep", (), {}, ()))
    assert _calibrated(design, rivals) == pytest.approx(min(won), rel=1e-3)


def test_a_robot_without_output_encoders_is_not_asked_for_their_readings() -> None:
    design = replace(present_design(make_bench(arm_data())), readings=False)
    motor = replace(design, output_encoder=False)
    kinds = [[c.kind for c in candidates(d, True, ())] for d in (design, motor)]
    assert kinds[0] == ["readings", *kinds[1]]
    bench = make_bench(replace(arm_data(), output_encoder=False))
    assert not planned(present_design(bench), bench).output_encoder


def test_a_level_is_reached_with_all_that_lasts_of_an_explanation() -> None:
    """The largest of both explanations, springs and what is no question among it."""
    bench = make_bench(arm_data())
    design = present_design(bench)
    creep, seat = rival(bench, "joint_creep", 1e-9), rival(bench, "contact_seating", 1e-9)
    plain = np.array(_reached(bench, design, (creep, seat)))
    assert plain.shape == (len(design.setups), len(design.levels[0]))
    springs = [s.lever**2 @ bench.data.compliance + s.outside for s in design.setups]
    np.testing.assert_allclose(plain, np.array(springs)[:, None] * design.levels, rtol=1e-3)
    beside = replace(seat, rest=rival(bench, "joint_creep", 0.5).forms)
    more = np.array(_reached(bench, design, (creep, beside)))
    assert (more[:, -1] > 1.1 * plain[:, -1]).any()
    assert (np.diff(more) >= 0).all()


def test_procedures_are_looked_at_from_the_quickest_until_none_can_be_worth_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where all decide, the quickest few are enough; where none does, all are looked at."""
    bench = small_bench()
    variants = library(bench, ["joint_creep", "joint_stiffness_error"])
    found = search(small_engine(bench), variants)
    chosen = next(e for e in found.explanations if e.words == {"joint_creep"})
    every = candidates(present_design(bench), bench.data.arm, ())
    looked: list[float] = []

    def proposal(nats: float) -> int:
        def given(_: Bench, design: Design, __: object) -> float:
            looked.append(design.minutes)
            return 0.0 if len(looked) == 1 else nats  # the present procedure comes first

        looked.clear()
        monkeypatch.setattr(discriminate, "_discrimination", given)
        pair = ("joint_creep", "joint_stiffness_error")
        assert next_measurement(found, chosen, pair) is not None
        assert looked[1:] == sorted(looked[1:])
        return len(looked) - 1

    assert proposal(100.0) < proposal(ENOUGH - 1) == len(every)


def test_what_was_pushed_both_ways_is_not_to_be_reversed() -> None:
    design = present_design(make_bench(arm_data()))
    both = replace(
        design,
        setups=(*design.setups, *(reverse(s) for s in design.setups[1:])),
        levels=(*design.levels, *design.levels[1:]),
    )
    (turned,) = (c.design for c in candidates(both, True, ()) if c.kind == "reversed")
    names = [(s.pose, s.direction) for s in turned.setups]
    assert len(names) == 2 * len(design.setups)
    assert len(set(names)) == len(names)
    assert "reversed" not in [c.kind for c in candidates(turned, True, ())]


def test_a_plan_for_fast_sampling_has_few_samples_that_average_as_many() -> None:
    step = np.repeat([1, 2, 3, 4], 500)
    draw = np.random.default_rng(2)
    force = 20.0 * step + draw.normal(0, 0.1, len(step))
    time = 1e-3 * np.arange(len(step))
    data = bench_data(force, 1e-5 * force, step=step, time=time)
    design = present_design(make_bench(data))
    assert design.hold_s == pytest.approx(0.5, rel=0.01)
    assert design.hold_s / design.sample_s == pytest.approx(60)
    assert design.instruments.force == pytest.approx(data.instruments.force * (60 / 500) ** 0.5)
