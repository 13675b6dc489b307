"""A wrong pose is met to the noise though springs, gains and mounting are off as well."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from identification.arm import tool_offset
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from identification.gap.search.refine import refine
from rig.diagnosis.gap_data import gap_data
from rig.models.robot import load_robot
from tests.conformance.gap_designs import (
    DESIGNS,
    TCP_MM,
    TRUE,
    Array,
    Q,
    imported,
    meta,
    noisy,
)
from tests.explained import explained

OFFSET_M = np.array([0.04, -0.023, 0.014])
TURN_RAD = 0.0168  # by which joint 1 stands off
FORCE_READ, DISPLACEMENT_READ = 0.9925, 1.006  # over true: 1.5 and two of what META states
TILT = 3e-6  # rad/Nm of the mounting, about base x, y and z
DEPTH_M = 0.65  # of its axes below the base
CLOSE_MM = 1.0  # what the gains of the instruments leave open


def measured(tilt: float) -> GapData:
    """A tool and a joint elsewhere than said, on an arm whose mounting tilts."""
    arm, turn = load_robot("ur10e"), np.array([TURN_RAD, 0, 0, 0, 0, 0])

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        force = rows["force_N"].to_numpy(float)
        more, deflection = np.zeros(len(rows)), np.zeros((len(rows), 6))
        for (pose, direction), mine in rows.groupby(["pose", "direction"]).indices.items():
            tool = tool_offset(np.array(TCP_MM) * 1e-3 + OFFSET_M)
            q, n = np.array(Q[pose]) + turn, np.eye(3)["xyz".index(direction)]
            there, true = arm.jacobian(q, tool)[:3].T @ n, force[mine, None] / FORCE_READ
            joints = there * true / TRUE
            moment = np.cross(arm.fk(q, tool)[:3, 3] + [0.0, 0.0, DEPTH_M], n)
            moved = np.sum(there * joints, axis=1) + tilt * (moment @ moment) * true[:, 0]
            deflection[mine] = joints - lever[mine] * force[mine, None] / TRUE + turn
            shown = np.sum(lever[mine] * (joints + turn), axis=1)
            more[mine] = moved * DISPLACEMENT_READ - shown
        return more, deflection

    design = DESIGNS["rich"]
    return gap_data(imported(noisy(design, law), meta(design)))


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, pytest.param(TILT, marks=pytest.mark.slow)])
def test_a_tool_elsewhere_is_found_beside_what_else_is_off(tilt: float) -> None:
    result = explained(measured(tilt))
    names = {e.name for e in result.effects}
    assert names == ({"pose_error", "base_compliance"} if tilt else {"pose_error"})
    assert result.after < 1.05 * result.noise
    pose = next(e for e in result.effects if e.name == "pose_error")
    offset = [pose.parameters[f"offset_{axis}"].value for axis in "xyz"]
    np.testing.assert_allclose(offset, OFFSET_M * 1e3, atol=CLOSE_MM)
    if not tilt:  # a mounting would take over what the gain does
        base = dict(zip(result.engine.base.names, result.fit.base.tolist(), strict=True))
        assert base["gain displacement"] == pytest.approx(DISPLACEMENT_READ - 1, abs=2e-3)


def test_a_second_effect_does_not_decide_where_the_tool_is_looked_for() -> None:
    bench = make_bench(measured(TILT))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    variants = library(bench, ["pose_error", "base_compliance"])
    engine = Engine(bench, base, target, eta_levels(bench, base, target))
    poses = [
        v for v in refine(engine, score(engine, engine.levels, variants)) if "offset_m" in v.info
    ]
    both = [v for v in poses if v.info["kind"] == "both"]
    off = {v.label: np.abs(v.info["offset_m"] - OFFSET_M).max() for v in both}
    alone, beside = (
        min(o for label, o in off.items() if ("beside" in label) is b) for b in (False, True)
    )
    assert alone > 0.05
    assert beside < 0.002
    # looked at more than once, it is as likely as one that was looked at once
    once = next(v for v in poses if v.info["kind"] == "tool")
    assert sum(v.prior for v in both) == pytest.approx(once.prior)
