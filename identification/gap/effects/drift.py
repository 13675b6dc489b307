"""Smooth paths on the session clock, shared by the effects that drift."""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array

RATES = (0.01, 0.03, 0.08, 0.2, 0.5)  # time constants, of the session
PIECES = 10  # of a free smooth path: slower than a run, faster than the session


def warm_ups(bench: Bench) -> dict[str, Array]:
    """Named paths (n,), 0 at the start, about 1 at the end: line, exponentials, root of time."""
    t = (bench.rows.session - bench.rows.session.min()) / bench.session_span
    out = {"linear": t, "root": np.sqrt(t)}
    for share in RATES:
        out[f"T {share:g}"] = (1 - np.exp(-t / share)) / (1 - np.exp(-1 / share))
    return out


def has_runs(bench: Bench) -> bool:
    """At least three runs: within one, a free path in time is a free curve of the load."""
    return len(np.unique(bench.rows.run)) >= 3


def free_path(bench: Bench) -> Array:
    """Hat functions (n, PIECES) over the session; with correlated coefficients a smooth path."""
    t = (bench.rows.session - bench.rows.session.min()) / bench.session_span
    at = np.linspace(0, 1, PIECES)
    return np.asarray(np.maximum(0.0, 1 - np.abs(t[:, None] - at) * (PIECES - 1)))


def path_root() -> Array:
    """Root of a random walk's covariance over the pieces, free where it starts."""
    at = np.linspace(0.15, 1, PIECES)
    covariance = np.minimum(at[:, None], at) + 1e-9 * np.eye(PIECES)
    return np.asarray(np.linalg.cholesky(covariance), dtype=float)
