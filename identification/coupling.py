"""Two arms that hold one node: the second is the mirror image of the first.

With the mirror plane's normal n (in the base's x-y plane, at angle beta to the base x axis) and
`S = diag(M, -M)`, `M = I - 2 n n^T`, the mirrored arm has the stiffness `S K S` at the node, and
the coupled pair `K + S K S`. In the mirror axes (n, t, z) S is diagonal with the signs below, so
the sum falls apart into a symmetric and an antisymmetric block, and the coupled compliance is half
the Schur complement of each. That needs no inverse of C as a whole and holds in singular poses too.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from identification.arm import along
from identification.arrays import Array

Kind = Literal["rigid", "point", "compliant"]
State = Literal["single", "couple", "infeasible"]

# How translation and rotation in (n, t, z) behave in the mirror: +1 stays, -1 turns round.
_SIGNS = np.array([-1, 1, 1, 1, -1, -1])


def mirror_axes(beta: float) -> Array:
    """Rotation (3, 3) whose columns are normal, tangent and z axis of the mirror, base frame."""
    c, s = np.cos(beta), np.sin(beta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def load_axes(beta: float, kind: str) -> Array:
    """Columns (3, 3), base frame: the axes that coupled loads act along; kind `mirror`: those of
    the mirror, else of the base."""
    return mirror_axes(beta) if kind == "mirror" else np.eye(3)


def mirror(beta: float) -> Array:
    """`S = diag(M, -M)` (6, 6) for twists and wrenches at a node in the mirror plane."""
    n = mirror_axes(beta)[:, 0]
    M = np.eye(3) - 2 * np.outer(n, n)
    S = np.zeros((6, 6))
    S[:3, :3], S[3:, 3:] = M, -M
    return S


def mirrored(C: Array, beta: float) -> Array:
    """Compliance (..., 6, 6) of the mirror image at the common node: `S C S`."""
    S = mirror(beta)
    return np.asarray(S @ C @ S)


def coupled(C: Array, beta: float, kind: Kind = "rigid", half: Array | None = None) -> Array:
    """Compliance of the coupled pair at the node, base frame: (..., 6, 6); point: (..., 3, 3).

    C (..., 6, 6): the single arm's compliance at the node. kind "rigid": flanges welded;
    "point": only the translations are tied; "compliant": `half` (6, 6), compliance of each arm's
    half of the connection in the mirror axes at the node (x along n), stands in series with it.
    Raises ValueError when `half` is missing or not wanted.
    """
    if (kind == "compliant") != (half is not None):
        raise ValueError('`half` belongs to the kind "compliant", and only to it')
    R = mirror_axes(beta)
    size = 3 if kind == "point" else 6
    turn = np.kron(np.eye(size // 3), R)
    own = turn.T @ C[..., :size, :size] @ turn
    if half is not None:
        own = own + half
    return np.asarray(turn @ _mirror_sum(own, _SIGNS[:size]) @ turn.T)


def parallel(first: Array, second: Array) -> Array:
    """Compliance of two arms, any two, welded at a node: `(C_A^-1 + C_B^-1)^-1`.

    Both (..., 6, 6) or (..., 3, 3) at the node in one frame; C_A + C_B must be regular.
    """
    out = first @ np.linalg.solve(first + second, second)
    return np.asarray((out + np.swapaxes(out, -1, -2)) / 2)


def on_axes(C: Array, axes: Array) -> Array:
    """Directional stiffness N/m (..., 3) along the columns of `axes` (3, 3)."""
    return np.stack([along(C, axes[:, i]) for i in range(3)], axis=-1)


def decide(required: float, single: float, coupled_stiffness: float) -> State:
    """The rule, all in N/m: couple above the single arm's stiffness, release at or below it;
    infeasible where even the coupled pair does not reach what is required."""
    if required <= single:
        return "single"
    return "couple" if required <= coupled_stiffness else "infeasible"


def base_distance(node: Array, beta: float) -> float:
    """Distance (m) between the two bases when the node (3,) lies in the mirror plane:
    `2 n . p`."""
    return float(2 * mirror_axes(beta)[:, 0] @ node)


def _mirror_sum(C: Array, signs: Array) -> Array:
    """`(C^-1 + S C^-1 S)^-1` for S = diag(signs): half the Schur complements of the two blocks."""
    out = np.zeros_like(C)
    for sign in (1, -1):
        this, other = np.flatnonzero(signs == sign), np.flatnonzero(signs == -sign)
        across = C[..., this[:, None], other]
        # pinv: a block without compliance couples nothing, and C is positive semi-definite
        inner = np.linalg.pinv(C[..., other[:, None], other], hermitian=True)
        block = C[..., this[:, None], this] - across @ inner @ np.swapaxes(across, -1, -2)
        out[..., this[:, None], this] = block / 2
    return out
