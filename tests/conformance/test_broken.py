"""Explanations whose coefficients their own words exclude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit
from identification.gap.judging.broken import broken
from identification.gap.model.variants import Variant
from tests.conformance.effect_benches import of, quick_engine
from tests.conformance.test_effect_recovery import strength, with_effect
from tests.explained import explained


def frictions() -> tuple[Engine, Variant]:
    """Friction of many strengths, each of which only holds."""
    bench, variants, _ = of("joint_hysteresis", "rich")
    return quick_engine(bench), next(v for v in variants if v.form == "spectrum" and v.each)


def found(engine: Engine, v: Variant, w: Array, sd: float = 1e-3) -> Fit:
    """A fit with coefficients w that are known to sd each."""
    one = fit(engine, Explanation((Part(v, 0.1),), 0.0, 0.0, (0.0,), 0.0))
    return replace(one, coefficients=w, covariance=sd**2 * np.eye(len(w)))


def test_what_keeps_its_limits_breaks_none() -> None:
    engine, v = frictions()
    assert broken(engine, found(engine, v, np.full(len(v.columns), 0.1))) == (0.0, "")
    nothing = fit(engine, Explanation((), 0.0, 0.0, (), 0.0))
    assert broken(engine, nothing) == (0.0, "")


def test_friction_that_pushes_is_as_far_off_as_it_does() -> None:
    engine, v = frictions()
    w = np.full(len(v.columns), 0.1)
    w[0] = -6e-3
    off, word = broken(engine, found(engine, v, w))
    assert (off, word) == (pytest.approx(6.0 / 2**0.5), "joint_hysteresis")
    assert broken(engine, found(engine, v, w, sd=1.0))[0] < 0.01  # nobody knows
    w[0] = -6e-4  # and no law is met to a thousandth
    assert broken(engine, found(engine, v, w, sd=1e-9))[0] == pytest.approx(0.6)


def test_many_limits_that_are_broken_a_little_count_together() -> None:
    engine, v = frictions()
    w = np.full(len(v.columns), 0.1)
    w[:4] = -3e-3
    assert broken(engine, found(engine, v, w))[0] == pytest.approx(6.0 / 2**0.5)  # by 3 each


def test_of_several_parts_the_one_that_is_farthest_off_counts() -> None:
    engine, v = frictions()
    w = np.full(len(v.columns), 0.1)
    two = fit(engine, Explanation((Part(v, 0.1),) * 2, 0.0, 0.0, (0.0,) * 2, 0.0))
    both = np.concatenate([w, w])
    both[len(w)] = -7e-3
    fitted = replace(two, coefficients=both, covariance=1e-6 * np.eye(len(both)))
    assert broken(engine, fitted)[0] == pytest.approx(7.0 / 2**0.5)


@pytest.mark.slow
@pytest.mark.parametrize("withheld", [True, False])
def test_a_joint_that_yields_does_not_rub(withheld: bool) -> None:
    """At half of the load, and nothing before: friction of that one strength fits as well."""
    bench, variants, columns = of("joint_yield", "rich")
    v = next(v for v in variants if v.joint == 3 and 0.45 < v.info["centre"] / v.info["top"] < 0.7)
    data = with_effect(
        "rich", v, columns[:, list(v.columns)] @ strength(bench, v, columns, 30.0), bench
    )
    explanation = explained(data, withhold=["joint_yield"] if withheld else [])
    assert explanation.verdict == ("unknown" if withheld else "joint_yield")
    told = [n for n in explanation.notes if "outside what that word allows" in n]
    assert bool(told) is withheld
