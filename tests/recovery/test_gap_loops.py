"""Loops of other forms than the library's: a bolt in its hole, and what switches piece by piece."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.diagnosis.gap_data import gap_data
from tests.explained import explained
from tests.recovery.one_effect import STIFFNESS, Law, Sample, measure


def bolts(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """60 um of play of the target's holder: taken up between 4 and 24 N beyond 5 N of friction."""
    taken, carried = np.zeros(len(samples)), 0.0
    for i, s in enumerate(samples):
        if i and samples[i - 1].direction != s.direction:
            carried = 0.0
        carried = min(max(carried, s.force - 5.0), s.force + 5.0)
        share = min(max((carried - 4.0) / 20.0, 0.0), 1.0)
        taken[i] = share**2 * (3 - 2 * share)
    return np.zeros_like(torque), 6e-5 * taken


def switches(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """Joint 3: 4000 relays that switch on and off about loads of their own (Preisach 1935), most
    about small ones."""
    rng = np.random.default_rng(5)
    top = float(np.abs(torque[:, 2]).max())
    centre, half = top * rng.normal(0, 0.45, 4000), top * np.abs(rng.normal(0.11, 0.07, 4000))
    state, out = np.zeros(4000), np.zeros_like(torque)
    for i, s in enumerate(samples):
        if i == 0 or samples[i - 1].direction != s.direction:
            state = np.where(centre < 0, 1.0, -1.0)
        state[torque[i, 2] > centre + half] = 1.0
        state[torque[i, 2] < centre - half] = -1.0
        out[i, 2] = 0.15 * top / STIFFNESS[2] * float(state.mean())
    return out, np.zeros(len(samples))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "word"), [(bolts, "contact_seating"), (switches, "joint_hysteresis")]
)
def test_a_loop_is_called_by_what_makes_it(tmp_path: Path, law: Law, word: str) -> None:
    found = explained(gap_data(measure(tmp_path, law, drop=("q",))))
    assert found.verdict == word
    assert found.probabilities[word] > 0.9
