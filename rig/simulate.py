"""`rig simulate`: the curves that a model predicts for a procedure.

Linear statics: stiff links (unless the model has segments), six torsional springs, a compliant
mounting where the model has one. Pose and point of load are the procedure's, not the model's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.arm import along, tool_offset
from rig.errors import InputError
from rig.model import ArmModel, load_model
from rig.model_schema import ModelFile
from rig.protocol import MeasurementProtocol, Run, load_protocol
from rig.yamlfile import read_document

Array = NDArray[np.float64]
SCHEMA = "rig.simulation/1"
CSV_HEADER = "pose,direction,force_N,displacement_mm"


@dataclass(frozen=True, eq=False)
class PredictedCurve:
    """One pose and direction: force N (n,) from zero load up, displacement m (n,) along the
    direction. stiffness N/m (infinite where the arm does not give way along it) with its relative
    standard uncertainty, that of the joint stiffnesses."""

    pose: str
    direction: str
    force: Array
    displacement: Array
    stiffness: float
    relative_u: float


@dataclass(frozen=True, eq=False)
class Simulation:
    """What a model predicts for a protocol."""

    model: str
    protocol: str
    title: str
    curves: tuple[PredictedCurve, ...]
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """`rig.simulation/1`."""
        return {
            "schema": SCHEMA,
            "model": self.model,
            "protocol": self.protocol,
            "curves": [_curve_json(c) for c in self.curves],
            "notes": list(self.notes),
        }

    def to_csv(self) -> str:
        """Columns pose, direction, force_N, displacement_mm: what `rig diagnose --simulation`
        takes."""
        rows = [
            f"{c.pose},{c.direction},{force:.10g},{1e3 * moved:.10g}"
            for c in self.curves
            for force, moved in zip(c.force, c.displacement, strict=True)
        ]
        return "\n".join([CSV_HEADER, *rows]) + "\n"

    def to_text(self) -> str:
        """One line a curve, then its levels."""
        lines = [f"Predicted by {self.model} for: {self.title}"]
        for c in self.curves:
            u = 1e-3 * c.stiffness * c.relative_u
            k = f"{1e-3 * c.stiffness:.2f} N/mm (standard uncertainty {u:.2g})"
            lines.append(
                f"\nPose {c.pose}, direction {c.direction}: "
                + (k if np.isfinite(c.stiffness) else "the arm does not give way along it")
            )
            lines.append(f"  {'force in N':>12} {'displacement in mm':>20}")
            for force, moved in zip(c.force, c.displacement, strict=True):
                lines.append(f"  {force:12.5g} {1e3 * moved:20.4f}")
        return "\n".join([*lines, *(f"\nNote: {note}" for note in self.notes)])


def simulate(model: str | Path, protocol: str | Path) -> Simulation:
    """The curves of every pose and direction that the protocol loads. Raises InputError."""
    read, procedure = load_model(model), load_protocol(Path(protocol))
    _refuse_effects(read)
    if read.arm.name not in (procedure.robot, "dh"):
        raise InputError(
            f"{read.name}: robot is {read.arm.name}, but {protocol} measures a {procedure.robot}. "
            "Give a model of the robot that the protocol names."
        )
    curves = tuple(_predict(read, procedure, run) for run in procedure.runs)
    return Simulation(read.name, str(protocol), procedure.title, curves, _notes(read, procedure))


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
    tool = tool_offset(np.array(pose.tcp_xyz_mm) / 1e3)
    q = np.array(pose.q_rad)
    C = model.arm.compliance(q, tool, links=model.links, base=model.mounting)
    with np.errstate(divide="ignore"):
        s = float(1.0 / along(C, n))
    parts = (n @ model.arm.jacobian(q, tool)[:3]) ** 2 / model.arm.joint_stiffness
    sd = model.arm.joint_stiffness_relative_sd
    return s, float(np.linalg.norm(parts * sd) / s) if s > 0 else 0.0


def _refuse_effects(model: ArmModel) -> None:
    if not model.effects:
        return
    document = read_document(Path(model.name), ModelFile)
    problems = []
    for i, effect in enumerate(model.effects):
        name = effect.get("name", effect.get("effect"))
        called = f'the effect "{name}"' if name is not None else "an effect without a name"
        problems.append(
            document.problem(
                ("effects", i),
                f"{called} is none that rig simulate can compute; allowed: no effects. Simulate "
                "with `effects: []`, which gives the springs alone.",
            )
        )
    document.refuse(problems)


def _notes(model: ArmModel, procedure: MeasurementProtocol) -> tuple[str, ...]:
    notes = [model.note] if model.note else []
    if procedure.branches == "loading-unloading":
        notes.append("Springs unload along the loading curve: each level stands once.")
    if any(run.stop_at_displacement_mm is not None for run in procedure.runs):
        notes.append("All levels are shown, also those beyond stop_at_displacement_mm.")
    return tuple(notes)


def _curve_json(c: PredictedCurve) -> dict[str, Any]:
    k = 1e-3 * c.stiffness
    known = bool(np.isfinite(k))
    u = k * c.relative_u
    return {
        "pose": c.pose,
        "direction": c.direction,
        "stiffness_N_per_mm": {
            "value": k if known else None,
            "standard_uncertainty": u if known else None,
            "ci95": [k - 1.959964 * u, k + 1.959964 * u] if known else [None, None],
        },
        "force_N": [float(f) for f in c.force],
        "displacement_mm": [float(1e3 * u) for u in c.displacement],
    }
