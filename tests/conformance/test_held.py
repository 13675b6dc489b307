"""Whether a recording rests at levels: a reduction to curves and a diagnosis agree on it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from identification.gap.recording.holds import hold_ids, is_continuous
from identification.stiffness import analyze_curve
from rig.dataset import Dataset
from rig.diagnosis.gap_data import gap_data
from rig.passes import is_held
from rig.reduce import curves
from tests.conformance.gap_designs import DESIGNS, imported, meta, noisy


def test_a_level_whose_displacement_is_missing_says_nothing() -> None:
    step, up = np.repeat([1, 2], 3), np.array(["loading"] * 6)
    force = np.array([10.0, 10, 10, 0, 20, 40])
    moved = np.array([1.0, 1, 1, np.nan, np.nan, np.nan])
    assert is_held([(up, step, force, moved)])
    assert not is_held([(up, step, force, np.nan_to_num(moved))])


def agreed(dataset: Dataset) -> bool:
    """Whether both say that it rests at levels."""
    columns, data = dataset.columns, gap_data(dataset)
    named = ("branch", "step", "force_N", "displacement_mm")
    runs = [data.run == run for run in range(int(data.run.max()) + 1)]
    held = is_held([tuple(columns[n][mine] for n in named) for mine in runs])  # type: ignore[misc]
    assert is_continuous(data, hold_ids(data)) is not held
    return held


@pytest.mark.parametrize("name", DESIGNS)
def test_reduction_and_diagnosis_agree_on_what_is_held(name: str) -> None:
    design = DESIGNS[name]
    assert agreed(imported(noisy(design), meta(design))) is not design.continuous


@pytest.mark.parametrize("rests", [True, False])
def test_they_agree_on_levels_whose_ramps_were_recorded_too(rests: bool) -> None:
    """Far across zero, so that the force goes through more than half of its range on the way: to
    where it rests, or on and on."""
    design = DESIGNS["bench"]
    level = np.repeat([30.0, -80, 100, -60, 90, -100, 60], 14)
    before = np.concatenate([np.zeros(14), level[:-14]])
    coming = (np.arange(98) % 14 + 1) / (3 if rests else 14)
    force = before + (level - before) * np.minimum(1.0, coming)
    rows = pd.DataFrame(
        {
            "time_s": np.arange(98.0),
            "direction": "x",
            "repetition": 1,
            "branch": "cycle",
            "step": np.repeat(np.arange(1, 8), 14),
            "force_N": force,
            "displacement_mm": force / 95,
        }
    )
    assert agreed(imported(rows, meta(design))) is rests


@pytest.mark.parametrize("way", [0.3, 0.4])
@pytest.mark.parametrize("top", [10.0, 100.0])
def test_ramps_under_the_names_of_their_levels_cost_no_stiffness(way: float, top: float) -> None:
    """From no load to a level and back to none, five times: neither the level nor the zero is what
    the load was on its way there."""
    level = np.repeat([0.0, top] * 5 + [0.0], 20)
    before = np.concatenate([np.zeros(20), level[:-20]])
    within = (np.arange(220) % 20 + 1) / 20
    force = before + (level - before) * np.minimum(1.0, within / way)
    rows = pd.DataFrame(
        {
            "time_s": np.arange(220.0),
            "direction": "x",
            "repetition": 1,
            "branch": np.where(level > 0, "loading", "zero"),
            "step": np.repeat(np.arange(11), 20),
            "force_N": force + np.random.default_rng(3).normal(0, 0.02, 220),
            "displacement_mm": force / 80,
        }
    )
    dataset = imported(rows, meta(DESIGNS["bench"]))
    assert agreed(dataset)
    (curve,) = curves(dataset).values()
    k = analyze_curve(curve).k
    assert k is not None
    assert k.value == pytest.approx(80e3, rel=0.01)
