"""When what has given way is where it was before: what a knee remembers, and how likely that is."""

from __future__ import annotations

import numpy as np

from identification.arrays import Flags
from identification.gap.model.bench import Bench
from identification.gap.model.variants import (
    BACK_UNDER_WEIGHT,
    LASTING,
    RESET_PER_RUN,
    RESET_PER_SETUP,
    UNDER_WEIGHT,
)

# A joint that is taken back leaves nothing behind: then a curved spring is the simpler reading.
LIKELY = {
    "": 1.0,
    LASTING: 0.5,
    RESET_PER_SETUP: 0.5,
    RESET_PER_RUN: 0.3,
    UNDER_WEIGHT: 1.0,
    BACK_UNDER_WEIGHT: 0.3,
}


def memories(bench: Bench) -> dict[str, Flags]:
    """When the joint gets back to where it was: never, when the arm moves, when the rig is turned
    to another direction (the arm may be sent away meanwhile), before every run."""
    moved, first = bench.moved, np.zeros(bench.rows.n, dtype=bool)
    out = {"": moved}
    if np.sum(moved) > 1:
        out[LASTING] = first
    if np.sum(bench.rebuilt) > np.sum(moved):
        out[RESET_PER_SETUP] = bench.rebuilt
    if np.sum(bench.rest) > np.sum(moved):
        out[RESET_PER_RUN] = moved | bench.rest
    return out


def fresh_of(bench: Bench, memory: str) -> Flags:
    """(n,) rows before which a joint of that memory is where it was."""
    lost = RESET_PER_RUN if memory == BACK_UNDER_WEIGHT else memory
    return memories(bench).get(lost, bench.moved)
