"""Evidence against nested sampling on five small cases (with -m slow; needs dynesty).

Only contenders count: models within 20 nats of the best by either route. What lies further below
has no probability by both.
"""

from __future__ import annotations

from functools import cache

import pytest

pytest.importorskip("dynesty", reason="dynesty is not installed (extra `engines`)")

from bench.nested_cases import CASES
from bench.nested_sampling import Line, compare

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]
WITHIN = 20.0
# Live points: with 100 the sampling error of a model with a threshold is a third of a nat.
LIVE, FINE = 300, 100
MODELS = dict.fromkeys(CASES, ("none", "joint_yield", "contact_seating"))
MODELS["friction"] = ("none", "joint_yield", "joint_hysteresis")


@cache
def lines(name: str, signs: bool, fine: bool) -> tuple[Line, ...]:
    return tuple(compare(name, FINE if fine else LIVE, MODELS[name], signs, fine)[0])


def apart(name: str, signs: bool, fine: bool) -> dict[str, float]:
    """Contender -> our evidence less the sampled one, nats."""
    found = lines(name, signs, fine)
    ours, theirs = max(x.ours for x in found), max(x.sampled for x in found)
    return {
        x.model: x.ours - x.sampled
        for x in found
        if x.ours > ours - WITHIN or x.sampled > theirs - WITHIN
    }


@pytest.mark.parametrize("name", list(CASES))
def test_gaussian_evidence_is_right_where_the_imperfection_is_finely_stepped(name: str) -> None:
    for model, difference in apart(name, signs=False, fine=True).items():
        assert abs(difference) < 1.0, model


@pytest.mark.parametrize("name", list(CASES))
def test_evidence_as_the_diagnosis_takes_it(name: str) -> None:
    for model, difference in apart(name, signs=True, fine=False).items():
        assert abs(difference) < 1.0, model
