"""The structural gap: what six springs within their stated bounds cannot explain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.arrays import Array
from rig.worlds.hidden.scene import Change, Index, Reading, Scene, observe

SPRING_BOUND = 3.0  # stated standard deviations to either side


def zeroed(scene: Scene, values: Array, per_run: bool) -> Array:
    """Values (m) of the samples minus the first of their setup, or of their run."""
    group = _group(scene, per_run)
    first = np.flatnonzero(np.diff(group, prepend=-1))
    return np.asarray(values - values[first][np.cumsum(np.diff(group, prepend=-1) != 0) - 1])


def _group(scene: Scene, per_run: bool) -> Index:
    history = scene.history
    return (history.run if per_run else history.setup)[history.sample]


def tared(scene: Scene, force: Array) -> Array:
    """(m, 3) N after taring: minus the first sample of the run, or of the session."""
    if scene.plan.recorded.tare == "session":
        return np.asarray(force - force[0])
    columns = [zeroed(scene, force[:, k], per_run=True) for k in range(3)]
    return np.stack(columns, axis=1)


def displacement(scene: Scene, reading: Reading) -> Array:
    """(m) mm after the datum."""
    return zeroed(scene, reading.displacement_mm, scene.plan.recorded.datum == "repetition")


def along(scene: Scene, force: Array) -> Array:
    """(m) component of (m, 3) N along each sample's direction."""
    unit = scene.unit[scene.history.setup[scene.history.sample]]
    return np.asarray(np.sum(force * unit, axis=1))


def spring_columns(scene: Scene, force_N: Array) -> Array:
    """(m, 6) mm that each joint contributes under the force (m), per unit of compliance."""
    lever = np.einsum("sij,sj->si", scene.levers, scene.unit)
    return np.asarray(
        1e3 * lever[scene.history.setup[scene.history.sample]] ** 2 * force_N[:, None]
    )


def structural_gap(scene: Scene, changes: Sequence[Change]) -> Array:
    """(m) mm: ideal displacement minus the best refit of the springs within their bounds."""
    reading = observe(scene, changes)
    moved = displacement(scene, reading)
    return leftover(scene, moved, along(scene, tared(scene, reading.force_N)))


def leftover(scene: Scene, moved_mm: Array, force_N: Array) -> Array:
    """(m) mm that springs within their bounds leave of a displacement (m) under a force (m)."""
    from scipy.optimize import lsq_linear

    plan = scene.plan
    bound = SPRING_BOUND * plan.relative_sd
    columns = spring_columns(scene, force_N) / plan.believed
    low, high = 1 / (1 + bound), 1 / max(1 - bound, 0.05)
    # the triangle of a QR decomposition stands for all rows
    triangle = np.asarray(np.linalg.qr(np.column_stack([columns, moved_mm]), mode="r"), dtype=float)
    factors = lsq_linear(triangle[:, :6], triangle[:, 6], (low, high), tol=1e-12).x
    return np.asarray(moved_mm - columns @ factors)


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0
