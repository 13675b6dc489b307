"""Which poses and directions would tell most about the joints that are still uncertain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.arm import JOINTS, Arm, tool_point
from identification.arrays import Array
from identification.joints import Gains, JointFit
from identification.maps import LEAST_SINGULAR

# A: least sum of the relative standard uncertainties; D: least volume of the joint confidence
# region; E: least uncertainty of the worst-known combination of joints.
Criterion = Literal["A", "D", "E"]

_AXES = np.eye(3)
_LEAST_SHARE = 0.05  # a pose that may carry less of the plan's force is not worth mounting
_AXIS_NAMES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class Plan:
    """What the next measurement is like.

    force N: at most, lowered where joint torques or the laser's range ask for it; u_force N and
    u_displacement m: of one level; levels: force levels in all repetitions together; gains: of the
    instruments; torque_share: of the joint torque limits, own weight included; range m: of the
    laser; least_singular: smallest singular value of the Jacobian (lengths by 1 m) that still
    counts as away from singularities; least_radius, lowest, highest m: where the tool may be.
    """

    force: float = 100.0
    u_force: float = 0.1
    u_displacement: float = 2e-6
    levels: int = 30
    gains: Gains = Gains(0.005, 0.003)  # noqa: RUF009 - frozen
    tool: Array | None = None
    torque_share: float = 0.8
    range: float = 8e-3
    least_singular: float = LEAST_SINGULAR
    least_radius: float = 0.35
    lowest: float = 0.15
    highest: float = 1.3


@dataclass(frozen=True, eq=False)
class Proposal:
    """q (6,) rad, unit `direction` (3,), greatest force N; expected (6,): standard uncertainty of
    ln c after this and all earlier proposals; why: in words."""

    q: Array
    direction: Array
    axis: str
    force: float
    expected: Array
    why: str


def propose(
    arm: Arm,
    fit: JointFit,
    plan: Plan,
    count: int = 6,
    seed: int = 0,
    candidates: int = 3000,
    criterion: Criterion = "A",
) -> list[Proposal]:
    """Greedy choice among random poses in reach: each lowers what `criterion` measures on the
    covariance of ln c most (Atkinson, Donev, Tobias 2007).

    The expected uncertainties count the gains of the new set-up as shared by all proposals.
    Raises ValueError when no pose meets the plan's limits, or for an unknown criterion.
    """
    if criterion not in _CRITERIA:
        raise ValueError(f'criterion "{criterion}" is unknown; allowed: {", ".join(_CRITERIA)}')
    q, levers, force = _candidates(arm.with_stiffness(fit.stiffness), plan, seed, candidates)
    gains = np.diag([plan.gains.force**2, plan.gains.displacement**2])
    P = np.zeros((JOINTS + 2, JOINTS + 2))
    P[:JOINTS, :JOINTS] = fit.covariance
    P[JOINTS:, JOINTS:] = gains
    h, u = _predictions(levers, force, fit.stiffness, plan)
    usable = force >= _LEAST_SHARE * plan.force
    if not usable.any():
        raise ValueError(f"no pose of {arm.name} may carry a load within the plan's limits")
    u[~usable] = np.inf
    out: list[Proposal] = []
    for _ in range(count):
        Ph = h @ P
        gained = Ph / np.sqrt(u**2 + (Ph * h).sum(axis=-1))[:, None]
        left = np.sqrt(np.maximum(np.diag(P) - gained**2, 0.0))[:, :JOINTS]
        best = int(np.argmin(_CRITERIA[criterion](P[:JOINTS, :JOINTS], gained[:, :JOINTS])))
        before = np.sqrt(np.diag(P))[:JOINTS]
        P = P - np.outer(gained[best], gained[best])
        axis = best % 3
        out.append(
            Proposal(
                q=q[best // 3],
                direction=_AXES[axis],
                axis=_AXIS_NAMES[axis],
                force=float(force[best]),
                expected=left[best],
                why=_why(before, left[best]),
            )
        )
    return out


def _summed(P: Array, gained: Array) -> Array:
    """Sum of the standard uncertainties when `P - g g^T` is left, for each row g."""
    return np.asarray(np.sqrt(np.maximum(np.diag(P) - gained**2, 0.0)).sum(axis=-1))


def _volume(P: Array, gained: Array) -> Array:
    """`det(P - g g^T) / det P = 1 - g^T P^-1 g`."""
    return np.asarray(1.0 - np.einsum("mi,ij,mj->m", gained, np.linalg.inv(P), gained))


def _worst(P: Array, gained: Array) -> Array:
    """Largest eigenvalue of `P - g g^T`."""
    return np.asarray(np.linalg.eigvalsh(P - gained[:, :, None] * gained[:, None, :])[:, -1])


_CRITERIA = {"A": _summed, "D": _volume, "E": _worst}


def _predictions(levers: Array, force: Array, stiffness: Array, plan: Plan) -> tuple[Array, Array]:
    """Derivatives (m, 8) of ln s by ln c and the gains, and the standard uncertainty (m,) of ln s.

    A line through n evenly spaced levels up to F has the slope's variance 12 u^2 / (n F^2).
    """
    parts = levers**2 / stiffness
    s = parts.sum(axis=-1)
    h = np.concatenate([-parts / s[:, None], np.tile([-1.0, 1.0], (s.size, 1))], axis=-1)
    one = np.hypot(plan.u_displacement, s * plan.u_force)
    with np.errstate(divide="ignore"):
        return h, np.sqrt(12 / plan.levels) * one / (s * force)


_DRAWS = 40  # at the most, each of as many poses as are wanted


def _candidates(arm: Arm, plan: Plan, seed: int, count: int) -> tuple[Array, Array, Array]:
    """Poses (n, 6) that meet the limits; levers (3 n, 6) and forces (3 n,) along x, y, z."""
    rng = np.random.default_rng(seed)
    low, high = np.maximum(arm.q_min, -np.pi), np.minimum(arm.q_max, np.pi)
    q, J = np.empty((0, JOINTS)), np.empty((0, 6, JOINTS))
    for _ in range(_DRAWS):
        drawn = rng.uniform(low, high, (count, JOINTS))
        drawn = drawn[_allowed_places(arm, drawn, plan)]
        seen = arm.jacobian(drawn, plan.tool)
        keep = np.linalg.svd(seen, compute_uv=False)[:, -1] >= plan.least_singular
        q, J = np.concatenate([q, drawn[keep]]), np.concatenate([J, seen[keep]])
        if len(q) >= count:
            break
    q, J = q[:count], J[:count]
    if not len(q):
        raise ValueError(f"no pose of {arm.name} meets the limits of the plan; widen them")
    levers = J[:, :3, :].reshape(-1, JOINTS)
    spare = plan.torque_share * arm.torque_limit - np.abs(arm.gravity_torques(q))
    spare = np.repeat(np.maximum(spare, 0.0), 3, axis=0)
    with np.errstate(divide="ignore"):
        by_torque = np.min(spare / np.maximum(np.abs(levers), 1e-9), axis=-1)
        by_range = plan.range / (levers**2 / arm.joint_stiffness).sum(axis=-1)
    force = np.minimum(plan.force, np.minimum(by_torque, by_range))
    return q, levers, force


def _allowed_places(arm: Arm, q: Array, plan: Plan) -> NDArray[np.bool_]:
    """Tool, elbow and wrist above the table, the tool away from the arm's own column."""
    frames = arm.frames(q)
    x, y, height = tool_point(frames, plan.tool).T
    radius = np.hypot(x, y)
    joints_up = (frames[:, 2:, 2, 3] > plan.lowest).all(axis=-1)
    return np.asarray(
        joints_up & (height > plan.lowest) & (height < plan.highest) & (radius > plan.least_radius)
    )


def _why(before: Array, after: Array) -> str:
    joint = int(np.argmax(before - after))
    return (
        f"joint {joint + 1}: standard uncertainty {100 * before[joint]:.2g} % -> "
        f"{100 * after[joint]:.2g} %; sum over the joints {100 * before.sum():.3g} % -> "
        f"{100 * after.sum():.3g} %"
    )
