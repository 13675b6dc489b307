"""The arm against engines that nobody here wrote; each is skipped where it is not installed."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.arm import Arm, along, tool_offset
from identification.coupling import coupled, mirror_axes
from identification.elastic import STEEL, Beam, cantilever, tube
from rig.models.model import load_model
from rig.models.robot import MODELS, load_robot

Array = NDArray[np.float64]


@pytest.fixture(params=["ur10e", "ur5e", "ur16e"])
def arm(request: pytest.FixtureRequest) -> Arm:
    return load_robot(request.param)


def poses(n: int) -> Array:
    return np.random.default_rng(4).uniform(-np.pi, np.pi, (n, 6))


def pinocchio_model(arm: Arm):  # type: ignore[no-untyped-def]
    pin = pytest.importorskip("pinocchio", reason="test extra: pip install pin")
    model = pin.Model()
    parent, placement = 0, pin.SE3.Identity()
    for i in range(6):
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint{i + 1}")
        c, s = np.cos(arm.alpha[i]), np.sin(arm.alpha[i])
        R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        placement = pin.SE3(R, np.array([arm.a[i], 0, arm.d[i]]))
        centre = placement.act(arm.centre[i])
        inertia = pin.Inertia(float(arm.mass[i]), centre, np.eye(3) * 1e-3)
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    frame = model.addFrame(pin.Frame("flange", parent, 0, placement, pin.FrameType.OP_FRAME))
    model.gravity.linear = np.array([0, 0, -9.80665])
    return pin, model, model.createData(), frame


def test_kinematics_jacobian_and_gravity_against_pinocchio(arm: Arm) -> None:
    pin, model, data, frame = pinocchio_model(arm)
    for q in poses(200):
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacements(model, data)
        np.testing.assert_allclose(arm.fk(q), data.oMf[frame].homogeneous, atol=1e-12)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(arm.jacobian(q), J, atol=1e-12)
        g = pin.computeGeneralizedGravity(model, data, q)
        np.testing.assert_allclose(arm.gravity_torques(q), g, atol=1e-9)


def test_inverse_against_ur_analytic_ik(arm: Arm) -> None:
    engine = pytest.importorskip("ur_analytic_ik", reason="test extra: pip install ur-analytic-ik")
    other = getattr(engine, arm.name)
    compared = 0
    for q in poses(200):
        T = arm.fk(q)
        np.testing.assert_allclose(np.array(other.forward_kinematics(*q)), T, atol=1e-9)
        theirs = np.array(other.inverse_kinematics(T)).reshape(-1, 6)
        ours = arm.inverse(T)
        ours = ours[np.isfinite(ours[:, 0])]
        for solution in theirs:
            gap = (ours - solution + np.pi) % (2 * np.pi) - np.pi
            assert np.abs(gap).max(axis=-1).min() < 1e-6
            compared += 1
        assert len(theirs) <= len(ours)
    assert compared > 1000


# --- MuJoCo: two arms of rigid links and joint springs under load -------------------------------


def _mjcf_arm(name: str, arm: Arm, q: Array, base: str, tool: Array, tail: str) -> str:
    """Nested bodies whose joints are unloaded in the pose q; `tail` stands in the tool's body."""
    closing = ""
    out = f'<body name="{name}" {base}>'
    for i in range(6):
        half = q[i] / 2
        out += f'<body quat="{np.cos(half):.17g} 0 0 {np.sin(half):.17g}">'
        out += (
            f'<joint name="{name}{i + 1}" axis="0 0 1" stiffness="{arm.joint_stiffness[i]:.17g}"/>'
            '<inertial pos="0 0 0" mass="0.01" diaginertia="1e-4 1e-4 1e-4"/>'
        )
        turn = arm.alpha[i] / 2
        out += (
            f'<body pos="{arm.a[i]:.17g} 0 {arm.d[i]:.17g}" '
            f'quat="{np.cos(turn):.17g} {np.sin(turn):.17g} 0 0">'
        )
        closing += "</body></body>"
    x, y, z = tool
    out += f'<site name="{name}_tool" pos="{x:.17g} {y:.17g} {z:.17g}"/>{tail}'
    return out + closing + "</body>"


def _equilibrium(mujoco, model, force: Array) -> Array:  # type: ignore[no-untyped-def]
    """Displacement of arm A's tool under a small force, by Newton's method on MuJoCo's own
    Jacobians and spring torques, welds held by MuJoCo's constraint Jacobian."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    site = model.site("A_tool").id
    start = data.site_xpos[site].copy()
    n = model.nv
    for _ in range(6):
        mujoco.mj_forward(model, data)
        Jp, Jr = np.zeros((3, n)), np.zeros((3, n))
        mujoco.mj_jacSite(model, data, Jp, Jr, site)
        rows = data.nefc
        E = data.efc_J.reshape(-1, n)[:rows] if rows else np.zeros((0, n))
        gap = data.efc_pos[:rows] if rows else np.zeros(0)
        K = np.diag(model.jnt_stiffness)
        A = np.block([[K, E.T], [E, np.zeros((len(E), len(E)))]])
        right = np.concatenate([Jp.T @ force + data.qfrc_spring, -gap])
        step = np.linalg.lstsq(A, right, rcond=None)[0][:n]
        data.qpos[:] += step
    mujoco.mj_forward(model, data)
    return data.site_xpos[site] - start


def test_single_stiffness_against_mujoco() -> None:
    mujoco = pytest.importorskip("mujoco", reason="test extra: pip install mujoco")
    model = load_model(MODELS / "F1.yaml")
    body = _mjcf_arm("A", model.arm, model.q, 'pos="0 0 0"', np.zeros(3), "")
    xml = (
        '<mujoco><option gravity="0 0 0"/><compiler autolimits="true"/><worldbody>'
        f"{body}</worldbody></mujoco>"
    )
    engine = mujoco.MjModel.from_xml_string(xml)
    for n in np.eye(3):
        moved = _equilibrium(mujoco, engine, 1.0 * n) @ n
        wanted = float(along(model.arm.compliance(model.q), n))
        assert 1.0 / moved == pytest.approx(wanted, rel=5e-3)


@pytest.mark.parametrize(("file", "beta_deg"), [("F1", 0.0), ("F1", 36.5), ("F2", 36.5)])
def test_rigid_coupling_against_a_mujoco_weld(file: str, beta_deg: float) -> None:
    """The second arm is no mirrored formula but a body: a mirrored arm is the same arm with
    its DH table reflected (d and alpha change sign), placed behind the mirror plane."""
    mujoco = pytest.importorskip("mujoco", reason="test extra: pip install mujoco")
    model = load_model(MODELS / f"{file}.yaml")
    beta = np.deg2rad(beta_deg)
    tool = model.tool[:3, 3]
    node = model.arm.fk(model.q, model.tool)
    axes = mirror_axes(beta)
    reflected = _reflected(model.arm)
    base = _base_of_the_mirror_image(beta, node[:3, 3])
    first = _mjcf_arm("A", model.arm, model.q, 'pos="0 0 0"', tool, "")
    second = _mjcf_arm("B", reflected, model.q, base, tool * [1, 1, -1], "")
    xml = (
        '<mujoco><option gravity="0 0 0"/><worldbody>' + first + second + "</worldbody>"
        '<equality><weld site1="A_tool" site2="B_node"/></equality></mujoco>'
    )
    # the site on B that coincides with A's tool, in position and orientation
    T = np.linalg.inv(_pose_of_b(reflected, model.q, beta, node[:3, 3])) @ node
    quat = _quaternion(T[:3, :3])
    site = (
        f'<site name="B_node" pos="{T[0, 3]:.17g} {T[1, 3]:.17g} {T[2, 3]:.17g}" '
        f'quat="{quat[0]:.17g} {quat[1]:.17g} {quat[2]:.17g} {quat[3]:.17g}"/>'
    )
    xml = xml.replace('<site name="B_tool"', site + '<site name="B_tool"')
    engine = mujoco.MjModel.from_xml_string(xml)
    for n in (axes[:, 0], axes[:, 1], np.eye(3)[0]):
        moved = _equilibrium(mujoco, engine, n) @ n
        C = coupled(model.compliance(), beta)
        assert 1.0 / moved == pytest.approx(1.0 / (n @ C[:3, :3] @ n), rel=5e-3)


def _reflected(arm: Arm) -> Arm:
    """Mirror image in the base's x-y plane, written as a DH arm again."""
    return Arm("reflected", -arm.d, arm.a, -arm.alpha, joint_stiffness=arm.joint_stiffness)


def _base_in_world(beta: float, node: Array) -> Array:
    """The mirror plane's reflection after the reflection in z: a proper rotation again."""
    n = mirror_axes(beta)[:, 0]
    M = np.eye(3) - 2 * np.outer(n, n)
    T = np.eye(4)
    T[:3, :3] = M @ np.diag([1.0, 1.0, -1.0])
    T[:3, 3] = 2 * (n @ node) * n
    return T


def _base_of_the_mirror_image(beta: float, node: Array) -> str:
    T = _base_in_world(beta, node)
    p, quat = T[:3, 3], _quaternion(T[:3, :3])
    return (
        f'pos="{p[0]:.17g} {p[1]:.17g} {p[2]:.17g}" '
        f'quat="{quat[0]:.17g} {quat[1]:.17g} {quat[2]:.17g} {quat[3]:.17g}"'
    )


def _pose_of_b(arm: Arm, q: Array, beta: float, node: Array) -> Array:
    return _base_in_world(beta, node) @ arm.fk(q)


def _quaternion(R: Array) -> Array:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return np.array([w, x, y, z])


def test_beam_coupling_against_chains_of_springs() -> None:
    """A slender beam of 200 rigid pieces with a bending and torsion spring between each two."""
    length, pieces = 0.1, 200
    section = tube(STEEL, 0.02)
    piece = length / pieces
    C = np.zeros((6, 6))
    from identification.elastic import transport

    for i in range(pieces):
        spring = np.diag(
            [
                piece / section.axial,
                0,
                0,
                piece / section.torsion,
                piece / section.bending_y,
                piece / section.bending_z,
            ]
        )
        A = transport(np.array([(pieces - i - 0.5) * piece, 0, 0]))
        C += A @ spring @ A.T
    np.testing.assert_allclose(C, cantilever(section, length), rtol=1e-4, atol=1e-16)
    assert Beam(section, (0, 0, 0), (length, 0, 0), 0).length == pytest.approx(length)
    assert tool_offset([0, 0, 1])[2, 3] == 1
