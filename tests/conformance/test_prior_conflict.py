"""Explanations that ask for what their own priors exclude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.data import GapData
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.lognormal_springs import nats_of
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit
from identification.gap.judging.prior_conflict import LIMIT, prior_conflict, what_is_strained
from identification.gap.words import WORDS
from tests.conformance.effect_benches import of, quick_engine
from tests.conformance.gap_designs import linear
from tests.conformance.test_effect_recovery import strength, typical, with_effect
from tests.explained import explained

FAR = 7.0  # standard deviations


def nothing() -> Explanation:
    return Explanation((), 0.0, 0.0, (), 0.0)


def pulled(engine: Engine, name: str, fitted: Fit | None = None) -> Fit:
    """A fit in which one of the base's coefficients is FAR off, and all others are as expected."""
    fitted = fitted or fit(engine, nothing())
    pulls = np.zeros(len(fitted.pulls))
    pulls[engine.base.index(name)[0]] = FAR
    base = pulls[: len(fitted.base)] * engine.base.sd
    scatter = engine.base.index("scatter run")
    base[scatter] = pulls[scatter] * engine.bench.noise.stated
    springs = engine.base.index("spring")
    base[springs] = np.expm1(FAR * nats_of(engine.base.sd)[springs] * (pulls[springs] > 0))
    return replace(fitted, pulls=pulls, base=base)


def test_pulls_are_coefficients_in_units_of_their_priors() -> None:
    bench, variants, _ = of("base_compliance", "rich")
    engine, v = quick_engine(bench), typical(variants)
    found = fit(engine, Explanation((Part(v, 2e-6),), 0.0, 0.0, (0.0,), 0.0))
    base = len(found.base)
    np.testing.assert_allclose(found.pulls[:base] * engine.base.sd, found.base)
    np.testing.assert_allclose(2e-6 * v.root @ found.pulls[base:], found.coefficients)


@pytest.mark.parametrize("name", ["spring2", "gain displacement", "crosstalk"])
def test_what_was_stated_may_not_be_far_off(name: str) -> None:
    engine = quick_engine(of("base_compliance", "rich")[0])
    assert prior_conflict(engine, pulled(engine, name), 0.0) == pytest.approx(FAR)


def test_many_that_are_a_little_off_count_together() -> None:
    engine = quick_engine(of("base_compliance", "rich")[0])
    few, several = pulled(engine, "crosstalk"), engine.base.index("crosstalk")
    few.base[several] = 3.5 * engine.base.sd[several]
    assert len(several) < len(few.pulls) / 4
    assert prior_conflict(engine, few, 0.0) > LIMIT


def test_a_mechanism_brings_the_mean_stiffness_of_its_joint() -> None:
    bench, variants, _ = of("joint_nonlinear_stiffness", "rich")
    engine = quick_engine(bench)
    v = next(v for v in variants if v.info.get("joint") == 1)
    bent = fit(engine, Explanation((Part(v, 1e-5),), 0.0, 0.0, (0.0,), 0.0))
    assert prior_conflict(engine, pulled(engine, "spring2", bent), 0.0) == 0.0
    assert prior_conflict(engine, pulled(engine, "spring3", bent), 0.0) == pytest.approx(FAR)


def test_springs_that_are_said_to_be_off_may_be() -> None:
    bench, variants, _ = of("joint_stiffness_error", "rich")
    engine = quick_engine(bench)
    said = fit(engine, Explanation((Part(variants[0], 0.1),), 0.0, 0.0, (0.0,), 0.0))
    assert prior_conflict(engine, pulled(engine, "spring2", said), 0.0) == 0.0
    assert prior_conflict(engine, pulled(engine, "gain force", said), 0.0) == pytest.approx(FAR)


@pytest.mark.parametrize(
    ("word", "counts"), [("thermal_drift", True), ("force_drift", False), ("joint_yield", False)]
)
def test_heat_does_not_jump_and_laws_are_families(word: str, counts: bool) -> None:
    bench, variants, _ = of(word, "rich")
    engine = quick_engine(bench)
    found = fit(engine, Explanation((Part(variants[0], 1e-5),), 0.0, 0.0, (0.0,), 0.0))
    pulls = np.zeros(len(found.pulls))
    pulls[len(found.base)] = FAR
    odd = replace(found, pulls=pulls, base=np.zeros(len(found.base)))
    assert prior_conflict(engine, odd, 0.0) == pytest.approx(FAR if counts else 0.0)


@pytest.mark.parametrize(
    ("largest", "next_to", "stands_out"),
    [(3.0, -0.3, True), (0.9, -0.3, False), (3.0, 1.2, False), (3.0, -1.0, True)],
)
def test_no_single_step_of_a_warming_path_stands_out(
    largest: float, next_to: float, stands_out: bool
) -> None:
    """Steps that get smaller one by one are no jump; one that turns back is."""
    bench, variants, _ = of("thermal_drift", "rich")
    engine = quick_engine(bench)
    v = next(v for v in variants if v.label == "winding path")
    found = fit(engine, Explanation((Part(v, 1e-5),), 0.0, 0.0, (0.0,), 0.0))
    seen = np.any(engine.columns(v.columns)[: bench.rows.n] != 0, axis=0)
    pulls = np.zeros(len(found.pulls))
    pulls[len(found.base) :] = np.where(np.arange(len(seen)) % 2, 0.3, -0.3) * seen
    pulls[len(found.base) + np.flatnonzero(seen)[[4, 5]]] = largest, next_to
    odd = replace(
        found,
        pulls=pulls,
        base=np.zeros(len(found.base)),
        coefficients=1e-5 * v.root @ pulls[len(found.base) :],
    )
    engine.structural = 1e-9
    assert (prior_conflict(engine, odd, 0.0) > LIMIT) is stands_out
    engine.structural = 1e-2  # a little heat beside something else may mop up what that leaves
    assert prior_conflict(engine, odd, 0.0) < LIMIT


def test_a_force_that_drifts_has_done_so_since_it_was_tared() -> None:
    """By the root of time it is far off before the first sample, and no tare is to blame."""
    bench, variants, _ = of("force_drift", "rich")
    engine = quick_engine(bench)
    drifts = fit(engine, Explanation((Part(typical(variants), 1.0),), 0.0, 0.0, (0.0,), 0.0))
    engine.structural = 1e-9
    assert prior_conflict(engine, pulled(engine, "tare"), 0.0) == pytest.approx(FAR)
    off = pulled(engine, "tare", drifts)
    assert prior_conflict(engine, off, 0.0) == 0.0
    assert what_is_strained(engine, off, 0.0) == ""


@pytest.mark.parametrize(
    ("word", "anywhere"),
    [
        ("joint_backlash", True),
        ("joint_yield", True),
        ("joint_hysteresis", True),
        ("joint_nonlinear_stiffness", False),
    ],
)
def test_a_joint_that_plays_yields_or_rubs_may_rest_elsewhere(word: str, anywhere: bool) -> None:
    bench, variants, _ = of(word, "rich")
    engine = quick_engine(bench)
    v = next(v for v in variants if v.joints == (3,))
    none = fit(engine, Explanation((Part(v, 1e-4),), 0.0, 0.0, (0.0,), 0.0))
    engine.structural = 1e-9
    off = FAR * engine.base.sd[engine.base.index("offset P1 4")[0]]
    q, joints = engine.bench.layout.q, engine.bench.data.joints
    turns = engine.columns(v.columns)[q].sum(axis=1).reshape(joints, -1)[3]
    for times, left in ((0.0, FAR), (0.5, FAR / 2), (2.0, 0.0)):
        unit = times * off / np.abs(turns).max()
        gives = replace(none, coefficients=np.full(len(v.columns), unit))
        found = prior_conflict(engine, pulled(engine, "offset P1 4", gives), 0.0)
        assert found == pytest.approx(left if anywhere else FAR, abs=1e-9)
        assert prior_conflict(engine, pulled(engine, "offset P1 3", gives), 0.0) == pytest.approx(
            FAR
        )


@pytest.mark.parametrize("times", [1.0, 2.0, FAR])
def test_runs_may_be_off_by_what_is_stated_of_a_sample_and_by_what_the_law_misses(
    times: float,
) -> None:
    engine = quick_engine(of("base_compliance", "rich")[0])
    stated, off = engine.bench.noise.stated, pulled(engine, "scatter run")
    off.base[engine.base.index("scatter run")] *= times / FAR
    assert prior_conflict(engine, off, 0.0) == pytest.approx(times)
    assert prior_conflict(engine, off, stated) == pytest.approx(times / 2**0.5, rel=0.05)


@pytest.mark.parametrize("name", ["tare", "offset"])
def test_what_stands_all_the_time_and_moves_little_of_the_gap_does_not_decide_it(name: str) -> None:
    engine = quick_engine(of("base_compliance", "rich")[0])
    off = pulled(engine, name)
    engine.structural = 1e-9
    assert prior_conflict(engine, off, 0.0) == pytest.approx(FAR)
    engine.structural = 1e-2
    assert prior_conflict(engine, off, 0.0) < 1.0


def askew() -> GapData:
    """A load askew, seen by the components of the force."""
    bench, variants, columns = of("load_misalignment", "rich")
    v = typical(variants)
    w = strength(bench, v, columns, 10.0)
    return with_effect("rich", v, columns[:, list(v.columns)] @ w, bench)


@pytest.mark.slow
def test_what_no_word_may_name_is_not_put_down_to_the_instruments() -> None:
    """A force across that only cross-talk of many standard deviations would make."""
    found = explained(askew())
    assert found.verdict == "load_misalignment"
    assert not any("believed" in note for note in found.notes)
    found = explained(askew(), withhold=["load_misalignment"])
    assert found.verdict == "unknown"
    assert "META" in found.notes[-1]
    assert "it was not believed" in found.notes[-1]


def test_it_is_said_what_an_explanation_asks_for() -> None:
    engine = quick_engine(of("base_compliance", "rich")[0])
    said = {name: what_is_strained(engine, pulled(engine, name), 0.0) for name in NAMED}
    assert said == NAMED
    few = pulled(engine, "crosstalk")
    few.base[:] = 0.0
    few.base[engine.base.index("crosstalk")] = 3.5 * engine.base.sd[engine.base.index("crosstalk")]
    assert what_is_strained(engine, few, 0.0) == "many things a little off what META states"
    few.base[:] = 0.0
    assert what_is_strained(engine, few, 0.0) == ""
    bench, variants, _ = of("thermal_drift", "rich")
    engine = quick_engine(bench)
    found = fit(engine, Explanation((Part(variants[0], 1e-5),), 0.0, 0.0, (0.0,), 0.0))
    pulls = np.zeros(len(found.pulls))
    pulls[len(found.base)] = FAR
    jumps = replace(found, pulls=pulls, base=np.zeros(len(found.base)))
    assert what_is_strained(engine, jumps, 0.0) == "heat that jumps"


_OFF = "7 standard deviations off what META states"
NAMED = {
    "spring2": f"the stiffness of joint 2 {_OFF}",
    "gain force": f"the gain of an instrument {_OFF}",
    "crosstalk": f"the cross-talk of the force {_OFF}",
    "geometry": f"the turn of the levers under load {_OFF}",
    "scatter run": f"the datum of a run {_OFF}",
}


def test_springs_far_beyond_what_was_stated_are_not_nothing() -> None:
    """`none` has priors, too."""
    data = linear("rich")
    assert explained(data).verdict == "none"
    others = [w for w in WORDS if w != "time_lag"]
    for sd, nothing_at_all in ((0.01, True), (0.005, False)):
        stated = replace(data, compliance_relative_sd=np.full(6, sd))
        found = explained(stated, withhold=others)
        assert found.verdict == ("none" if nothing_at_all else "unknown")
