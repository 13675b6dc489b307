"""Which explanation is shown for a verdict."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.gap.answer.found_notes import called, left_out
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.verdict import TAKES_TWO, simpler_of
from identification.gap.judging import choice as choosing
from identification.gap.judging.choice import (
    SHOWN_WITHOUT_LOAD,
    WORTH,
    WORTH_OF_THIRD,
    chosen_of,
    passes_validation,
)
from identification.gap.model.variants import variant
from tests.unit.small_explanations import part

CURVE, LAG, ASKEW = "joint_nonlinear_stiffness", "time_lag", "load_misalignment"
TILT = "base_compliance"
LARGE = 1e-5  # m


NOISE = 1e-6


def said(
    sizes: dict[str, float], weight: float, good: float = 0.0, eta: float = 0.0
) -> Explanation:
    """An explanation by words of sizes (as shares of LARGE), the largest first."""
    parts = tuple(Part(variant(word, word, [0], (1.0,)), 1.0) for word in sizes)
    each = tuple(LARGE * s for s in sizes.values())
    return Explanation(parts, weight, eta, each, weight + good)


def found(*explanations: Explanation) -> SearchResult:
    ranked = tuple(sorted(explanations, key=lambda e: -e.log_weight))
    arm = SimpleNamespace(noise=SimpleNamespace(stated=NOISE), data=SimpleNamespace(arm=True))
    engine = SimpleNamespace(bench=arm)
    return SearchResult(cast(Engine, engine), (*ranked, said({}, -500.0)), {}, {}, -400.0, 1e-6)


def shown_of(result: SearchResult, verdict: str) -> Explanation:
    return chosen_of(result, verdict).shown


@pytest.mark.parametrize("verdict", ["none", "unknown"])
def test_what_no_effect_explains_is_shown_without_one(verdict: str) -> None:
    choice = chosen_of(found(said({CURVE: 1.0}, 0.0)), verdict)
    assert choice.shown.parts == ()
    assert choice.fuller is None


@pytest.mark.parametrize(
    ("worth", "size", "named"), [(WORTH - 1, 0.5, 1), (WORTH + 2, 0.5, 2), (400.0, 0.1, 1)]
)
def test_a_second_effect_is_named_only_if_it_brings_and_does_something(
    worth: float, size: float, named: int
) -> None:
    one, two = said({CURVE: 1.0}, 0.0), said({CURVE: 1.0, LAG: size}, worth)
    both = found(one, two)
    assert len(shown_of(both, CURVE).parts) == named
    # one that withheld data refuse, or that leaves too much, is no simpler choice
    refused = replace(both, kept={one.words: 0.1, two.words: 1.0})
    assert shown_of(refused, CURVE) is two
    assert shown_of(found(said({CURVE: 1.0}, 0.0, good=-5.0), two), CURVE) is two


@pytest.mark.parametrize(("size", "named"), [(0.05, 2), (0.15, 2), (0.3, 3)])
def test_a_third_effect_has_to_do_and_to_bring_more(size: float, named: int) -> None:
    one, two = said({CURVE: 1.0}, 0.0), said({CURVE: 1.0, LAG: 0.8}, 10.0)
    for worth, shown in (
        (500.0, named),
        (WORTH_OF_THIRD - 1, 2),
        (WORTH_OF_THIRD + 1, named),
    ):
        three = said({CURVE: 1.0, LAG: 0.8, ASKEW: size}, 10.0 + worth)
        assert len(shown_of(found(one, two, three), CURVE).parts) == shown


@pytest.mark.parametrize(
    ("large", "small", "named"),
    [
        ("force_scale", CURVE, 2),  # no line bends
        ("force_scale", ASKEW, 1),
        ("zero_shift", CURVE, 2),  # of which no law could be off
        (CURVE, "zero_shift", 2),  # a datum jumps without load
        ("thermal_drift", "zero_shift", 1),
        (CURVE, "thermal_drift", 1),
    ],
)
def test_little_is_named_that_no_other_law_can_do(large: str, small: str, named: int) -> None:
    one, two = said({large: 1.0}, 0.0), said({large: 1.0, small: 0.05}, 400.0)
    assert len(shown_of(found(one, two), large).parts) == named


def test_a_larger_effect_that_is_one_of_several_alike_is_shown_beside_the_verdict() -> None:
    """Which of them it is nobody can tell; what splits it between them is no better."""
    beside = [said({large: 2.0, LAG: 1.0}, 0.0) for large in ("force_scale", "pose_error")]
    split = said({LAG: 1.0, "force_scale": 0.9, "pose_error": 0.9}, -3.0)
    for weight in (-40.0, -TAKES_TWO - 1):
        assert shown_of(found(*beside, split, said({LAG: 1.0}, weight)), LAG) is beside[0]
    alone = said({LAG: 1.0}, 1 - WORTH)
    assert shown_of(found(*beside, split, alone), LAG) is alone


@pytest.mark.parametrize(
    ("worth", "largest", "off", "named"),
    [(21.0, LAG, 1.0, 2), (21.0, CURVE, 1.0, 3), (91.0, LAG, 1.0, 3), (21.0, LAG, 3.3, 3)],
)
def test_what_brings_too_little_to_lead_is_not_shown_as_the_largest(
    worth: float, largest: str, off: float, named: int
) -> None:
    """A third effect that takes the gap over from the two that the verdict is of; but where springs
    and gains that are off stand for it."""
    two = replace(said({CURVE: 1.0, ASKEW: 0.5}, 0.0), off=off)
    sizes = {largest: 1.3, **{w: 1.0 for w in (CURVE, LAG) if w != largest}, ASKEW: 0.6}
    choice = chosen_of(found(two, said(sizes, worth)), CURVE)
    assert len(choice.shown.words) == named
    assert [n.text.count("few nats") for n in left_out(*choice, 1.0)] == [1] * (named == 2)


def test_springs_far_off_speak_for_no_pair() -> None:
    """What stands for wrong springs by springs that are off explains nothing without them."""
    both, alone = (
        said(s, w)
        for s, w in (({"joint_stiffness_error": 1.0, TILT: 0.2}, 8.0), ({TILT: 0.1}, 0.0))
    )
    for off, speaks in ((1.0, True), (5.0, False)):
        ranked = (both, replace(alone, off=off))
        assert (simpler_of(both, ranked, {}, arm=True) is not None) is speaks


def test_what_is_added_to_a_failure_was_not_foreseen_either() -> None:
    two, three, other = (
        said(dict.fromkeys(words, 1.0), 0.0)
        for words in ((CURVE, LAG), (CURVE, LAG, ASKEW), (CURVE, ASKEW))
    )
    told = replace(found(two), kept={two.words: 0.1, frozenset({"joint_creep"}): 0.9})
    assert [passes_validation(told, e) for e in (two, three, other)] == [False, False, True]


@pytest.mark.parametrize(
    ("left", "had", "named"), [(1.9, 0.0, 1), (2.1, 0.0, 2), (2.1, 2.1, 1), (3.0, 2.5, 2)]
)
def test_little_is_named_without_which_too_much_is_left(
    left: float, had: float, named: int
) -> None:
    one = said({CURVE: 1.0}, 0.0, eta=left * NOISE)
    two = said({CURVE: 1.0, LAG: 0.05}, 400.0, eta=had * NOISE)
    assert len(shown_of(found(one, two), CURVE).parts) == named


@pytest.mark.parametrize(("size", "named"), [(0.05, {CURVE}), (0.15, {CURVE, LAG})])
def test_of_two_small_ones_the_smaller_goes_first(size: float, named: set[str]) -> None:
    """What is too little beside two may be enough beside one; nor does it stay for having come with
    another that goes."""
    each = (
        said({CURVE: 1.0}, 0.0),
        said({CURVE: 1.0, LAG: size}, 300.0),
        said({CURVE: 1.0, ASKEW: 0.04}, 200.0),
        said({CURVE: 1.0, LAG: size, ASKEW: 0.04}, 500.0),
    )
    choice = chosen_of(found(*each), CURVE)
    assert choice.shown.words == named
    assert choice.fuller is each[-1]


def test_what_does_too_little_to_be_named_is_told() -> None:
    one, two = said({CURVE: 1.0}, 0.0), said({CURVE: 1.0, LAG: 0.1}, 400.0)
    (note,) = left_out(*chosen_of(found(one, two), CURVE), 1.0)
    assert "time_lag (0.001 mm rms)" in note.text
    assert "400 nats more" in note.text
    assert "--add time_lag." in note.text
    assert "most of" not in note.text
    (most,) = left_out(one, two, 1.5 * two.rms_by_word[LAG])
    assert "400 nats more, most of the 0.0015 mm that are left. " in most.text
    assert not left_out(two, two, 1.0)  # it was asked for
    large = said({CURVE: 1.0, LAG: 0.9}, 400.0)
    assert not left_out(*chosen_of(found(one, large), CURVE), 1.0)
    # what is left out for another reason is no matter of its size
    refused = replace(found(one, large), kept={large.words: 0.1, one.words: 1.0})
    assert not left_out(*chosen_of(refused, CURVE), 1.0)
    little = said({CURVE: 1.0, LAG: 0.9}, WORTH - 1)
    assert not left_out(*chosen_of(found(one, little), CURVE), 1.0)


@pytest.mark.parametrize(("missed", "named"), [(SHOWN_WITHOUT_LOAD - 1, 1), (20.0, 2)])
def test_a_little_drift_is_named_where_the_force_without_load_shows_it(
    monkeypatch: pytest.MonkeyPatch, missed: float, named: int
) -> None:
    """No law of what is loaded could be off there."""
    drift = "force_drift"
    one, two = said({CURVE: 1.0}, 0.0), said({CURVE: 1.0, drift: 0.01}, 400.0)
    other = said({CURVE: 1.0, LAG: 0.01}, 300.0)
    zeros = np.array([missed, -missed])
    fitted = SimpleNamespace(missed_zeros=lambda _: zeros)
    monkeypatch.setattr(choosing, "fit", lambda *_: fitted)
    assert len(shown_of(found(one, two), CURVE).words) == named
    assert len(shown_of(found(one, other), CURVE).words) == 1
    three = said({CURVE: 1.0, drift: 0.01, LAG: 0.01}, 900.0)
    assert len(shown_of(found(one, two, three), CURVE).words) == named
    zeros = np.zeros(0)  # where it is no channel
    assert len(shown_of(found(one, two), CURVE).words) == 1


def test_a_smaller_verdict_of_a_play_and_a_curve_is_told_why() -> None:
    sizes = {CURVE: 1.0, "joint_backlash": 0.2}
    both = said(sizes, 0.0)
    both = replace(both, parts=placed(sizes, 1, 1))
    play, curve = (said({w: 1.0}, -weight) for w, weight in (("joint_backlash", 5.0), (CURVE, 9.0)))
    ranked = of_an_arm(found(both, play, curve))
    (note,) = called(ranked, both, "joint_backlash")
    assert "one that explains more without the other" in note.text
    assert not called(ranked, both, CURVE)  # the larger one anyway
    assert not called(ranked, said({CURVE: 1.0, LAG: 0.2}, 0.0), LAG)
    assert not called(ranked, replace(both, parts=placed(sizes, 1, 2)), "joint_backlash")
    assert not called(of_an_arm(found(both, curve)), both, "joint_backlash")  # said by others
    assert not called(of_an_arm(found(both, play), arm=False), both, "joint_backlash")


def placed(words: Iterable[str], *joints: int) -> tuple[Part, ...]:
    each = zip(words, joints, strict=True)
    return tuple(Part(variant(w, w, [0], (1.0,), joint=j), 1.0) for w, j in each)


def of_an_arm(result: SearchResult, arm: bool = True) -> SearchResult:
    bench = SimpleNamespace(data=SimpleNamespace(arm=arm))
    return replace(result, engine=cast(Engine, SimpleNamespace(bench=bench)))


@pytest.mark.parametrize(("worth", "joints", "named"), [(15.0, 0, 1), (15.0, 1, 2), (25.0, 0, 2)])
def test_a_curve_is_named_beside_a_play_of_its_joint_only_for_much(
    worth: float, joints: int, named: int
) -> None:
    """They are one trouble; in joints of their own they are two."""
    play, curve = part("joint_backlash", [0], joint=0), part(CURVE, [1], joint=joints)
    alone = Explanation((play,), 0.0, 0.0, (LARGE,), 0.0)
    both = Explanation((play, curve), worth, 0.0, (LARGE, 0.6 * LARGE), worth)
    assert len(shown_of(found(alone, both), "joint_backlash").words) == named
