"""What is said of what was found: what no run foretells, and whose noise it is that is told."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.gap.answer import found_notes
from identification.gap.answer.found_notes import (
    at_few_readings,
    joints_missed,
    not_foretold,
    there_already,
)
from identification.gap.answer.same_force import same_force
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.fit import Fit, fit
from identification.gap.judging.heldout import HeldOut
from identification.gap.laws.gains import factor
from identification.gap.laws.interval import Coefficients, ComplianceChange
from identification.gap.model.bench import Bench, make_bench
from rig.diagnosis.gap_model import springs
from tests.conformance.gap_designs import linear
from tests.explained import explained
from tests.unit.small_explanations import part, said
from tests.unit.test_gap_operators import bench_data

# Newtons a step, steps, metres that the target goes; whether that is a fault.
SAME_FORCE = [
    (0.0, 5, 1e-3, True),
    (0.2, 5, 1e-3, False),
    (0.0, 2, 1e-3, False),
    (0.0, 0, 1e-3, False),
    (0.0, 5, 0.0, False),
]


def held(fold: str, before: float, after: float) -> HeldOut:
    return HeldOut(fold, before, after, (1.0, 1.0))


def test_withheld_data_that_get_worse_are_said_to_and_why() -> None:
    better, worse = held("repetition", 3.0, 1.0), held("direction", 1.0, 1.5)
    assert not_foretold([better], {"joint_yield"}) == ()
    assert not_foretold([worse], set()) == ()
    (note,) = not_foretold([better, worse], {"joint_yield"})
    assert note.kind == "undecided"
    assert note.text.startswith("Withheld direction: the effects found leave more there than")
    assert note.text.endswith("hold of these alone.")
    (note,) = not_foretold([held("repetition", 1.0, 1.5), worse], {"joint_yield", "force_drift"})
    assert note.text.startswith("Withheld repetition and direction: ")
    assert "Of force_drift that is no wonder" in note.text


def test_what_is_added_though_it_is_there_is_said_to_be() -> None:
    plain = said((part("joint_yield", [0]), part("time_lag", [0])), (1.0, 0.5))
    assert there_already(plain, {"joint_creep"}) == ()
    (note,) = there_already(plain, {"joint_yield", "joint_creep"})
    assert note.text.startswith("joint_yield is an effect that was found anyway")


@pytest.mark.parametrize(("force", "steps", "way", "says"), SAME_FORCE)
def test_a_force_that_shows_no_step_is_a_fault(
    force: float, steps: int, way: float, says: bool
) -> None:
    """As of a load cell that is not connected; not of a load that is held while something creeps,
    nor of a recording without load."""
    rng, n = np.random.default_rng(0), 12 * max(steps, 1)
    step = np.repeat(np.arange(1, steps + 1), 12) if steps else np.zeros(n)
    read = 30.0 + force * step + rng.normal(0, 0.1, n)
    moved = way * np.arange(n) / n + rng.normal(0, 2e-6, n)
    bench = make_bench(bench_data(read, moved, step=step))
    assert [n.kind for n in same_force(bench)] == ["fault"] * says


@pytest.mark.parametrize(("missed", "said"), [(1.0, False), (9.0, True)])
def test_noise_of_few_readings_is_said_to_be_that(
    missed: float, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(found_notes, "noise_rms", lambda _: 1.0)
    own = missed * np.array([1.0, -1.0, 1.0, 0.01])
    fitted = cast(Fit, SimpleNamespace(missed_responses=lambda _: own))
    engine = cast(Engine, SimpleNamespace(bench=None))
    notes = at_few_readings(engine, fitted, 1.2)
    assert [n.text[:44] for n in notes] == ["Half of the readings miss by more than 9 tim"] * said
    assert at_few_readings(engine, fitted, missed) == ()  # that is what the table says already


def test_responses_are_missed_by_standard_deviations_of_their_own() -> None:
    found = explained(linear("medium"))
    own = found.fit.missed_responses(found.engine)
    assert own.shape == (found.bench.rows.n,)
    assert np.sqrt(np.mean(own**2)) == pytest.approx(1.0, abs=0.4)


def test_a_spring_that_is_a_mean_is_written_as_uncertain_as_its_joint_is_missed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from rig.diagnosis import gap_model

    found = explained(linear("medium"))
    stiffness, sd = springs(found)
    assert joints_missed(found.engine, fit(found.engine, found.found.explanations[0])) == {}
    missed = found_notes.Missed(1e-4, 30.0, 0.2)
    monkeypatch.setattr(gap_model, "joints_missed", lambda *_: {1: missed})
    same, wider = springs(found)
    np.testing.assert_allclose(same, stiffness)
    assert wider[1] == pytest.approx(np.hypot(sd[1], 0.2 * stiffness[1]))
    np.testing.assert_allclose(np.delete(wider, 1), np.delete(sd, 1))


def of_gain(bench: Bench, word: str, off: float, sd: float, spring: float) -> tuple[float, float]:
    """The factor, and the logarithm of its interval's upper end over it: of a share off, known to
    sd, and as a spring is known to a share of what it carries."""
    carries = 1 - off
    variance = sd**2 + (carries * spring) ** 2
    softer = ComplianceChange({0: 0.0}, {0: spring**2}, {0: np.array([carries * spring**2])})
    found = Coefficients(np.array([off]), np.array([[variance]]), softer)
    p = factor(bench, part(word, [0]).variant, found)["factor"]
    assert 0 < p.low < p.value < p.high
    return p.value, float(np.log(p.high / p.value))


def test_a_gain_is_known_to_a_factor_however_far_it_is_off() -> None:
    """A reading a thousand times too large, whose law is met to half a percent: the factor is known
    so well, but for the spring."""
    bench = replace(make_bench(linear("medium")), imposed=False)
    value, nats = of_gain(bench, "displacement_scale", 0.999, 0.005, 0.1)
    assert value == pytest.approx(1000.0)
    assert nats == pytest.approx(1.96 * np.hypot(0.005, 0.1), rel=1e-3)
    # of a force that is read too large, what is left is a share of what is true
    value, nats = of_gain(bench, "force_scale", 0.5, 0.005, 0.0001)
    assert value == pytest.approx(2.0)
    assert nats == pytest.approx(1.96 * 0.01, rel=1e-3)
