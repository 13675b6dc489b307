"""Who is asked for loads between readings, how often, and what is kept of the answers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from identification.gap import explore
from identification.gap.words import WORDS

FIRST = "first repetitions"
NOISE = 2e-6  # m
WORD = "joint_hysteresis"


def result(
    log_weight: float, foretells: bool, left: float = 0.5 * NOISE, lawless: float = -100.0
) -> Any:
    """What a search found, as far as rounds look at it; left: m, by the best explanation; lawless:
    log weight of a gap without a law."""
    best = SimpleNamespace(log_weight=log_weight, eta=left, parts=())
    bench = SimpleNamespace(noise=SimpleNamespace(stated=NOISE))
    engine = SimpleNamespace(bench=bench)
    return SimpleNamespace(explanations=[best], engine=engine, foretells=foretells, unknown=lawless)


LIBRARY = explore.Library()


class Rounds:
    """Rounds whose searches find the results of a list, at a cost; with all words the same, or
    `whole`; asked: who was."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, *found: Any, cost: float = 10.0, whole: Any = None
    ) -> None:
        self.asked: list[str | None] = []
        self.searched: list[set[str]] = []  # words that were left out
        self._loads = SimpleNamespace(words=frozenset({WORD}), cost=cost)
        self._results, self._last, self._whole = iter(found), None, whole
        monkeypatch.setattr(explore, "predicts_held_out", lambda one: one.foretells)
        monkeypatch.setattr(explore, "first_repetitions", lambda engine: FIRST)
        monkeypatch.setattr(explore, "by_one_word", lambda one: iter(()))
        monkeypatch.setattr(
            explore,
            "overshoots_of_best",
            lambda one, calibration_rows: self._ask(calibration_rows),
        )
        monkeypatch.setattr(explore, "_along", lambda *args: self._search(set(args[-1].withheld)))

    def _ask(self, calibration_rows: str | None) -> Any:
        self.asked.append(calibration_rows)
        return self._loads

    def _search(self, withheld: set[str]) -> Any:
        """With the word that asks, and once more with all of them."""
        self.searched.append(withheld)
        self._last = next(self._results) if withheld else self._whole or self._last
        return self._last


def test_where_the_first_repetitions_lead_nowhere_all_are_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    start, worse, better = result(0.0, False), result(5.0, False), result(30.0, True)
    rounds = Rounds(monkeypatch, worse, better, result(29.0, True))
    assert explore.with_overshoots(start, LIBRARY) is better
    assert rounds.asked == [FIRST, None, None]  # once more of what is foretold, for nothing


def test_what_foretells_what_was_not_is_kept_for_less_than_it_costs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    start, mended = result(0.0, False), result(5.0, True)
    Rounds(monkeypatch, mended, result(4.0, True))
    assert explore.with_overshoots(start, LIBRARY) is mended
    rounds = Rounds(monkeypatch, result(-1.0, True), result(-1.0, True))
    assert explore.with_overshoots(start, LIBRARY) is start
    assert rounds.asked == [FIRST, None]


def test_what_is_foretold_is_searched_once_more_and_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    start, dear, better = result(0.0, True), result(9.0, True), result(11.0, True)
    Rounds(monkeypatch, dear)
    assert explore.with_overshoots(start, LIBRARY) is start
    rounds = Rounds(monkeypatch, better)
    assert explore.with_overshoots(start, LIBRARY) is better
    assert rounds.asked == [None]


def test_rounds_end(monkeypatch: pytest.MonkeyPatch) -> None:
    ever_better = [result(20.0 * i, False) for i in range(1, 9)]
    rounds = Rounds(monkeypatch, *ever_better)
    assert explore.with_overshoots(result(0.0, False), LIBRARY) is ever_better[2]
    assert rounds.asked == [FIRST] * 3


def test_what_leaves_nothing_and_is_foretold_asks_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    rounds = Rounds(monkeypatch)
    start = result(0.0, True, left=0.0)
    assert explore.with_overshoots(start, LIBRARY) is start
    assert rounds.asked == []
    rounds = Rounds(monkeypatch, result(-1.0, False), result(-1.0, False))
    start = result(0.0, False, left=0.0)  # it foretells nothing: a hand may be why
    assert explore.with_overshoots(start, LIBRARY) is start
    assert rounds.asked == [FIRST, None]


def test_no_hand_is_looked_for_where_the_law_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    rounds = Rounds(monkeypatch, result(300.0, True), result(300.0, True))
    far = result(0.0, False, lawless=600.0)
    assert explore.with_overshoots(far, LIBRARY) is far
    assert rounds.asked == []
    near = result(0.0, False, lawless=200.0)
    assert explore.with_overshoots(near, LIBRARY).explanations[0].log_weight == 300.0
    assert rounds.asked[0] == FIRST


@pytest.mark.parametrize(
    ("gain", "left", "rounds"), [(15.0, NOISE / 2, 2), (15.0, 3 * NOISE, 1), (25.0, 3 * NOISE, 2)]
)
def test_loads_that_hardly_pay_beside_more_than_noise_ask_for_no_more(
    monkeypatch: pytest.MonkeyPatch, gain: float, left: float, rounds: int
) -> None:
    made = Rounds(monkeypatch, result(gain, False, left), result(gain, False, left))
    assert explore.with_overshoots(result(0.0, False), LIBRARY).explanations[0].log_weight == gain
    assert made.asked == [FIRST] * rounds


@pytest.mark.parametrize(
    ("gain", "cost", "searched"), [(9.0, 30.0, 2), (9.0, 40.0, 1), (-1.0, 10.0, 2), (41.0, 40.0, 2)]
)
def test_all_words_are_searched_where_those_that_ask_for_loads_nearly_gain_by_them(
    monkeypatch: pytest.MonkeyPatch, gain: float, cost: float, searched: int
) -> None:
    """Others may gain more along the same path."""
    for more in (0.0, 50.0):
        whole = result(gain + more, True)
        rounds = Rounds(monkeypatch, result(gain, True), cost=cost, whole=whole)
        found = explore.with_overshoots(start := result(0.0, True), LIBRARY)
        assert rounds.searched == [set(WORDS) - {WORD}, set()][:searched]
        assert found is (whole if searched == 2 and gain + more > cost else start)


def test_what_acts_only_where_a_hand_went_is_no_law(monkeypatch: pytest.MonkeyPatch) -> None:
    better = result(300.0, True)
    Rounds(monkeypatch, better)
    assert explore.with_overshoots(start := result(0.0, True), LIBRARY) is better
    Rounds(monkeypatch, better)
    monkeypatch.setattr(explore, "acts_only_after_overshoot", lambda one: one is better)
    assert explore.with_overshoots(start, LIBRARY) is start


@pytest.mark.parametrize(
    ("by_each", "cost", "kept"),
    [((20.0, 40.0), 10.0, 41.0), ((20.0, 9.0), 10.0, 41.0), ((9.0, 9.5), 10.0, 0.0)],
)
def test_a_word_alone_asks_first_where_it_then_explains_more_than_all_did(
    monkeypatch: pytest.MonkeyPatch, by_each: tuple[float, float], cost: float, kept: float
) -> None:
    """Of two words the one that explains more by its loads, less what these cost; then all words
    are searched along them."""
    words = ("joint_hysteresis", "joint_yield")
    loads = [SimpleNamespace(words=frozenset({w}), cost=cost) for w in words]
    whole, start = result(41.0, True, left=0.0), result(0.0, True)
    along = dict(zip(words, [result(value, True) for value in by_each], strict=True))
    Rounds(monkeypatch)
    monkeypatch.setattr(explore, "by_one_word", lambda one: iter(loads))
    monkeypatch.setattr(explore, "overshoots_of_best", lambda *_: None)
    asked = []

    def searched(_: Any, more: Any, library: explore.Library) -> Any:
        asked.append(next(iter(more.words)))
        return along[asked[-1]] if library.withheld else whole

    monkeypatch.setattr(explore, "_along", searched)
    found = explore.with_overshoots(start, LIBRARY)
    assert found.explanations[0].log_weight == kept
    ahead = words[int(by_each[1] > by_each[0])]
    assert asked == [*words, *([ahead] if kept else [])]


def test_a_word_alone_that_all_others_do_not_bear_out_is_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loads = SimpleNamespace(words=frozenset({WORD}), cost=10.0)
    start = result(0.0, True)
    Rounds(monkeypatch)
    monkeypatch.setattr(explore, "by_one_word", lambda one: iter((loads,)))
    monkeypatch.setattr(explore, "overshoots_of_best", lambda *_: None)
    monkeypatch.setattr(
        explore, "_along", lambda *given: result(20.0 if given[-1].withheld else 9.0, True)
    )
    assert explore.with_overshoots(start, LIBRARY) is start
