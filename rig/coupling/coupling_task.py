"""`rig couple`: where the second arm should stand for the stiffness that a model asks for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.inverse import tool_pose
from identification.maps import Need, Placement, Stance, Task, best_placement
from rig import schemas
from rig.errors import InputError
from rig.models.model import ArmModel, CouplingSpec, load_model
from rig.units import MM_PER_M, N_PER_MM

_DISTANCES_MM = (800.0, 2400.0)
_BETAS_DEG = (-60.0, 60.0)
_GRID = (41, 41)


@dataclass(frozen=True, eq=False)
class TaskResult:
    """The best placement for the model's requirements, beside the one the model states.

    as_modelled: margin of the latter."""

    model: ArmModel
    spec: CouplingSpec
    task: Task
    best: Placement
    as_modelled: float
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """`rig.placement/1`."""
        best = self.best
        return {
            "schema": schemas.PLACEMENT,
            "model": self.model.name,
            "base_distance_mm": MM_PER_M * best.base_distance,
            "beta_deg": float(np.rad2deg(best.beta)),
            "angle_between_arms_deg": between_arms_deg(best.beta),
            "q_rad": [float(v) for v in best.q],
            "branch": best.branch,
            "margin": best.margin,
            "feasible": best.feasible,
            "margin_as_modelled": self.as_modelled,
            "stiffness": [
                {
                    "direction": need.name,
                    "required_N_per_mm": need.stiffness * N_PER_MM,
                    "reached_N_per_mm": float(k) * N_PER_MM,
                }
                for need, k in zip(self.model.required, best.stiffness, strict=True)
            ],
            "notes": list(self.notes),
        }

    def to_text(self) -> str:
        """The place, what it reaches, and how much there is to spare."""
        best = self.best
        beta = float(np.rad2deg(best.beta))
        lines = [
            f"Best place for the second arm: base distance {MM_PER_M * best.base_distance:.0f} mm, "
            f"beta = {beta:.1f} deg ({between_arms_deg(best.beta):.1f} deg between the arms)",
            "  arm A: q = ("
            + ", ".join(f"{v:.2f}" for v in np.rad2deg(best.q))
            + f") deg, branch {best.branch}",
        ]
        for need, k in zip(self.model.required, best.stiffness, strict=True):
            lines.append(
                f"  {need.name}: {need.stiffness * N_PER_MM:g} N/mm required, "
                f"{k * N_PER_MM:.1f} reached"
            )
        verdict = "the task can be done" if best.feasible else "no placement reaches the task"
        lines.append(f"  reached over required: {best.margin:.2f}; {verdict}")
        lines.append(
            f"  as modelled (beta = {np.rad2deg(self.spec.beta):g} deg): {self.as_modelled:.2f}"
        )
        return "\n".join([*lines, *(f"Note: {note}" for note in self.notes)])


def best_for(model: str | Path) -> TaskResult:
    """`best_place` for a model file. Raises InputError as `load_model` does, too."""
    return best_place(load_model(model))


def best_place(read: ArmModel) -> TaskResult:
    """Base distance and angle within the ranges above that meet the model's `required` best.

    Height of the node and how the tool is held are the model's; the branch is free.
    Raises InputError for models without requirements, or out of reach.
    """
    if read.coupling is None or not read.required:
        raise InputError(
            f"{read.name}: the best placement needs `coupling` (how the arms are joined) and "
            "`required` (direction and stiffness_N_per_mm). data/models/F1.yaml shows both."
        )
    spec = read.coupling
    task, azimuth = _task(read, spec)
    distances = np.linspace(*_DISTANCES_MM, _GRID[0]) / MM_PER_M
    betas = np.deg2rad(np.linspace(*_BETAS_DEG, _GRID[1]))
    try:
        best = best_placement(read.arm, task, distances, betas)
    except ValueError as error:
        raise InputError(f"{read.name}: {error}. Move the node nearer.") from error
    notes = _notes(read, best, azimuth)
    return TaskResult(read, spec, task, best, _as_modelled(read, spec), notes)


def _task(model: ArmModel, spec: CouplingSpec) -> tuple[Task, float]:
    """The model's node turned about axis 1 onto the base x axis, and by how much (rad).

    Turning about axis 1 changes nothing but names: the arm is the same all round.
    """
    T = model.arm.fk(model.q, model.tool)
    azimuth = float(np.arctan2(T[1, 3], T[0, 3]))
    c, s = np.cos(azimuth), np.sin(azimuth)
    R = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ T[:3, :3]
    level = tool_pose(np.zeros(3), R[:, 2])[:3, :3].T @ R
    turn = float(np.arctan2(level[1, 0], level[0, 0]))
    stance = Stance(R[:, 2], model.tool, turn, links=model.links, mounting=model.mounting)
    needs = tuple(Need(np.array(r.direction), r.stiffness) for r in model.required)
    return Task(float(T[2, 3]), stance, needs, spec.kind, spec.half, spec.load_axes), azimuth


def between_arms_deg(beta: float) -> float:
    """Angle that the base x axes of the two arms enclose, in degrees."""
    return 180.0 - 2.0 * abs(float(np.rad2deg(beta)))


def _as_modelled(model: ArmModel, spec: CouplingSpec) -> float:
    """Margin of the model's own pose and angle."""
    from identification.arm import along
    from identification.coupling import coupled, load_axes

    pair = coupled(model.compliance(), spec.beta, spec.kind, spec.half)
    axes = load_axes(spec.beta, spec.load_axes)
    return min(float(along(pair, axes @ r.direction)) / r.stiffness for r in model.required)


def _notes(model: ArmModel, best: Placement, azimuth: float) -> tuple[str, ...]:
    notes = [model.note] if model.note else []
    ends = ((best.base_distance, best.distances, "base distances"), (best.beta, best.betas, "beta"))
    for value, grid, name in ends:
        near = 0.5 * np.ptp(grid) / (grid.size - 1)
        if near > 0 and min(value - grid[0], grid[-1] - value) < near:
            notes.append(f"The best place lies at an end of the range of {name}.")
    if abs(azimuth) > 1e-3:
        notes.append(
            f"beta counts from the line from base to node, which the model's pose has at "
            f"{np.rad2deg(azimuth):.1f} deg to the base x axis."
        )
    if not model.links:
        notes.append("Links are taken as rigid; the larger the stiffness, the less that holds.")
    notes.append("Self-collision, obstacles and the partner's body are not part of the model.")
    return tuple(notes)
