"""What a model file says of tool and springs, looked at for slips of the unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identification.arm import Arm, tool_offset, tool_transform
from rig.arrays import Array
from rig.models.model_schema import ModelFile
from rig.models.robot import checked
from rig.plan_margins import may_be_radians
from rig.protocolfile import LONGEST_TOOL_MM
from rig.units import MM_PER_M
from rig.yaml.yamlfile import Document

_FAR = 100.0  # times softer or stiffer than the robot's own springs: another unit, most likely
_SOFTEST = 300.0  # Nm/rad: arms that carry a load have at least one joint above


def tool_of(document: Document[ModelFile]) -> Array:
    """flange_T_tcp (4, 4); its translation no longer than a protocol's tool may be."""
    written = document.value.tool
    if written.flange_T_tcp is None:
        return tool_offset([0.0, 0.0, (written.length_mm or 0.0) / MM_PER_M])
    matrix = np.array(written.flange_T_tcp)
    tool: Array = checked(document, ("tool", "flange_T_tcp"), lambda: tool_transform(matrix))
    longest = LONGEST_TOOL_MM / MM_PER_M
    document.refuse(
        [
            document.problem(
                ("tool", "flange_T_tcp", i, 3),
                f"{tool[i, 3]:.10g} m is no tool; allowed: {-longest:g} to {longest:g} m. "
                "The last column is in m.",
            )
            for i in range(3)
            if abs(tool[i, 3]) > longest
        ]
    )
    return tool


def doubts(document: Document[ModelFile], arm: Arm, nominal: Array) -> tuple[str, ...]:
    """Questions about angles that may be radians, and about springs of another order of size than
    the robot's; nominal (6,) Nm/rad: of the robot file, zeros without one."""
    return (*_radians(document), *_springs(document, arm, nominal))


def _radians(document: Document[ModelFile]) -> Iterator[str]:
    if doubt := may_be_radians(document.value.pose.q_deg or []):
        yield f"{document.at(('pose', 'q_deg'))}: pose.q_deg: {doubt}"


def _springs(document: Document[ModelFile], arm: Arm, nominal: Array) -> tuple[str, ...]:
    springs = document.value.joint_stiffness_Nm_per_rad
    if springs is None:
        return ()
    key = "joint_stiffness_Nm_per_rad"
    low, high = min(springs), max(springs)
    said = f"{document.at((key,))}: {key}: from {low:.4g} to {high:.4g} Nm/rad"
    if (nominal > 0).all():
        ratio = float(np.exp(np.mean(np.log(np.array(springs) / nominal))))
        if not 1 / _FAR <= ratio <= _FAR:
            return (
                f"{said}, about {ratio:.2g} times those of {arm.name}. Is the unit Nm/rad (not "
                "kNm/rad)?",
            )
    elif high < _SOFTEST:
        return (f"{said}; are these kNm/rad? Nm/rad are wanted.",)
    return ()
