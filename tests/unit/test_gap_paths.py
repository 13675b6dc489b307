"""Whether what is said to drift goes as drifts do."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from identification.arrays import Array
from identification.gap.answer.result import GapResult
from identification.gap.judging.paths import is_implausible_drift, there_and_back
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import DESIGNS, imported, meta, noisy
from tests.explained import explained

MEDIUM = DESIGNS["medium"]


@pytest.mark.parametrize(
    ("way", "step_s", "far"),
    [
        ([0, 0, 3, 0, 0], 100, 3.0),
        ([0, 0, -3, -1, 0], 100, 2.0),
        ([0, 0, -3, -1, 0], 60, 3.0),
        ([0, 1, 2, 3, 2, 1, 0], 100, 1.0),
        ([0, 1, 2, 3, 2, 1, 0], 30, 3.0),
        ([0, 1, 2, 3, 4, 5], 10, 0.0),
        ([0, 2, 0], 101, 0.0),
        ([1.0], 10, 0.0),
        ([], 10, 0.0),
    ],
)
def test_there_and_back(way: list[float], step_s: float, far: float) -> None:
    assert there_and_back(np.array(way, float), step_s * np.arange(len(way))) == far


def test_time_goes_on_while_nobody_looks() -> None:
    way, time = np.array([0.0, 3.0, 0.0]), np.array([0.0, 60.0, 120.0])
    assert there_and_back(way, time) == 3.0
    assert there_and_back(way, np.array([0.0, 60.0, 420.0])) == 0.0


@pytest.mark.parametrize(
    ("width", "clock", "seen", "no_drift"),
    [
        (0.6, True, slice(None), True),
        (0.6, True, slice(0, 12), False),  # what no row shows is but drawn through
        (0.6, False, slice(None), False),  # nobody knows how long it took
        (6.0, True, slice(None), False),
    ],
)
def test_heat_does_not_come_and_leave_within_minutes(
    width: float, clock: bool, seen: slice, no_drift: bool
) -> None:
    """A rig that warms up, and is moved once by nearly as far, for a minute or for ten."""
    pieces = np.arange(32)
    way = 1e-4 * (0.6 * pieces / 31 + 0.9 * np.exp(-(((pieces - 16) / width) ** 2)))
    shown = np.zeros((1, 32))
    shown[:, seen] = 1.0
    part = SimpleNamespace(
        word="thermal_drift", variant=SimpleNamespace(free_pieces=32, columns=range(32))
    )
    fitted = SimpleNamespace(parts=(part,), of=lambda _: (way, None))
    rows = SimpleNamespace(clock=clock, n=1)
    bench = SimpleNamespace(rows=rows, load_history=SimpleNamespace(session_span=1600.0))
    engine = SimpleNamespace(bench=bench, columns=lambda _: shown)
    assert is_implausible_drift(engine, fitted) is no_drift


def hump(width_s: float) -> GapResult:
    """A linear rig that is moved by 150 um and back, once."""

    def law(rows: pd.DataFrame, _: Array) -> tuple[Array, Array]:
        time = rows["session_s"].to_numpy(float)
        middle = time[len(time) // 3]
        return 1.5e-4 * np.exp(-(((time - middle) / width_s) ** 2)), np.zeros((len(rows), 6))

    return explained(gap_data(imported(noisy(MEDIUM, law), meta(MEDIUM))))


@pytest.mark.slow
@pytest.mark.parametrize(("width_s", "verdict"), [(110.0, "unknown"), (400.0, "thermal_drift")])
def test_what_comes_and_leaves_within_minutes_is_no_heat(width_s: float, verdict: str) -> None:
    """Somebody leans on the stand; the sun comes in."""
    assert hump(width_s).verdict == verdict
