"""An arm of hinges in MuJoCo: springs, dry friction, dampers and plays of an engine not ours.

The model is built at the commanded pose: every body's frame stands parallel to the base, so a hinge
that reads zero is the arm without load. What gives way in one place stands in series as further
hinges about the same axis. There is no gravity: the drives hold the weight.

Statics come from stepping: every hinge has so much armature that its spring swings at `SWING` and
is critically damped, and a load is stepped on until nothing moves any more. MuJoCo's dry friction
is regularised: below its threshold a hinge still creeps, at about `1e-4 SWING^2 STEP_S` of its
deflection per second, which is why the armature is large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco  # type: ignore[import-untyped]
import numpy as np

from rig.arrays import Array
from rig.worlds.arm import place

STEP_S = 0.02
SWING = 6.0  # rad/s
STILL_RAD_PER_S = 3e-7
RAMP_S = 2.0  # the screw is turned
SETTLE_S = 2.0  # at least, before it is asked whether anything moves
PATIENCE_S = 15.0
_AT_ONCE = 5  # steps under one set of torques
_OPTION = (
    f'<option timestep="{STEP_S}" gravity="0 0 0" integrator="implicitfast" '
    'iterations="30" tolerance="1e-22"/>'
)


@dataclass(frozen=True)
class Hinge:
    """One thing that turns.

    place: `base`, `joint1` to `joint6`, `link2`, `link3` (the middle of a segment). axis (3,), at
    (3,) in the base frame, m. stiffness Nm/rad of its spring; stop_stiffness: of a second one that
    acts only beyond stop_rad to either side (with stiffness 0: a play); friction_Nm: dry, in
    parallel; damping Nm s/rad (left out: critical); reference: stiffness that the armature goes
    by, of a hinge whose own spring is not stiff.
    """

    place: str
    axis: Array
    at: Array
    stiffness: float
    stop_stiffness: float = 0.0
    stop_rad: float = 0.0
    friction_Nm: float = 0.0
    damping: float | None = None
    reference: float | None = None


class MujocoArm:
    """The arm at q (6) rad with a point of load tool (3) m in the base frame.

    turns: 1, or a factor by which forces, frictions and plays are made smaller for the engine and
    what moves larger again: the laws stay what they are, and finite turns lose their effect.
    """

    def __init__(self, q: Array, tool: Array, hinges: Sequence[Hinge], turns: float = 1.0) -> None:
        self.hinges, self._turns = tuple(hinges), turns
        smaller = [
            replace(h, friction_Nm=h.friction_Nm * turns, stop_rad=h.stop_rad * turns)
            for h in hinges
        ]
        xml = _xml(np.asarray(q, dtype=float), tool, smaller)
        self._model = mujoco.MjModel.from_xml_string(xml)
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._body = self._model.body("joint6").id
        self._start = self._data.site("tool").xpos.copy()
        self._force = np.zeros(3)
        # qpos of hinge i, in the order of `hinges`
        self._order = [int(self._model.joint(f"h{i}").qposadr[0]) for i in range(len(hinges))]

    def load(self, force: Array, patience: float = PATIENCE_S) -> None:
        """Goes over to another force (3) N within the turn of the screw, then until all is still.

        patience: after so many seconds the wait ends at the latest. What creeps does not come to
        rest, and creeps all the while: whoever keeps a clock gives it SETTLE_S.
        """
        new = self._turns * np.asarray(force, dtype=float)
        old, parts = self._force, round(RAMP_S / STEP_S / _AT_ONCE)
        for k in range(1, parts + 1):
            self._push(old + (new - old) * k / parts)
        self._force = new
        self.hold(SETTLE_S)
        waited = SETTLE_S
        while np.abs(self._data.qvel).max() > self._turns * STILL_RAD_PER_S and waited < patience:
            self.hold(0.5)
            waited += 0.5

    def hold(self, seconds: float) -> None:
        """Lets time pass under the load."""
        for _ in range(max(1, round(seconds / STEP_S / _AT_ONCE))):
            self._push(self._force)

    def give_back(self, hinge: int) -> None:
        """Takes a hinge back to where it stood at first, as a controller does between runs."""
        self._data.qpos[self._order[hinge]] = 0.0
        self._data.qvel[:] = 0.0
        self.hold(SETTLE_S)

    def displacement(self) -> Array:
        """(3,) m: of the point of load since the beginning."""
        return np.asarray(self._data.site("tool").xpos - self._start) / self._turns

    def turned(self) -> Array:
        """(number of hinges,) rad."""
        return np.asarray(self._data.qpos[self._order]) / self._turns

    def _push(self, force: Array) -> None:
        """A few steps with the torques that the force makes on the arm as it stands now."""
        d = self._data
        d.qfrc_applied[:] = 0.0
        mujoco.mj_applyFT(
            self._model, d, force, np.zeros(3), d.site("tool").xpos, self._body, d.qfrc_applied
        )
        mujoco.mj_step(self._model, d, _AT_ONCE)


def places(q: Array) -> dict[str, tuple[Array, Array]]:
    """Axis and point of every joint; of the segments, their direction and middle."""
    arm = place(q)
    out = {f"joint{j + 1}": (arm.axes[j], arm.points[j]) for j in range(6)}
    for segment in (2, 3):
        start, end = arm.points[segment - 1], arm.points[segment]
        along = (end - start) / np.linalg.norm(end - start)
        out[f"link{segment}"] = (along, (start + end) / 2)
    return out


_CHAIN = ("base", "joint1", "joint2", "link2", "joint3", "link3", "joint4", "joint5", "joint6")


def _xml(q: Array, tool: Array, hinges: Sequence[Hinge]) -> str:
    """The model as MJCF: bodies within bodies, tendons for the springs that have play."""
    spots = places(q)
    origin, opening = np.zeros(3), []
    for name in _CHAIN:
        at = spots[name][1] if name in spots else np.zeros(3)
        opening.append(f'<body name="{name}" pos="{_row(at - origin)}">')
        opening += [_hinge(i, h, at) for i, h in enumerate(hinges) if h.place == name]
        opening.append('<inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/>')
        origin = at
    opening.append(f'<site name="tool" pos="{_row(tool - origin)}"/>')
    tendons = [_tendon(i, h) for i, h in enumerate(hinges) if h.stop_stiffness > 0]
    world = "\n".join(opening) + "</body>" * len(_CHAIN)
    return (
        f'<mujoco><compiler angle="radian"/>{_OPTION}<worldbody>{world}</worldbody>'
        f"<tendon>{''.join(tendons)}</tendon></mujoco>"
    )


def _hinge(number: int, h: Hinge, origin: Array) -> str:
    reference = h.reference or h.stiffness
    armature = reference / SWING**2
    damping = 2 * armature * SWING if h.damping is None else h.damping
    friction = (
        f' frictionloss="{h.friction_Nm:.9g}" solreffriction="{2.5 * STEP_S} 1" '
        'solimpfriction="0.9999 0.9999 0.001 0.5 2"'
        if h.friction_Nm > 0
        else ""
    )
    return (
        f'<joint name="h{number}" type="hinge" axis="{_row(h.axis)}" pos="{_row(h.at - origin)}" '
        f'stiffness="{h.stiffness:.9g}" damping="{damping:.9g}" armature="{armature:.9g}"'
        f"{friction}/>"
    )


def _tendon(number: int, h: Hinge) -> str:
    return (
        f'<fixed stiffness="{h.stop_stiffness:.9g}" '
        f'springlength="{-h.stop_rad:.9g} {h.stop_rad:.9g}">'
        f'<joint joint="h{number}" coef="1"/></fixed>'
    )


def _row(vector: Array) -> str:
    return " ".join(f"{c:.12g}" for c in vector)
