"""How alike the imperfection of laws is: from level to level, and along a run."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.data import UNLOADING
from identification.gap.model.bench import Bench
from identification.gap.recording.turns import rises

NEIGHBOUR = 0.25  # share of the force range over which the imperfection stays alike


def level_columns(bench: Bench) -> Array:
    """Indicator of every level, response only, (size, levels)."""
    rows = bench.rows
    out = np.zeros((bench.layout.size, int(rows.level.max()) + 1))
    out[np.arange(rows.n), rows.level] = 1.0
    return out


HATS = 4  # of a run's own imperfection, over its range of load


def run_columns(bench: Bench) -> Array:
    """Hat functions of the load for every run and sense of loading, response only, (size, k);
    none where no run is there twice, or the rig runs on and on."""
    rows = bench.rows
    runs = np.unique(rows.run)
    if rows.continuous or len(runs) <= len(bench.data.setups):
        return np.zeros((bench.layout.size, 0))
    out = []
    for run in runs:
        mine = rows.run == run
        low, high = float(bench.load[mine].min()), float(bench.load[mine].max())
        at = (bench.load - low) / ((high - low) or 1.0) * (HATS - 1)
        for back in (False, True):
            here = mine & ((rows.branch == UNLOADING) == back)
            for k in range(HATS) if here.any() else ():
                out.append(bench.stacked(np.where(here, np.maximum(0.0, 1 - np.abs(at - k)), 0.0)))
    return np.column_stack(out)


def level_covariance(bench: Bench) -> Array:
    """(levels, levels) of the imperfection at the levels of a bench, of unit variance."""
    rows = bench.rows
    count = int(rows.level.max()) + 1
    sums = np.bincount(rows.level, minlength=count)
    load = np.bincount(rows.level, weights=bench.load, minlength=count) / sums
    first = np.unique(rows.level, return_index=True)[1]
    setup = rows.setup[first]
    branch = (rises(bench.load) if rows.continuous else rows.branch)[first]
    return alike(setup, branch, load, float(np.ptp(bench.load)))


def alike(setup: Ints, branch: Ints | Flags, load: Array, span: float) -> Array:
    """(k, k) covariance of the imperfection at k levels, of unit variance: an exponential kernel of
    the load, correlation length NEIGHBOUR of the span (a path that may have corners), half of it
    between branches and none between setups."""
    near = np.exp(-np.abs(load[:, None] - load) / (NEIGHBOUR * (span or 1.0)))
    branches = np.where(branch[:, None] == branch, 1.0, 0.5)
    return np.asarray(near * branches * (setup[:, None] == setup) + 1e-9 * np.eye(len(load)))
