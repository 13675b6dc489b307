"""Mountings and joints that give way anew in every run, as much or by less and less."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from identification.gap.answer.result import GapResult
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import DESIGNS, Array, Law, imported, meta, noisy
from tests.conformance.test_as_rigs_are import about_base
from tests.explained import explained

RICH, MEDIUM = DESIGNS["rich"], DESIGNS["medium"]


def anew(load: Array, threshold: float, fade: float) -> Array:
    """How far it has given way, row by row of one setup: beyond the threshold, in the n-th run by
    the n-th power of the fading."""
    out, total, peak, passes = np.zeros(len(load)), 0.0, 0.0, 0
    for i, x in enumerate(load):
        if abs(x) < 0.3 * threshold:
            peak = 0.0
        elif abs(x) > threshold > peak:
            passes, peak = passes + 1, threshold
        if peak and abs(x) > peak:
            total += np.sign(x) * (abs(x) - peak) / passes**fade
            peak = abs(x)
        out[i] = total
    return out


def diagnosed(law: Law, design=RICH) -> GapResult:  # type: ignore[no-untyped-def]
    return explained(gap_data(imported(noisy(design, law), meta(design))))


@pytest.mark.slow
@pytest.mark.parametrize("fade", [0.7, 0.0, 0.3, 1.5])
def test_a_mounting_that_slips_anew_in_every_run_does_not_warm_up(fade: float) -> None:
    def law(rows: pd.DataFrame, _: Array) -> tuple[Array, Array]:
        turns = about_base(rows, np.array([0.0, 1, 0]), lambda m: 4e-6 * anew(m, 18.0, fade))
        return turns, np.zeros((len(rows), 6))

    found = diagnosed(law)
    assert found.verdict == "base_slip"
    assert next(iter(found.effects[0].places)) == "axis y"
    assert found.effects[0].parameters["threshold"].value == pytest.approx(18.0, rel=0.1)
    assert found.after < 1.1 * found.noise


@pytest.mark.slow
def test_a_clutch_that_slips_on_in_every_run_is_the_joint_that_yields() -> None:
    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        turned = np.zeros((len(rows), 6))
        for mine in rows.groupby(["pose", "direction"]).indices.values():
            torque = lever[mine, 0] * rows["force_N"].to_numpy(float)[mine]
            turned[mine, 0] = 4e-5 * anew(torque, 30.0, 0.7)
        return np.zeros(len(rows)), turned

    found = diagnosed(law, MEDIUM)
    assert found.verdict == "joint_yield"
    assert found.where.joints == (1,)
    assert found.after < 1.2 * found.noise


@pytest.mark.slow
def test_what_moves_while_nothing_is_loaded_still_is_a_drift() -> None:
    def law(rows: pd.DataFrame, _: Array) -> tuple[Array, Array]:
        time = rows["session_s"].to_numpy(float)
        return 1e-4 * (1 - np.exp(-time / 400)), np.zeros((len(rows), 6))

    assert diagnosed(law).verdict == "thermal_drift"
