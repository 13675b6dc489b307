"""A six-axis arm: kinematics, compliance of its joints, torques of gravity and load.

Frames follow the standard Denavit-Hartenberg convention (Denavit, Hartenberg 1955; Craig calls
it the distal one): `T_{i-1,i} = Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i)`; frame 0 is the base, frame 6
the flange. Everything is SI and expressed in the base frame. Six-vectors put translation (force)
first, rotation (moment) second. Poses are vectorised: `q` may have any leading shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array
from identification.elastic import Beam, transport

JOINTS = 6
STANDARD_GRAVITY = (0.0, 0.0, -9.80665)  # m/s^2 in the base frame of an arm that stands upright


@dataclass(frozen=True, eq=False)
class Arm:
    """What a model file says of an arm, and what follows from it.

    d, a m, alpha rad, mass kg, torque_limit Nm, q_min, q_max rad, joint_stiffness Nm/rad,
    joint_stiffness_relative_sd: (6,) each. centre (6, 3) m: centre of mass of link i in frame i.
    payload kg, fixed to the flange at payload_centre (3,) m in the flange frame; what the arm may
    carry is payload_limit. links: elastic segments, fixed to frame `Beam.frame`.
    Raises ValueError for shapes or values that no arm can have.
    """

    name: str
    d: Array
    a: Array
    alpha: Array
    mass: Array = field(default_factory=lambda: np.zeros(JOINTS))
    centre: Array = field(default_factory=lambda: np.zeros((JOINTS, 3)))
    torque_limit: Array = field(default_factory=lambda: np.full(JOINTS, np.inf))
    q_min: Array = field(default_factory=lambda: np.full(JOINTS, -2 * np.pi))
    q_max: Array = field(default_factory=lambda: np.full(JOINTS, 2 * np.pi))
    joint_stiffness: Array = field(default_factory=lambda: np.full(JOINTS, np.nan))
    joint_stiffness_relative_sd: Array = field(default_factory=lambda: np.zeros(JOINTS))
    payload: float = 0.0
    payload_centre: Array = field(default_factory=lambda: np.zeros(3))
    payload_limit: float = np.inf
    links: tuple[Beam, ...] = ()

    def __post_init__(self) -> None:
        """Checks and freezes the arrays."""
        shapes = {"centre": (JOINTS, 3), "payload_centre": (3,)}
        for name in _ARRAYS:
            value = np.array(getattr(self, name), dtype=float)
            wanted = shapes.get(name, (JOINTS,))
            if value.shape != wanted:
                raise ValueError(f"{name} of {self.name} has shape {value.shape}; {wanted} wanted")
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        for name in ("d", "a", "alpha", "mass", "centre"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} of {self.name} holds values that are not finite")
        if (self.mass < 0).any() or self.payload < 0:
            raise ValueError(f"a mass of {self.name} is negative")
        if not (self.q_min < self.q_max).all():
            raise ValueError(f"a lower joint limit of {self.name} is not below the upper one")
        if (self.joint_stiffness <= 0).any():
            raise ValueError(f"joint stiffness of {self.name} must be above 0 Nm/rad")
        if not all(0 <= link.frame <= JOINTS for link in self.links):
            raise ValueError(f"a link segment of {self.name} names a frame that is not 0..{JOINTS}")

    def with_stiffness(self, joint_stiffness: ArrayLike, relative_sd: ArrayLike = 0.0) -> Arm:
        """The same arm with other springs (6,) Nm/rad."""
        sd = np.broadcast_to(np.asarray(relative_sd, dtype=float), (JOINTS,))
        return replace(
            self, joint_stiffness=np.asarray(joint_stiffness), joint_stiffness_relative_sd=sd
        )

    # --- kinematics -----------------------------------------------------------------------------

    def frames(self, q: ArrayLike) -> Array:
        """Poses of frames 0..6 in the base frame, (..., 7, 4, 4), for q (..., 6) rad."""
        angles = joint_positions(q)
        cos, sin = np.cos(angles), np.sin(angles)
        ca, sa = np.cos(self.alpha), np.sin(self.alpha)
        out = np.zeros((*angles.shape[:-1], JOINTS + 1, 4, 4))
        out[..., 0, :, :] = np.eye(4)
        step = np.zeros((*angles.shape[:-1], 4, 4))
        step[..., 3, 3] = 1.0
        for i in range(JOINTS):
            c, s = cos[..., i], sin[..., i]
            step[..., 0, 0], step[..., 0, 1], step[..., 0, 2] = c, -s * ca[i], s * sa[i]
            step[..., 1, 0], step[..., 1, 1], step[..., 1, 2] = s, c * ca[i], -c * sa[i]
            step[..., 2, 1], step[..., 2, 2] = sa[i], ca[i]
            step[..., 0, 3], step[..., 1, 3], step[..., 2, 3] = (
                self.a[i] * c,
                self.a[i] * s,
                self.d[i],
            )
            out[..., i + 1, :, :] = out[..., i, :, :] @ step
        return out

    def fk(self, q: ArrayLike, tool: ArrayLike | None = None) -> Array:
        """Pose of the tool (of the flange without one) in the base frame, (..., 4, 4)."""
        flange = self.frames(q)[..., JOINTS, :, :]
        return flange if tool is None else np.asarray(flange @ tool_transform(tool))

    def jacobian(self, q: ArrayLike, tool: ArrayLike | None = None) -> Array:
        """Geometric Jacobian at the tool, (..., 6, 6): twist of the tool's point = J dq.

        Column i is `[z_i x (p - p_i); z_i]`, z_i and p_i axis and origin of frame i-1.
        """
        frames = self.frames(q)
        return _columns(frames, tool_point(frames, tool))

    def inverse(self, T: ArrayLike, q6: float = 0.0) -> Array:
        """All closed-form solutions, (..., 8, 6) rad, NaN where a branch does not exist.

        See `identification.inverse.solve`.
        """
        from identification.inverse import solve

        return solve(self, T, q6)

    # --- torques --------------------------------------------------------------------------------

    def gravity_torques(self, q: ArrayLike, gravity: Sequence[float] = STANDARD_GRAVITY) -> Array:
        """Torques (..., 6) Nm that the joints must hold against the weights of links and payload.

        `tau_i = -sum_k m_k z_i x (c_k - p_i) . g` over the links k >= i: the gradient of the
        potential energy.
        """
        frames = self.frames(q)
        g = np.asarray(gravity, dtype=float)
        tau = np.zeros((*frames.shape[:-3], JOINTS))
        for k, (mass, point) in enumerate(self._weights(frames), start=1):
            last = min(k, JOINTS)
            z, p = frames[..., :last, :3, 2], frames[..., :last, :3, 3]
            lever = np.cross(z, point[..., None, :] - p)
            tau[..., :last] -= mass * (lever @ g)
        return tau

    def load_torques(self, q: ArrayLike, wrench: ArrayLike, tool: ArrayLike | None = None) -> Array:
        """`tau = J^T W` (..., 6) Nm for a wrench (..., 6) N, Nm on the tool's point."""
        W = np.asarray(wrench, dtype=float)
        return np.asarray(np.einsum("...ij,...i->...j", self.jacobian(q, tool), W))

    def loaded_term(
        self,
        q: ArrayLike,
        wrench: ArrayLike,
        tool: ArrayLike | None = None,
        gravity: Sequence[float] | None = None,
    ) -> Array:
        """Geometric stiffness K_C (..., 6, 6) Nm/rad: `dtau_i / dq_j` of a load that keeps its
        direction in space, so that `K_x = J^-T (K_theta - K_C) J^-1` (Chen, Kao 2000).

        With `gravity` (3,) m/s^2 the arm's own weight counts as a load too. Symmetric for forces;
        a constant moment has no potential, its part is not symmetric.
        """
        frames = self.frames(q)
        W = np.asarray(wrench, dtype=float)
        z = frames[..., :JOINTS, :3, 2]
        origin = frames[..., :JOINTS, :3, 3]
        out = _force_hessian(z, origin, tool_point(frames, tool), W[..., :3])
        turned = np.cross(z[..., None, :, :], z[..., :, None, :])  # [i, j] = z_j x z_i
        moment = np.einsum("...ijk,...k->...ij", turned, W[..., 3:])
        out += np.tril(moment, -1)
        if gravity is not None:
            g = np.asarray(gravity, dtype=float)
            for k, (mass, point) in enumerate(self._weights(frames), start=1):
                part = _force_hessian(z, origin, point, mass * g)
                part[..., min(k, JOINTS) :, :] = 0.0
                part[..., :, min(k, JOINTS) :] = 0.0
                out += part
        return out

    def _weights(self, frames: Array) -> list[tuple[float, Array]]:
        """Mass and place (..., 3) of the links 1..6, then of the payload."""
        out = [
            (float(self.mass[k]), _apply(frames[..., k + 1, :, :], self.centre[k]))
            for k in range(JOINTS)
        ]
        if self.payload > 0:
            out.append((self.payload, _apply(frames[..., JOINTS, :, :], self.payload_centre)))
        return out

    # --- compliance -----------------------------------------------------------------------------

    def compliance(
        self,
        q: ArrayLike,
        tool: ArrayLike | None = None,
        *,
        wrench: ArrayLike | None = None,
        gravity: Sequence[float] | None = None,
        links: Sequence[Beam] = (),
        base: ArrayLike | None = None,
    ) -> Array:
        """Cartesian compliance at the tool (..., 6, 6): twist = C wrench, m/N, rad/Nm.

        `C = J (K_theta - K_C)^-1 J^T`, with K_C = 0 unless `wrench` (..., 6) or `gravity` are
        given (Salisbury 1980; Chen, Kao 2000). In series with it: `links`, elastic segments, and
        `base` (6, 6), compliance of the mounting at the base frame's origin.
        Raises ValueError when the arm has no joint stiffness, or buckles under the load.
        """
        if not np.isfinite(self.joint_stiffness).all():
            raise ValueError(f"the model of {self.name} has no joint stiffness for all six joints")
        frames = self.frames(q)
        point = tool_point(frames, tool)
        J = _columns(frames, point)
        if wrench is None and gravity is None:
            C = (J / self.joint_stiffness) @ np.swapaxes(J, -1, -2)
        else:
            load = np.zeros(6) if wrench is None else wrench
            K = np.diag(self.joint_stiffness) - self.loaded_term(q, load, tool, gravity)
            symmetric = (K + np.swapaxes(K, -1, -2)) / 2
            if (np.linalg.eigvalsh(symmetric)[..., 0] <= 0).any():
                raise ValueError("the load exceeds what the joint springs can carry (buckling)")
            C = J @ np.linalg.solve(K, np.swapaxes(J, -1, -2))
        for link in links:
            C = C + _segment(link, frames[..., link.frame, :, :], point)
        if base is not None:
            A = transport(point)
            C = C + A @ np.asarray(base, dtype=float) @ np.swapaxes(A, -1, -2)
        return C


_ARRAYS = (
    "d",
    "a",
    "alpha",
    "mass",
    "centre",
    "torque_limit",
    "q_min",
    "q_max",
    "joint_stiffness",
    "joint_stiffness_relative_sd",
    "payload_centre",
)


def along(compliance: Array, direction: ArrayLike) -> Array:
    """Stiffness N/m (...) along unit vectors (..., 3), compliance (..., 6, 6) or (..., 3, 3)."""
    n = unit_vector(direction)
    c = np.einsum("...i,...ij,...j->...", n, compliance[..., :3, :3], n)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / c)


def unit_vector(direction: ArrayLike) -> Array:
    """`direction` (..., 3), checked and normalised.

    Raises ValueError when its length is not 1 within 1e-3 (components typed with four digits pass).
    """
    n = np.asarray(direction, dtype=float)
    if n.shape[-1:] != (3,):
        raise ValueError(f"a direction has three components, not shape {n.shape}")
    length = np.linalg.norm(n, axis=-1, keepdims=True)
    wrong = ~(np.abs(length[..., 0] - 1.0) <= 1e-3)
    if wrong.any():
        first = np.argmax(wrong)
        given = n.reshape(-1, 3)[first].tolist()
        raise ValueError(
            f"direction {given} has length {length.reshape(-1)[first]:.6g}; a unit vector is wanted"
        )
    return np.asarray(n / length)


def invert_compliance(C: Array) -> Array:
    """Stiffness (..., 6, 6) from compliance; ValueError where it is singular.

    Rows are scaled first: N/m and Nm/rad differ by orders of magnitude without being singular.
    """
    scale = np.sqrt(np.einsum("...ii->...i", C))
    if not (scale > 0).all():
        raise ValueError("singular pose: along some axis no joint gives way, stiffness is infinite")
    scaled = C / (scale[..., :, None] * scale[..., None, :])
    # beyond this the inverse of doubles holds no trustworthy digit
    if not (np.linalg.cond(scaled) < 1e13).all():
        raise ValueError(
            "singular pose: the Jacobian loses rank, stiffness is infinite along some twist; "
            "use the compliance, or a pose away from the singularity"
        )
    inverse = np.linalg.inv(scaled)
    return np.asarray(inverse / (scale[..., :, None] * scale[..., None, :]))


def joint_positions(q: ArrayLike) -> Array:
    """q (..., 6) rad, checked. Raises ValueError for another shape or values not finite."""
    angles = np.asarray(q, dtype=float)
    if angles.shape[-1:] != (JOINTS,):
        raise ValueError(f"joint positions have shape {angles.shape}; the last axis must be 6")
    if not np.isfinite(angles).all():
        raise ValueError("joint positions hold values that are not finite")
    return angles


def tool_transform(tool: ArrayLike) -> Array:
    """flange_T_tcp (..., 4, 4), checked to be a rigid motion; ValueError otherwise."""
    T = np.asarray(tool, dtype=float)
    if T.shape[-2:] != (4, 4):
        raise ValueError(f"a tool is a 4 x 4 matrix flange_T_tcp, not of shape {T.shape}")
    R = T[..., :3, :3]
    orthogonal = np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max() < 1e-6
    if not (orthogonal and (np.linalg.det(R) > 0).all() and np.isfinite(T).all()):
        raise ValueError("the tool's rotation is no rotation matrix")
    if not (T[..., 3, :] == [0, 0, 0, 1]).all():
        raise ValueError("the tool's last row must be 0, 0, 0, 1")
    return T


def tool_offset(xyz: ArrayLike) -> Array:
    """flange_T_tcp of a tool that only shifts, xyz (3,) m in the flange frame."""
    T = np.eye(4)
    T[:3, 3] = xyz
    return T


def tool_point(frames: Array, tool: ArrayLike | None) -> Array:
    """Position (..., 3) m of the tool (of the flange without one) for `Arm.frames`."""
    flange = frames[..., JOINTS, :, :]
    placed = flange if tool is None else flange @ tool_transform(tool)
    return np.asarray(placed[..., :3, 3])


def _columns(frames: Array, point: Array) -> Array:
    z, p = frames[..., :JOINTS, :3, 2], frames[..., :JOINTS, :3, 3]
    lever = np.cross(z, point[..., None, :] - p)
    return np.swapaxes(np.concatenate([lever, z], axis=-1), -1, -2)


def _force_hessian(z: Array, origin: Array, point: Array, force: Array) -> Array:
    """Second derivative of `F . p(q)`, [i, j] = F . (z_i x (z_j x r_j)) for i <= j, symmetric."""
    lever = np.cross(z, point[..., None, :] - origin)  # (..., 6, 3)
    second = np.cross(z[..., :, None, :], lever[..., None, :, :])
    upper = np.triu(np.einsum("...ijk,...k->...ij", second, force))
    return np.asarray(upper + np.swapaxes(np.triu(upper, 1), -1, -2))


def _segment(link: Beam, frame: Array, point: Array) -> Array:
    """Compliance that an elastic segment contributes at `point` (..., 3)."""
    R = frame[..., :3, :3] @ link.axes()
    A = transport(point - _apply(frame, np.asarray(link.end)))
    A = A @ _both(R)
    return np.asarray(A @ link.compliance() @ np.swapaxes(A, -1, -2))


def _both(R: Array) -> Array:
    out = np.zeros((*R.shape[:-2], 6, 6))
    out[..., :3, :3] = R
    out[..., 3:, 3:] = R
    return out


def _apply(T: Array, point: Array) -> Array:
    return np.asarray(T[..., :3, :3] @ point + T[..., :3, 3])
