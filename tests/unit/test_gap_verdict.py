"""What several effects of one explanation owe each other, and what follows for the words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.compare import log_mean
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import (
    LAW_REMAINDER,
)
from identification.gap.explanations.verdict import (
    ARMLESS_DOUBT,
    DOUBT,
    EXPLAINED,
    TAKES_MORE,
    TAKES_TWO,
    THREE,
    THREE_CLOSELY,
    UNKNOWN_DOUBT,
    _heir,
    _main,
    _tells_of_three,
    find_representative,
    tolerated_misfit,
    with_a_lead,
    with_posterior,
)
from identification.gap.judging.residual_checks import reweighted_by_residuals
from identification.gap.search.search import search
from identification.gap.words import JERKS, WORDS
from tests.unit.small_explanations import OFF, part, replace_bench, said, small_engine_of
from tests.unit.test_gap_evidence import small_bench, small_engine


def test_the_main_cause_of_two_is_the_larger_one_as_far_as_their_sizes_are_known() -> None:
    mechanisms = (part("joint_yield", [0]), part("thermal_drift", [1]))
    linear = (part("joint_yield", [0]), part("force_scale", [1]))
    for parts, ratio, share in (
        (mechanisms, 1.0, 0.5),
        (mechanisms, 1.2, 0.946 * 0.95 + 0.025),
        (linear, 1.2, 0.641 * 0.95 + 0.025),
        (linear, 3.0, 0.985 * 0.95 + 0.025),
        (mechanisms, 1e12, 0.975),
    ):
        found = _main(said(parts, (ratio * 1e-5, 1e-5)), (), True)
        assert found[parts[0].word] == pytest.approx(share, abs=2e-3)
        assert sum(found.values()) == pytest.approx(1.0)
    assert _main(said(mechanisms, (2e-5, 1e-5)), (), False) == {"joint_yield": 1.0}
    assert _main(said(mechanisms, (0.0, 0.0)), (), True)["joint_yield"] == pytest.approx(0.5)
    assert _main(said(mechanisms[:1], (0.0,)), (), True) == {"joint_yield": 1.0}
    assert _main(said((), ()), (), True) == {"none": 1.0}


def test_what_explains_far_less_inherits_nothing_unless_it_fits_closely() -> None:
    both = (part("thermal_drift", [0]), part("joint_yield", [1]))
    failed = said(both, (2e-5, 1e-5), 0.0)
    for weight, eta, inherits in ((-10.0, 9e-6, True), (-90.0, 9e-6, False), (-90.0, 3e-6, True)):
        alone = said(both[:1], (2e-5,), weight, eta)
        heir = _heir(failed, [failed, alone], {failed.words: 0.0}, 4e-6)
        assert heir is (alone if inherits else None)


def test_an_heir_speaks_as_if_it_had_been_found_first() -> None:
    """A play and a curve that inherit from three are called by what does better alone."""
    bench = small_bench()
    found = search(small_engine_of(bench), library(bench, ["joint_creep"]))
    on_arm = replace_bench(found.engine, replace(bench, data=replace(bench.data, arm=True)))
    play, bends = (part(w, [0], joint=2) for w in ("joint_backlash", "joint_nonlinear_stiffness"))
    drift = part("thermal_drift", [0])
    three = replace(said((bends, play, drift), (3e-5, 1e-5, 9e-6), 10.0), log_adequate=-90.0)
    both = said((bends, play), (3e-5, 1e-5), 0.0)
    alone = (said((play,), (1e-5,), -200.0), said((bends,), (1e-5,), -260.0))
    case = replace(found, engine=on_arm, explanations=(three, both, *alone), unknown=-800.0)
    assert with_posterior(case, {}).probabilities["joint_backlash"] > 0.9


def test_what_explains_most_of_a_gap_fits_closely_whatever_its_noise() -> None:
    engine = small_engine(small_bench())
    noise = engine.bench.noise.stated
    for structural, most in ((2 * noise, 2 * noise), (100 * noise, 17 * noise)):
        engine.structural = structural
        assert tolerated_misfit(engine) == pytest.approx(most)


def test_a_mean_of_evidence_leaves_out_what_weighs_nothing() -> None:
    assert log_mean([0.0, -2000.0], [0.0, 1.0]) == pytest.approx(-2000.0)
    assert log_mean([-1.0, -1.0]) == pytest.approx(-1.0)


def test_three_troubles_at_once_leave_room_for_one_that_is_not_known() -> None:
    bench = small_bench()
    variants = library(bench, ["joint_creep", "joint_hysteresis"])
    of_bench = search(small_engine_of(bench), variants)
    on_arm = replace_bench(of_bench.engine, replace(bench, data=replace(bench.data, arm=True)))
    found = replace(of_bench, engine=on_arm)
    three = tuple(part(w, [0]) for w in ("joint_yield", "thermal_drift", "force_drift"))
    for parts, least, share in ((three, 0.3, 1 - THREE), (three, 0.05, 0.0), (three[:2], 1, 0.0)):
        sizes = (1e-5, 0.5e-5, 1e-5 * least)[: len(parts)]
        one = replace(found, explanations=(said(parts, sizes, 0.0, OFF),), unknown=-800.0, alone={})
        left = share - UNKNOWN_DOUBT * share * max(0.0, 2 * share - 1)
        assert with_posterior(one, {}).probabilities["unknown"] == pytest.approx(left)
        # without an arm all of them speak of one spring
        alone = replace(one, engine=of_bench.engine)
        assert with_posterior(alone, {}).probabilities["unknown"] < 0.01
    # where three laws fit to the noise there is less room for another
    noise = found.engine.bench.noise.stated
    for eta, unknown in ((1.9 * noise, 1 - THREE_CLOSELY), (2.1 * noise, 1 - THREE)):
        one = replace(
            found,
            explanations=(said(three, (1e-5, 5e-6, 3e-6), 0.0, eta),),
            unknown=-800.0,
            alone={},
        )
        assert with_posterior(one, {}).probabilities["unknown"] == pytest.approx(unknown, abs=0.1)
    # two of them explain nearly as much: then they are meant, whatever the third does
    third = said(three, (1e-5, 1e-5, 5e-6), 0.0, OFF)
    for worth, unknown in ((TAKES_MORE - 1, 0.0), (TAKES_MORE + 1, 0.9)):
        two = said(three[1:], (2e-5, 1e-6), -worth)
        both = replace(found, explanations=(third, two), unknown=-800.0, alone={})
        p = with_posterior(both, {}).probabilities
        assert p["unknown"] == pytest.approx(unknown, abs=0.1)
        assert (p["thermal_drift"] > 0.9) == (unknown == 0)
    # of a gap that stands out far, what the laws of two are off asks for more
    none = replace(third, parts=(), sizes=(), log_weight=-1e6, log_adequate=-1e6)
    for share, unknown in ((0.9, 0.0), (1.1, 0.9)):
        two = said(three[1:], (2e-5, 1e-6), -share * LAW_REMAINDER**2 * 1e6)
        both = replace(found, explanations=(third, two, none), unknown=-1e5, alone={})
        assert with_posterior(both, {}).probabilities["unknown"] == pytest.approx(unknown, abs=0.1)


def test_of_three_effects_of_which_two_bring_little_the_third_is_the_main_one() -> None:
    bench = small_bench()
    found = search(small_engine_of(bench), library(bench, ["joint_hysteresis"]))
    on_arm = replace_bench(found.engine, replace(bench, data=replace(bench.data, arm=True)))
    gain, springs, friction = (
        part(w, [0]) for w in ("force_scale", "joint_stiffness_error", "joint_hysteresis")
    )
    three = said((gain, springs, friction), (1e-4, 7e-5, 3e-5), 0.0)
    two = said((gain, friction), (4e-5, 3e-5), -3.0)
    for brings, main in ((12.0, "joint_hysteresis"), (40.0, "force_scale")):
        alone = said((friction,), (3e-5,), -3.0 - brings)
        case = replace(found, engine=on_arm, explanations=(three, two, alone), unknown=-800.0)
        probabilities = with_posterior(case, {}).probabilities
        assert max(probabilities, key=lambda w: probabilities[w]) == main


def test_of_an_arm_a_second_effect_that_brings_little_is_not_the_main_one() -> None:
    bench = small_bench()
    variants = library(bench, ["joint_creep"])
    found = search(small_engine_of(bench), variants)
    on_arm = replace_bench(found.engine, replace(bench, data=replace(bench.data, arm=True)))
    gain, link, knee = (part(w, [0]) for w in ("force_scale", "link_flexibility", "joint_yield"))
    for second, most in ((knee, TAKES_TWO), (link, TAKES_MORE)):
        for worth in (most - 1, most + 1):
            pair, one = said((gain, second), (3e-5, 3e-6)), said((second,), (1e-5,), -worth)
            both = replace(found, explanations=(pair, one), unknown=-800.0, alone={})
            weights = with_posterior(replace(both, engine=on_arm), {}).probabilities
            assert (weights[second.word] > 0.99) == (worth < most)
            assert with_posterior(both, {}).probabilities["force_scale"] > 0.9  # of a bench


def test_a_play_and_a_curve_of_one_joint_are_one_trouble() -> None:
    play, drift = part("joint_backlash", [0], joint=1), part("thermal_drift", [0])
    for joint, curve in ((1, False), (2, True)):
        bends = part("joint_nonlinear_stiffness", [0], joint=joint)
        assert _tells_of_three(said((play, bends, drift), (3e-5, 2e-5, 1e-5)), ()) == curve
    assert _tells_of_three(said((play, bends, drift, part("zero_shift", [0])), (1e-5,) * 4), ())


@pytest.mark.parametrize("beside", [(), (part("thermal_drift", [0]),)])
def test_a_play_and_a_curve_of_one_joint_are_called_by_what_explains_more_alone(
    beside: tuple[Part, ...],
) -> None:
    """Beside each other the curve does more, whatever it does without the play."""
    play, bends = (part(w, [0], joint=2) for w in ("joint_backlash", "joint_nonlinear_stiffness"))
    both = said((bends, play, *beside), (3e-5, 1e-5, 2e-6)[: 2 + len(beside)])
    for better in (play, bends):
        alone = [said((p, *beside), (1e-5,), -9.0 + (p is better)) for p in (play, bends)]
        alone.sort(key=lambda e: -e.log_weight)
        shares = _main(both, [both, *alone], True)
        assert max(shares, key=lambda w: shares[w]) == better.word
        assert shares[better.word] > 0.9
    elsewhere = replace(play, variant=replace(play.variant, info={"joint": 1}))
    two = said((bends, elsewhere), (3e-5, 1e-5))
    assert _main(two, [two, said((elsewhere,), (1e-5,), -1.0)], True)[bends.word] > 0.9
    assert _main(both, [both], True)[bends.word] > 0.9  # nobody looked at either alone


def test_an_unknown_of_an_arm_leaves_room_for_what_explains_most() -> None:
    given = {"joint_yield": 0.0, "base_slip": 0.0, "none": 0.1, "unknown": 0.9}
    best = {"joint_yield": 0.75, "base_slip": 0.25}
    out = with_a_lead(given, best)
    assert sum(out.values()) == pytest.approx(1.0)
    assert out["joint_yield"] == pytest.approx(3 * out["base_slip"])
    assert out["unknown"] == pytest.approx(0.9 - UNKNOWN_DOUBT * 0.9 * 0.8)
    even = {**given, "none": 0.5, "unknown": 0.5}  # what is no likelier than not keeps all
    assert with_a_lead(even, best) == even
    bench = small_bench()
    found = search(small_engine_of(bench), library(bench, ["joint_creep"]))
    one = said((part("joint_creep", [0]),), (1e-5,), -200.0)
    for arm in (True, False):
        engine = replace_bench(found.engine, replace(bench, data=replace(bench.data, arm=arm)))
        whole = replace(found, engine=engine, explanations=(one,), unknown=0.0, alone={})
        p = with_posterior(whole, {}).probabilities
        assert (p["joint_creep"] == pytest.approx(UNKNOWN_DOUBT)) == arm


def test_of_a_short_table_what_a_law_explains_is_not_unknown() -> None:
    bench = small_bench()
    variants = library(bench, ["joint_creep"])
    found = search(small_engine_of(bench), variants)
    law, noise = (part("joint_creep", [0]),), bench.noise.stated
    sure = 1 - 0.5 * ARMLESS_DOUBT  # on a bench; of two that are doubted, half comes back
    shares = (
        (noise, False, None),
        (1.6 * noise, False, None),
        (3 * noise, False, sure),
        (noise, True, 1 - UNKNOWN_DOUBT),
    )
    for eta, arm, unknown in shares:
        data = replace(bench.data, arm=arm)
        engine = replace_bench(found.engine, replace(bench, data=data))
        one = said(law, (1e-5,), -20.0, eta)
        whole = replace(found, engine=engine, explanations=(one,), unknown=0.0, alone={})
        given = with_posterior(whole, {}).probabilities
        if unknown is None:
            odds = np.log(given["joint_creep"] / given["unknown"])
            assert odds == pytest.approx(EXPLAINED, abs=0.2)
        else:
            assert given["unknown"] == pytest.approx(unknown, abs=1e-6)
    failed = {frozenset({"joint_creep"}): 0.1}
    whole = replace(found, explanations=(said(law, (1e-5,), -20.0, noise),), unknown=0.0, alone={})
    assert with_posterior(whole, failed).probabilities["unknown"] == pytest.approx(sure, abs=1e-6)


def test_what_no_word_names_is_unknown_unless_a_word_explains_it_as_well() -> None:
    """A word that is the larger one beside it keeps its weight; one that leaves no more than the
    noise keeps all."""
    bench = small_bench()
    variants = library(bench, ["joint_creep"])
    found = search(small_engine_of(bench), variants)
    creep, jerks, noise = part("joint_creep", [0]), part(JERKS, [1]), bench.noise.stated
    for parts, eta, main in (
        ((jerks,), 3 * noise, "unknown"),
        ((jerks, creep), 3 * noise, "unknown"),
        ((creep, jerks), 3 * noise, "joint_creep"),
        ((jerks,), noise, "joint_creep"),
    ):
        word = said((creep,), (1e-5,), -20.0, eta)
        odd = said(parts, (1e-5, 0.5e-5)[: len(parts)], 20.0, 0.0)
        whole = replace(found, explanations=(word,), unmodelled=(odd,), unknown=-90.0, alone={})
        given = with_posterior(whole, {}).probabilities
        assert max(given, key=lambda w: given[w]) == main
        assert given.keys() == {*WORDS, "none", "unknown"}


def test_what_no_word_names_is_looked_up_as_well() -> None:
    """A mechanism beside it that leaves too much is no more believed than it is alone."""
    bench = small_bench()
    bench.add(bench.stacked(1e-4 * (bench.load / np.ptp(bench.load)) ** 2))
    variants = library(bench, ["joint_creep"])
    found = search(small_engine_of(bench), variants)
    creep, jerks = part("joint_creep", [0]), part(JERKS, [0])
    poor = replace(said((creep, jerks), (3e-5, 1e-5), -10.0), log_adequate=-30.0)
    far = said((jerks,), (1e-5,), -80.0)
    one = replace(found, explanations=(said((creep,), (3e-5,)),), unmodelled=(poor, far))
    first, second = reweighted_by_residuals(one).unmodelled
    assert first.log_adequate != poor.log_adequate
    assert second is far


def test_what_is_worth_too_little_for_three_speaks_for_two_of_them() -> None:
    """Two drifts against each other, which are worth less than the main one of three has to be; and
    one that leaves too much, whose heir explains enough."""
    bench = small_bench()
    found = search(small_engine_of(bench), library(bench, ["joint_creep"]))
    on_arm = replace_bench(found.engine, replace(bench, data=replace(bench.data, arm=True)))
    warm, knee, amplifier = (part(w, [0]) for w in ("thermal_drift", "joint_yield", "force_drift"))
    two, one = said((knee, amplifier), (2e-5, 1e-5), -30.0), said((knee,), (2e-5,), -35.0)
    three = said((warm, knee, amplifier), (3e-5, 2e-5, 1e-5))
    poor = replace(said((warm, knee), (3e-5, 1e-6)), log_adequate=-60.0)
    for whole, heir in ((three, two), (poor, one)):
        fresh = replace(found, engine=on_arm, explanations=(whole, heir), unknown=-800.0, alone={})
        assert with_posterior(fresh, {}).probabilities["joint_yield"] > 0.9


@pytest.mark.parametrize(("arm", "most"), [(True, DOUBT), (False, ARMLESS_DOUBT)])
def test_a_sure_verdict_gives_a_little_away_on_a_bench_more_of_it(arm: bool, most: float) -> None:
    assert ARMLESS_DOUBT > 4 * DOUBT
    bench = small_bench()
    variants = library(bench, ["joint_creep", "joint_hysteresis"])
    found = search(small_engine_of(bench), variants)
    engine = replace_bench(found.engine, replace(bench, data=replace(bench.data, arm=arm)))
    sure = said((part("joint_creep", [0]),), (1e-5,), 0.0)
    alone = {"joint_creep": 0.0, "joint_hysteresis": 0.0}
    one = replace(found, engine=engine, explanations=(sure,), unknown=-800.0, alone=alone)
    given = with_posterior(one, {}).probabilities
    # half of it goes to `unknown`, half to all words alike; on a bench that and `none` are of these
    each = 0.5 * most / (2 if arm else 4)
    assert given["joint_creep"] == pytest.approx(1 - most + each)
    assert given["unknown"] == pytest.approx(0.5 * most + (0.0 if arm else each))
    nothing = replace(sure, parts=(), sizes=())
    one = replace(found, engine=engine, explanations=(nothing,), unknown=-800.0, alone=alone)
    none = with_posterior(one, {}).probabilities["none"]
    assert none == pytest.approx(1.0 if arm else 1 - most + each)


@pytest.mark.parametrize(("apart", "spoken_by"), [(-2.0, "joint_hysteresis"), (2.0, "joint_yield")])
def test_two_that_are_worth_too_little_may_stand_for_another_one(
    apart: float, spoken_by: str
) -> None:
    """Friction and a slip for one yield, which explains more than friction does. On a rig without
    an arm a word speaks for itself."""
    bench = small_bench()
    found = search(small_engine_of(bench), library(bench, ["joint_creep"]))
    rubs, slips, gives = (part(w, [0]) for w in ("joint_hysteresis", "base_slip", "joint_yield"))
    both = said((rubs, slips), (2e-5, 1.9e-5))
    alone, other = said((rubs,), (3e-5,), -18.0), said((gives,), (3e-5,), apart - 18.0)
    for arm in (True, False):
        engine = replace_bench(found.engine, replace(bench, data=replace(bench.data, arm=arm)))
        ranked = tuple(sorted((both, alone, other), key=lambda e: -e.log_weight))
        fresh = replace(found, engine=engine, explanations=ranked, unknown=-800.0, alone={})
        given = with_posterior(fresh, {}).probabilities
        assert max(given, key=lambda w: given[w]) == (spoken_by if arm else "joint_hysteresis")
        if arm:  # as likely as they are alone
            odds = given["joint_yield"] / given["joint_hysteresis"]
            assert np.log(odds) == pytest.approx(apart, abs=0.2)
        speaker = find_representative(fresh, both, {})
        assert (speaker is other) is (arm and spoken_by == "joint_yield")
    failed = {frozenset({"joint_yield"}): 0.1}  # it does not foretell what was withheld
    arm = replace(bench, data=replace(bench.data, arm=True))
    on_arm = replace(fresh, engine=replace_bench(found.engine, arm))
    assert find_representative(on_arm, both, failed) is None
