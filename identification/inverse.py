"""Closed-form inverse kinematics of arms built like the UR: axes 2 to 4 parallel.

The wrist centre gives q1 (two shoulders), the flange's axis q5 (two wrists), the rest is a planar
arm of two links (two elbows): at most 2 x 2 x 2 = 8 branches. Derived after Hawkins, "Analytic
inverse kinematics for the Universal Robots UR-5/UR-10 arms" (Georgia Tech, 2013).
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array

if TYPE_CHECKING:
    from identification.arm import Arm


# Names of the eight branches, in the order of `solve`.
BRANCHES: tuple[str, ...] = tuple(
    " ".join(words)
    for words in product(("left", "right"), ("wrist+", "wrist-"), ("elbow+", "elbow-"))
)
# Rounding carries a pose at the rim of the workspace just beyond it; so far it still counts as in.
_RIM = 1e-9
# Below this |sin q5| axis 6 is parallel to axes 2 to 4, and q6 is free.
_WRIST_SINGULAR = 1e-9


def solve(arm: Arm, T: ArrayLike, q6: float = 0.0) -> Array:
    """Joint positions (..., 8, 6) rad in [-pi, pi) of flange poses T (..., 4, 4).

    Order of the branches: `BRANCHES`; "left"/"right" is the sign of the shoulder's root, "wrist"
    the sign of q5, "elbow" that of q3. A branch that does not reach the pose is NaN throughout.
    Where axis 6 is parallel to axes 2 to 4, q6 is free and taken as given.
    Raises ValueError when the arm is not built like the UR, or T is no rigid motion.
    """
    from identification.arm import tool_transform

    _check_structure(arm)
    pose = tool_transform(T)
    out = np.empty((*pose.shape[:-2], 8, 6))
    signs = np.array(list(product((1.0, -1.0), repeat=3)))
    with np.errstate(invalid="ignore", divide="ignore"):
        for branch, sign in enumerate(signs):
            out[..., branch, :] = _branch(arm, pose, q6, sign)
    # one joint without a solution makes the whole branch none
    out[np.isnan(out).any(axis=-1)] = np.nan
    return (out + np.pi) % (2 * np.pi) - np.pi


def solutions(arm: Arm, T: ArrayLike, q6: float = 0.0) -> dict[str, Array]:
    """Branches (name -> (6,) rad) that reach one pose (4, 4), within the joint limits."""
    found = solve(arm, T, q6)
    if found.ndim != 2:
        raise ValueError("solutions() takes one pose; use solve() for many")
    return {
        name: q
        for name, q in zip(BRANCHES, found, strict=True)
        if np.isfinite(q).all() and (arm.q_min <= q).all() and (q <= arm.q_max).all()
    }


def nearest(arm: Arm, T: ArrayLike, q: ArrayLike) -> Array:
    """The solution (6,) of one pose that is nearest to q (6,), whole turns taken off.

    Raises ValueError when the pose is out of reach.
    """
    near = np.asarray(q, dtype=float)
    found = solve(arm, T, float(near[5]))
    found = found + 2 * np.pi * np.round((near - found) / (2 * np.pi))
    distance = np.linalg.norm(found - near, axis=-1)
    if np.isnan(distance).all():
        raise ValueError(f"{arm.name} does not reach the pose at {_place(np.asarray(T))} m")
    return np.asarray(found[np.nanargmin(distance)])


def tool_pose(position: Array, direction: Array, turn: float = 0.0) -> Array:
    """Tool pose (4, 4): z axis along the unit vector `direction`; x axis as near as possible to
    the base's x axis (to its y axis where the tool points along x), then turned about z by `turn`.

    Raises ValueError when `direction` is no unit vector.
    """
    from identification.arm import unit_vector

    z = unit_vector(direction)
    wish = np.eye(3)[1 if abs(z[0]) > 0.99 else 0]
    x = wish - (wish @ z) * z
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    T = np.eye(4)
    c, s = np.cos(turn), np.sin(turn)
    T[:3, :3] = np.column_stack([c * x + s * y, c * y - s * x, z])
    T[:3, 3] = position
    return T


def _branch(arm: Arm, T: Array, q6: float, signs: Array) -> Array:
    """One branch, (..., 6); NaN where it does not exist."""
    shoulder, wrist, elbow = signs
    d1, d4, d5, d6 = arm.d[0], arm.d[3], arm.d[4], arm.d[5]
    x, y, z, p = T[..., :3, 0], T[..., :3, 1], T[..., :3, 2], T[..., :3, 3]
    centre = p - d6 * z
    # q1: the plane of the arm stands d4 beside axis 1
    rho = np.hypot(centre[..., 0], centre[..., 1])
    q1 = np.arctan2(centre[..., 1], centre[..., 0]) + shoulder * _arccos(d4 / rho) + np.pi / 2
    s1, c1 = np.sin(q1), np.cos(q1)
    normal = np.stack([s1, -c1, np.zeros_like(s1)], axis=-1)  # axes 2, 3, 4
    # q5: angle between flange axis and that normal; from both sine and cosine, so that it stays
    # exact near 0 and pi, where the cosine alone loses half the digits
    cos5 = (z * normal).sum(-1)
    sin5_squared = (x * normal).sum(-1) ** 2 + (y * normal).sum(-1) ** 2
    sin5 = wrist * np.sqrt(sin5_squared)
    q5 = np.arctan2(sin5, cos5)
    q6_found = np.arctan2(-(y * normal).sum(-1) * wrist, (x * normal).sum(-1) * wrist)
    q6_found = np.where(np.abs(sin5) < _WRIST_SINGULAR, q6, q6_found)
    # planar arm: axis 5 leaves the sum q2 + q3 + q4, and the point where axis 4 stands
    s6, c6 = np.sin(q6_found)[..., None], np.cos(q6_found)[..., None]
    s5, c5 = np.sin(q5)[..., None], np.cos(q5)[..., None]
    x4 = c5 * (c6 * x - s6 * y) - s5 * z
    z4 = -(s6 * x + c6 * y)
    forward = np.stack([c1, s1, np.zeros_like(s1)], axis=-1)
    q234 = np.arctan2(x4[..., 2], (x4 * forward).sum(-1))
    point = centre - d5 * z4
    u, v = (point * forward).sum(-1), point[..., 2] - d1
    q2, q3 = _planar(u, v, arm.a[1], arm.a[2], elbow)
    return np.stack([q1, q2, q3, q234 - q2 - q3, q5, q6_found], axis=-1)


def _planar(u: Array, v: Array, a2: float, a3: float, elbow: float) -> tuple[Array, Array]:
    q3 = elbow * _arccos((u * u + v * v - a2 * a2 - a3 * a3) / (2 * a2 * a3))
    q2 = np.arctan2(v, u) - np.arctan2(a3 * np.sin(q3), a2 + a3 * np.cos(q3))
    return q2, q3


def _arccos(value: Array) -> Array:
    """arccos, with what rounding carried past +-1 taken as +-1; NaN beyond."""
    inside = np.abs(value) <= 1 + _RIM
    return np.where(inside, np.arccos(np.clip(value, -1, 1)), np.nan)


def _check_structure(arm: Arm) -> None:
    quarter = np.pi / 2
    alpha = np.array([quarter, 0, 0, quarter, -quarter, 0])
    built = (
        np.allclose(arm.alpha, alpha, atol=1e-12)
        and not arm.a[[0, 3, 4, 5]].any()
        and not arm.d[[1, 2]].any()
        and arm.a[[1, 2]].all()
    )
    if not built:
        raise ValueError(
            f"the closed form covers arms built like the UR (alpha = pi/2, 0, 0, pi/2, -pi/2, 0; "
            f"only a2, a3, d1, d4, d5, d6 not zero); {arm.name} is not"
        )


def _place(T: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in T[:3, 3])
