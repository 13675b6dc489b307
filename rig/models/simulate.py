"""`rig simulate`: the curves that a model predicts for a procedure.

Linear statics: stiff links (unless the model has segments), six torsional springs, a compliant
mounting where the model has one. Pose and point of load are the procedure's, not the model's.
Effects of the model (`rig diagnose --write-model`) follow the procedure's whole path: loading and
unloading, holds and rests, one repetition after the other. Those of the measured session alone
(drifts, jumps of the datum) are left out, and said: the next session has its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from identification.arm import along, tool_offset
from identification.gap.answer.forms import Form
from identification.uncertainty import TWO_SIDED
from rig import schemas
from rig.arrays import Array
from rig.diagnosis.gap_forms import effects_of
from rig.diagnosis.gap_keys import SEEN_TO
from rig.diagnosis.gap_path import left_out, predict
from rig.digits import number
from rig.errors import InputError
from rig.models.model import ArmModel, load_model, told_first
from rig.plan_margins import unit_warnings
from rig.protocol import MeasurementProtocol, Run, load_protocol
from rig.units import MM_PER_M, N_PER_MM

CSV_HEADER = "pose,direction,force_N,displacement_mm"
CSV_PATH = ",repetition,branch,step,session_s"


@dataclass(frozen=True, eq=False)
class PredictedCurve:
    """One pose and direction: force N (n,) from zero load up, displacement m (n,) along the
    direction. stiffness N/m (infinite where the arm does not give way along it) with its relative
    standard uncertainty, that of the joint stiffnesses: of the springs, effects left out.

    path: of a model with effects; force and displacement then follow all holds of all repetitions.
    """

    pose: str
    direction: str
    force: Array
    displacement: Array
    stiffness: float
    relative_u: float
    path: CurvePath | None = None


@dataclass(frozen=True, eq=False)
class CurvePath:
    """Of every hold of a curve (n,): repetition, branch, step, session s, and the displacement m
    of the springs alone."""

    repetition: tuple[int, ...]
    branch: tuple[str, ...]
    step: tuple[int, ...]
    session: Array
    springs: Array


@dataclass(frozen=True, eq=False)
class Simulation:
    """What a model predicts for a protocol."""

    model: str
    protocol: str
    title: str
    curves: tuple[PredictedCurve, ...]
    notes: tuple[str, ...]
    effects: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """`rig.simulation/1`."""
        return {
            "schema": schemas.SIMULATION,
            "model": self.model,
            "protocol": self.protocol,
            "effects": list(self.effects),
            "curves": [_curve_json(c) for c in self.curves],
            "notes": list(self.notes),
        }

    def to_csv(self) -> str:
        """Columns pose, direction, force_N, displacement_mm: what `rig diagnose --simulation`
        takes; of a model with effects also repetition, branch, step, session_s."""
        rows = [_csv_row(c, i) for c in self.curves for i in range(len(c.force))]
        further = CSV_PATH if any(c.path is not None for c in self.curves) else ""
        return "\n".join([CSV_HEADER + further, *rows]) + "\n"

    def to_text(self) -> str:
        """One line a curve, then its levels."""
        first, others = told_first(self.notes)
        lines = [*(f"{note}\n" for note in first), f"Predicted by {self.model} for: {self.title}"]
        if self.effects:
            lines.append(f"With the effects {', '.join(self.effects)}; k is that of the springs.")
        for c in self.curves:
            u = N_PER_MM * c.stiffness * c.relative_u
            k = f"{N_PER_MM * c.stiffness:.2f} N/mm (standard uncertainty {number(u, 2)} N/mm)"
            lines.append(
                f"\nPose {c.pose}, direction {c.direction}: "
                + (k if np.isfinite(c.stiffness) else "the arm does not give way along it")
            )
            lines += _levels(c) if c.path is None else _holds(c, c.path)
        return "\n".join([*lines, *(f"\nNote: {note}" for note in others)])


def simulate(model: str | Path, protocol: str | Path) -> Simulation:
    """The curves of every pose and direction that the protocol loads. Raises InputError."""
    read, procedure = load_model(model), load_protocol(Path(protocol))
    effects = effects_of(read)
    if read.arm.name not in (procedure.robot, "dh"):
        raise InputError(
            f"{read.name}: robot is {read.arm.name}, but {protocol} measures a {procedure.robot}. "
            "Give a model of the robot that the protocol names."
        )
    curves = tuple(_predict(read, procedure, run) for run in procedure.runs)
    lasting = effects.lasting
    notes = (*_notes(read, procedure, lasting), *left_out(effects.forms))
    if lasting:
        curves, more = _with_effects(read, lasting, procedure, curves)
        notes = (*notes, *more, *_farther(read, lasting, procedure))
    names = tuple(dict.fromkeys([*effects.contained, *(f.word for f in lasting)]))
    return Simulation(read.name, str(protocol), procedure.title, curves, notes, names)


def write_csv(simulation: Simulation, path: Path) -> None:
    """Writes `to_csv`; InputError if the folder refuses."""
    from rig.storage.files import in_place_of

    with in_place_of(path) as temporary:
        temporary.write_text(simulation.to_csv(), "utf-8")


def _predict(model: ArmModel, procedure: MeasurementProtocol, run: Run) -> PredictedCurve:
    force = np.array([0.0, *run.forces_N])
    compliance, relative_u = _compliance(model, procedure, run)
    return PredictedCurve(
        run.pose,
        run.direction,
        force,
        force * compliance,
        1.0 / compliance if compliance > 0 else float("inf"),
        relative_u,
    )


def _compliance(model: ArmModel, procedure: MeasurementProtocol, run: Run) -> tuple[float, float]:
    """m/N along the run's direction, and its relative standard uncertainty.

    `s = sum_j (J_nj^2 / c_j) + rest`, so each joint's share of s weights its relative sd (GUM).
    """
    pose = procedure.poses[run.pose]
    n = np.array(procedure.directions[run.direction])
    tool = tool_offset(np.array(pose.tcp_xyz_mm) / MM_PER_M)
    q = np.array(pose.q_rad)
    C = model.arm.compliance(q, tool, links=model.links, base=model.mounting)
    with np.errstate(divide="ignore"):
        s = float(1.0 / along(C, n))
    parts = (n @ model.arm.jacobian(q, tool)[:3]) ** 2 / model.arm.joint_stiffness
    sd = model.arm.joint_stiffness_relative_sd
    return s, float(np.linalg.norm(parts * sd) / s) if s > 0 else 0.0


def _with_effects(
    model: ArmModel,
    forms: tuple[Form, ...],
    procedure: MeasurementProtocol,
    curves: tuple[PredictedCurve, ...],
) -> tuple[tuple[PredictedCurve, ...], tuple[str, ...]]:
    """The curves with the effects along the path, and where their laws are stretched."""
    compliance = np.array([1 / c.stiffness for c in curves])
    try:
        path, notes = predict(model, forms, procedure, compliance)
    except ValueError as error:
        raise InputError(f"{model.name}: effects: {error}.") from error
    out = []
    for s, curve in enumerate(curves):
        mine = np.flatnonzero(path.setup == s)
        holds = CurvePath(
            repetition=tuple(int(r) for r in path.repetition[mine]),
            branch=tuple(path.branch[i] for i in mine),
            step=tuple(int(k) for k in path.step[mine]),
            session=path.session[mine],
            springs=path.springs[mine],
        )
        force, moved = path.force[mine], path.displacement[mine]
        out.append(replace(curve, force=force, displacement=moved, path=holds))
    return tuple(out), notes


def _farther(
    model: ArmModel, forms: tuple[Form, ...], procedure: MeasurementProtocol
) -> tuple[str, ...]:
    """Directions in which effects are loaded further than where they were found."""
    words, notes = {f.word for f in forms}, []
    for entry in (e for e in model.effects if e.get("name") in words):
        told = entry.get(SEEN_TO)
        greatest = told if isinstance(told, dict) else {}
        for run in procedure.runs:
            seen, top = greatest.get(run.direction), max(abs(f) for f in run.forces_N)
            if isinstance(seen, int | float) and top > _FARTHER * seen:
                notes.append(
                    f"{entry['name']}: seen up to {seen:.4g} N along {run.direction}, here up to "
                    f"{top:.4g} N; what it does beyond is a guess."
                )
    return tuple(dict.fromkeys(notes))


_FARTHER = 1.02  # times: levels are met no closer


def _notes(
    model: ArmModel, procedure: MeasurementProtocol, effects: tuple[Form, ...]
) -> tuple[str, ...]:
    notes = [*([model.note] if model.note else []), *model.doubts]
    notes += [*unit_warnings(procedure), *_other_setup(model, procedure)]
    if procedure.branches == "loading-unloading" and not effects:
        notes.append("Springs unload along the loading curve: each level stands once.")
    if any(run.stop_at_displacement_mm is not None for run in procedure.runs):
        notes.append("All levels are shown, also those beyond stop_at_displacement_mm.")
    return tuple(notes)


def _other_setup(model: ArmModel, procedure: MeasurementProtocol) -> list[str]:
    """Where the protocol loads the arm elsewhere than the model's own pose and tool say."""
    poses = {run.pose: procedure.poses[run.pose] for run in procedure.runs}
    tcp = MM_PER_M * model.tool[:3, 3]
    others = [n for n, p in poses.items() if np.abs(tcp - p.tcp_xyz_mm).max() > _SAME_MM]
    notes = []
    if not any(np.abs(model.q - p.q_rad).max() <= _SAME_RAD for p in poses.values()):
        notes.append(
            f"The model's own pose, {_listed(np.rad2deg(model.q))} deg, is not used: the curves "
            f"are those of the protocol's {' and '.join(poses)}."
        )
    for name in others:
        notes.append(
            f"The model's tool, {_listed(tcp)} mm from the flange, is not used: in pose {name} the "
            f"protocol loads the point tcp_xyz_mm {_listed(np.array(poses[name].tcp_xyz_mm))} mm. "
            "Put the tool there if it is mounted."
        )
    return notes


_SAME_RAD, _SAME_MM = 2e-3, 0.1


def _listed(values: Array) -> str:
    return "(" + ", ".join(f"{v + 0.0:.4g}" for v in values) + ")"


def _levels(c: PredictedCurve) -> list[str]:
    lines = [f"  {'force in N':>12} {'displacement in mm':>20}"]
    for force, moved in zip(c.force, c.displacement, strict=True):
        lines.append(f"  {force:12.5g} {MM_PER_M * moved:20.4f}")
    return lines


def _holds(c: PredictedCurve, path: CurvePath) -> list[str]:
    """The first and the last repetition; between them lies what the effects carry over."""
    shown = {min(path.repetition), max(path.repetition)}
    lines = [
        f"  {'repetition':>10} {'branch':<10} {'force in N':>12} {'displacement in mm':>20} "
        f"{'springs alone':>15}"
    ]
    if len(set(path.repetition) - shown) > 0:
        lines.insert(0, "  The first and the last repetition; --csv and --json hold all.")
    for i, repetition in enumerate(path.repetition):
        if repetition in shown:
            lines.append(
                f"  {repetition:10d} {path.branch[i]:<10} {c.force[i]:12.5g} "
                f"{MM_PER_M * c.displacement[i]:20.4f} {MM_PER_M * path.springs[i]:15.4f}"
            )
    return lines


def _csv_row(c: PredictedCurve, i: int) -> str:
    row = f"{c.pose},{c.direction},{c.force[i]:.10g},{MM_PER_M * c.displacement[i]:.10g}"
    if c.path is None:
        return row
    p = c.path
    return f"{row},{p.repetition[i]},{p.branch[i]},{p.step[i]},{p.session[i]:.10g}"


def _curve_json(c: PredictedCurve) -> dict[str, Any]:
    k = N_PER_MM * c.stiffness
    known = bool(np.isfinite(k))
    u = k * c.relative_u
    return {
        "pose": c.pose,
        "direction": c.direction,
        "stiffness_N_per_mm": {
            "value": k if known else None,
            "standard_uncertainty": u if known else None,
            "ci95": [k - TWO_SIDED * u, k + TWO_SIDED * u] if known else [None, None],
        },
        "force_N": [float(f) for f in c.force],
        "displacement_mm": [float(MM_PER_M * u) for u in c.displacement],
        **({} if c.path is None else _path_json(c.path)),
    }


def _path_json(path: CurvePath) -> dict[str, Any]:
    return {
        "repetition": list(path.repetition),
        "branch": list(path.branch),
        "step": list(path.step),
        "session_s": [float(t) for t in path.session],
        "springs_alone_mm": [float(MM_PER_M * u) for u in path.springs],
    }
