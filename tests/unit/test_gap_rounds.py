"""Who is asked for loads between readings, how often, and what is kept of the answers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from identification.gap import diagnose

FIRST = "first repetitions"


def result(log_weight: float, foretells: bool) -> Any:
    """What a search found, as far as rounds look at it."""
    best = SimpleNamespace(log_weight=log_weight)
    return SimpleNamespace(explanations=[best], engine=None, foretells=foretells)


class Rounds:
    """Rounds whose searches find the results of a list, at a cost; asked: who was."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *found: Any, cost: float = 10.0) -> None:
        self.asked: list[str | None] = []
        results = iter(found)
        monkeypatch.setattr(diagnose, "foretells", lambda one: one.foretells)
        monkeypatch.setattr(diagnose, "first_repetitions", lambda engine: FIRST)
        monkeypatch.setattr(diagnose, "unseen", lambda one, told_by: self._ask(told_by))
        monkeypatch.setattr(diagnose, "_along", lambda *_: (next(results), cost))

    def _ask(self, told_by: str | None) -> str:
        self.asked.append(told_by)
        return "loads"


def test_where_the_first_repetitions_lead_nowhere_all_are_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    start, worse, better = result(0.0, False), result(5.0, False), result(30.0, True)
    rounds = Rounds(monkeypatch, worse, better, result(29.0, True))
    assert diagnose._with_unseen(start, (), ()) is better
    assert rounds.asked == [FIRST, None, None]  # once more of what is foretold, for nothing


def test_what_foretells_what_was_not_is_kept_for_less_than_it_costs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    start, mended = result(0.0, False), result(5.0, True)
    Rounds(monkeypatch, mended, result(4.0, True))
    assert diagnose._with_unseen(start, (), ()) is mended
    rounds = Rounds(monkeypatch, result(-1.0, True), result(-1.0, True))
    assert diagnose._with_unseen(start, (), ()) is start
    assert rounds.asked == [FIRST, None]


def test_what_is_foretold_is_searched_once_more_and_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    start, dear, better = result(0.0, True), result(9.0, True), result(11.0, True)
    Rounds(monkeypatch, dear)
    assert diagnose._with_unseen(start, (), ()) is start
    rounds = Rounds(monkeypatch, better)
    assert diagnose._with_unseen(start, (), ()) is better
    assert rounds.asked == [None]


def test_rounds_end(monkeypatch: pytest.MonkeyPatch) -> None:
    ever_better = [result(20.0 * i, False) for i in range(1, 9)]
    rounds = Rounds(monkeypatch, *ever_better)
    assert diagnose._with_unseen(result(0.0, False), (), ()) is ever_better[2]
    assert rounds.asked == [FIRST] * 3
