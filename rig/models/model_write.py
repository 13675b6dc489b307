"""The lines that every model file written here has, whoever found its numbers."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from rig.arrays import Array
from rig.units import MM_PER_M

_PLAIN = re.compile(r"(?!true|false|null)[a-z]{4,}(_[a-z]+)*")  # read as text by every YAML
# Of the published pair; what stands in a model file until somebody edits it.
_ASSUMED_DISTANCE_MM = 1500.0


def arm_lines(
    robot: str, q: Sequence[float], tcp_mm: Sequence[float], stiffness: Array, sd: Array
) -> list[str]:
    """The arm in its pose: q (6,) rad, tool tcp_mm (3,), springs (6,) Nm/rad with their standard
    deviations."""
    x, y, z = (v / MM_PER_M for v in tcp_mm)
    return [
        f"robot: {robot}",
        f"pose: {{q_rad: {flow(list(q))}}}",
        f"tool: {{flange_T_tcp: [[1, 0, 0, {x:g}], [0, 1, 0, {y:g}], [0, 0, 1, {z:g}], "
        "[0, 0, 0, 1]]}",
        f"joint_stiffness_Nm_per_rad: {flow([float(f'{k:.7g}') for k in stiffness])}",
        f"joint_stiffness_sd: {flow([float(f'{s:.4g}') for s in sd])}",
    ]


def coupling_lines() -> list[str]:
    """Where the second arm would stand."""
    return [
        "# Not measured, an assumption for rig couple: edit it to the second arm's place.",
        f"coupling: {{base_distance_mm: {_ASSUMED_DISTANCE_MM:g}, beta_deg: 0, load_axes: base, "
        "kind: rigid}",
    ]


def flow(value: Any) -> str:
    """A value in YAML's flow style; numbers with nine digits and always read as numbers."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{k}: {flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(flow(v) for v in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value if _PLAIN.fullmatch(value) else json.dumps(value)
    text = f"{value:.9g}"
    mantissa, _, exponent = text.partition("e")
    return f"{mantissa}.0e{exponent}" if exponent and "." not in mantissa else text
