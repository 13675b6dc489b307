"""Recordings that were not held at levels: are they, and their bins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from identification.curve import Array

BINS = 20  # over the range of force
TURN = 0.25  # share of the range by which the force must come back to count as a turn
HELD = 0.5  # share of the range that the force of a held level stays within


def is_held(runs: Iterable[tuple[NDArray[np.str_], NDArray[np.int64], Array]]) -> bool:
    """Whether every run (branch, step, force; (n,) each) rests at levels.

    Not, if samples carry no step (negative), or the force runs through more than half of the run's
    range within one level. Two samples of a level can't say either, and count as held.
    """
    for branch, step, force in runs:
        loaded = (branch != "zero") & np.isfinite(force)
        if np.any(step[loaded] < 0):
            return False
        if loaded.any() and _runs_through(branch[loaded], step[loaded], force[loaded]):
            return False
    return True


def _runs_through(branch: NDArray[np.str_], step: NDArray[np.int64], force: Array) -> bool:
    change = np.flatnonzero((branch[1:] != branch[:-1]) | (step[1:] != step[:-1])) + 1
    edges = np.concatenate([[0], change])
    width = np.maximum.reduceat(force, edges) - np.minimum.reduceat(force, edges)
    span = float(np.ptp(np.append(force, 0.0)))
    count = np.diff(np.append(edges, force.size))
    return bool(np.any((count > 2) & (width > HELD * span)))


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
