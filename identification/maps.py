"""Stiffness over the workspace, and the best place for two arms that share a task.

A cell of a map is a tool position with the tool's orientation given. The arm reaches it in up to
eight branches; a map shows one of them, or the stiffest. Self-collision and obstacles are not part
of the model: a cell that is reached here need not be free.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.arm import Arm, along, unit_vector
from identification.arrays import Array
from identification.coupling import Kind, coupled, load_axes
from identification.elastic import Beam
from identification.inverse import BRANCHES, solve, tool_pose

_ROUNDS = 4  # of the search around the best cell of a grid
_BLOCK = 5_000  # cells at once: eight branches of 6 x 6 each, a few MB
# Smallest singular value of the Jacobian (lengths by 1 m) that still counts as away from
# singularities: nearer, joints race, and joint springs alone promise a stiffness that links deny.
LEAST_SINGULAR = 0.08


@dataclass(frozen=True, eq=False)
class Stance:
    """How the tool is held in every cell: `direction` (3,) of its z axis in the base frame, turned
    by `turn` rad about it; `tool` flange_T_tcp (4, 4). branch: one of BRANCHES, None: the stiffest
    along the load. links, mounting (6, 6): what bends besides the joints, as in `Arm.compliance`.
    """

    direction: Array
    tool: Array
    turn: float = 0.0
    branch: str | None = None
    links: tuple[Beam, ...] = ()
    mounting: Array | None = None

    def __post_init__(self) -> None:
        unit_vector(self.direction)
        if self.branch is not None and self.branch not in BRANCHES:
            known = ", ".join(BRANCHES)
            raise ValueError(f'"{self.branch}" is no branch; allowed: {known}')


@dataclass(frozen=True, eq=False)
class Coupling:
    """Two arms at the cell: beta rad, kind and half as in `coupling.coupled`."""

    beta: float
    kind: Kind = "rigid"
    half: Array | None = None


@dataclass(frozen=True, eq=False)
class Cells:
    """Of every cell (...): stiffness N/m along the load, q (..., 6) rad and `branch`, index into
    BRANCHES; NaN and -1 where the arm does not reach."""

    stiffness: Array
    q: Array
    branch: NDArray[np.int64]


def stiffness_map(
    arm: Arm,
    points: ArrayLike,
    stance: Stance,
    direction: ArrayLike,
    coupling: Coupling | None = None,
) -> Cells:
    """Stiffness along `direction` (3,) in the base frame at tool positions (..., 3) m.

    Of one arm; with `coupling` of the pair, whose mirror plane then passes through each point.
    Raises ValueError for bad vectors or a wrong arm.
    """
    where = np.asarray(points, dtype=float)
    if where.shape[-1:] != (3,) or not np.isfinite(where).all():
        raise ValueError(f"tool positions have shape {where.shape}; (..., 3) m, finite, is wanted")
    n = unit_vector(direction)
    flat = where.reshape(-1, 3)
    k, q = np.full(len(flat), np.nan), np.full((len(flat), 6), np.nan)
    branch = np.full(len(flat), -1)
    for start in range(0, len(flat), _BLOCK):
        part = slice(start, start + _BLOCK)
        k[part], q[part], branch[part] = _block(arm, flat[part], stance, n, coupling)
    shape = where.shape[:-1]
    return Cells(k.reshape(shape), q.reshape(*shape, 6), branch.reshape(shape))


def _block(
    arm: Arm, points: Array, stance: Stance, n: Array, coupling: Coupling | None
) -> tuple[Array, Array, NDArray[np.int64]]:
    found = branches_at(arm, points, stance)
    k = np.full(found.shape[:-1], -np.inf)
    reached = np.isfinite(found[..., 0])
    C = _compliance(arm, found[reached], stance)
    if coupling is not None:
        C = coupled(C, coupling.beta, coupling.kind, coupling.half)
    k[reached] = along(C, n)
    best = np.argmax(k, axis=-1)
    rows = np.arange(len(points))
    none = ~reached[rows, best]
    return (
        np.where(none, np.nan, k[rows, best]),
        np.where(none[:, None], np.nan, found[rows, best]),
        np.where(none, -1, best),
    )


def branches_at(arm: Arm, points: Array, stance: Stance) -> Array:
    """Joint positions (n, 8, 6) rad that put the tool at points (n, 3) m; NaN where a branch does
    not exist, is not wanted, breaks a joint limit, or is singular."""
    T = np.tile(tool_pose(np.zeros(3), stance.direction, stance.turn), (len(points), 1, 1))
    T[:, :3, 3] = points
    found = solve(arm, T @ np.linalg.inv(stance.tool))
    if stance.branch is not None:
        found[:, [name != stance.branch for name in BRANCHES]] = np.nan
    with np.errstate(invalid="ignore"):
        found[((found < arm.q_min) | (found > arm.q_max)).any(axis=-1)] = np.nan
    reached = np.isfinite(found[..., 0])
    J = arm.jacobian(found[reached], stance.tool)
    # the smallest singular value, squared: half the time of a singular value decomposition
    far = np.linalg.eigvalsh(J @ np.swapaxes(J, -1, -2))[:, 0] >= LEAST_SINGULAR**2
    found[tuple(axis[~far] for axis in np.nonzero(reached))] = np.nan
    return found


def _compliance(arm: Arm, q: Array, stance: Stance) -> Array:
    return arm.compliance(q, stance.tool, links=stance.links, base=stance.mounting)


def branch_of(arm: Arm, q: Array) -> str:
    """The branch that q (6,) rad belongs to. Raises ValueError in poses where q6 is free."""
    found = solve(arm, arm.fk(q))
    apart = np.abs((found - q + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)
    apart = np.nan_to_num(apart, nan=np.inf)
    if apart.min() > 1e-6:
        raise ValueError("no branch gives the pose back: joint 6 is free in it (wrist stretched)")
    return BRANCHES[int(np.argmin(apart))]


# --- the best place ------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Need:
    """stiffness N/m that a task asks for along `direction` (3,), unit vector in the load axes."""

    direction: Array
    stiffness: float

    def __post_init__(self) -> None:
        unit_vector(self.direction)
        if not self.stiffness > 0:
            raise ValueError(f"{self.stiffness:g} N/m are asked for; it must be above 0 N/m")


@dataclass(frozen=True, eq=False)
class Task:
    """What both arms hold together: the node at `height` m on arm A's base x axis, the tool held
    as `stance` says, what is needed there, and how the flanges are joined. load_axes: what needs'
    directions count in: mirror (normal, tangent, z) or base (of arm A)."""

    height: float
    stance: Stance
    needs: tuple[Need, ...]
    kind: Kind = "rigid"
    half: Array | None = None
    load_axes: Literal["base", "mirror"] = "mirror"

    def __post_init__(self) -> None:
        if not self.needs:
            raise ValueError("a task asks for stiffness in at least one direction")


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the second base stands: base_distance m, beta rad; q (6,) rad and branch of arm A;
    stiffness (needs,) N/m; margin: the smallest of stiffness over need (at least 1: the task can be
    done). margins (distances, angles) of the grid, NaN where the arm does not reach."""

    base_distance: float
    beta: float
    q: Array
    branch: str
    stiffness: Array
    margin: float
    distances: Array
    betas: Array
    margins: Array

    @property
    def feasible(self) -> bool:
        """Whether every need is met."""
        return self.margin >= 1


def best_placement(arm: Arm, task: Task, distances: ArrayLike, betas: ArrayLike) -> Placement:
    """Base distance (m) and angle (rad) that meet the needs with the largest margin.

    The node lies on arm A's base x axis, so its radius is `distance / (2 cos beta)`. The whole
    grid is computed; then the best cell's neighbourhood is searched, and again, each time a quarter
    as wide. Raises ValueError when the arm reaches no cell, or for ranges that are none.
    """
    D, B = np.atleast_1d(np.asarray(distances, float)), np.atleast_1d(np.asarray(betas, float))
    if not ((D > 0).all() and (np.abs(B) < np.pi / 2).all()):
        raise ValueError("base distances must be above 0 m, and beta between -90 and 90 deg")
    margins, *_ = _margins(arm, task, D, B)
    if np.isnan(margins).all():
        raise ValueError(
            f"{arm.name} reaches the node at {task.height:g} m in none of the placements "
            f"(base distance {D.min():g} to {D.max():g} m)"
        )
    i, j = np.unravel_index(np.nanargmax(margins), margins.shape)
    best_D, best_B = float(D[i]), float(B[j])
    step_D, step_B = _spacing(D), _spacing(B)
    for _ in range(_ROUNDS):
        fine_D = np.clip(best_D + step_D * np.linspace(-1, 1, 9), D.min(), D.max())
        fine_B = np.clip(best_B + step_B * np.linspace(-1, 1, 9), B.min(), B.max())
        fine, *_ = _margins(arm, task, fine_D, fine_B)
        i, j = np.unravel_index(np.nanargmax(fine), fine.shape)
        best_D, best_B = float(fine_D[i]), float(fine_B[j])
        step_D, step_B = step_D / 4, step_B / 4
    margin, k, q, branch = _margins(arm, task, np.array([best_D]), np.array([best_B]))
    return Placement(
        best_D, best_B, q[0, 0], BRANCHES[branch[0, 0]], k[0, 0], float(margin[0, 0]), D, B, margins
    )


def _margins(
    arm: Arm, task: Task, D: Array, B: Array
) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """margin (D, B), stiffness (D, B, needs), q (D, B, 6) and branch of the best branch there."""
    radius = D[:, None] / (2 * np.cos(B))
    points = np.stack([radius, np.zeros_like(radius), np.full_like(radius, task.height)], axis=-1)
    found = branches_at(arm, points.reshape(-1, 3), task.stance).reshape(*radius.shape, 8, 6)
    k = np.full((*found.shape[:-1], len(task.needs)), np.nan)
    for j, beta in enumerate(B):
        here = np.isfinite(found[:, j, :, 0])
        C = _compliance(arm, found[:, j][here], task.stance)
        pair = coupled(C, float(beta), task.kind, task.half)
        axes = load_axes(float(beta), task.load_axes)
        for m, need in enumerate(task.needs):
            k[:, j, :, m][here] = along(pair, axes @ unit_vector(need.direction))
    share = (k / [need.stiffness for need in task.needs]).min(axis=-1)
    best = np.argmax(np.nan_to_num(share, nan=-1.0), axis=-1)
    at = best[..., None]
    return (
        np.take_along_axis(share, at, axis=-1)[..., 0],
        np.take_along_axis(k, at[..., None], axis=-2)[..., 0, :],
        np.take_along_axis(found, at[..., None], axis=-2)[..., 0, :],
        best,
    )


def _spacing(values: Array) -> float:
    return float(np.ptp(values) / (values.size - 1)) if values.size > 1 else 0.0
