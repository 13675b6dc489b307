"""An arm with its joint springs for other simulators: MuJoCo XML and URDF.

Bodies follow the DH frames, joints turn about their z axes, angles are radians. Numbers are written
with all their digits: what is loaded back is what was written.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import ArrayLike

from identification.arm import JOINTS, STANDARD_GRAVITY, Arm, joint_positions, tool_transform
from rig.arrays import Array
from rig.storage.files import in_place_of

if TYPE_CHECKING:
    from rig.analysis.identify import IdentifyResult
    from rig.models.model import ArmModel


# Inertia tensors are no part of a robot file, and statics do not ask for them: a ball stands in.
_BALL_RADIUS_M = 0.05
# Simulators refuse moving bodies without mass.
_LEAST_MASS_KG = 1e-3


def mujoco_xml(arm: Arm, q: ArrayLike, tool: ArrayLike | None = None) -> str:
    """MJCF: joint stiffness in Nm/rad, springs without torque at q (6,) rad (keyframe "pose").

    The weight of the links is compensated (`gravcomp`), as a controller does that holds its pose:
    what deflects is what a load adds. The site "tool" is the point of load.
    Raises ValueError for a bad q or tool, or an arm without joint stiffness.
    """
    rest = _checked(arm, q)
    root = ET.Element("mujoco", model=arm.name)
    root.append(ET.Comment(_SAYS))
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", gravity=_numbers(STANDARD_GRAVITY))
    outer = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name="base", gravcomp="1")
    for i, place in enumerate(_places(arm)[:JOINTS]):
        body = ET.SubElement(
            outer,
            "body",
            name=f"link{i + 1}",
            gravcomp="1",
            pos=_numbers(place[:3, 3]),
            quat=_numbers(_quaternion(place[:3, :3])),
        )
        ET.SubElement(
            body,
            "joint",
            name=f"joint{i + 1}",
            type="hinge",
            axis="0 0 1",
            stiffness=_numbers(arm.joint_stiffness[i]),
            springref=_numbers(rest[i]),
            range=_numbers([arm.q_min[i], arm.q_max[i]]),
        )
        mass, centre, inertia = _inertia(arm, i)
        ET.SubElement(
            body,
            "inertial",
            mass=_numbers(mass),
            pos=_numbers(centre),
            diaginertia=_numbers([inertia] * 3),
        )
        outer = body
    flange = _places(arm)[JOINTS]
    for name, T in (("flange", flange), ("tool", flange @ _tool(tool))):
        ET.SubElement(
            outer, "site", name=name, pos=_numbers(T[:3, 3]), quat=_numbers(_quaternion(T[:3, :3]))
        )
    keys = ET.SubElement(root, "keyframe")
    ET.SubElement(keys, "key", name="pose", qpos=_numbers(rest))
    return _text(root)


def urdf(arm: Arm, q: ArrayLike, tool: ArrayLike | None = None) -> str:
    """URDF: kinematics and masses; springs as Gazebo's `springStiffness` (Nm/rad) and
    `springReference` (rad), because URDF itself knows no joint stiffness.

    Raises ValueError for a bad q or tool, or an arm without joint stiffness.
    """
    rest = _checked(arm, q)
    root = ET.Element("robot", name=arm.name)
    root.append(ET.Comment(_SAYS))
    ET.SubElement(root, "link", name="base")
    places = _places(arm)
    for i in range(JOINTS):
        link = ET.SubElement(root, "link", name=f"link{i + 1}")
        mass, centre, inertia = _inertia(arm, i)
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=_numbers(centre), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=_numbers(mass))
        moments = dict.fromkeys(("ixx", "iyy", "izz"), _numbers(inertia))
        ET.SubElement(inertial, "inertia", moments, ixy="0", ixz="0", iyz="0")
        parent = f"link{i}" if i else "base"
        joint = _urdf_joint(root, f"joint{i + 1}", "revolute", parent, f"link{i + 1}", places[i])
        ET.SubElement(joint, "axis", xyz="0 0 1")
        ET.SubElement(
            joint,
            "limit",
            lower=_numbers(arm.q_min[i]),
            upper=_numbers(arm.q_max[i]),
            effort=_numbers(_finite(arm.torque_limit[i])),
            velocity=_numbers(np.pi),
        )
    for name, parent, T in (
        ("flange", f"link{JOINTS}", places[JOINTS]),
        ("tool", "flange", _tool(tool)),
    ):
        ET.SubElement(root, "link", name=name)
        _urdf_joint(root, f"{name}_fixed", "fixed", parent, name, T)
    for i in range(JOINTS):
        spring = ET.SubElement(root, "gazebo", reference=f"joint{i + 1}")
        ET.SubElement(spring, "springStiffness").text = _numbers(arm.joint_stiffness[i])
        ET.SubElement(spring, "springReference").text = _numbers(rest[i])
    return _text(root)


def write(
    source: ArmModel | IdentifyResult, *, mujoco: Path | None = None, urdf_file: Path | None = None
) -> list[Path]:
    """Writes what is asked for, in the model's pose with its tool; the files written.

    An identification stands in its first measured pose. InputError if a folder refuses.
    """
    q, tool = _stance(source)
    written = []
    for path, text in ((mujoco, mujoco_xml), (urdf_file, urdf)):
        if path is not None:
            with in_place_of(path) as temporary:
                temporary.write_text(text(source.arm, q, tool), "utf-8")
            written.append(path)
    return written


_SAYS = (
    " Joint springs in Nm/rad about the stated pose; z axes of the DH frames. Masses and centres of"
    " mass as the maker states them, inertia tensors are stand-ins: for statics, not for motion. "
)


def _stance(source: ArmModel | IdentifyResult) -> tuple[Array, Array | None]:
    from rig.models.model import ArmModel

    if isinstance(source, ArmModel):
        return source.q, source.tool
    first = source.observations[0]
    return first.q, first.tool


def _checked(arm: Arm, q: ArrayLike) -> Array:
    if not np.isfinite(arm.joint_stiffness).all():
        raise ValueError(f"the model of {arm.name} has no joint stiffness for all six joints")
    rest = joint_positions(q)
    if rest.shape != (JOINTS,):
        raise ValueError(f"joint positions have shape {rest.shape}; one pose (6,) is wanted")
    return rest


def _places(arm: Arm) -> list[Array]:
    """Fixed transforms (4, 4): frame of joint i + 1 on link i, and last the flange on link 6.

    Link i turns with joint i about its own z axis; the rest of the DH step stands behind it.
    """
    out = [np.eye(4)]
    for d, a, alpha in zip(arm.d, arm.a, arm.alpha, strict=True):
        c, s = np.cos(alpha), np.sin(alpha)
        out.append(np.array([[1, 0, 0, a], [0, c, -s, 0], [0, s, c, d], [0, 0, 0, 1]]))
    return out


def _inertia(arm: Arm, i: int) -> tuple[float, Array, float]:
    """Mass, centre of mass in the frame of link i + 1, principal moment of the stand-in."""
    behind = _places(arm)[i + 1]
    mass = max(float(arm.mass[i]), _LEAST_MASS_KG)
    centre = behind[:3, :3] @ arm.centre[i] + behind[:3, 3]
    return mass, centre, 0.4 * mass * _BALL_RADIUS_M**2


def _urdf_joint(
    root: ET.Element, name: str, kind: str, parent: str, child: str, T: Array
) -> ET.Element:
    joint = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_numbers(T[:3, 3]), rpy=_numbers(_roll_pitch_yaw(T)))
    return joint


def _roll_pitch_yaw(T: Array) -> Array:
    """`R = Rz(yaw) Ry(pitch) Rx(roll)`; where pitch is a quarter turn, yaw is taken as 0."""
    R = T[:3, :3]
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    if np.hypot(R[0, 0], R[1, 0]) < 1e-9:
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def _quaternion(R: Array) -> Array:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return np.array([w, x, y, z])


def _tool(tool: ArrayLike | None) -> Array:
    return np.eye(4) if tool is None else tool_transform(tool)


def _finite(value: float) -> float:
    return float(value) if np.isfinite(value) else 1e9


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(float(v) + 0.0) for v in np.atleast_1d(np.asarray(values, dtype=float)))


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"
