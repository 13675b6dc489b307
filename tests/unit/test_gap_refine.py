"""Which words are looked at more closely."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identification.gap.search import refine as room
from identification.gap.search.overshoot_paths import Overshoots
from identification.gap.search.overshoots import _unlike, _worth


@pytest.mark.parametrize(
    ("level", "near", "looked_at"),
    [
        (0, {"first"}, ["first"]),  # it leaves nothing but noise: no others are asked
        (0, {"first", "third"}, ["first", "third"]),  # but what explains nearly as much
        (1, {"first"}, ["first", "second", "third"]),
    ],
)
def test_beside_nothing_but_noise_no_word_is_refined_that_is_far_behind(
    monkeypatch: pytest.MonkeyPatch, level: int, near: set[str], looked_at: list[str]
) -> None:
    words = {"first": 900.0, "second": 300.0, "third": 200.0}
    asked: list[str] = []

    def finer(word: Any) -> list[Any]:
        asked.append(word.name)
        return []

    scored = {
        w: [SimpleNamespace(variant=SimpleNamespace(word=w), log_evidence=v, level=level)]
        for w, v in words.items()
    }
    for name, does in {
        "by_word": lambda _: scored,
        "marginal": lambda s: s[0].log_evidence,
        "closest": lambda s: s[0],
        "EFFECTS": {w: SimpleNamespace(finer=finer, beside=False) for w in words},
        "nearly_leads": lambda word: word.name in near,
    }.items():
        monkeypatch.setattr(room, name, does)
    engine: Any = SimpleNamespace(levels=[SimpleNamespace(log_base=0.0)])
    assert room.refine(engine, []) == []
    assert asked == looked_at


def test_of_laws_with_the_same_memory_the_likeliest_says_where_hands_went() -> None:
    lag, rubs, creeps = object(), object(), object()
    each = [
        (n, SimpleNamespace(memory=frozenset(m)))
        for n, m in enumerate(([lag], [], [lag], [rubs, creeps], [creeps, rubs], [rubs]))
    ]
    assert [n for n, _ in _unlike(cast(Any, each))] == [0, 3, 5]


NOWHERE = np.zeros(1)


def test_loads_before_most_levels_or_for_little_are_no_hand() -> None:
    few, most = (Overshoots(frozenset(), NOWHERE, count, 40) for count in (5, 25))
    assert _worth(few, few.cost, 0.7)
    assert not _worth(few, 0.5 * few.cost, 0.7)
    assert not _worth(most, 10 * most.cost, 0.7)
