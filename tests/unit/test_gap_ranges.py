"""Ranges of force in which a gap lies."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from identification.gap.answer.locate import _ranges


def test_what_sums_of_zeros_leave_is_no_force() -> None:
    """Means of readings without load, less their datum; a real small force stays."""
    force, setup = np.array([1.2e-18, 82.2, -3e-6, 60.0]), np.array([0, 0, 1, 1])
    setups = [SimpleNamespace(direction=d) for d in ("y", "z")]
    rows = SimpleNamespace(force=force, setup=setup)
    engine: Any = SimpleNamespace(
        bench=SimpleNamespace(rows=rows, data=SimpleNamespace(setups=setups))
    )
    every = np.ones(4, dtype=bool)
    assert _ranges(engine, every) == {"y": (0.0, 82.2), "z": (-3e-6, 60.0)}
