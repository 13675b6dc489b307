"""What may stand in a robot file and in a model file: keys with units, types and ranges."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Gt, Interval, Len, MinLen

from rig.protocolfile import LONGEST_TOOL_MM

_Row3 = tuple[float, float, float]
_Six = Annotated[list[float], Len(6, 6)]
_Matrix6 = Annotated[list[_Six], Len(6, 6)]
_Positive = Annotated[float, Gt(0)]
_SixPositive = Annotated[list[_Positive], Len(6, 6)]
# From a hair spring to what no drive reaches: beyond, sums of compliances lose their digits.
_SixSprings = Annotated[list[Annotated[float, Interval(ge=1e-3, le=1e15)]], Len(6, 6)]
# In m, and longer than the links of any arm: millimetres are beyond.
_SixLengths = Annotated[list[Annotated[float, Interval(ge=-5, le=5)]], Len(6, 6)]
_SixNotNegative = Annotated[list[Annotated[float, Ge(0)]], Len(6, 6)]
_Forbid: dict[str, str] = {"extra": "forbid"}


@dataclass(frozen=True, kw_only=True)
class DhTable:
    """Denavit-Hartenberg parameters in the standard (distal) convention."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    d_m: _SixLengths
    a_m: _SixLengths
    alpha_rad: _Six


@dataclass(frozen=True, kw_only=True)
class TubeFile:
    """A round tube; without `wall_mm` a solid rod."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    material: Annotated[str, MinLen(1)]
    diameter_mm: _Positive
    wall_mm: _Positive | None = None


@dataclass(frozen=True, kw_only=True)
class SegmentFile:
    """An elastic segment fixed to DH frame `frame` (0: base)."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    name: Annotated[str, MinLen(1)]
    frame: Annotated[int, Interval(ge=0, le=6)]
    from_m: _Row3
    to_m: _Row3
    tube: TubeFile


@dataclass(frozen=True, kw_only=True)
class LimitsFile:
    """Joint limits in degrees."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    min: _Six
    max: _Six


@dataclass(frozen=True, kw_only=True)
class RobotFile:
    """data/models/<robot>.yaml."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    schema: Literal["rig.robot/1"]
    name: Annotated[str, MinLen(1)]
    dh: DhTable
    mass_kg: _SixNotNegative
    centre_of_mass_m: Annotated[list[_Row3], Len(6, 6)]
    joint_limits_deg: LimitsFile
    joint_torque_limits_Nm: _SixPositive
    payload_limit_kg: _Positive
    reach_mm: _Positive
    joint_stiffness_Nm_per_rad: _SixSprings
    joint_stiffness_relative_sd: Annotated[float, Ge(0)]
    link_segments: list[SegmentFile] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class PoseFile:
    """Either q_deg, or q_rad, or position and direction of the tool with the branch."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    q_deg: _Six | None = None
    q_rad: _Six | None = None
    position_mm: _Row3 | None = None
    direction: _Row3 | None = None
    turn_deg: float = 0.0
    branch: str | None = None


@dataclass(frozen=True, kw_only=True)
class ToolFile:
    """Along the flange's z axis, or a 4 x 4 matrix in m."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    length_mm: Annotated[float, Interval(ge=0, le=LONGEST_TOOL_MM)] | None = None
    flange_T_tcp: Annotated[list[Annotated[list[float], Len(4, 4)]], Len(4, 4)] | None = None


@dataclass(frozen=True, kw_only=True)
class BeamFile:
    """A round beam between the tools; `half_length_mm` is one arm's share of it."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    material: Annotated[str, MinLen(1)]
    diameter_mm: _Positive
    half_length_mm: _Positive
    wall_mm: _Positive | None = None


@dataclass(frozen=True, kw_only=True)
class BeamKind:
    """`kind: {beam: {...}}`."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    beam: BeamFile


@dataclass(frozen=True, kw_only=True)
class ComplianceKind:
    """`kind: {compliance_m_rad_per_N_Nm: 6 x 6}`: one arm's half of the connection, in the mirror
    axes (normal, tangent, z) at the common node."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    compliance_m_rad_per_N_Nm: _Matrix6


@dataclass(frozen=True, kw_only=True)
class CouplingFile:
    """The second arm is the mirror image of the first."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    base_distance_mm: _Positive
    beta_deg: Annotated[float, Interval(gt=-90, lt=90)] = 0.0
    load_axes: Literal["base", "mirror"] = "base"
    kind: Literal["rigid", "point"] | BeamKind | ComplianceKind = "rigid"


@dataclass(frozen=True, kw_only=True)
class RequiredFile:
    """A stiffness that a task needs along one of the load axes, or along a unit vector."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    direction: Literal["x", "y", "z"] | _Row3
    stiffness_N_per_mm: _Positive


@dataclass(frozen=True, kw_only=True)
class MountingFile:
    """Elastic mounting: stiffness against tilting about x and y, and turning about z."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    tilt_Nm_per_rad: _Positive
    turn_Nm_per_rad: _Positive


@dataclass(frozen=True, kw_only=True)
class ModelFile:
    """A model file as it is written; `note` is shown with every result of it."""

    __pydantic_config__: ClassVar[dict[str, str]] = _Forbid
    note: str = ""
    robot: Annotated[str, MinLen(1)] | None = None
    dh: DhTable | None = None
    pose: PoseFile
    tool: ToolFile = ToolFile(length_mm=0.0)
    joint_stiffness_Nm_per_rad: _SixSprings | None = None
    joint_stiffness_relative_sd: Annotated[float, Ge(0)] | _SixNotNegative | None = None
    joint_stiffness_sd: _SixNotNegative | None = None
    link_segments: Literal["none", "robot"] | list[SegmentFile] = "none"
    mounting: MountingFile | None = None
    effects: list[dict[str, Any]] = field(default_factory=list)
    coupling: CouplingFile | None = None
    required: list[RequiredFile] = field(default_factory=list)
