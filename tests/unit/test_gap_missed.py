"""Joints that turn otherwise than an explanation has it are named, and speak against it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.answer.found_notes import readings_missed
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.judging import residual_checks
from identification.gap.judging.residual_checks import _checked_on_arm
from identification.gap.judging.residuals import excess_joint_reading_rms
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from tests.unit.small_explanations import part, said
from tests.unit.test_gap_forms import arm_data

NOTHING = Explanation((), 0.0, 0.0, (), 0.0)
BENT = 1  # joint


def texts(share: float) -> list[str]:
    """Said where one joint's readings bend by a share of its way, and the displacement does not."""
    bench = make_bench(arm_data())
    torque, most = bench.true_torque[:, BENT], float(np.abs(bench.true_torque[:, BENT]).max())
    q = np.zeros((bench.rows.n, bench.data.joints))
    q[:, BENT] = share * most * bench.compliance[BENT] * (torque / most) ** 3
    target = bench.observed - prediction(bench) + bench.stacked(q=q)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 3e-6]))
    return [n.text for n in readings_missed(engine, fit(engine, NOTHING))]


def test_a_joint_that_bends_where_a_spring_was_found_is_said() -> None:
    assert texts(0.0) == []
    (said,) = texts(0.4)
    assert said.startswith("Joint 2 turns otherwise than the effects found have it, by up to ")
    assert "its stiffness is a mean over these loads" in said


@pytest.mark.parametrize("turns", [False, True])
def test_what_a_joint_was_seen_to_do_no_mounting_did(
    turns: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A motion of the target that meets the displacement to the last digit, while the joint that
    made it is read, or stands still."""
    bench = make_bench(arm_data())
    torque, most = bench.true_torque[:, BENT], float(np.abs(bench.true_torque[:, BENT]).max())
    turned = 40 * most * bench.compliance[BENT] * (torque / most) ** 3
    q = np.zeros((bench.rows.n, bench.data.joints))
    q[:, BENT] = turned * turns
    moved = bench.lever[:, BENT] * turned
    target = bench.stacked(moved, q=q)
    for other in (
        "prior_conflict",
        "excess_response_rms",
    ):  # of the joint's spring, and of the displacement
        monkeypatch.setattr(residual_checks, other, lambda *_: 0.0)
    mounting = part("base_slip", [bench.add(bench.stacked(moved))])
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 3e-6]))
    slips = said((mounting,), (bench.rows.rms(moved),))
    off = excess_joint_reading_rms(engine, fit(engine, slips))
    share = off / bench.rows.rms(moved)  # of which the joint's spring takes what is straight
    assert 0.4 < share < 0.7 if turns else share < 0.02
    assert _checked_on_arm(engine, slips).adequate is not turns
    no_readings = make_bench(replace(arm_data(), output_encoder=False))
    blind = Engine(no_readings, base_columns(no_readings), no_readings.observed, np.array([0.0]))
    assert excess_joint_reading_rms(blind, fit(blind, NOTHING)) == 0.0


@pytest.mark.parametrize(("times", "counts"), [(2.0, False), (6.0, True)])
def test_readings_speak_only_plainly_beyond_their_noise(times: float, counts: bool) -> None:
    """How large that is nobody knows better than to a fifth."""
    bench = make_bench(arm_data())
    q, target = bench.layout.q, np.zeros(bench.layout.size)
    signs = np.random.default_rng(5).choice((-1.0, 1.0), q.stop - q.start)
    target[q] = times * signs * np.hypot(bench.sigma[q], bench.noise.q_run)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0]))
    assert (excess_joint_reading_rms(engine, fit(engine, NOTHING)) > 0) is counts
