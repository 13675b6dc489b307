"""What a data set tells of the joints: one compliance a pose and direction, and joint readings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.arm import JOINTS, tool_offset
from identification.curve import Curve
from identification.estimate import stated_uncertainty
from identification.joints import Observation
from identification.levels import grid_of
from identification.stiffness import Stiffness, analyze_curve
from rig.arrays import Array
from rig.dataset import Dataset
from rig.digits import counted
from rig.errors import InputError
from rig.reduce import curves
from rig.units import MM_PER_M

# What a joint reading may be off by from one load to another. The readings' resolution is far
# finer; their linearity is not published: +-0.01 deg, usual for absolute encoders of that size,
# with a rectangular distribution.
ENCODER_U_RAD = 1.0e-4


def observations_of(
    dataset: Dataset, name: str, setup: int, joint_readings: bool
) -> tuple[list[Observation], list[str]]:
    """One observation a pose and direction that has a stiffness."""
    found: list[tuple[Curve, Stiffness, float]] = []
    notes: list[str] = []
    for (pose, direction), curve in curves(dataset).items():
        result = analyze_curve(curve)
        label = f"{name}: pose {pose}, direction {direction}"
        if result.k is None or not result.k.value > 0:
            notes.append(f"{label} is left out: {result.sentence or 'no stiffness above 0'}")
            continue
        notes += [f"{label}: {words}." for words in _left_out(result)]
        found.append((curve, result, _stated(curve, result)))
    scale = _scale(found)
    out = []
    for curve, result, stated in found:
        assert result.k is not None
        stood = dataset.meta.poses[curve.pose]
        k = result.k.value
        joints, u_joints = _joint_readings(dataset, curve, result) if joint_readings else _NONE
        out.append(
            Observation(
                q=np.array(stood.q_rad),
                direction=np.array(curve.unit_vector),
                tool=tool_offset(np.array(stood.tcp_xyz_mm) / MM_PER_M),
                compliance=1 / k,
                u_compliance=scale * stated / k**2,
                joints=joints,
                u_joints=u_joints,
                setup=setup,
                label=f"{name}: pose {curve.pose}, direction {curve.direction}",
                bent_over=_range(result) if result.bent else None,
            )
        )
    if not out:
        raise InputError(_without_stiffness(dataset, name, notes))
    bent = [f"{curve.pose}/{curve.direction}" for curve, result, _ in found if result.bent]
    return out, notes + [_averages(name, bent)] * bool(bent)


def _without_stiffness(dataset: Dataset, name: str, notes: list[str]) -> str:
    """Why a data set says nothing of joints, and what to do."""
    told = f"{name}: no pose and direction has a stiffness"
    why = [f"{told}.", *notes] if dataset.rows else [f"{told}: the data set holds no samples."]
    if dataset.complete:
        return " ".join([*why, "Leave this data set out."])
    return " ".join(
        [
            *why,
            "The measurement did not reach its end: go on with rig measure --resume, or leave "
            "this data set out.",
        ]
    )


def _range(result: Stiffness) -> tuple[float, float]:
    """Lowest and highest force N that counts towards k."""
    levels = [p for p in result.levels if p.branch == "loading"]
    forces = [p.force for p in levels if p.step not in result.steps_out]
    return min(forces), max(forces)


def _averages(name: str, bent: list[str]) -> str:
    curve = "the curve of" if len(bent) == 1 else "the curves of"
    verb = "is" if len(bent) == 1 else "are"
    return (
        f"{name}: {curve} {', '.join(bent)} {verb} not straight within the noise: the springs are "
        "averages over what was loaded. rig diagnose separates springs from effects."
    )


def _left_out(result: Stiffness) -> list[str]:
    """What does not count towards k, in words."""
    words = []
    if result.steps_out:
        verb = "does" if len(result.steps_out) == 1 else "do"
        words.append(f"{counted(len(result.steps_out), 'step')} {verb} not count towards k")
    single = [e.reason for e in result.excluded if e.repetition is not None]
    return words + list(dict.fromkeys(single))


_NONE: tuple[Array | None, Array | None] = (None, None)


def _stated(curve: Curve, result: Stiffness) -> float:
    """Standard uncertainty of k (N/m) from the levels' stated ones, repetitions averaged."""
    points = [p for p in curve.points if result.counts(p.repetition, p.step)]
    used = grid_of(points, "loading")
    table = used.mean()
    u = stated_uncertainty(table, result.choice)
    return float(u / np.sqrt(max(1, len(used.repetitions))))


def _scale(found: Sequence[tuple[Curve, Stiffness, float]]) -> float:
    """How much the repetitions scatter, over what was stated, pooled over all curves.

    Few repetitions estimate their own scatter badly; all curves together do it well. Never below
    one quarter, because a stated uncertainty also holds what repetitions share.
    """
    squares = dof = 0.0
    for _, result, stated in found:
        n = len(result.by_repetition)
        if n > 1 and stated > 0:
            squares += float(np.var(result.by_repetition, ddof=1)) / n / stated**2 * (n - 1)
            dof += n - 1
    return max(0.25, float(np.sqrt(squares / dof))) if dof else 1.0


def _joint_readings(
    dataset: Dataset, curve: Curve, result: Stiffness
) -> tuple[Array | None, Array | None]:
    """Slopes rad/N (6,) of the joint readings over force, and their standard uncertainties.

    Least squares with one intercept a repetition, over the loading levels that count and the
    unloaded ones. None where readings do not contain the deflection, or were not recorded.
    """
    columns = dataset.columns
    names = [f"q{j}_rad" for j in range(1, JOINTS + 1)]
    if dataset.meta.joint_encoder != "output" or not all(n in columns for n in names):
        return _NONE
    rows = (columns["pose"] == curve.pose) & (columns["direction"] == curve.direction)
    rows &= ~columns["discarded"] & np.isin(columns["branch"], ["zero", "loading"])
    for e in result.excluded:
        out = (columns["branch"] == "loading") & (columns["step"] == e.step)
        rows &= ~out if e.repetition is None else ~out | (columns["repetition"] != e.repetition)
    force, repetition = columns["force_N"][rows], columns["repetition"][rows]
    q = np.stack([columns[n][rows] for n in names], axis=-1).astype(float)
    slopes, u = _slopes(np.asarray(force, dtype=float), np.asarray(repetition), q)
    return slopes, u


def _slopes(force: Array, repetition: NDArray[Any], q: Array) -> tuple[Array | None, Array | None]:
    f, dq = force.copy(), q.copy()
    for r in np.unique(repetition):
        mine = repetition == r
        f[mine] -= f[mine].mean()
        dq[mine] -= dq[mine].mean(axis=0)
    span, xx = float(np.ptp(force)) if force.size else 0.0, float(f @ f)
    free = force.size - np.unique(repetition).size - 1
    if span <= 0 or free < 1 or not np.isfinite(dq).all():
        return _NONE
    slopes = f @ dq / xx
    scatter = ((dq - f[:, None] * slopes) ** 2).sum(axis=0) / free / xx
    return slopes, np.sqrt(scatter + (ENCODER_U_RAD / span) ** 2)
