"""What differs from the best explanation in one word is looked at as closely as that one."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import pytest

from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation
from identification.gap.search import search
from identification.gap.search.search import _MAY_GAIN, _RIVALS, _polish_rivals
from tests.unit.small_explanations import part, said

ENGINE = cast(Engine, None)
Pool = dict[frozenset[str], Explanation]


def words(text: str) -> frozenset[str]:
    return frozenset(text.split())


def pool_of(weights: dict[str, float]) -> Pool:
    return {
        words(text): replace(
            said(tuple(part(w, [0]) for w in text.split()), (1.0,) * len(text.split())),
            log_weight=weight,
        )
        for text, weight in weights.items()
    }


def test_only_what_differs_in_one_word_and_may_win_is_polished(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[frozenset[str]] = []

    def polish(_: Engine, __: list[object], e: Explanation) -> Explanation:
        asked.append(e.words)
        return replace(e, log_weight=e.log_weight + 50.0)

    monkeypatch.setattr(search, "polished", polish)
    pool = pool_of(
        {
            "time_lag joint_yield": 0.0,
            "time_lag base_slip": -46.0,
            "joint_creep base_slip": -1.0,  # two words
            "time_lag joint_creep": -2.0,  # is polished
            "time_lag pose_error": -_MAY_GAIN - 1,
            "time_lag": -3.0,
        }
    )
    _polish_rivals(ENGINE, [], pool, {words("time_lag joint_creep"), words("time_lag joint_yield")})
    # the second one differs in one word from the first, which has won
    assert asked == [words("time_lag base_slip"), words("joint_creep base_slip")]
    assert pool[words("time_lag base_slip")].log_weight == 4.0


def test_no_more_than_a_few_are_polished(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[frozenset[str]] = []
    monkeypatch.setattr(search, "polished", lambda _, __, e: asked.append(e.words) or e)
    others = ("joint_creep", "base_slip", "pose_error", "zero_shift", "force_drift")
    pool = pool_of({"time_lag joint_yield": 0.0, **{f"time_lag {w}": -9.0 for w in others}})
    _polish_rivals(ENGINE, [], pool, set())
    assert len(asked) == _RIVALS
    single = pool_of({"time_lag": 0.0, "joint_yield": -1.0})
    _polish_rivals(ENGINE, [], single, set())
    assert len(asked) == _RIVALS
