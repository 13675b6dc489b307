"""Whether what is said to drift goes as drifts do."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from identification.arrays import Array
from identification.gap.answer.result import GapResult
from identification.gap.explanations.fit import fit
from identification.gap.judging.paths import goes_as_no_drift, there_and_back
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import DESIGNS, imported, meta, noisy
from tests.explained import explained

MEDIUM = DESIGNS["medium"]


@pytest.mark.parametrize(
    ("way", "within", "far"),
    [
        ([0, 0, 3, 0, 0], 2, 3.0),
        ([0, 0, -3, -1, 0], 2, 2.0),
        ([0, 0, -3, -1, 0], 3, 3.0),
        ([0, 1, 2, 3, 2, 1, 0], 2, 1.0),
        ([0, 1, 2, 3, 2, 1, 0], 6, 3.0),
        ([0, 1, 2, 3, 4, 5], 5, 0.0),
        ([0, 2, 0], 1, 0.0),
        ([1.0], 5, 0.0),
    ],
)
def test_there_and_back(way: list[float], within: int, far: float) -> None:
    assert there_and_back(np.array(way, float), within) == far


def hump(width_s: float) -> GapResult:
    """A linear rig that is moved by 150 um and back, once."""

    def law(rows: pd.DataFrame, _: Array) -> tuple[Array, Array]:
        time = rows["session_s"].to_numpy(float)
        middle = time[len(time) // 3]
        return 1.5e-4 * np.exp(-(((time - middle) / width_s) ** 2)), np.zeros((len(rows), 6))

    return explained(gap_data(imported(noisy(MEDIUM, law), meta(MEDIUM))))


@pytest.mark.parametrize(("width_s", "verdict"), [(110.0, "unknown"), (400.0, "thermal_drift")])
def test_what_comes_and_leaves_within_minutes_is_no_heat(width_s: float, verdict: str) -> None:
    """Somebody leans on the stand; the sun comes in."""
    result = hump(width_s)
    best = next(e for e in result.found.explanations if "thermal_drift" in e.words)
    engine = result.found.engine
    assert goes_as_no_drift(engine, fit(engine, best)) is (verdict == "unknown")
    assert result.verdict == verdict
