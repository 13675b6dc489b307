"""Predicted curves: the reference numbers, formats, and what is refused."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from rig.errors import InputError
from rig.models.robot import MODELS
from rig.models.simulate import Simulation, simulate, write_csv
from rig.protocol import load_protocol
from rig.worlds import make_world
from tests.true_curves import true_curve

PROTOCOLS = Path(__file__).parents[2] / "protocols"
PAPER_XY = PROTOCOLS / "paper_xy.yaml"
F1 = (MODELS / "F1.yaml").read_text()


@pytest.fixture(scope="module")
def predicted() -> Simulation:
    return simulate(MODELS / "F1.yaml", PAPER_XY)


def test_stiffness_of_the_reference_arm(predicted: Simulation) -> None:
    found = {c.direction: c.stiffness / 1e3 for c in predicted.curves}
    assert found == pytest.approx({"x": 95.94, "y": 57.42}, rel=1e-3)


def test_curves_are_those_of_an_independent_world(tmp_path: Path) -> None:
    """The emulated rig's noise-free curve of the same springs, pose by pose; levers of the
    unloaded pose in both. Pose and point of load are the procedure's, not the model's."""
    text = (PROTOCOLS / "load_unload_hold.yaml").read_text()
    path = tmp_path / "p.yaml"
    path.write_text(text.replace("tcp_xyz_mm: [0, 0, 0]", "tcp_xyz_mm: [50, -20, 130]"))
    procedure = load_protocol(path)
    curves = simulate(MODELS / "F1.yaml", path).curves
    assert [(c.pose, c.direction) for c in curves] == [
        (p, d) for p in ("P1", "P2") for d in ("x", "y")
    ]
    for curve in curves:
        world = make_world("linear", 0)
        pose = procedure.poses[curve.pose]
        world.move(pose.q_rad, [v / 1e3 for v in pose.tcp_xyz_mm])
        true = true_curve(world, procedure.directions[curve.direction], curve.force[1:])
        np.testing.assert_allclose(curve.displacement[1:], true, rtol=1e-6)
        assert curve.force[0] == curve.displacement[0] == 0


def test_csv_is_what_a_diagnosis_reads(predicted: Simulation, tmp_path: Path) -> None:
    write_csv(predicted, tmp_path / "c.csv")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "c.csv").read_text())))
    assert list(rows[0]) == ["pose", "direction", "force_N", "displacement_mm"]
    x = [r for r in rows if r["direction"] == "x"]
    assert [float(r["force_N"]) for r in x] == list(range(0, 240, 20))
    assert float(x[-1]["displacement_mm"]) == pytest.approx(220 / 95.94, rel=1e-3)
    with pytest.raises(InputError, match="cannot be written"):
        write_csv(predicted, tmp_path / "nowhere" / "c.csv")


def test_json_and_text(predicted: Simulation) -> None:
    out = json.loads(json.dumps(predicted.to_json(), allow_nan=False))
    assert out["schema"] == "rig.simulation/1"
    y = next(c for c in out["curves"] if c["direction"] == "y")
    assert y["stiffness_N_per_mm"]["value"] == pytest.approx(57.42, rel=1e-3)
    assert len(y["force_N"]) == len(y["displacement_mm"]) == 13
    text = predicted.to_text()
    assert "Pose P1, direction y: 57.42 N/mm" in text
    assert "many other sets of six springs" in text


def test_uncertainty_follows_the_springs(tmp_path: Path) -> None:
    """Each joint's share of the compliance times its relative sd, independent of each other."""
    sd = [3720.1, 0, 0, 0, 1506.6, 0]  # 10 % and 20 %
    text = F1.replace("joint_stiffness_relative_sd: 0.1", f"joint_stiffness_sd: {sd}")
    (tmp_path / "m.yaml").write_text(text)
    curve = next(c for c in simulate(tmp_path / "m.yaml", PAPER_XY).curves if c.direction == "y")
    shares = np.array([0.7500**2 / 37201, 0.11342**2 / 7533]) * curve.stiffness
    assert curve.relative_u == pytest.approx(np.hypot(*(shares * [0.1, 0.2])), rel=1e-3)


def test_links_and_mounting_are_part_of_the_model(tmp_path: Path) -> None:
    stiff = simulate(MODELS / "F1.yaml", PAPER_XY).curves
    for extra in (
        "link_segments: robot\n",
        "mounting: {tilt_Nm_per_rad: 5e5, turn_Nm_per_rad: 5e5}\n",
    ):
        (tmp_path / "m.yaml").write_text(F1 + extra)
        for soft, hard in zip(simulate(tmp_path / "m.yaml", PAPER_XY).curves, stiff, strict=True):
            assert soft.stiffness < 0.999 * hard.stiffness


def test_unseen_directions_have_no_stiffness(tmp_path: Path) -> None:
    """Stretched upwards, no joint gives way along the arm."""
    text = PAPER_XY.read_text().replace(
        "q_deg: [13.43, -99.84, -108.10, -62.06, 90.0, -76.57]", "q_deg: [0, -90, 0, -90, 0, 0]"
    )
    text = text.replace("y: [0, 1, 0]", "y: [0, 0, 1]")
    (tmp_path / "p.yaml").write_text(text)
    curve = simulate(MODELS / "F1.yaml", tmp_path / "p.yaml").curves[1]
    assert curve.stiffness > 1e12
    json.dumps(curve.displacement.tolist(), allow_nan=False)


def refusal(model: Path, protocol: Path = PAPER_XY) -> str:
    with pytest.raises(InputError) as caught:
        simulate(model, protocol)
    return str(caught.value)


def test_what_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(F1.replace("effects: []", "effects:\n  - {name: joint_jelly, share: 1}"))
    line = path.read_text().splitlines().index("  - {name: joint_jelly, share: 1}") + 1
    message = refusal(path)
    assert message.startswith(f"{path}:{line}:")
    assert 'the effect "joint_jelly" is none that rig simulate can compute' in message
    path.write_text(F1.replace("effects: []", "effects: [{share: 1}]"))
    assert "an effect without a name" in refusal(path)
    path.write_text(F1.replace("robot: ur10e", "robot: ur5e"))
    assert "robot is ur5e, but" in refusal(path)
    assert "Give a model of the robot that the protocol names" in refusal(path)
    assert "nowhere.yaml" in refusal(tmp_path / "nowhere.yaml")
    assert "nowhere.yaml" in refusal(MODELS / "F1.yaml", tmp_path / "nowhere.yaml")
