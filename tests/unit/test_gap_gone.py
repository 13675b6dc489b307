"""Effects that a simulation has, and the data have not as it has them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from identification.gap.answer.forms import Form, describe, lawful
from identification.gap.answer.known import in_question, is_gone
from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.diagnose import explain_gap
from rig.diagnosis.diagnose import Diagnosis
from tests.unit.test_gap_forms import arm_data

LASER_M, ENCODER_RAD = 2e-6, 1e-5
ADDED = 1.5  # times the joint's compliance, beyond the threshold


def arm(threshold_Nm: float = 60.0, added: float = ADDED, drift_N: float = 0.0) -> GapData:
    """Joint 1 gives way beyond its threshold, and goes back between two runs; x and y in two poses,
    twice up and down. The reading of the force may drift over the session."""
    there, rng = arm_data(), np.random.default_rng(7)
    force = np.round(there.force / 40.0) * 40.0
    turned = np.zeros((len(force), 6))
    for run in np.unique(there.run):
        mine = there.run == run
        lever = there.setups[there.setup[mine][0]].lever
        torque = np.outer(force[mine], lever)
        turned[mine] = torque * there.compliance
        beyond = np.maximum.accumulate(np.maximum(np.abs(torque[:, 0]) - threshold_Nm, 0.0))
        turned[mine, 0] += added * there.compliance[0] * beyond * np.sign(lever[0])
    lever = np.stack([s.lever for s in there.setups])[there.setup]
    moved = np.sum(lever * turned, axis=1)
    assert there.session is not None
    drift = drift_N * there.session / there.session.max()
    meter = replace(there.instruments, force=0.1, displacement=LASER_M)
    return replace(
        there,
        force=force + drift + rng.normal(0, 0.05, len(force)),
        displacement=moved + rng.normal(0, LASER_M, len(force)),
        q=turned + rng.normal(0, ENCODER_RAD, turned.shape),
        instruments=meter,
        temperature=None,
    )


@cache
def first_day() -> tuple[Form, ...]:
    result, _ = explain_gap(arm())
    assert result.verdict == "joint_yield"
    fit = result.fit
    return tuple(
        lawful(describe(result.bench, part, *fit.of(i))) for i, part in enumerate(fit.parts)
    )


def second_day(data: GapData) -> GapResult:
    return explain_gap(data, known=first_day())[0]


def said(result: GapResult) -> str:
    names = tuple({"name": f.word} for f in first_day() if f.word not in result.gone)
    return Diagnosis("", result, known_effects=names).to_text()


def test_what_is_as_the_model_has_it_is_no_gap() -> None:
    result = second_day(arm())
    assert (result.verdict, result.gone) == ("none", ())
    assert "has these effects already: joint_yield" in said(result)


@pytest.mark.parametrize("added", [0.0, 0.5 * ADDED, 1.6 * ADDED])
def test_what_was_repaired_or_got_worse_is_found_anew(added: float) -> None:
    """What the model has of it would pass for a law that is known to a tenth."""
    result = second_day(arm(added=added))
    assert result.gone == ("joint_yield",)
    assert result.verdict == ("joint_yield" if added else "none")
    if added:
        slope = result.effects[0].parameters["slope_beyond_over_elastic"]
        assert slope.low <= added <= slope.high
    text = said(result)
    assert "The model's joint_yield does not do to these data what it did" in text
    assert "has these effects already" not in text


def test_a_threshold_that_moved_is_the_joints_not_the_difference() -> None:
    result = second_day(arm(threshold_Nm=40.0))
    assert (result.verdict, result.gone) == ("joint_yield", ("joint_yield",))
    threshold = result.effects[0].parameters["threshold"]
    assert threshold.low <= 40.0 <= threshold.high


def test_a_drift_beside_it_leaves_it_where_it_is() -> None:
    result = second_day(arm(drift_N=8.0))
    assert (result.verdict, result.gone) == ("force_drift", ())


@pytest.mark.parametrize("drift_N", [0.0, 8.0])
def test_thresholds_are_met_by_the_true_force(drift_N: float) -> None:
    """Not by what an amplifier reads that has drifted."""
    data = arm(drift_N=drift_N)
    values = explain_gap(data)[0].effects[0].parameters
    lever = max(abs(s.lever[0]) for s in data.setups if s.direction == "y")
    assert values["threshold"].value == pytest.approx(60.0, rel=0.015)
    assert values["onset_y"].value == pytest.approx(60.0 / lever, rel=0.015)


@pytest.mark.parametrize(
    ("eta", "log_weight", "gone"),
    [(2.9e-6, -500.0, True), (4e-6, -500.0, False), (4e-6, 15.0, False), (4e-6, 25.0, True)],
)
def test_it_is_gone_where_all_is_explained_as_well_without_or_far_better(
    eta: float, log_weight: float, gone: bool
) -> None:
    def found(log_weight: float, eta: float) -> SimpleNamespace:
        bench = SimpleNamespace(noise=SimpleNamespace(stated=2e-6))
        best = SimpleNamespace(log_weight=log_weight, eta=eta)
        return SimpleNamespace(explanations=[best], engine=SimpleNamespace(bench=bench))

    assert is_gone(found(0.0, 0.0), found(log_weight, eta)) is gone  # type: ignore[arg-type]


def test_a_simulation_without_effects_has_none_in_question() -> None:
    assert in_question(explain_gap(arm(added=0.0))[0].found) is None
