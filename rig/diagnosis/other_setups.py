"""Where else the arm of a data set could be measured: other poses, other axes."""

from __future__ import annotations

import numpy as np

from identification.arm import Arm, tool_offset
from identification.arrays import Array
from identification.gap.answer.designs import Elsewhere
from identification.inverse import solutions
from rig.dataset import Dataset
from rig.diagnosis.gap_data import arm_setup
from rig.meta import Meta
from rig.models.model import AXES, ArmModel
from rig.models.robot import load_robot
from rig.units import MM_PER_M

_NEARER_M = 0.2  # of the point of load towards the base's axis: levers about a quarter shorter
_ROUNDING_M = 1e-3
_CLEAR_M = 0.15  # above what the base stands on: a link is as thick, and cables hang from it


def elsewhere(dataset: Dataset, model: ArmModel | None = None) -> list[Elsewhere]:
    """Other poses with the directions of the first one, and base axes not loaded yet; empty for a
    rig without an arm. Poses that the arm does not reach are left out. model: whose links and
    mounting are simulated."""
    meta = dataset.meta
    if meta.robot == "none":
        return []
    arm = load_robot(meta.robot)
    first = next(iter(dict.fromkeys(str(p) for p in dataset.columns["pose"][dataset.used])))
    tcp = np.array(meta.poses[first].tcp_xyz_mm) / MM_PER_M
    out = []
    for name, (text, q) in other_poses(arm, meta, first).items():
        setups = tuple(
            arm_setup(arm, name, q, tcp, d, np.array(n), model) for d, n in meta.directions.items()
        )
        out.append(Elsewhere(name.rsplit("_", maxsplit=1)[-1], text, setups))
    vectors = np.array(list(meta.directions.values()))
    for axis, vector in AXES.items():
        if np.abs(vectors @ np.array(vector)).max() < 0.9 and axis not in meta.directions:
            q = np.array(meta.poses[first].q_rad)
            one = arm_setup(arm, first, q, tcp, axis, np.array(vector), model)
            text = f"Load along {axis} of the base frame as well: other joints carry there."
            out.append(Elsewhere(f"axis {axis}", text, (one,)))
    return out


def other_poses(arm: Arm, meta: Meta, first: str) -> dict[str, tuple[str, Array]]:
    """Name -> (what to do, joint positions (6,) rad): nearer to the base, and elbow turned. Nobody
    says what stands around the arm; but no joint is lower than a pose that was measured has one, or
    than is clear of what the base stands on."""
    pose = meta.poses[first]
    q, tool = np.array(pose.q_rad), tool_offset(np.array(pose.tcp_xyz_mm) / MM_PER_M)
    here = arm.fk(q, tool)
    near = here.copy()
    reach = float(np.hypot(here[0, 3], here[1, 3]))
    share = min(_NEARER_M, 0.4 * reach) / max(reach, 1e-9)
    near[:2, 3] *= 1 - share
    floor, out = min(_lowest(arm, q), _CLEAR_M) - _ROUNDING_M, {}
    found = _nearest(arm, near @ np.linalg.inv(tool), q, floor)
    if found is not None:
        text = (
            f"Repeat the procedure with the point of load {MM_PER_M * share * reach:.0f} mm nearer "
            "to the base: levers, links, base and gains scale differently."
        )
        out[f"{first}_nearer"] = (text, found)
    turned = [
        p
        for p in solutions(arm, here @ np.linalg.inv(tool), float(q[5])).values()
        if p[2] * q[2] < 0 and _lowest(arm, p) >= floor
    ]
    if turned:
        best = min(turned, key=lambda p: float(np.abs(_wrapped(p - q)).max()))
        text = (
            "Repeat the procedure with the elbow turned over, at the same point of load: base and "
            "instruments see the same, the joints do not."
        )
        out[f"{first}_turned"] = (text, best)
    return out


def _lowest(arm: Arm, q: Array) -> float:
    """m above the base's plane of the lowest joint beyond the shoulder, or the flange."""
    return float(arm.frames(q)[2:, 2, 3].min())


def _nearest(arm: Arm, flange: Array, q: Array, floor: float) -> Array | None:
    each = solutions(arm, flange, float(q[5])).values()
    found = [p for p in each if _lowest(arm, p) >= floor]
    if not found:
        return None
    return min(found, key=lambda p: float(np.abs(_wrapped(p - q)).max()))


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
