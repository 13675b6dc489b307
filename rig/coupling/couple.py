"""`rig couple`: the single arm and the coupled pair of a model file, side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification import workspace
from identification.arm import along, invert_compliance
from identification.coupling import Kind, State, coupled, decide, load_axes, on_axes
from identification.coupling import base_distance as distance_of
from identification.when import Schedule
from identification.workspace import Workspace
from rig import schemas
from rig.arrays import Array
from rig.coupling import coupling_task
from rig.coupling.coupling_path import read_path, run_path
from rig.digits import brief
from rig.errors import InputError
from rig.models.model import ArmModel, CouplingSpec, load_model
from rig.units import MM_PER_M, N_PER_MM

_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Decision:
    """What the rule says of one requirement, N/m."""

    direction: str
    required: float
    single: float
    coupled: float
    state: State


@dataclass(frozen=True, eq=False)
class CouplingResult:
    """Stiffness N/m (3,): `single` along the base axes, `pair[kind]` along the load axes, with
    standard uncertainties of the same shape."""

    model: ArmModel
    spec: CouplingSpec
    workspaces: tuple[Workspace, ...]
    single: Array
    u_single: Array
    pair: dict[str, Array]
    u_pair: dict[str, Array]
    decisions: tuple[Decision, ...]
    schedule: Schedule | None
    notes: tuple[str, ...]
    placement: coupling_task.TaskResult | None = None  # where it was asked for

    def to_json(self) -> dict[str, Any]:
        """`rig.coupling/1`, with further keys."""
        first, *others = self.workspaces
        out: dict[str, Any] = {
            "schema": schemas.COUPLING,
            "model": self.model.name,
            "load_axes": self.spec.load_axes,
            "kind": self.spec.described,
            "workspace_m3": _volumes(first),
            "workspace_others_m3": [_volumes(w) for w in others],
            "single_N_per_mm": _per_axis(self.single * N_PER_MM),
            "single_standard_uncertainty_N_per_mm": _per_axis(self.u_single * N_PER_MM),
            "coupled_N_per_mm": {k: _per_axis(v * N_PER_MM) for k, v in self.pair.items()},
            "coupled_standard_uncertainty_N_per_mm": {
                k: _per_axis(v * N_PER_MM) for k, v in self.u_pair.items()
            },
            "gain": {k: _per_axis(v / self.single) for k, v in self.pair.items()},
            "decision": [
                {
                    "required_N_per_mm": d.required * N_PER_MM,
                    "direction": d.direction,
                    "state": d.state,
                }
                for d in self.decisions
            ],
            "published": _published(self),
            "notes": list(self.notes),
        }
        # a rigid or point model states no beam: nothing compliant can be computed from it
        out["coupled_N_per_mm"].setdefault("compliant", None)
        out["gain"].setdefault("compliant", None)
        if self.schedule is not None:
            out["schedule"] = [
                {"from_s": i.start, "to_s": i.end, "state": i.state}
                for i in self.schedule.intervals()
            ]
        if self.placement is not None:
            out["placement"] = self.placement.to_json()
        return out

    def to_text(self) -> str:
        """Tables for a terminal."""
        from rig.coupling.couple_text import text

        return text(self) if self.placement is None else f"{text(self)}\n{self.placement.to_text()}"


def couple(
    model: str | Path,
    *,
    samples: int = 1_000_000,
    seed: int = 0,
    path: str | Path | None = None,
    dead_band: float = 0.0,
    best_placement: bool = False,
    progress: Callable[[float], None] | None = None,
) -> CouplingResult:
    """Workspace, stiffness and decisions of a model file; along `path` (CSV) the schedule, and the
    best placement of the second arm where they are asked for.

    samples: joint positions of the Monte Carlo workspace, 0 leaves it out. Raises InputError.
    """
    read = load_model(model)
    spec = _spec(read)
    if read.effects:
        from rig.diagnosis.gap_forms import effects_of

        effects_of(read)  # left out here, but refused where nobody could read them
    C = _regular_compliance(read)
    kinds = _kinds(spec)
    single = on_axes(C, np.eye(3))
    pair = {name: _pair(C, spec, kind, half) for name, kind, half in kinds}
    u_single, u_pair = _uncertainty(read, spec, kinds)
    track = read_path(Path(path)) if path is not None else None
    if not 0 <= dead_band < 1:
        raise InputError(f"--dead-band is {dead_band:g}; wanted: at least 0 and below 1.")
    placement = coupling_task.best_place(read) if best_placement else None
    workspaces = _workspaces(read, spec, samples, seed, progress)
    meet = _can_meet(read, spec, workspaces)
    return CouplingResult(
        model=read,
        spec=spec,
        workspaces=workspaces,
        single=single,
        u_single=u_single,
        pair=pair,
        u_pair=u_pair,
        decisions=_decisions(read, C, spec, meet=meet),
        schedule=run_path(read, spec, track, dead_band, meet=meet) if track is not None else None,
        notes=(*_notes(read, spec), *_apart(spec, meet=meet), *_sparse(workspaces)),
        placement=placement,
    )


def _spec(model: ArmModel) -> CouplingSpec:
    if model.coupling is None:
        raise InputError(
            f"{model.name}: no `coupling` block; rig couple needs base_distance_mm, beta_deg, "
            "load_axes and kind. data/models/F1.yaml shows one."
        )
    return model.coupling


def _regular_compliance(model: ArmModel) -> Array:
    C = model.compliance()
    try:
        invert_compliance(C)
    except ValueError as error:
        degrees = ", ".join(f"{v:.4g}" for v in np.rad2deg(model.q))
        raise InputError(
            f"{model.pose_at}: pose: ({degrees}) deg: {error}. Give one in which the arm is "
            "neither stretched out nor folded (UR arms: with q5 away from 0 and 180 deg)."
        ) from error
    return C


def _kinds(spec: CouplingSpec) -> list[tuple[str, Kind, Array | None]]:
    kinds: list[tuple[str, Kind, Array | None]] = [("rigid", "rigid", None)]
    if spec.half is not None:
        kinds.append(("compliant", "compliant", spec.half))
    kinds.append(("point", "point", None))
    return kinds


def _pair(C: Array, spec: CouplingSpec, kind: Kind, half: Array | None) -> Array:
    return on_axes(coupled(C, spec.beta, kind, half), load_axes(spec.beta, spec.load_axes))


def _uncertainty(
    model: ArmModel, spec: CouplingSpec, kinds: list[tuple[str, Kind, Array | None]]
) -> tuple[Array, dict[str, Array]]:
    """First order in the logarithms of the joint stiffnesses (GUM), by central differences."""
    arm, step = model.arm, 1e-4
    variances = {name: np.zeros(3) for name in ["single", *(k[0] for k in kinds)]}
    for i, sd in enumerate(arm.joint_stiffness_relative_sd):
        sides = []
        for sign in (1, -1):
            factor = np.ones(6)
            factor[i] += sign * step
            varied = arm.with_stiffness(arm.joint_stiffness * factor)
            C = varied.compliance(model.q, model.tool, links=model.links, base=model.mounting)
            found = {"single": on_axes(C, np.eye(3))}
            found |= {name: _pair(C, spec, kind, half) for name, kind, half in kinds}
            sides.append(found)
        for name in variances:
            variances[name] += ((sides[0][name] - sides[1][name]) / (2 * step) * sd) ** 2
    roots = {name: np.sqrt(total) for name, total in variances.items()}
    return roots.pop("single"), roots


def _can_meet(model: ArmModel, spec: CouplingSpec, workspaces: Sequence[Workspace]) -> bool:
    """Whether the tools of both arms reach some point between the bases. The workspaces are the
    flanges'; a tool adds its length on either side."""
    if any(w.coupled > 0 for w in workspaces):
        return True
    tool = float(np.linalg.norm(model.tool[:3, 3]))
    farthest = model.reach if model.reach is not None else workspace.outermost(model.arm)
    return tool > 0 and spec.base_distance < 2 * (farthest + tool)


def _decisions(
    model: ArmModel, C: Array, spec: CouplingSpec, *, meet: bool
) -> tuple[Decision, ...]:
    """Components of a requirement count in the base axes for the single arm, in the load axes for
    the pair, as its table does. Arms that can't meet can't couple."""
    kind = next(k for k in _kinds(spec) if k[0] == spec.kind)
    pair_compliance = coupled(C, spec.beta, kind[1], kind[2])
    axes, out = load_axes(spec.beta, spec.load_axes), []
    for need in model.required:
        single = float(along(C, need.direction))
        pair = float(along(pair_compliance, axes @ np.array(need.direction)))
        state = decide(need.stiffness, single, pair if meet else 0.0)
        out.append(Decision(need.name, need.stiffness, single, pair, state))
    return tuple(out)


def _workspaces(
    model: ArmModel,
    spec: CouplingSpec,
    samples: int,
    seed: int,
    progress: Callable[[float], None] | None,
) -> tuple[Workspace, ...]:
    out = []
    reach = model.reach
    if reach is not None:
        out.append(workspace.analytic(reach, spec.base_distance))
    if samples > 0 or not out:
        out.append(
            workspace.monte_carlo(
                model.arm, spec.base_distance, samples or 300_000, seed, progress=progress
            )
        )
    return tuple(out)


def _notes(model: ArmModel, spec: CouplingSpec) -> list[str]:
    notes = [*([model.note] if model.note else []), *model.doubts]
    node = model.arm.fk(model.q, model.tool)[:3, 3]
    distance = distance_of(node, spec.beta)
    if abs(distance - spec.base_distance) > 0.5e-3:
        notes.append(
            f"With this pose and angle the bases stand {distance * MM_PER_M:.1f} mm apart, not "
            f"{spec.base_distance * MM_PER_M:g} mm: the latter counts for the workspace, the pose "
            "for the stiffness."
        )
    if model.effects:
        notes.append("The model's effects are left out: stiffness here is that of the springs.")
    if spec.half is None:
        notes.append("No beam in the model: compliant coupling is not computed.")
    return notes


def _apart(spec: CouplingSpec, *, meet: bool) -> list[str]:
    if meet:
        return []
    distance = brief(spec.base_distance * MM_PER_M)
    return [
        f"base_distance_mm: at {distance} mm the arms can't meet, so what one arm does not reach "
        "is infeasible. The coupled stiffness is that of the pose, as if they met."
    ]


def _sparse(workspaces: Sequence[Workspace]) -> list[str]:
    """Where a Monte Carlo workspace rests on too few samples."""
    return [
        f"The Monte Carlo workspace rests on few samples: {100 * w.thin:.0f} % of the single "
        "volume is in cells that one sample alone fell into. Up to about as much may be missing in "
        "cells that none found, and more of the coupled volume. Give --samples 1000000 or more."
        for w in workspaces
        if w.thin > _THIN
    ]


_THIN = 0.03


def _published(result: CouplingResult) -> list[dict[str, Any]]:
    from rig.coupling.couple_text import compare, is_published_setup

    if not is_published_setup(result):
        return []
    return [
        {
            "quantity": row.quantity,
            "unit": row.unit,
            "stated": row.stated,
            "follows": row.follows,
            "model": row.model,
        }
        for row in compare(result)
    ]


def _volumes(w: Workspace) -> dict[str, Any]:
    return {
        "single": w.single,
        "coupled": w.coupled,
        "ratio": w.ratio,
        "definition": w.definition,
        "hit_once_ratio": w.thin,
    }


def _per_axis(values: Array) -> dict[str, float]:
    return {axis: float(v) for axis, v in zip(_AXES, values, strict=True)}
