"""One mechanism in several joints at once: all gears of an arm rub."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest

from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.evidence.parts import Part, Sizes
from identification.gap.explanations.explanation import Explanation, explain
from identification.gap.explanations.penalties import minor_parts
from identification.gap.explanations.several import family_of, in_more_joints
from identification.gap.model.bench import make_bench
from rig.diagnosis.diagnose_text import render
from rig.diagnosis.gap_data import gap_data
from tests.conformance.effect_benches import quick_engine
from tests.conformance.gap_designs import DESIGNS, TRUE, Array, imported, meta, noisy
from tests.explained import explained

RADII = (0.05, 0.15, 0.35)  # of the largest torque of a joint


def played(torque: Array) -> Array:
    """(n,) states of three plays on a torque (n,), as they add up in a gear that rubs."""
    out = np.zeros(len(torque))
    for share in RADII:
        radius, state = share * float(np.abs(torque).max()), 0.0
        for i, x in enumerate(torque):
            state = min(max(state, x - radius), x + radius)
            out[i] += state / len(RADII)
    return out


def rubbing(*joints: int) -> GapData:
    """Of the named joints (0 to 5) the gears rub: half as compliant again, behind friction."""

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        torque = lever * rows["force_N"].to_numpy()[:, None]
        deflection = np.zeros_like(torque)
        for j in joints:
            deflection[:, j] = 0.5 * played(torque[:, j]) / TRUE[j]
        return np.zeros(len(rows)), deflection

    design = DESIGNS["medium"]
    return gap_data(imported(noisy(design, law), meta(design)))


@cache
def result(*joints: int) -> GapResult:
    return explained(rubbing(*joints))


@pytest.mark.slow
def test_friction_in_two_joints_is_one_word_in_both() -> None:
    found = result(0, 2)
    assert found.verdict == "joint_hysteresis"
    assert found.names == ("joint_hysteresis",)
    assert set(found.where.joints) == {1, 3}
    assert found.after < 1.3 * found.noise
    text = render(found)
    for joint in (1, 3):
        assert f"joint_hysteresis, joint {joint}: present" in text
    assert "Beside it" not in text


def test_friction_in_one_joint_stays_in_one() -> None:
    found = result(0)
    assert [e.name for e in found.effects] == ["joint_hysteresis"]
    assert found.where.joints == (1,)


def alone(found: GapResult) -> Explanation:
    """The explanation with the first of the joints only, far from the noise."""
    part = found.fit.parts[0]
    return replace(explain(found.engine, (part,), 0.0), eta=1e-5, log_weight=-1e6)


@pytest.mark.slow
def test_only_joint_readings_tell_several_joints_apart() -> None:
    found = result(0, 2)
    variants = [p.variant for p in found.fit.parts]
    more = in_more_joints(found.engine, variants, alone(found))
    assert [p.variant.info["joint"] for p in more.parts] == [
        p.variant.info["joint"] for p in found.fit.parts
    ]
    engine = quick_engine(make_bench(replace(rubbing(0, 2), q=None)))
    assert not engine.bench.has_q
    start = alone(found)
    assert in_more_joints(engine, variants, start) is start


@pytest.mark.slow
def test_a_joint_more_that_is_far_worse_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """No choice of shapes comes back from there."""
    found = result(0, 2)
    variants = [p.variant for p in found.fit.parts]
    polished: list[float] = []

    def spy(_: object, __: object, start: Explanation) -> Explanation:
        polished.append(start.log_weight)
        return start

    monkeypatch.setattr("identification.gap.explanations.several.polished", spy)
    far = replace(alone(found), log_weight=1e6)
    assert in_more_joints(found.engine, variants, far) is far
    assert not polished
    in_more_joints(found.engine, variants, alone(found))
    assert polished


def test_a_joint_is_taken_once() -> None:
    found = result(0, 2)
    variants = [p.variant for p in found.fit.parts]
    first, second = found.fit.parts
    assert family_of(variants, "joint_hysteresis", (first,)) == [second.variant]
    assert family_of(variants, "joint_hysteresis", ()) == variants
    assert family_of(variants, "joint_yield", ()) == []


def test_a_joint_that_does_next_to_nothing_is_not_one_of_several() -> None:
    found = result(0, 2)
    first, second = found.fit.parts
    both = explain(found.engine, (first, second), 0.0)
    petty = explain(found.engine, (first, Part(second.variant, 1e-4 * second.scale)), 0.0)
    assert both.log_weight > -100.0
    assert petty.log_weight < -5000.0
    rubs = Sizes(np.array([1e-5, 2e-6]), np.array([1e-5, 2e-6]), 1e-10)
    assert minor_parts(found.engine, (first, second), rubs) == 0.0
    assert both.rms_by_word["joint_hysteresis"] == pytest.approx(np.hypot(*both.sizes))
