"""A simulated rig: an arm of compliant elements, and a screw that pushes on it.

Every compliance of the rig, whether in a joint, a link, the base or the fixture, is an `Element`:
a lever g (3) and laws. A force f at the tool loads it with `g . f`; when it deflects by p, the
tool moves by `g p` (virtual work). Levers belong to the commanded pose: what deflections of some
milliradians change in them is left out (below 1 % of the deflection), and so is the arm's mass.

The screw stands in series with the arm and pushes only; it is driven by displacement. In every
step the force is the root of

    u(F) + F / k_screw = advance - gap,    F >= 0,

so that the force stalls when the arm gives way while the screw goes on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rig.arrays import Array
from rig.worlds.arm import Placement, place
from rig.worlds.balance import root
from rig.worlds.laws import Law

HOME_GAP_M = 0.3e-3  # air between screw and arm after the set-up
HAND_SPEED_M_PER_S = 0.4e-3  # a fine thread, most of a turn in a second
SCREW_STIFFNESS_N_PER_M = 5.0e6  # screw and dynamometer
LOOSENING_M_PER_S = 1.0e-3  # backwards
ZERO_PLATEAU_S = 6.0  # after a run, unless told otherwise
CONTROLLER_WAITS_S = 14.0  # after that, before the controller takes yielded joints back
NEW_CONTACT_AFTER_S = 1.0  # without touching, before the fixture seats itself anew
SEATING_FORCE_N = 5.0  # at which half of a contact's seating scatter has shown


@dataclass
class Element:
    """One compliance. `lever` gives g (3) for a placement and a tool position; `joint` is the
    joint (0 to 5) whose encoder sees the deflection, None if none does."""

    lever: Callable[[Placement, Array], Array]
    laws: tuple[Law, ...]
    joint: int | None = None


def joint_element(joint: int, *laws: Law) -> Element:
    """The element of joint 0 to 5: its lever is the joint's column of the Jacobian matrix."""

    def lever(placement: Placement, tool: Array) -> Array:
        row: Array = placement.levers(tool)[joint]
        return row

    return Element(lever, laws, joint)


@dataclass(frozen=True)
class Design:
    """What a world is made of; `elements` builds them unloaded and without history.

    `scatter_relative`, `scatter_m`: standard deviations of what differs from one loading to the
    next, in proportion to the deflection and apart from it.
    """

    name: str
    title: str
    q_rad: tuple[float, ...]
    elements: Callable[[], tuple[Element, ...]]
    tcp_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scatter_relative: float = 0.005
    scatter_m: float = 3.0e-6


@dataclass(frozen=True, slots=True)
class State:
    """The rig at the end of a step: force on the arm and displacement of the tool along the
    mounted direction (without the gains of the instruments), deflection of the joints (6) rad."""

    force_N: float
    displacement_m: float
    joints_rad: tuple[float, ...]


class World:
    """A rig with its history. The same seed and the same calls give the same states.

    `before` counts loadings of an earlier sitting: those to come scatter apart from them, about
    the same gains.
    `force_gain` and `displacement_gain` are the true gains of the two chains, drawn once from
    their stated relative standard deviations; whoever senses the world applies them.
    `controller_waits_s`: unloaded so long, the controller takes yielded joints back; longer than
    the zero plateau after a run, shorter than the pause before the next.
    `torques_per_N` (6): what a newton along the mounted direction puts on the joints, Nm.
    """

    def __init__(
        self,
        design: Design,
        seed: int,
        force_gain_sd: float = 0.005,
        displacement_gain_sd: float = 0.003,
        before: int = 0,
    ) -> None:
        streams = np.random.SeedSequence(seed).spawn(2 + before)
        gains, self._scatter = (np.random.default_rng(streams[i]) for i in (0, 1 + before))
        self.design = design
        self.seed = seed
        self.force_gain = float(1.0 + force_gain_sd * gains.standard_normal())
        self.displacement_gain = float(1.0 + displacement_gain_sd * gains.standard_normal())
        self.controller_waits_s = ZERO_PLATEAU_S + CONTROLLER_WAITS_S
        self._elements = design.elements()
        self.direction = np.array([1.0, 0.0, 0.0])
        self.move(design.q_rad, design.tcp_m)

    def move(self, q_rad: Sequence[float], tcp_m: Sequence[float] | None = None) -> None:
        """The unloaded arm stands in another pose: joint angles (6) rad, tool (3) m in the
        flange frame (left as it was if None)."""
        self.q = _vector("joint angles", q_rad, 6)
        if tcp_m is not None:
            self.tcp_m = _vector("tool position", tcp_m, 3)
        self.placement = place(self.q)
        self.gravity_torques = self.placement.gravity_torques()
        self._set_up()

    def mount(self, direction: Sequence[float]) -> None:
        """Sets up screw and laser along a unit vector (3) of the base frame, without load."""
        vector = _vector("direction", direction, 3)
        length = float(np.linalg.norm(vector))
        if abs(length - 1.0) > 1e-3:
            raise ValueError(f"direction {list(direction)} has length {length:.4g}; it must be 1")
        self.direction = vector / length
        self._set_up()

    def _set_up(self) -> None:
        self.advance_m = 0.0
        self.target_m = 0.0
        self._relative, self._seating_m = 0.0, 0.0
        self._unloaded_s = self._peak_N = math.inf
        self._force = 0.0
        self._compliance = 1.0 / SCREW_STIFFNESS_N_PER_M
        self._aim()
        self._return_to_position(math.inf)
        self.state = self._take(0.0, math.inf)

    def _aim(self) -> None:
        tool = self.placement.tool(self.tcp_m)
        self.torques_per_N: Array = self.placement.levers(tool) @ self.direction
        self._active = tuple(
            (float(e.lever(self.placement, tool) @ self.direction), e) for e in self._elements
        )

    @property
    def turning(self) -> bool:
        """Whether the hand is still turning the screw."""
        return self.advance_m != self.target_m

    def turn(self, advance_m: float) -> None:
        """The hand begins to turn the screw by so much more advance; `step` carries it out."""
        if not math.isfinite(advance_m):
            raise ValueError(f"the screw can't be turned by {advance_m} m")
        self.target_m += advance_m

    def step(self, dt: float) -> State:
        """Goes on by `dt` seconds: turns the screw at the hand's speed, finds the force."""
        left = self.target_m - self.advance_m
        most = (LOOSENING_M_PER_S if left < 0 else HAND_SPEED_M_PER_S) * dt
        self.advance_m = (
            self.target_m if abs(left) <= most else self.advance_m + math.copysign(most, left)
        )
        self._redraw_at_contact(self.advance_m - HOME_GAP_M)
        return self._end_step(self._balance(self.advance_m - HOME_GAP_M, dt), dt)

    def impose(self, force_N: float, dt: float) -> State:
        """Turns the screw until, `dt` seconds later, the force is `force_N` (0 or more)."""
        if not (math.isfinite(force_N) and force_N >= 0):
            raise ValueError(f"force {force_N} N; a screw that pushes gives 0 N or more")
        if force_N > 0:
            self._redraw_at_contact(math.inf)
        state = self._end_step(force_N, dt)
        clearance = HOME_GAP_M if force_N == 0 else 0.0
        reach = state.displacement_m + force_N / SCREW_STIFFNESS_N_PER_M
        self.advance_m = self.target_m = HOME_GAP_M + reach - clearance
        return state

    def _end_step(self, force: float, dt: float) -> State:
        before = self.state
        self._force = force
        self.state = self._take(force, dt)
        if force > 0:
            self._unloaded_s = 0.0
            self._peak_N = max(self._peak_N, force)
            rise = force - before.force_N
            if abs(rise) > 1e-6:
                moved = self.state.displacement_m - before.displacement_m
                self._compliance = max(moved / rise, 0.0) + 1.0 / SCREW_STIFFNESS_N_PER_M
        else:
            self._unloaded_s += dt
            if self._unloaded_s > self.controller_waits_s:
                self._return_joints(dt)
        return self.state

    def _return_joints(self, dt: float) -> None:
        """The controller brings the arm back, and the hand keeps the screw off its way."""
        before = self._displacement(0.0, 0.0)
        self._return_to_position(dt)
        after = self._displacement(0.0, 0.0)
        away = min(before - after, self.advance_m - after)
        if away > 0:
            self.advance_m -= away
            self.target_m -= away

    def _return_to_position(self, dt: float) -> None:
        for element in self._elements:
            for law in element.laws:
                law.return_to_position(dt)

    def _redraw_at_contact(self, reach: float) -> None:
        # A touch that never carried load seats nothing: how often the hand feels for the arm must
        # not decide which scatter a loading gets.
        parted = self._unloaded_s >= NEW_CONTACT_AFTER_S and self._peak_N > SEATING_FORCE_N
        if parted and reach > self.state.displacement_m:
            draw = self._scatter.standard_normal(2)
            self._relative = float(self.design.scatter_relative * draw[0])
            self._seating_m = float(self.design.scatter_m * draw[1])
            self._unloaded_s = self._peak_N = 0.0

    def _displacement(self, force: float, dt: float) -> float:
        total = 0.0
        for lever, element in self._active:
            load = lever * force
            for law in element.laws:
                total += lever * law.respond(load, dt)
        return (1.0 + self._relative) * total + self._seating(force)

    def _seating(self, force: float) -> float:
        return self._seating_m * force / (force + SEATING_FORCE_N)

    def _take(self, force: float, dt: float) -> State:
        joints = [0.0] * 6
        total = 0.0
        for lever, element in self._active:
            load = lever * force
            deflection = (1.0 + self._relative) * sum(law.advance(load, dt) for law in element.laws)
            total += lever * deflection
            if element.joint is not None:
                joints[element.joint] += deflection
        return State(force, total + self._seating(force), tuple(joints))

    def _balance(self, reach: float, dt: float) -> float:
        """The force at which arm and screw share `reach`.

        The excess rises at least with 1 / k_screw, which bounds the force from above.
        """

        def excess(force: float) -> float:
            return self._displacement(force, dt) + force / SCREW_STIFFNESS_N_PER_M - reach

        most = max(0.0, reach - self._displacement(0.0, dt)) * SCREW_STIFFNESS_N_PER_M
        return root(excess, self._force, self._compliance, most)


def _vector(what: str, values: Sequence[float], length: int) -> Array:
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (length,) or not np.all(np.isfinite(vector)):
        raise ValueError(f"{what} {list(values)}: {length} finite numbers are needed")
    return vector
