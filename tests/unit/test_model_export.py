"""What is exported, loaded back by the simulators it is for: same places, same stiffness."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from identification.arm import Arm
from rig.errors import InputError
from rig.models.model import ArmModel, load_model
from rig.models.model_export import mujoco_xml, urdf, write
from rig.models.robot import MODELS

# beside the flange, and turned about all axes
TOOL = np.array(
    [[0.0, -0.6, 0.8, 0.03], [1.0, 0.0, 0.0, -0.02], [0.0, 0.8, 0.6, 0.11], [0, 0, 0, 1]]
)


@pytest.fixture
def f1() -> ArmModel:
    return load_model(MODELS / "F1.yaml")


def compliance_in_mujoco(mujoco: Any, engine: Any, data: Any) -> np.ndarray:
    """(6, 6) at the tool, by moving the joints until springs balance small wrenches."""
    site, n = engine.site("tool").id, engine.nv
    out = np.zeros((6, 6))
    mujoco.mj_resetDataKeyframe(engine, data, engine.key("pose").id)
    mujoco.mj_forward(engine, data)
    J = np.zeros((6, n))
    mujoco.mj_jacSite(engine, data, J[:3], J[3:], site)
    rest = data.qpos.copy()
    for i in range(6):
        # qfrc_spring is linear: its response to unit turns gives the stiffness the engine uses
        springs = np.zeros((n, n))
        for j in range(n):
            data.qpos[:] = rest + 1e-3 * np.eye(n)[j]
            mujoco.mj_forward(engine, data)
            springs[:, j] = -data.qfrc_spring / 1e-3
        out[:, i] = J @ np.linalg.solve(springs, J[i])
    return out


def test_mujoco_has_the_same_arm(f1: ArmModel) -> None:
    mujoco = pytest.importorskip("mujoco", reason="test extra: pip install mujoco")
    engine = mujoco.MjModel.from_xml_string(mujoco_xml(f1.arm, f1.q, TOOL))
    data = mujoco.MjData(engine)
    mujoco.mj_resetDataKeyframe(engine, data, engine.key("pose").id)
    mujoco.mj_forward(engine, data)
    wanted = f1.arm.fk(f1.q, TOOL)
    np.testing.assert_allclose(data.site("tool").xpos, wanted[:3, 3], atol=1e-12)
    np.testing.assert_allclose(data.site("tool").xmat.reshape(3, 3), wanted[:3, :3], atol=1e-12)
    np.testing.assert_allclose(data.qfrc_spring, 0, atol=1e-9)
    # the weight is held: unloaded, nothing moves
    np.testing.assert_allclose(data.qfrc_gravcomp - data.qfrc_bias, 0, atol=1e-9)
    assert np.abs(data.qfrc_bias).max() > 10
    np.testing.assert_allclose(data.qfrc_bias, f1.arm.gravity_torques(f1.q), atol=1e-9)
    found = compliance_in_mujoco(mujoco, engine, data)
    np.testing.assert_allclose(found, f1.arm.compliance(f1.q, TOOL), rtol=1e-6, atol=1e-12)


def test_mujoco_deflects_as_predicted(f1: ArmModel) -> None:
    """100 N on the tool, time integrated until it rests: force over displacement is k."""
    mujoco = pytest.importorskip("mujoco", reason="test extra: pip install mujoco")
    engine = mujoco.MjModel.from_xml_string(mujoco_xml(f1.arm, f1.q))
    engine.dof_damping[:] = 2 * np.sqrt(f1.arm.joint_stiffness)
    engine.opt.timestep = 1e-3
    engine.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = mujoco.MjData(engine)
    mujoco.mj_resetDataKeyframe(engine, data, engine.key("pose").id)
    mujoco.mj_forward(engine, data)
    start = data.site("tool").xpos.copy()
    body, site = engine.body("link6").id, engine.site("tool").id
    for _ in range(3000):
        data.qfrc_applied[:] = 0
        mujoco.mj_applyFT(
            engine,
            data,
            np.array([0, 30.0, 0]),
            np.zeros(3),
            data.site_xpos[site],
            body,
            data.qfrc_applied,
        )
        mujoco.mj_step(engine, data)
    moved = (data.site("tool").xpos - start)[1]
    assert np.abs(data.qvel).max() < 1e-6
    assert 30.0 / moved / 1e3 == pytest.approx(57.42, rel=5e-3)


def test_urdf_has_the_same_arm(f1: ArmModel) -> None:
    pin = pytest.importorskip("pinocchio", reason="test extra: pip install pin")
    text = urdf(f1.arm, f1.q, TOOL)
    model = pin.buildModelFromXML(text)
    data = model.createData()
    for q in np.random.default_rng(2).uniform(-3, 3, (20, 6)):
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacements(model, data)
        place = data.oMf[model.getFrameId("tool")].homogeneous
        np.testing.assert_allclose(place, f1.arm.fk(q, TOOL), atol=1e-12)
        torques = pin.computeGeneralizedGravity(model, data, q)
        # pinocchio's gravity is 9.81 m/s^2
        np.testing.assert_allclose(torques, f1.arm.gravity_torques(q, (0, 0, -9.81)), atol=1e-9)
    np.testing.assert_allclose(model.effortLimit, f1.arm.torque_limit)


def test_urdf_carries_the_springs(f1: ArmModel) -> None:
    root = ET.fromstring(urdf(f1.arm, f1.q))
    springs = {g.get("reference"): g for g in root.iter("gazebo")}
    assert list(springs) == [f"joint{i}" for i in range(1, 7)]
    for i, spring in enumerate(springs.values()):
        assert float(spring.findtext("springStiffness") or "nan") == f1.arm.joint_stiffness[i]
        assert float(spring.findtext("springReference") or "nan") == f1.q[i]


def test_what_cannot_be_exported_is_refused(f1: ArmModel) -> None:
    bare = Arm("bare", f1.arm.d, f1.arm.a, f1.arm.alpha)
    for export in (mujoco_xml, urdf):
        with pytest.raises(ValueError, match="no joint stiffness"):
            export(bare, f1.q)
        with pytest.raises(ValueError, match="the last axis must be 6"):
            export(f1.arm, f1.q[:5])
        with pytest.raises(ValueError, match="no rotation matrix"):
            export(f1.arm, f1.q, 2 * np.eye(4))


def test_files(f1: ArmModel, tmp_path: Path) -> None:
    written = write(f1, mujoco=tmp_path / "a.xml", urdf_file=tmp_path / "a.urdf")
    assert [p.name for p in written] == ["a.xml", "a.urdf"]
    assert (tmp_path / "a.xml").read_text() == mujoco_xml(f1.arm, f1.q, f1.tool)
    assert (tmp_path / "a.urdf").read_text() == urdf(f1.arm, f1.q, f1.tool)
    assert len(list(tmp_path.iterdir())) == 2
    with pytest.raises(InputError, match="cannot be written"):
        write(f1, mujoco=tmp_path / "nowhere" / "a.xml")
