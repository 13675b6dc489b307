"""The answers to a case from MuJoCo: size of the gap, where it shows, which words explain it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from rig.arrays import Array
from rig.blind.mujoco_effects import Hidden
from rig.blind.mujoco_session import AXES, Design, Row, levers, true_mm
from rig.worlds.arm import place

SHOWS = 0.15  # of the largest, for directions and poses
AS_WELL = 0.5  # times the noise: what a word that explains the case as well may leave
_READING_RAD = 1e-5 / 3  # of a hold's mean
_DEPTHS_M = (0.0, 0.35, 0.7)


def answers(
    hidden: Hidden | None, rows: Sequence[Row], design: Design, noise_mm: float
) -> dict[str, Any]:
    """Keys as the labelled cases have them."""
    gap = structural_mm(rows, design)
    rms = float(np.sqrt(np.mean(gap**2)))
    if hidden is None:
        empty: dict[str, Any] = {"forms": [], "laws": [], "parameters": [], "snr_each": []}
        nothing = {**empty, "snr": 0.0, "structural_rms_mm": rms, "where": None}
        return {**_common("none", design, noise_mm), **nothing}
    accept = accepted(hidden, rows, design, noise_mm)
    return {
        **_common(hidden.word, design, noise_mm),
        "accept": accept,
        "accept_each": [accept],
        "forms": [hidden.form],
        "laws": [hidden.law],
        "parameters": [hidden.parameters],
        "snr": rms / noise_mm,
        "snr_each": [rms / noise_mm],
        "structural_rms_mm": rms,
        "where": _where(hidden, rows, gap),
    }


def _common(word: str, design: Design, noise_mm: float) -> dict[str, Any]:
    return {
        "truth": [word],
        "verdict": word,
        "accept": [word],
        "accept_each": [[word]],
        "design": "rich",
        "engine": "mujoco",
        "noise_rms_mm": noise_mm,
        "directions": list(design.forces),
    }


def _where(hidden: Hidden, rows: Sequence[Row], gap: Array) -> dict[str, Any]:
    def sizes(names: list[str]) -> dict[str, float]:
        each = np.array(names)
        return {n: float(np.sqrt(np.mean(gap[each == n] ** 2))) for n in dict.fromkeys(names)}

    directions, poses = sizes([r.direction for r in rows]), sizes([r.pose for r in rows])
    return {
        "directions": [d for d, v in directions.items() if v >= SHOWS * max(directions.values())],
        "main_direction": max(directions, key=lambda d: directions[d]),
        "poses": [p for p, v in poses.items() if v >= SHOWS * max(poses.values())],
        "joints": list(hidden.joints),
        "seen_by_encoders": hidden.seen,
    }


def structural_mm(rows: Sequence[Row], design: Design) -> Array:
    """(n,) mm: displacement without noise minus the best six springs within three stated sd."""
    columns = _springs(rows, design)
    datum = _setups(rows)
    left: Array = true_mm(rows) - _fit(columns, datum, true_mm(rows), 3 * design.relative_sd)
    return left


def _springs(rows: Sequence[Row], design: Design) -> Array:
    """(n, 6) mm: what every stated spring adds to the displacement."""
    return _per_newton(
        rows, design, lambda p, d: 1e3 * (levers(design, p) @ AXES[d]) ** 2 / design.stated
    )


def _setups(rows: Sequence[Row]) -> Array:
    """(n, setups): ones in the rows of each; the datum is free."""
    names = [(row.pose, row.direction) for row in rows]
    column = {name: i for i, name in enumerate(dict.fromkeys(names))}
    return np.eye(len(column))[[column[name] for name in names]]


def _fit(springs: Array, free: Array, target: Array, most: float) -> Array:
    """(n,) best explanation: springs times 1 + r, |r| <= most, and free columns."""
    matrix = np.hstack([springs, free])
    bounds = np.concatenate([np.full(springs.shape[1], most), np.full(free.shape[1], np.inf)])
    scale = np.maximum(np.abs(matrix).max(axis=0), 1e-12)
    found = lsq_linear(
        matrix / scale, target - springs.sum(axis=1), (-bounds * scale, bounds * scale), tol=1e-12
    )
    out: Array = springs.sum(axis=1) + matrix @ (found.x / scale)
    return out


# -------------------------------------------------------------------------------------- accept


def accepted(hidden: Hidden, rows: Sequence[Row], design: Design, noise_mm: float) -> list[str]:
    """The true word, and linear words that leave no more than half the noise of a linear truth,
    in laser and joint readings together."""
    rivals = _rivals(rows, design)
    if hidden.word not in rivals:
        return [hidden.word]
    out = {hidden.word}
    for word, choices in rivals.items():
        if word != hidden.word and any(
            _leaves(rows, design, noise_mm, laser, joints) <= AS_WELL for laser, joints in choices
        ):
            out.add(word)
    return sorted(out)


def _leaves(
    rows: Sequence[Row], design: Design, noise_mm: float, laser: Array, joints: Array
) -> float:
    """rms of what stays, in units of the noise. laser (n, k) mm and joints (n, 6, k) rad: what the
    rival's columns do to displacement and readings."""
    n, torque = len(rows), _torques(rows, design)
    turned = torque / design.stated
    unit = np.einsum("nj,jk->njk", turned, np.eye(6))
    springs = np.vstack([_springs(rows, design) / noise_mm, *_by_joint(unit, _READING_RAD)])
    datum = _setups(rows)
    free = np.vstack([laser / noise_mm, *_by_joint(joints, _READING_RAD)])
    datum = np.vstack([datum, np.zeros((6 * n, datum.shape[1]))])
    readings = np.array([row.turned for row in rows]).T.ravel() / _READING_RAD
    target = np.concatenate([true_mm(rows) / noise_mm, readings])
    left = target - _fit(springs, np.hstack([free, datum]), target, 3 * design.relative_sd)
    return max(float(np.sqrt(np.mean(part**2))) for part in (left[:n], left[n:]))


def _by_joint(columns: Array, unit: float) -> list[Array]:
    return [columns[:, j] / unit for j in range(6)]


def _torques(rows: Sequence[Row], design: Design) -> Array:
    """(n, 6) Nm that the loads put on the joints."""
    return _per_newton(rows, design, lambda p, d: np.asarray(levers(design, p) @ AXES[d]))


def _rivals(rows: Sequence[Row], design: Design) -> dict[str, list[tuple[Array, Array]]]:
    """Per linear word its textbook forms: columns of displacement mm and of readings rad."""
    n, springs = len(rows), _springs(rows, design)
    turned = np.einsum("nj,jk->njk", _torques(rows, design) / design.stated, np.eye(6))
    total = springs.sum(axis=1, keepdims=True)
    still = np.zeros((n, 6, 1))

    def unseen(columns: Array) -> tuple[Array, Array]:
        return columns, np.zeros((n, 6, columns.shape[1]))

    return {
        "joint_stiffness_error": [(springs, turned)],
        "displacement_scale": [(total, still)],
        "force_scale": [(total, turned.sum(axis=2, keepdims=True))],
        "base_compliance": [unseen(_base(rows, design, depth)) for depth in _DEPTHS_M],
        "link_flexibility": [unseen(_links(rows, design))],
    }


def _base(rows: Sequence[Row], design: Design, depth_m: float) -> Array:
    """(n, 3) mm per (rad / 1e6 Nm): turning about the base axes through a point below."""

    def of(pose: str, direction: str) -> Array:
        above = place(design.poses[pose]).tool(design.tool) + np.array([0.0, 0.0, depth_m])
        return 1e-3 * np.asarray(np.cross(np.eye(3), above) @ AXES[direction]) ** 2

    return _per_newton(rows, design, of)


def _links(rows: Sequence[Row], design: Design) -> Array:
    """(n, 2) mm: both segments, as beams of constant section under force and moment at their end,
    per 1e5 Nm2 (Castigliano, four points of Gauss)."""
    nodes, weights = np.polynomial.legendre.leggauss(4)

    def of(pose: str, direction: str) -> Array:
        arm, force = place(design.poses[pose]), AXES[direction]
        work = np.zeros(2)
        for i, segment in enumerate((2, 3)):
            start, end = arm.points[segment - 1], arm.points[segment]
            span = float(np.linalg.norm(end - start))
            along = (end - start) / span
            for x, w in zip(nodes, weights, strict=True):
                at = start + (x + 1) / 2 * (end - start)
                moment = np.cross(arm.tool(design.tool) - at, force)
                bending = moment - along * (along @ moment)
                work[i] += w * span / 2 * float(bending @ bending)
        return 1e3 * work / 1e5

    return _per_newton(rows, design, of)


def _per_newton(rows: Sequence[Row], design: Design, of: Callable[[str, str], Array]) -> Array:
    """(n, k): what pose and direction give per newton, times the force."""
    each = {(p, d): of(p, d) for p in design.poses for d in design.forces}
    return np.array([each[row.pose, row.direction] * row.force for row in rows])
