"""Five small cases with laws by loops over the rows, for `bench/nested_sampling.py`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.gap.data import GapData
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import TRUE, Design, Law, imported, meta, noisy

Array = NDArray[np.float64]
SMALL = Design(repetitions=2, steps=4, hold=2)


def _torque(rows: pd.DataFrame, lever: Array) -> Array:
    return np.asarray(lever * rows["force_N"].to_numpy(float)[:, None])


def yielding(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """Joint 1 flows above 45 Nm, half as stiff beyond; what has flowed stays."""
    torque, q, flowed = _torque(rows, lever), np.zeros_like(lever), 0.0
    for i, t in enumerate(torque[:, 0]):
        flowed = max(flowed, (abs(t) - 45.0) / TRUE[0])
        q[i, 0] = np.sign(lever[i, 0]) * flowed
    return np.zeros(len(q)), q


def rubbing(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """A tenth of joint 1's compliance works through friction of 6 and of 15 Nm."""
    torque, q = _torque(rows, lever)[:, 0], np.zeros_like(lever)
    for strength in (6.0, 15.0):
        state = 0.0
        for i, t in enumerate(torque):
            state = min(t + strength, max(t - strength, state))
            q[i, 0] -= 0.1 * (t - state) / TRUE[0]
    return np.zeros(len(q)), q


def seating(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """25 um, arctangent of the force."""
    force = rows["force_N"].to_numpy(float)
    return 2.5e-5 * 2 / np.pi * np.arctan(force / 12.0), np.zeros_like(lever)


CASES: dict[str, tuple[Law | None, Design]] = {
    "none": (None, SMALL),
    "yield": (yielding, SMALL),
    "friction": (rubbing, SMALL),
    "seating": (seating, SMALL),
    "yield, no readings": (yielding, replace(SMALL, readings=False)),
}


def case_data(name: str) -> GapData:
    """The data of a case."""
    law, design = CASES[name]
    return gap_data(imported(noisy(design, law, seed=5), meta(design)))
