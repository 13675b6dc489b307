"""Model files: YAML into `ArmModel`, SI inside, every value checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from identification.arm import Arm, unit_vector
from identification.elastic import Beam, cantilever
from identification.inverse import BRANCHES, solutions, tool_pose
from rig.arrays import Array
from rig.errors import InputError, did_you_mean
from rig.models.model_checks import doubts, tool_of
from rig.models.model_schema import BeamKind, ComplianceKind, ModelFile, MountingFile
from rig.models.robot import checked, robot_and_reach, section_of, segments
from rig.units import MM_PER_M, N_PER_MM
from rig.yaml.yamlfile import Document, read_document
from rig.yaml.yamlnodes import Problem

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class CouplingSpec:
    """base_distance m, beta rad; `half`: compliance (6, 6) of one arm's half of the connection in
    mirror axes, None for a rigid or a point connection."""

    base_distance: float
    beta: float
    load_axes: Literal["base", "mirror"]
    kind: Literal["rigid", "point", "compliant"]
    half: Array | None = None
    described: str = ""


@dataclass(frozen=True)
class Requirement:
    """stiffness N/m along `direction`, a unit vector in the load axes; `name` as written."""

    name: str
    direction: tuple[float, float, float]
    stiffness: float


@dataclass(frozen=True, eq=False)
class ArmModel:
    """A model file, read and checked. q (6,) rad, tool (4, 4), mounting: compliance (6, 6) of the
    base or None; `effects` verbatim; `links` in use (empty: rigid links); written_outside: links
    and mounting as the file has them, of the keys that it has. pose_at: where in the file the pose
    stands; doubts: what may be a slip of the unit, to be shown with every result."""

    name: str
    arm: Arm
    q: Array
    tool: Array
    links: tuple[Beam, ...]
    mounting: Array | None
    effects: tuple[dict[str, Any], ...]
    coupling: CouplingSpec | None
    required: tuple[Requirement, ...]
    reach: float | None
    note: str = ""
    written_outside: Mapping[str, Any] = field(default_factory=dict)
    pose_at: str = ""
    doubts: tuple[str, ...] = ()

    def compliance(self) -> Array:
        """Compliance (6, 6) at the tool of the single arm, effects left out."""
        return self.arm.compliance(self.q, self.tool, links=self.links, base=self.mounting)

    def outside(self, q: Array, tool: Array, n: Array) -> float:
        """m/N along n (3,) at the tool (4, 4) in pose q (6,): what links and mounting give way."""
        if self.mounting is None and not self.links:
            return 0.0
        springs = self.arm.compliance(q, tool)
        C = self.arm.compliance(q, tool, links=self.links, base=self.mounting) - springs
        return float(n @ C[:3, :3] @ n)


def told_first(notes: Sequence[str]) -> tuple[list[str], list[str]]:
    """Notes that have to be read before any number (where it comes from), and the others."""
    first = [note for note in notes if note.startswith(("EMULATED:", "INCOMPLETE:"))]
    return first, [note for note in notes if note not in first]


def load_model(path: str | Path) -> ArmModel:
    """A model file. Raises InputError with every problem found."""
    document = read_document(Path(path), ModelFile)
    written = document.value
    _check_model(document)
    named, reach = _named_arm(document)
    arm = _with_springs(document, named)
    tool = tool_of(document)
    return ArmModel(
        name=document.name,
        arm=arm,
        q=_pose(document, arm, tool),
        tool=tool,
        links=_model_links(document, arm),
        mounting=_mounting(written.mounting),
        effects=tuple(written.effects),
        coupling=_coupling(document),
        required=tuple(_requirement(document, i) for i in range(len(written.required))),
        reach=reach,
        note=written.note,
        written_outside=_written_outside(written),
        pose_at=document.at(("pose",)),
        doubts=doubts(document, arm, named.joint_stiffness),
    )


def _check_model(document: Document[ModelFile]) -> None:
    """What holds across keys."""
    written, pose = document.value, document.value.pose
    problems: list[Problem] = []
    if (written.robot is None) == (written.dh is None):
        problems.append(document.problem(("robot",), "give either robot or dh, and one of them."))
    ways = [pose.q_deg is not None, pose.q_rad is not None, pose.position_mm is not None]
    if sum(ways) != 1:
        problems.append(
            document.problem(("pose",), "give one of q_deg, q_rad, or position_mm with direction.")
        )
    elif ways[2] and (pose.direction is None or pose.branch is None):
        problems.append(
            document.problem(
                ("pose",), "position_mm needs the tool's direction and the branch beside it."
            )
        )
    if written.tool.length_mm is not None and written.tool.flange_T_tcp is not None:
        problems.append(document.problem(("tool",), "give length_mm or flange_T_tcp, not both."))
    both = (
        written.joint_stiffness_relative_sd is not None and written.joint_stiffness_sd is not None
    )
    if both:
        problems.append(
            document.problem(
                ("joint_stiffness_sd",), "stands beside joint_stiffness_relative_sd; keep one."
            )
        )
    if written.dh is not None and written.joint_stiffness_Nm_per_rad is None:
        problems.append(
            document.problem((), "joint_stiffness_Nm_per_rad is missing; dh alone brings none.")
        )
    document.refuse(problems)


def _named_arm(document: Document[ModelFile]) -> tuple[Arm, float | None]:
    """The arm with the springs of its robot file (zeros where `dh` is given), and its reach m."""
    written = document.value
    if written.robot is not None:
        try:
            return robot_and_reach(_beside(document.name, written.robot))
        except InputError as error:
            document.refuse([document.problem(("robot",), str(error))])
            raise
    dh = written.dh
    assert dh is not None
    arm = checked(
        document,
        ("dh",),
        lambda: Arm("dh", d=np.array(dh.d_m), a=np.array(dh.a_m), alpha=np.array(dh.alpha_rad)),
    )
    return arm, None


def _with_springs(document: Document[ModelFile], arm: Arm) -> Arm:
    """The arm with the springs of the model file, where it states any."""
    written = document.value
    stiffness = arm.joint_stiffness
    relative = arm.joint_stiffness_relative_sd
    if written.joint_stiffness_Nm_per_rad is not None:
        stiffness, relative = np.array(written.joint_stiffness_Nm_per_rad), np.zeros(6)
    if written.joint_stiffness_relative_sd is not None:
        relative = np.broadcast_to(np.array(written.joint_stiffness_relative_sd, dtype=float), (6,))
    if written.joint_stiffness_sd is not None:
        relative = np.array(written.joint_stiffness_sd) / stiffness
    return arm.with_stiffness(stiffness, relative)


def _beside(model: str, robot: str) -> str | Path:
    """A path of a robot file is meant relative to the model file."""
    return Path(model).parent / robot if robot.endswith((".yaml", ".yml")) else robot


def _pose(document: Document[ModelFile], arm: Arm, tool: Array) -> Array:
    pose = document.value.pose
    if pose.q_deg is not None:
        return _within(document, ("pose", "q_deg"), arm, np.deg2rad(pose.q_deg))
    if pose.q_rad is not None:
        return _within(document, ("pose", "q_rad"), arm, np.array(pose.q_rad))
    assert pose.position_mm is not None
    assert pose.direction is not None
    assert pose.branch is not None
    if pose.branch not in BRANCHES:
        what = f'"{pose.branch}" is no branch.{did_you_mean(pose.branch, BRANCHES)}'
        document.refuse([document.problem(("pose", "branch"), what)])
    direction = np.array(pose.direction)
    target = checked(
        document,
        ("pose", "direction"),
        lambda: tool_pose(
            np.array(pose.position_mm) / MM_PER_M, direction, np.deg2rad(pose.turn_deg)
        ),
    )
    found = checked(document, ("pose",), lambda: solutions(arm, target @ np.linalg.inv(tool)))
    if pose.branch not in found:
        reached = "; branches that reach it: " + ", ".join(found) if found else ""
        what = (
            f"{arm.name} does not reach {list(pose.position_mm)} mm with the tool along "
            f"{list(pose.direction)} in branch {pose.branch}{reached}. "
            "Move the position, or name another branch."
        )
        document.refuse([document.problem(("pose", "position_mm"), what)])
    return found[pose.branch]


def _within(document: Document[ModelFile], place: tuple[str, str], arm: Arm, q: Array) -> Array:
    outside = (q < arm.q_min) | (q > arm.q_max)
    if outside.any():
        i = int(np.argmax(outside))
        low, high = np.rad2deg([arm.q_min[i], arm.q_max[i]])
        what = (
            f"{np.rad2deg(q[i]):.6g} deg at joint {i + 1}; "
            f"{arm.name} allows {low:.6g} to {high:.6g} deg."
        )
        document.refuse([document.problem((*place, i), what)])
    return q


def _model_links(document: Document[ModelFile], arm: Arm) -> tuple[Beam, ...]:
    wanted = document.value.link_segments
    if wanted == "none":
        return ()
    if wanted == "robot":
        if not arm.links:
            what = f"the model of {arm.name} has no link segments; list them here."
            document.refuse([document.problem(("link_segments",), what)])
        return arm.links
    return segments(document, wanted)


def _written_outside(written: ModelFile) -> dict[str, Any]:
    """Plain values of `link_segments` and `mounting`, left out where there are none."""
    out: dict[str, Any] = {}
    if isinstance(written.link_segments, list):
        out["link_segments"] = [_given(s) for s in written.link_segments]
    elif written.link_segments != "none":
        out["link_segments"] = written.link_segments
    if written.mounting is not None:
        out["mounting"] = _given(written.mounting)
    return out


def _given(written: Any) -> dict[str, Any]:
    """A part of a file, without the keys that it leaves out."""
    return asdict(written, dict_factory=lambda pairs: {k: v for k, v in pairs if v is not None})


def _mounting(written: MountingFile | None) -> Array | None:
    if written is None:
        return None
    tilt, turn = 1 / written.tilt_Nm_per_rad, 1 / written.turn_Nm_per_rad
    return np.diag([0.0, 0.0, 0.0, tilt, tilt, turn])


def _coupling(document: Document[ModelFile]) -> CouplingSpec | None:
    written = document.value.coupling
    if written is None:
        return None
    kind: Literal["rigid", "point", "compliant"] = "compliant"
    half: Array | None = None
    if isinstance(written.kind, BeamKind):
        beam = written.kind.beam
        section = section_of(document, ("coupling", "kind", "beam"), beam)
        half = cantilever(section, beam.half_length_mm / MM_PER_M)
        described = (
            f"{beam.material} beam, diameter {beam.diameter_mm:g} mm, "
            f"half length {beam.half_length_mm:g} mm"
        )
    elif isinstance(written.kind, ComplianceKind):
        half = np.array(written.kind.compliance_m_rad_per_N_Nm)
        described = "compliance given as 6 x 6"
        _check_compliance(document, half)
    else:
        kind = written.kind
        described = kind
    return CouplingSpec(
        base_distance=written.base_distance_mm / MM_PER_M,
        beta=float(np.deg2rad(written.beta_deg)),
        load_axes=written.load_axes,
        kind=kind,
        half=half,
        described=described,
    )


def _check_compliance(document: Document[ModelFile], half: Array) -> None:
    scale = np.abs(half).max()
    what = ""
    if not np.abs(half - half.T).max() <= 1e-9 * scale:
        what = "a compliance is symmetric; this matrix is not."
    elif np.linalg.eigvalsh(half)[0] < -1e-9 * scale:
        what = "a compliance has no negative eigenvalue; this matrix has one."
    if what:
        place = ("coupling", "kind", "compliance_m_rad_per_N_Nm")
        document.refuse([document.problem(place, what)])


def _requirement(document: Document[ModelFile], i: int) -> Requirement:
    written = document.value.required[i]
    stiffness = written.stiffness_N_per_mm / N_PER_MM
    if isinstance(written.direction, str):
        return Requirement(written.direction, AXES[written.direction], stiffness)
    given = written.direction
    checked(document, ("required", i, "direction"), lambda: unit_vector(given))
    name = "(" + ", ".join(f"{v:g}" for v in given) + ")"
    return Requirement(name, given, stiffness)
