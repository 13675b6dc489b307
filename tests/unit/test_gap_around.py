"""Around which explanations further effects are looked for, and how closely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.compare import Scored
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, log_joints
from identification.gap.explanations.explanation import (
    Explanation,
    up_to_likeliest,
)
from identification.gap.explanations.priors import LOG_NONE
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import KnownEffects
from identification.gap.model.variants import Variant
from identification.gap.search.search import (
    SPRINGS,
    _elsewhere,
    _near,
    _seeds,
    _sharpened,
    _with_one_more,
    search,
)
from tests.unit.small_explanations import part, said
from tests.unit.test_gap_evidence import small_bench, small_engine


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
    monkeypatch.setattr("identification.gap.explanations.explanation.explain", explained)
    start = said((part("joint_backlash", [0], joints=[0]),), (1e-5,))
    (found,) = _with_one_more(small_engine(small_bench()), [], start, {}).values()
    assert found.parts[1].variant is springs[taken].variant


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
    assert [e.log_adequate for e in found] == [-3.0, -10.0, -50.0, -60.0]
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


@pytest.mark.parametrize(("behind", "asked_for"), [(15.0, True), (80.0, True), (100.0, False)])
def test_what_a_second_effect_brings_is_counted_between_the_levels_for_both(
    monkeypatch: pytest.MonkeyPatch, behind: float, asked_for: bool
) -> None:
    """Else it would seem to bring what the best explanation gains there, 78 nats."""
    engine = small_engine(small_bench())
    monkeypatch.setattr("identification.gap.search.search.gained", lambda *_: 78.0)
    friction, gain, lag = (part(w, [0]) for w in ("joint_hysteresis", "force_scale", "time_lag"))
    both, alone = said((gain, friction), (2e-5, 1e-5), 0.0), said((friction,), (1e-5,), -behind)
    other = said((lag,), (1e-5,), -15.0)
    found = _sharpened(engine, [both, other, alone, said((), (), -900.0)])
    weight = {e.words: e.log_weight for e in found}
    assert weight[both.words] == 78.0
    assert weight[alone.words] == 78.0 * asked_for - behind
    assert weight[other.words] == -15.0, "no part of the best, and too far off to matter"


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
