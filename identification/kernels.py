"""Millions of poses at once: forward kinematics, Jacobian and compliance in one compiled pass.

The same formulas as `Arm.compliance` with stiff links; numba is imported and compiled on use.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.arm import JOINTS, Arm, joint_positions, tool_transform

Array = NDArray[np.float64]
_LANES = 64  # poses a block: its work stays in the first-level cache


def compliance_many(
    arm: Arm, q: ArrayLike, tool: ArrayLike | None = None, out: Array | None = None
) -> Array:
    """`arm.compliance(q, tool)` (n, 6, 6) for q (n, 6) rad, on all cores; into `out` if given.

    Raises ValueError for bad shapes or an arm without joint stiffness, ImportError without numba.
    """
    angles = np.ascontiguousarray(joint_positions(q))
    if angles.ndim != 2:
        raise ValueError(f"joint positions have shape {angles.shape}; (n, 6) is wanted")
    if not np.isfinite(arm.joint_stiffness).all():
        raise ValueError(f"the model of {arm.name} has no joint stiffness for all six joints")
    offset = np.zeros(3) if tool is None else tool_transform(tool)[:3, 3].copy()
    shape = (angles.shape[0], JOINTS, JOINTS)
    out = np.empty(shape) if out is None else out
    if out.shape != shape or out.dtype != np.float64:
        raise ValueError(f"out has shape {out.shape}; {shape} of float64 is wanted")
    fixed = np.stack([arm.d, arm.a, np.cos(arm.alpha), np.sin(arm.alpha)])
    _kernel()(angles, fixed, 1.0 / arm.joint_stiffness, offset, out)
    return out


@cache
def _kernel() -> Callable[..., None]:
    import numba

    compiled: Any = numba.njit(parallel=True, fastmath=False, error_model="numpy")(_loop(numba))
    return compiled  # type: ignore[no-any-return]


def _loop(numba: Any) -> Callable[..., None]:
    prange = numba.prange

    def loop(q: Array, fixed: Array, soft: Array, tool: Array, out: Array) -> None:
        blocks = (q.shape[0] + _LANES - 1) // _LANES
        for block in prange(blocks):
            first = block * _LANES
            count = min(_LANES, q.shape[0] - first)
            # structure of arrays: the innermost loops run over poses and become vector code
            c, s = np.empty((6, _LANES)), np.empty((6, _LANES))
            for lane in range(count):
                for i in range(6):
                    c[i, lane], s[i, lane] = cos(q[first + lane, i]), sin(q[first + lane, i])
            z, p = np.empty((6, 3, _LANES)), np.empty((6, 3, _LANES))
            tip = np.empty((3, _LANES))
            J = np.empty((6, 6, _LANES))
            for n in range(count):
                xx, xy, xz = 1.0, 0.0, 0.0
                yx, yy, yz = 0.0, 1.0, 0.0
                zx, zy, zz = 0.0, 0.0, 1.0
                px, py, pz = 0.0, 0.0, 0.0
                for i in range(6):
                    z[i, 0, n], z[i, 1, n], z[i, 2, n] = zx, zy, zz
                    p[i, 0, n], p[i, 1, n], p[i, 2, n] = px, py, pz
                    d, a, ca, sa = fixed[0, i], fixed[1, i], fixed[2, i], fixed[3, i]
                    C, S = c[i, n], s[i, n]
                    ux, uy, uz = C * xx + S * yx, C * xy + S * yy, C * xz + S * yz
                    vx, vy, vz = C * yx - S * xx, C * yy - S * xy, C * yz - S * xz
                    px, py, pz = px + d * zx + a * ux, py + d * zy + a * uy, pz + d * zz + a * uz
                    xx, xy, xz = ux, uy, uz
                    yx, yy, yz = ca * vx + sa * zx, ca * vy + sa * zy, ca * vz + sa * zz
                    zx, zy, zz = ca * zx - sa * vx, ca * zy - sa * vy, ca * zz - sa * vz
                tip[0, n] = px + tool[0] * xx + tool[1] * yx + tool[2] * zx
                tip[1, n] = py + tool[0] * xy + tool[1] * yy + tool[2] * zy
                tip[2, n] = pz + tool[0] * xz + tool[1] * yz + tool[2] * zz
            for i in range(6):
                for n in range(count):
                    rx, ry, rz = (
                        tip[0, n] - p[i, 0, n],
                        tip[1, n] - p[i, 1, n],
                        tip[2, n] - p[i, 2, n],
                    )
                    J[i, 0, n] = z[i, 1, n] * rz - z[i, 2, n] * ry
                    J[i, 1, n] = z[i, 2, n] * rx - z[i, 0, n] * rz
                    J[i, 2, n] = z[i, 0, n] * ry - z[i, 1, n] * rx
                    J[i, 3, n], J[i, 4, n], J[i, 5, n] = z[i, 0, n], z[i, 1, n], z[i, 2, n]
            k0, k1, k2, k3, k4, k5 = soft[0], soft[1], soft[2], soft[3], soft[4], soft[5]
            for r in range(6):
                for k in range(r, 6):
                    for n in range(count):
                        value = (
                            k0 * J[0, r, n] * J[0, k, n]
                            + k1 * J[1, r, n] * J[1, k, n]
                            + k2 * J[2, r, n] * J[2, k, n]
                            + k3 * J[3, r, n] * J[3, k, n]
                            + k4 * J[4, r, n] * J[4, k, n]
                            + k5 * J[5, r, n] * J[5, k, n]
                        )
                        out[first + n, r, k] = value
                        out[first + n, k, r] = value

    return loop
