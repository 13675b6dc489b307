"""What several effects of one explanation owe each other, and what follows for the words."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.compare import Scored, log_mean
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, log_joints
from identification.gap.explanations.explanation import (
    LAW_REMAINDER,
    OF_A_BENCH,
    REMAINDER,
    Explanation,
    may_remain,
    up_to_likeliest,
)
from identification.gap.explanations.priors import LOG_NONE
from identification.gap.explanations.verdict import (
    BENCH_DOUBT,
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
    may_miss,
    with_a_lead,
    with_posterior,
)
from identification.gap.judging.leftover import looked_up
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, KnownEffects
from identification.gap.model.variants import Variant, variant
from identification.gap.search.search import (
    SPRINGS,
    _elsewhere,
    _near,
    _seeds,
    _sharpened,
    _with_one_more,
    search,
)
from identification.gap.words import JERKS
from tests.unit.test_gap_evidence import small_bench, small_engine


def part(word: str, columns: list[int], **info: object) -> Part:
    return Part(variant(word, word, columns, (1.0,), **info), 1.0)


def said(
    parts: tuple[Part, ...], sizes: tuple[float, ...], weight: float = 0.0, eta: float = 0.0
) -> Explanation:
    return Explanation(parts, weight, eta, sizes, weight)


OFF = 1e-4  # m: laws that are off by far more than noise


def small_engine_of(bench: Bench) -> Engine:
    target = bench.observed - prediction(bench)
    return Engine(bench, base_columns(bench), target, np.array([0.0, 3e-6]))


def replace_bench(engine: Engine, bench: Bench) -> Engine:
    """The engine as it is, of another bench."""
    other = copy(engine)
    other.bench = bench
    return other


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
    three = replace(said((bends, play, drift), (3e-5, 1e-5, 9e-6), 10.0), log_good=-90.0)
    both = said((bends, play), (3e-5, 1e-5), 0.0)
    alone = (said((play,), (1e-5,), -200.0), said((bends,), (1e-5,), -260.0))
    case = replace(found, engine=on_arm, explanations=(three, both, *alone), unknown=-800.0)
    assert with_posterior(case, {}).probabilities["joint_backlash"] > 0.9


def test_what_explains_most_of_a_gap_fits_closely_whatever_its_noise() -> None:
    engine = small_engine(small_bench())
    noise = engine.bench.noise.stated
    for structural, most in ((2 * noise, 2 * noise), (100 * noise, 17 * noise)):
        engine.structural = structural
        assert may_miss(engine) == pytest.approx(most)


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
    none = replace(third, parts=(), sizes=(), log_weight=-1e6, log_good=-1e6)
    for share, unknown in ((0.9, 0.0), (1.1, 0.9)):
        two = said(three[1:], (2e-5, 1e-6), -share * LAW_REMAINDER**2 * 1e6)
        both = replace(found, explanations=(third, two, none), unknown=-1e5, alone={})
        assert with_posterior(both, {}).probabilities["unknown"] == pytest.approx(unknown, abs=0.1)


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


def test_springs_beside_a_mechanism_are_looked_for_in_other_joints_too() -> None:
    """All springs are no second trouble where the mechanism's own joint is among them."""

    def scored(word: str, *joints: int) -> Scored:
        return Scored(part(word, [0], joints=list(joints)).variant, 0.0, 1.0, 0)

    def beside(word: str, *joints: int) -> Explanation:
        return said((part(word, [0], joints=list(joints)),), (1e-5,))

    springs = [scored(SPRINGS, 0, 1, 2), scored(SPRINGS, 1, 2), scored(SPRINGS, 1)]
    assert _elsewhere(beside("joint_backlash", 0), springs) == springs[1:]
    assert _elsewhere(beside("joint_backlash", 3), springs) == []  # all of them are
    assert _elsewhere(beside("force_scale", 0), springs) == []
    plays = [scored("joint_backlash", 0), scored("joint_backlash", 3)]
    assert _elsewhere(beside(SPRINGS, 0, 1), plays) == plays[1:]


@pytest.mark.parametrize(("wall", "taken"), [(1e4, 1), (0.0, 0)])
def test_of_springs_beside_a_mechanism_the_better_ones_are_taken(
    monkeypatch: pytest.MonkeyPatch, wall: float, taken: int
) -> None:
    """Those that share its joint bring more, but mostly are no second trouble."""
    springs = [
        Scored(part(SPRINGS, [0], joints=j).variant, 9.0 - len(j), 1.0, 0) for j in ([0], [1, 2])
    ]

    def explained(_: Engine, parts: tuple[Part, ...], evidence: float, taken: float) -> Explanation:
        assert taken == 0.0
        shared = parts[0].variant.info["joints"][0] in parts[1].variant.info["joints"]
        return said(parts, (1e-5, 1e-5), evidence - wall * shared)

    monkeypatch.setattr("identification.gap.search.search.score", lambda *_: springs)
    monkeypatch.setattr("identification.gap.search.search.up_to_likeliest", lambda *_: ([], 0.0))
    monkeypatch.setattr("identification.gap.search.search.explain", explained)
    start = said((part("joint_backlash", [0], joints=[0]),), (1e-5,))
    (found,) = _with_one_more(small_engine(small_bench()), [], start, {}).values()
    assert found.parts[1].variant is springs[taken].variant


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
    sure = 1 - 0.5 * BENCH_DOUBT  # on a bench; of two that are doubted, half comes back
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
        whole = replace(found, explanations=(word,), nameless=(odd,), unknown=-90.0, alone={})
        given = with_posterior(whole, {}).probabilities
        assert max(given, key=lambda w: given[w]) == main
        assert given.keys() == found.probabilities.keys()


def test_what_no_word_names_is_looked_up_as_well() -> None:
    """A mechanism beside it that leaves too much is no more believed than it is alone."""
    bench = small_bench()
    bench.add(bench.stacked(1e-4 * (bench.load / np.ptp(bench.load)) ** 2))
    variants = library(bench, ["joint_creep"])
    found = search(small_engine_of(bench), variants)
    creep, jerks = part("joint_creep", [0]), part(JERKS, [0])
    poor = replace(said((creep, jerks), (3e-5, 1e-5), -10.0), log_good=-30.0)
    far = said((jerks,), (1e-5,), -80.0)
    one = replace(found, explanations=(said((creep,), (3e-5,)),), nameless=(poor, far))
    first, second = looked_up(one).nameless
    assert first.log_good != poor.log_good
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
    poor = replace(said((warm, knee), (3e-5, 1e-6)), log_good=-60.0)
    for whole, heir in ((three, two), (poor, one)):
        fresh = replace(found, engine=on_arm, explanations=(whole, heir), unknown=-800.0, alone={})
        assert with_posterior(fresh, {}).probabilities["joint_yield"] > 0.9


@pytest.mark.parametrize(("arm", "most"), [(True, DOUBT), (False, BENCH_DOUBT)])
def test_a_sure_verdict_gives_a_little_away_on_a_bench_more_of_it(arm: bool, most: float) -> None:
    assert BENCH_DOUBT == 4 * DOUBT
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


@pytest.mark.parametrize(("arm", "around"), [(True, 4), (False, 6)])
def test_pairs_are_looked_for_around_the_best_words(
    arm: bool, around: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a bench around more of them: two words that belong together may look poor alone there."""
    bench = small_bench()
    bench = replace(bench, data=replace(bench.data, arm=arm))
    words = [
        "joint_creep",
        "joint_stiffness_error",
        "force_scale",
        "time_lag",
        "displacement_scale",
        "zero_shift",
    ]
    engine = small_engine(bench)
    asked: list[int] = []

    def spy(pool: dict[frozenset[str], Explanation], most: int) -> list[Explanation]:
        asked.append(most)
        return []

    monkeypatch.setattr("identification.gap.search.search._seeds", spy)
    variants = library(bench, words)
    search(engine, variants)
    assert asked == [around]
    ranked = [
        replace(said((part(w, [0]),), (3e-5,)), log_weight=-float(i), eta=1e-6)
        for i, w in enumerate(words)
    ]
    monkeypatch.undo()
    pool = {e.words: e for e in ranked}
    assert _seeds(pool, 4) == ranked[:4]
    assert _near(pool, ranked) == ranked


def test_where_one_effect_leaves_no_more_than_noise_others_far_below_are_not_asked_at_once() -> (
    None
):
    best, near, far = (
        replace(said((part(w, [0]),), (3e-5,)), log_weight=weight)
        for w, weight in (("joint_creep", 0.0), ("time_lag", -5.0), ("zero_shift", -7.0))
    )
    ranked = [best, near, far]
    assert _near({e.words: e for e in ranked}, ranked) == [best, near]
    worse = replace(best, eta=1e-6)
    assert _near({e.words: e for e in [worse, near, far]}, ranked) == ranked


@pytest.mark.parametrize(("gained", "again"), [(10.0, False), (30.0, True)])
def test_what_a_second_effect_wins_for_the_best_is_asked_of_others_as_well(
    gained: float, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One word leaves no more than the noise, another one 20 nats less explains as much."""
    first = replace(said((part("joint_hysteresis", [0]),), (3e-5,)), log_weight=-100.0)
    other = replace(said((part("joint_yield", [0]),), (3e-5,)), log_weight=-120.0)
    asked: list[list[Explanation]] = []

    def deepen(
        _: Engine,
        __: list[Variant],
        pool: dict[frozenset[str], Explanation],
        front: list[Explanation],
        *more: int,
    ) -> list[Explanation]:
        asked.append(front)
        both = frozenset({"joint_hysteresis", "joint_creep"})
        pool[both] = replace(first, log_weight=-100.0 + gained)
        return []

    where = "identification.gap.search.search."
    monkeypatch.setattr(where + "_seeds", lambda *_: [first, other])
    monkeypatch.setattr(where + "_near", lambda *_: [first])
    monkeypatch.setattr(where + "_in_more_joints", lambda *a: a[3])
    monkeypatch.setattr(where + "_deepen", deepen)
    monkeypatch.setattr(where + "_best", lambda pool: max([-100.0, *_weights(pool)]))
    engine = small_engine(small_bench())
    search(engine, library(engine.bench, ["zero_shift"]))
    assert asked == [[first], [other] if again else []]


def _weights(pool: dict[frozenset[str], Explanation]) -> list[float]:
    return [e.log_weight for words, e in pool.items() if len(words) > 1]


def test_what_levels_without_an_arm_really_leave_is_looked_up() -> None:
    """The grid of imperfections says that too much is left; the rows say that nothing is."""
    bench = small_bench()
    bench.add(bench.stacked(1e-4 * (bench.load / np.ptp(bench.load)) ** 2))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    engine = Engine(bench, base, target + bench.columns[0], np.array([0.0, 3e-6]))
    variants = library(bench, ["joint_creep"])
    found = search(small_engine_of(bench), variants)
    poor = replace(said((part("joint_creep", [0]),), (3e-5,)), log_good=-30.0)
    other = replace(said((part("zero_shift", [0]),), (3e-5,), -50.0), log_good=-80.0)
    one = replace(found, engine=engine, explanations=(poor, other), unknown=-800.0)
    first, second = looked_up(one).explanations
    assert first.log_good > -0.1
    assert second is other  # so far down nobody looks


def test_laws_of_a_rig_without_an_arm_may_leave_more() -> None:
    """A spring or gain that is off by more than what springs leave counts as what it is."""
    bench = small_bench()
    plain = small_engine(bench)
    arm = replace_bench(plain, replace(bench, data=replace(bench.data, arm=True)))
    large, left = 9.0 * plain.structural, plain.structural
    for engine, troubles, most in (
        (plain, {"joint_creep": large}, OF_A_BENCH * left),
        (arm, {"joint_creep": large}, REMAINDER * left),
        (plain, {"force_scale": large, "joint_creep": left}, OF_A_BENCH * large),
        (plain, {"joint_creep": large, "force_scale": large}, OF_A_BENCH * left),
        (plain, {"force_scale": 0.1 * left}, OF_A_BENCH * left),
        (arm, {"force_scale": large}, REMAINDER * left),
        (plain, {}, OF_A_BENCH * left),
    ):
        assert may_remain(engine, troubles) == pytest.approx(most)


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
    poor = replace(two, log_good=-30.0)
    variants = library(bench, ["joint_creep"])
    searched = search(small_engine_of(bench), variants)
    for left, kept in ((0.0, True), (1.0, False)):
        engine = Engine(bench, base, target + column + left * bumps, np.array([0.0, 3e-6]))
        found = replace(searched, engine=engine, unknown=-800.0)
        out = looked_up(replace(found, explanations=(two, few, other))).explanations
        assert [e.good for e in out] == [kept, kept, True]
        assert out[2] is other  # so far down nobody looks
        seen = looked_up(replace(found, explanations=(poor,))).explanations[0]
        assert seen.good is kept  # whatever the levels said
    left = 0.12 * bumps
    engine = Engine(bench, base, target + column + left, np.array([0.0, 3e-6]))
    found = replace(searched, engine=engine, unknown=-800.0)
    out = looked_up(replace(found, explanations=(two, few))).explanations
    assert [e.good for e in out] == [False, True]  # two words have to explain better than one


def test_explanations_that_matter_are_taken_between_the_levels(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine, asked, more = (
        small_engine(small_bench()),
        [],
        {"joint_creep": -10.0, "joint_yield": 1.0},
    )

    def gains(_: Engine, parts: tuple[Part, ...], __: float) -> float:
        asked.append(parts[0].word)
        return more[parts[0].word]

    monkeypatch.setattr("identification.gap.search.search.gained", gains)
    words = ("joint_creep", "joint_yield", "joint_hysteresis")
    ranked = [said((part(w, [0]),), (1e-6,), g) for w, g in zip(words, (0, -4, -50), strict=True)]
    found = _sharpened(engine, [*ranked, said((), (), -60.0)])
    assert [e.log_weight for e in found] == [-3.0, -10.0, -50.0, -60.0]
    assert [e.log_good for e in found] == [-3.0, -10.0, -50.0, -60.0]
    assert asked == ["joint_creep", "joint_yield"]  # what is hopeless is left as it is
    more = {"joint_creep": 20.0, "joint_yield": 26.0}  # the first one's gain shuts out nobody
    found = _sharpened(engine, [*ranked, said((), (), -60.0)])
    assert [e.log_weight for e in found] == [22.0, 20.0, -50.0, -60.0]
    asked.clear()  # nor does what was stated, which was looked at between the levels before
    stated = engine.levels[0].log_base + LOG_NONE
    near, far = (
        said((part(w, [0]),), (1e-6,), stated - n) for w, n in zip(words[:2], (1, 50), strict=True)
    )
    _sharpened(engine, [said((), (), stated + 20.0), near, far])
    assert asked == ["joint_creep"]
    asked.clear()  # but for what the laws of the simulation's own effects may leave
    none = np.zeros(engine.bench.layout.size)
    engine.bench = replace(engine.bench, known=KnownEffects(none, none[:, None], ("",), 1e-6))
    _sharpened(engine, [said((), (), stated + 20.0), near, far])
    assert asked == []


def test_another_effect_is_looked_for_at_sizes_that_the_first_one_may_have() -> None:
    """No law meets a rig to the noise of these data, however well it fits: what is weighed beside
    it must not be held to less imperfection than it has itself."""
    bench = small_bench()
    v = library(bench, ["joint_creep"])[0]
    effect = bench.columns[v.columns[0]]
    target = bench.observed - prediction(bench) + 5e-4 * effect / np.abs(effect).max()
    e = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 2.5e-6, 6e-6, 1.5e-5]))
    law = (Part(v, 0.6),)
    assert int(log_joints(e, law).argmax()) == 0
    levels, _ = up_to_likeliest(e, law)
    assert [lv.eta for lv in levels] == [0.0, 1e-6]
