"""Which question a next measurement is asked: one that the data leave open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from identification.gap import diagnose
from identification.gap.diagnose import _next, _open


def diagnosis(
    chosen: dict[str, float],
    probabilities: dict[str, float],
    others: dict[str, float],
    alike: tuple[str, ...] = (),
) -> tuple[Any, Any, Any]:
    """Search, explanation and result. chosen: word -> probability that it is there, the verdict
    first; others: words of other explanations -> nats by which they explain worse; alike: what
    can't be told from the verdict."""
    verdict = next(iter(chosen))
    effects = [
        SimpleNamespace(name=w, probability=p, indistinguishable_from=alike if w == verdict else ())
        for w, p in chosen.items()
    ]
    own = SimpleNamespace(words=frozenset(chosen), log_weight=-10.0)
    explanations = [own]
    for words, nats in others.items():
        worse = SimpleNamespace(words=frozenset(words.split()), log_weight=-10.0 - nats)
        explanations.append(worse)
    result = SimpleNamespace(verdict=verdict, probabilities=probabilities, effects=effects)
    return SimpleNamespace(explanations=explanations), own, result


SURE = {"thermal_drift": 1.0, "joint_backlash": 0.99}


@pytest.mark.parametrize(
    ("chosen", "others", "asked"),
    [
        (SURE, {"joint_backlash": 1.0}, []),  # both are there beyond doubt
        ({**SURE, "joint_backlash": 0.7}, {"joint_backlash": 9.0}, []),  # the data separate them
        ({**SURE, "joint_backlash": 0.7}, {"joint_backlash": 1.0}, ["joint_backlash"]),
        ({"thermal_drift": 0.6}, {"joint_backlash zero_shift": 2.0}, ["joint_backlash"]),
    ],
)
def test_what_is_sure_or_told_apart_is_no_question(
    chosen: dict[str, float], others: dict[str, float], asked: list[str]
) -> None:
    shown = {"thermal_drift": 0.8, "joint_backlash": 0.1, "unknown": 0.09, "zero_shift": 0.01}
    pairs = _open(*diagnosis(chosen, shown, others))
    assert pairs == [("thermal_drift", word) for word in asked]


def test_what_can_not_be_told_apart_is_asked_first_and_what_nothing_tells_is_passed_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown = {"joint_yield": 0.4, "base_slip": 0.3, "joint_creep": 0.2, "zero_shift": 0.1}
    alike = ("zero_shift", "base_slip")
    case = diagnosis({"joint_yield": 0.9}, shown, {"joint_creep": 1.0, "base_slip": 0.0}, alike)
    asked = []

    def hopeless(*given: Any) -> None:
        asked.append(given[2])

    monkeypatch.setattr(diagnose, "next_measurement", hopeless)
    assert _next(*case, None) is None
    assert [other for _, other in asked] == ["base_slip", "zero_shift", "joint_creep"]
    wanted = object()
    monkeypatch.setattr(
        diagnose, "next_measurement", lambda *given: wanted if "zero_shift" in given[2] else None
    )
    assert _next(*case, None) is wanted
