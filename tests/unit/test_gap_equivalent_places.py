"""Words that share their probability, and the verdict."""

from __future__ import annotations

import pytest

from identification.gap.answer.result import _shared


def test_twins_share_their_probability() -> None:
    found = {"joint_yield": 0.7, "base_slip": 0.1, "none": 0.2}
    shared = _shared(found, "joint_yield", "base_slip")
    assert shared == {"joint_yield": pytest.approx(0.4), "base_slip": pytest.approx(0.4)}


@pytest.mark.parametrize("other", [0.4, 0.55])
def test_the_verdict_stays_the_most_probable_word(other: float) -> None:
    found = {"joint_yield": 0.95 - other, "base_slip": 0.05, "joint_creep": other}
    shared = _shared(found, "joint_yield", "base_slip")
    assert shared["joint_yield"] == pytest.approx(min(other, 1 - other))
    assert sum(shared.values()) == pytest.approx(1 - other)
