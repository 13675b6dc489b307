"""Effects that a simulation has, and the data have not as it has them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from identification.gap import explore
from identification.gap.answer.forms import Form, describe, lawful
from identification.gap.answer.known import in_question, is_gone
from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.diagnose import explain_gap
from rig.diagnosis.diagnose import Diagnosis
from tests.slow import slow_ones
from tests.unit.arm_as_read import as_read, levels_of
from tests.unit.test_gap_forms import arm_data

ADDED = 1.5  # times the joint's compliance, beyond the threshold


def arm(threshold_Nm: float = 60.0, added: float = ADDED, drift_N: float = 0.0) -> GapData:
    """Joint 1 gives way beyond its threshold, and goes back between two runs; x and y in two poses,
    twice up and down. The reading of the force may drift over the session."""
    there, rng = arm_data(), np.random.default_rng(7)
    force, _ = levels_of(there)
    turned = np.zeros((len(force), 6))
    for run in np.unique(there.run):
        mine = there.run == run
        lever = there.setups[there.setup[mine][0]].lever
        torque = np.outer(force[mine], lever)
        turned[mine] = torque * there.compliance
        beyond = np.maximum.accumulate(np.maximum(np.abs(torque[:, 0]) - threshold_Nm, 0.0))
        turned[mine, 0] += added * there.compliance[0] * beyond * np.sign(lever[0])
    assert there.session is not None
    drift = drift_N * there.session / there.session.max()
    return as_read(there, force + drift, turned, rng)


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


@pytest.mark.slow
def test_what_is_as_the_model_has_it_is_no_gap() -> None:
    result = second_day(arm())
    assert (result.verdict, result.gone) == ("none", ())
    assert "has these effects already: joint_yield" in said(result)


@pytest.mark.parametrize(
    "added", slow_ones((0.0, 0.5 * ADDED, 1.6 * ADDED), (0.5 * ADDED, 1.6 * ADDED))
)
def test_what_was_repaired_or_got_worse_is_found_anew(added: float) -> None:
    """What the model has of it would pass for a law that is known to a tenth."""
    result = second_day(arm(added=added))
    assert result.gone == ("joint_yield",)
    assert result.verdict == ("joint_yield" if added else "none")
    if added:
        slope = result.effects[0].parameters["slope_beyond_over_elastic"]
        assert slope.low <= added <= slope.high
    text = said(result)
    assert "Left out of the model: joint_yield, which is not in these data as the model" in text
    assert "has these effects already" not in text


@pytest.mark.slow
def test_a_threshold_that_moved_is_the_joints_not_the_difference() -> None:
    result = second_day(arm(threshold_Nm=40.0))
    assert (result.verdict, result.gone) == ("joint_yield", ("joint_yield",))
    threshold = result.effects[0].parameters["threshold"]
    assert threshold.low <= 40.0 <= threshold.high


@pytest.mark.slow
def test_a_drift_beside_it_leaves_it_where_it_is() -> None:
    result = second_day(arm(drift_N=8.0))
    assert (result.verdict, result.gone) == ("force_drift", ())


@pytest.mark.slow
@pytest.mark.parametrize("drift_N", [0.0, 8.0])
def test_thresholds_are_met_by_the_true_force(drift_N: float) -> None:
    """Not by what an amplifier reads that has drifted."""
    data = arm(drift_N=drift_N)
    values = explain_gap(data)[0].effects[0].parameters
    lever = max(abs(s.lever[0]) for s in data.setups if s.direction == "y")
    assert values["threshold"].value == pytest.approx(60.0, rel=0.015)
    assert values["onset_y"].value == pytest.approx(60.0 / lever, rel=0.015)


@pytest.mark.parametrize(
    ("eta", "log_weight", "lawless", "gone"),
    [
        (2.9e-6, -500.0, -900.0, True),
        (4e-6, -500.0, -900.0, False),
        (4e-6, 15.0, -900.0, False),
        (4e-6, 25.0, -900.0, True),
        (2.9e-6, 25.0, 30.0, False),
    ],
)
def test_it_is_gone_where_all_is_explained_as_well_without_or_far_better(
    eta: float, log_weight: float, lawless: float, gone: bool
) -> None:
    """However badly the best explanation with it does; not where no law explains it without."""

    def found(log_weight: float, eta: float, unknown: float = -900.0) -> SimpleNamespace:
        bench = SimpleNamespace(noise=SimpleNamespace(stated=2e-6))
        best = SimpleNamespace(log_weight=log_weight, eta=eta)
        engine = SimpleNamespace(bench=bench)
        return SimpleNamespace(explanations=[best], engine=engine, unknown=unknown)

    with_it, without = found(0.0, 5e-6), found(log_weight, eta, lawless)
    assert is_gone(with_it, without) is gone  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_is_unknown_beside_it_takes_nothing_from_the_model(seed: int) -> None:
    """Every level of every run is off by its own tenth of a millimetre."""
    data = arm()
    level = np.unique(np.stack([data.run, data.branch, data.step]), axis=1, return_inverse=True)[1]
    off = np.random.default_rng(seed).normal(0, 1e-4, level.max() + 1)[level.ravel()]
    result = second_day(replace(data, displacement=data.displacement + off * (data.step > 0)))
    assert (result.verdict, result.gone) == ("unknown", ())


@pytest.mark.parametrize("really", [("joint_yield",), ("joint_creep",), ()])
def test_all_that_are_in_question_are_tried(
    monkeypatch: pytest.MonkeyPatch, really: tuple[str, ...]
) -> None:
    known = [SimpleNamespace(word=w) for w in ("joint_creep", "joint_yield")]
    monkeypatch.setattr(explore, "prepared", lambda bench, library: (library.known, ()))
    monkeypatch.setattr(explore, "searched", lambda kept, _: tuple(f.word for f in kept))
    monkeypatch.setattr(explore, "with_overshoots", lambda found, *_: found)
    monkeypatch.setattr(explore, "in_question", list)
    monkeypatch.setattr(
        explore, "is_gone", lambda found, again: bool(({*found} - {*again}) & {*really})
    )
    start = ("joint_creep", "joint_yield")
    assert explore.without_what_is_gone(start, None, explore.Library(tuple(known)))[1] == really  # type: ignore[arg-type]


def test_a_simulation_without_effects_has_none_in_question() -> None:
    assert in_question(explain_gap(arm(added=0.0))[0].found) == []
