"""An arm of springs that shares no code with the identification: screws instead of DH matrices,
deflection found by iterating the balance of torques in the displaced pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# UR10e with all joints at zero: a point on each axis, its direction, and the flange.
_POINTS = np.array(
    [
        [0, 0, 0],
        [0, 0, 0.1807],
        [-0.6127, 0, 0.1807],
        [-1.18425, 0, 0.1807],
        [-1.18425, -0.17415, 0.1807],
        [-1.18425, -0.17415, 0.06085],
    ]
)
_AXES = np.array([[0, 0, 1], [0, -1, 0], [0, -1, 0], [0, -1, 0], [0, 0, -1], [0, -1, 0]], float)
_FLANGE = np.array([-1.18425, -0.2907, 0.06085])
_FLANGE_R = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def _turn(axis: Array, angle: float) -> Array:
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def place(q: Array, tool: Array) -> tuple[Array, Array, Array]:
    """Tool point (3,), axes (6, 3) and points on them (6, 3) in the base frame."""
    R, p = np.eye(3), np.zeros(3)
    axes, points = np.zeros((6, 3)), np.zeros((6, 3))
    for i in range(6):
        axes[i], points[i] = R @ _AXES[i], p + R @ _POINTS[i]
        turn = _turn(_AXES[i], q[i])
        p = p + R @ (_POINTS[i] - turn @ _POINTS[i])
        R = R @ turn
    return p + R @ (_FLANGE + _FLANGE_R @ tool), axes, points


def deflect(q: Array, stiffness: Array, force: Array, tool: Array) -> tuple[Array, Array]:
    """Displacement (3,) of the tool and turning (6,) of the joints under a force, base frame."""
    start = place(q, tool)[0]
    turned = np.zeros(6)
    for _ in range(30):
        tip, axes, points = place(q + turned, tool)
        torque = np.einsum("ij,ij->i", axes, np.cross(tip - points, force))
        before, turned = turned, torque / stiffness
        if np.abs(turned - before).max() < 1e-12:
            break
    return place(q + turned, tool)[0] - start, turned
