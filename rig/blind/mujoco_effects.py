"""What can be hidden in an arm of MuJoCo's hinges: forms, sizes and the words for them.

The laws are those of an engine that nobody here wrote: dry friction as a regularised constraint,
stops as springs with a dead band, dampers, large turns. All are `foreign` to the library's shapes
but for the linear ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.blind.mujoco_arm import SWING, Hinge, places

Random = np.random.Generator


@dataclass(frozen=True)
class Rig:
    """What effects are sized by: q, springs (6) as they truly are, and the largest torque (6) Nm
    that the loads of all directions put on each joint; moment (3) Nm about the base axes."""

    q: Array
    springs: Array
    torque: Array
    moment: Array


@dataclass(frozen=True)
class Hidden:
    """An effect: further hinges, changed springs, and the answers about it.

    returned: whether the controller takes the added hinges back between two runs. creeps: whether
    time under load matters.
    """

    word: str
    form: str
    law: str
    parameters: dict[str, Any]
    joints: tuple[int, ...] = ()
    hinges: tuple[Hinge, ...] = ()
    replaced: dict[int, Hinge] = field(default_factory=dict)
    returned: bool = False
    creeps: bool = False
    seen: bool = True


def draw_effect(word: str, rig: Rig, random: Random) -> Hidden:
    """One effect of the word, its size within what is physical."""
    return _DRAW[word](rig, random)


def spring(rig: Rig, joint: int, stiffness: float | None = None, **more: float) -> Hinge:
    """The hinge of a joint (from 0), or a further one beside it."""
    axis, at = places(rig.q)[f"joint{joint + 1}"]
    k = rig.springs[joint] if stiffness is None else stiffness
    return Hinge(f"joint{joint + 1}", axis, at, float(k), **more)


def _loaded_joint(rig: Rig, random: Random) -> int:
    """A joint whose deflection matters: by torque squared over stiffness."""
    weight = rig.torque**2 / rig.springs
    return int(random.choice(6, p=weight / weight.sum()))


def _yield(rig: Rig, random: Random) -> Hidden:
    j = _loaded_joint(rig, random)
    threshold = float(random.uniform(0.45, 0.8) * rig.torque[j])
    share = float(random.uniform(0.3, 1.2))
    hinge = spring(rig, j, share * rig.springs[j], friction_Nm=threshold, reference=rig.springs[j])
    returned = bool(random.random() < 0.5)
    # there is no gravity: what slips feels the load alone
    facts = {
        "threshold_of_load_Nm": threshold,
        "spring_beside_over_elastic": share,
        "taken_back": returned,
    }
    return Hidden(
        "joint_yield", "friction_in_series", "foreign", facts, (j + 1,), (hinge,), returned=returned
    )


def _hysteresis(rig: Rig, random: Random) -> Hidden:
    j, n = _loaded_joint(rig, random), int(random.integers(2, 6))
    lowest, highest = random.uniform(0.02, 0.05), random.uniform(0.2, 0.4)
    friction = np.geomspace(lowest, highest, n) * rig.torque[j]
    share = float(random.uniform(0.1, 0.5))
    hinges = tuple(
        spring(rig, j, n / share * rig.springs[j], friction_Nm=float(f), reference=rig.springs[j])
        for f in friction
    )
    facts = {"slider_strengths_Nm": friction.tolist(), "compliance_of_sliders_over_elastic": share}
    return Hidden("joint_hysteresis", f"{n}_sliders", "foreign", facts, (j + 1,), hinges)


def _backlash(rig: Rig, random: Random) -> Hidden:
    """In joint 1, whose axis stands upright: its torque passes zero where the load does."""
    width = float(np.exp(random.uniform(np.log(6e-5), np.log(4e-4))))
    friction = float(random.uniform(0.1, 0.6))
    hinge = spring(
        rig,
        0,
        0.0,
        stop_stiffness=float(20 * rig.springs[0]),
        stop_rad=width / 2,
        friction_Nm=friction,
        damping=float(rig.springs[0] / SWING / 5),
        reference=float(rig.springs[0]),
    )
    facts = {"width_rad": width, "friction_Nm": friction}
    return Hidden("joint_backlash", "stops_with_friction", "foreign", facts, (1,), (hinge,))


def _creep(rig: Rig, random: Random) -> Hidden:
    j = _loaded_joint(rig, random)
    fraction = float(random.uniform(0.05, 0.35))
    time = float(np.exp(random.uniform(np.log(4.0), np.log(80.0))))
    k = float(rig.springs[j] / fraction)
    hinge = spring(rig, j, k, damping=k * time, reference=float(rig.springs[j]))
    facts = {"creep_fraction": fraction, "times_s": [time]}
    return Hidden(
        "joint_creep", "damper_beside_spring", "fitted", facts, (j + 1,), (hinge,), creeps=True
    )


def _nonlinear(rig: Rig, random: Random) -> Hidden:
    j = _loaded_joint(rig, random)
    soft = float(random.uniform(0.55, 0.8) * rig.springs[j])
    stop = float(random.uniform(0.15, 0.5) * rig.torque[j] / rig.springs[j])
    further = float(random.uniform(0.4, 0.9) * rig.springs[j])
    hinge = spring(rig, j, soft, stop_stiffness=further, stop_rad=stop)
    facts = {"K_Nm_per_rad": [soft, soft + further], "T1_Nm": soft * stop}
    return Hidden(
        "joint_nonlinear_stiffness", "second_spring", "fitted", facts, (j + 1,), replaced={j: hinge}
    )


def _stiffness_error(rig: Rig, random: Random) -> Hidden:
    j = _loaded_joint(rig, random)
    factor = float(random.choice([random.uniform(0.45, 0.7), random.uniform(1.5, 2.0)]))
    hinge = spring(rig, j, factor * rig.springs[j])
    facts = {f"factor_joint{j + 1}": factor}
    return Hidden(
        "joint_stiffness_error", "one_joint", "fitted", facts, (j + 1,), replaced={j: hinge}
    )


def _base_axis(random: Random) -> tuple[int, Array, Array, float]:
    a = int(random.integers(3))
    depth = 0.0 if a == 2 else float(random.uniform(0.0, 0.7))
    return a, np.eye(3)[a], np.array([0.0, 0.0, -depth]), depth


def _base_compliance(rig: Rig, random: Random) -> Hidden:  # noqa: ARG001
    a, axis, at, depth = _base_axis(random)
    k = float(np.exp(random.uniform(np.log(1e5), np.log(1.5e6))))
    facts = {"turn_Nm_per_rad": {"xyz"[a]: k}, "axis_depth_m": depth}
    hinge = Hinge("base", axis, at, k)
    form = "yaw" if a == 2 else "tilt"
    return Hidden("base_compliance", form, "fitted", facts, hinges=(hinge,), seen=False)


def _base_slip(rig: Rig, random: Random) -> Hidden:
    a, axis, at, depth = _base_axis(random)
    threshold = float(random.uniform(0.45, 0.8) * rig.moment[a])
    k = float(np.exp(random.uniform(np.log(3e4), np.log(3e5))))
    hinge = Hinge("base", axis, at, k, friction_Nm=threshold, reference=float(rig.springs[0]))
    facts = {
        "threshold_Nm": threshold,
        "stiffness_after_Nm_per_rad": k,
        "axis": axis.tolist(),
        "axis_depth_m": depth,
    }
    form = "yaw_friction" if a == 2 else "tilt_friction"
    return Hidden("base_slip", form, "foreign", facts, hinges=(hinge,), seen=False)


def _links(rig: Rig, random: Random) -> Hidden:
    """A hinge about two axes across the segment in the middle of each long segment."""
    hinges, sizes = [], {}
    for name in ("link2", "link3"):
        along, at = places(rig.q)[name]
        across = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
        across /= np.linalg.norm(across)
        k = float(np.exp(random.uniform(np.log(2.5e4), np.log(1.5e5))))
        sizes[name] = k
        hinges += [Hinge(name, axis, at, k) for axis in (across, np.cross(along, across))]
    facts = {"hinge_Nm_per_rad": sizes}
    return Hidden(
        "link_flexibility",
        "hinge_in_the_middle",
        "foreign",
        facts,
        hinges=tuple(hinges),
        seen=False,
    )


_DRAW: dict[str, Callable[[Rig, Random], Hidden]] = {
    "joint_yield": _yield,
    "joint_hysteresis": _hysteresis,
    "joint_backlash": _backlash,
    "joint_creep": _creep,
    "joint_nonlinear_stiffness": _nonlinear,
    "joint_stiffness_error": _stiffness_error,
    "base_compliance": _base_compliance,
    "base_slip": _base_slip,
    "link_flexibility": _links,
}
EFFECTS = tuple(_DRAW)
