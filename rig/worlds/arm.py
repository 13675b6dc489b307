"""The UR10e of the simulated rigs, by products of exponentials.

At q = 0 every joint is a line in space: a direction and a point on it, read off the published
dimensions (d1, a2, a3, d4, d5, d6). A pose turns these lines one after the other,
`T(q) = exp(s1 q1) ... exp(s6 q6) M` (Brockett 1984), so no link frames and no chain of
Denavit-Hartenberg matrices is involved. Base frame, SI.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rig.arrays import Array

D1, A2, A3, D4, D5, D6 = 0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655
GRAVITY_M_PER_S2 = np.array([0.0, 0.0, -9.80665])

# Lines of the joints at q = 0: the arm lies stretched along -x, its plane normal is -y.
_AXES = np.array(
    [[0.0, 0, 1], [0, -1, 0], [0, -1, 0], [0, -1, 0], [0, 0, -1], [0, -1, 0]], dtype=np.float64
)
_POINTS = np.array(
    [
        [0.0, 0.0, 0.0],
        [0.0, 0.0, D1],
        [A2, 0.0, D1],
        [A2 + A3, 0.0, D1],
        [A2 + A3, -D4, D1],
        [A2 + A3, -D4, D1 - D5],
    ],
    dtype=np.float64,
)
_FLANGE_AXES = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # at q = 0: z of the flange is -y
_FLANGE_ORIGIN = np.array([A2 + A3, -D4 - D6, D1 - D5])

# Masses of the links [kg] and their centres at q = 0 [m], from the maker's table of the UR10e.
_MASSES_KG = np.array([7.369, 13.051, 3.989, 2.1, 1.98, 0.615])
_CENTRES = np.array(
    [
        [0.021, -0.027, D1],
        [A2 + 0.38, -0.158, D1],
        [A2 + A3 + 0.24, -0.068, D1],
        [A2 + A3, -D4 - 0.007, D1 - 0.018],
        [A2 + A3, -D4 - 0.018, D1 - D5 + 0.007],
        [A2 + A3, -D4 - D6 + 0.026, D1 - D5],
    ],
    dtype=np.float64,
)


@dataclass(frozen=True)
class Placement:
    """The arm in one pose.

    axes, points (6, 3): unit direction of every joint and a point on it; rotation (3, 3) and
    origin (3) of the flange; centres (6, 3) of mass of the links.
    """

    axes: Array
    points: Array
    rotation: Array
    origin: Array
    centres: Array

    def tool(self, tcp_m: Array) -> Array:
        """(3,) position of a point given in the flange frame."""
        return self.origin + self.rotation @ tcp_m

    def levers(self, at: Array) -> Array:
        """(6, 3): row i is the motion of point `at` (m) per radian of joint i.

        The torque that a force f at this point puts on joint i is row i times f.
        """
        return np.cross(self.axes, at - self.points)

    def gravity_torques(self) -> Array:
        """(6,) Nm that the weight of the links outboard of each joint puts on it."""
        torques = np.zeros(6)
        for joint in range(6):
            arms = self.centres[joint:] - self.points[joint]
            weights = _MASSES_KG[joint:, None] * GRAVITY_M_PER_S2
            torques[joint] = self.axes[joint] @ np.cross(arms, weights).sum(axis=0)
        return torques


def _skew(axis: Array) -> Array:
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


_SKEWS = np.stack([_skew(axis) for axis in _AXES])
_SKEWS_SQUARED = _SKEWS @ _SKEWS


def _motions(q: Array) -> tuple[Array, Array]:
    """Turns (n, 6, 3, 3) and shifts (n, 6, 3) of space when joint angles are q (n, 6) and each
    joint turns alone about its line at q = 0 (Rodrigues' formula)."""
    sine, versine = np.sin(q)[..., None, None], 1.0 - np.cos(q)[..., None, None]
    turns = np.eye(3) + sine * _SKEWS + versine * _SKEWS_SQUARED
    return turns, _POINTS - (turns @ _POINTS[..., None])[..., 0]


def place(q: Array) -> Placement:
    """The arm at joint angles q (6) rad."""
    rotation, shift = np.eye(3), np.zeros(3)
    axes, points, centres = np.empty((6, 3)), np.empty((6, 3)), np.empty((6, 3))
    turns, shifts = (motion[0] for motion in _motions(q[None]))
    for joint in range(6):
        axes[joint] = rotation @ _AXES[joint]
        points[joint] = rotation @ _POINTS[joint] + shift
        shift = shift + rotation @ shifts[joint]
        rotation = rotation @ turns[joint]
        centres[joint] = rotation @ _CENTRES[joint] + shift
    return Placement(
        axes, points, rotation @ _FLANGE_AXES, rotation @ _FLANGE_ORIGIN + shift, centres
    )


def tool_poses(q: Array, tcp_m: Array) -> Array:
    """(n, 6) position (m) and rotation vector (rad) of the tool for joint angles q (n, 6) rad."""
    turns, shifts = _motions(q)
    rotation, shift = turns[:, 0], shifts[:, 0]
    for joint in range(1, 6):
        shift = shift + (rotation @ shifts[:, joint, :, None])[..., 0]
        rotation = rotation @ turns[:, joint]
    position = shift + rotation @ (_FLANGE_ORIGIN + _FLANGE_AXES @ tcp_m)
    return np.hstack([position, _rotation_vectors(rotation @ _FLANGE_AXES)])


def _rotation_vectors(rotation: Array) -> Array:
    """(n, 3) axis times angle of rotations (n, 3, 3), angles within 0..pi.

    By way of the unit quaternion, whose largest component is taken from the diagonal: stays
    accurate near half turns, where a tool that points down always is (Shepperd 1978). So is scipy's
    `Rotation`, which takes up to three times as long, and a fifth of a second to be imported by
    worlds that need nothing else of scipy.
    """
    diagonal = np.einsum("nii->ni", rotation)
    trace = diagonal.sum(axis=1, keepdims=True)
    squares = np.hstack([1.0 + trace, 1.0 + 2.0 * diagonal - trace])  # four times q_w^2, q_x^2 ...
    best = squares.argmax(axis=1)
    r = rotation
    products = np.empty((len(r), 4, 4))  # four times every product of two components
    products[:, 0, 1] = r[:, 2, 1] - r[:, 1, 2]
    products[:, 0, 2] = r[:, 0, 2] - r[:, 2, 0]
    products[:, 0, 3] = r[:, 1, 0] - r[:, 0, 1]
    products[:, 1, 2] = r[:, 0, 1] + r[:, 1, 0]
    products[:, 1, 3] = r[:, 0, 2] + r[:, 2, 0]
    products[:, 2, 3] = r[:, 1, 2] + r[:, 2, 1]
    rows, columns = np.triu_indices(4, 1)
    products[:, columns, rows] = products[:, rows, columns]
    products[:, range(4), range(4)] = squares
    quaternion = products[np.arange(len(r)), best]
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    quaternion *= np.where(quaternion[:, :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(quaternion[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, quaternion[:, :1])
    # sin(a/2)/a tends to 1/2 without rotation
    scale = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)
    result: Array = quaternion[:, 1:] * scale
    return result
