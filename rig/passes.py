"""Recordings that were not held at levels: are they, and their bins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.running import first_rows, runs_through, stretches
from rig.arrays import Array

BINS = 20  # over the range of force
TURN = 0.25  # share of the range by which the force must come back to count as a turn


Levels = tuple[NDArray[np.str_], NDArray[np.int64], Array, Array]


def is_held(runs: Iterable[Levels]) -> bool:
    """Whether every run (branch, step, force, displacement; (n,) each) rests at levels: all its
    samples carry a step (none is negative), and none of them is run through."""
    for branch, step, force, displacement in runs:
        loaded = (branch != "zero") & np.isfinite(force) & np.isfinite(displacement)
        if np.any(step[loaded] < 0):
            return False
        if not loaded.any():
            continue
        load, first = force[loaded], first_rows(branch[loaded], step[loaded])
        if runs_through(load, displacement[loaded], first, float(np.ptp(np.append(load, 0.0)))):
            return False
    return True


_FEW = 0.1  # of the loaded samples of a run


def between_levels(columns: Mapping[str, NDArray[Any]]) -> NDArray[np.bool_]:
    """(n,) samples in use that lack the step which others of their run have, a few of them (one in
    ten, or a single one): on the way from level to level, or a cell that was lost. A run that lacks
    more of them was not held."""
    branch, step = columns["branch"], columns["step"]
    loaded = branch != "zero"
    if "discarded" in columns:
        loaded = loaded & ~columns["discarded"]
    out = loaded & (step < 0)
    if not out.any() or not np.any(loaded & (step >= 0)):
        return np.zeros(len(step), dtype=bool)
    run = stretches(*(columns[n] for n in ("pose", "direction", "repetition")))
    without, count = (np.bincount(run, weights=w)[run] for w in (out, loaded))
    return np.asarray(out & (without <= np.maximum(_FEW * count, 1)) & (2 * without < count))


def binned(
    force: Array, displacement: Array, low: float, high: float
) -> Iterator[tuple[int, float, float, int]]:
    """Bins of equal width between `low` and `high`: number (from 1), mean force, mean displacement,
    samples; empty ones are left out. Of a falling pass the highest bin comes first."""
    width = (high - low) / BINS
    if width > 0:
        number = np.minimum(((force - low) / width).astype(np.int64), BINS - 1)
    else:
        number = np.zeros(force.size, dtype=np.int64)
    count = np.bincount(number, minlength=BINS)
    f = np.bincount(number, weights=force, minlength=BINS)
    u = np.bincount(number, weights=displacement, minlength=BINS)
    order = range(BINS) if force[-1] >= force[0] else range(BINS - 1, -1, -1)
    for i in order:
        if count[i]:
            yield i + 1, float(f[i] / count[i]), float(u[i] / count[i]), int(count[i])
