"""Joints that turn otherwise than an explanation has it are named."""

from __future__ import annotations

import numpy as np

from identification.gap.answer.notes import readings_missed
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
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
