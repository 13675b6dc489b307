from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from drivers.kistler.settings import PerAxis
from identification.times import MOUNT_S
from rig.errors import InputError
from rig.models.robot import load_robot
from rig.plan import Plan, plan
from rig.protocol import MeasurementProtocol, Pose, Run, load_protocol, parse_protocol
from rig.station import Station, load_station

PROTOCOLS = Path(__file__).parents[2] / "protocols"
GOLDEN = Path(__file__).parents[1] / "golden"
PAPER = PROTOCOLS / "paper_xy.yaml"


@pytest.fixture(scope="module")
def paper() -> MeasurementProtocol:
    return load_protocol(PAPER)


@pytest.fixture(scope="module")
def lab() -> Station:
    return load_station("ur10e_lab")


def text_of(plan_: Plan) -> str:
    return plan_.to_text() + "\n"


def test_text_for_the_emulated_station() -> None:
    planned = plan(load_protocol(PROTOCOLS / "load_unload_hold.yaml"), load_station("emulated"))
    assert text_of(planned) == (GOLDEN / "plan_load_unload_hold.txt").read_text("utf-8")


def test_text_for_a_lab(paper: MeasurementProtocol, lab: Station) -> None:
    assert text_of(plan(paper, lab)) == (GOLDEN / "plan_paper_xy.txt").read_text("utf-8")


def test_every_ready_protocol_has_a_plan_without_warnings(lab: Station) -> None:
    for file in PROTOCOLS.glob("*.yaml"):
        assert plan(load_protocol(file), lab).warnings == ()


@pytest.mark.parametrize("file", sorted(PROTOCOLS.glob("*.yaml")), ids=lambda file: file.stem)
def test_the_plan_of_a_ready_protocol_fits_80_columns(file: Path, lab: Station) -> None:
    """A terminal would tear the rows of a wider table."""
    lines = plan(load_protocol(file), lab).to_text().splitlines()
    end = next(i for i, line in enumerate(lines) if line.startswith("Directions"))
    assert max(map(len, lines[:end])) <= 80


def test_torques_by_hand(paper: MeasurementProtocol) -> None:
    # y: 82 N at 0.75 m from axis 1, which stands upright and carries no weight.
    along_y = plan(paper).runs[1]
    assert along_y.load_torque_Nm[0] == pytest.approx(82 * 0.75, abs=0.02)
    assert along_y.hold_torque_Nm[0] == pytest.approx(-82 * 0.75, abs=0.02)
    # A weight's worth of force straight up at the flange takes its moment off the shoulder.
    arm = load_robot("ur10e")
    up = dataclasses.replace(
        paper, directions={"x": (0.0, 0.0, 1.0)}, runs=(Run("P1", "x", (50.0,)),)
    )
    lifted = plan(up).runs[0]
    weight = arm.gravity_torques(paper.poses["P1"].q_rad)
    q1 = np.deg2rad(13.43)
    lever = 0.75 * np.cos(q1)  # of the flange about axis 2, in the arm's plane
    assert abs(lifted.hold_torque_Nm[1]) == pytest.approx(abs(weight[1] - 50 * lever), abs=0.2)
    assert abs(lifted.hold_torque_Nm[1]) < abs(weight[1])


def test_stiffness_and_displacement_agree(paper: MeasurementProtocol) -> None:
    for run in plan(paper).runs:
        expected = run.forces_N[-1] / run.stiffness_N_per_mm
        assert run.displacement_mm == pytest.approx(expected)
    stopped = dataclasses.replace(paper.runs[0], stop_at_displacement_mm=0.5)
    assert plan(dataclasses.replace(paper, runs=(stopped,))).runs[0].displacement_mm == 0.5


def test_duration_by_hand(paper: MeasurementProtocol, lab: Station) -> None:
    # Reset 2, operate 2, tare 2, zero 6 + 6, 12 steps of 10 + 4 + 5, unload 15, rest 10.
    planned = plan(paper, lab)
    assert planned.runs[1].duration_s == 2 + 2 + 2 + 12 + 12 * 19 + 15 + 10
    both = sum(run.duration_s for run in planned.runs)
    assert planned.duration_s == 3 * both + 2 * MOUNT_S
    by_repetition = plan(dataclasses.replace(paper, order="by_repetition"), lab)
    assert by_repetition.mounts == 6
    assert by_repetition.duration_s == 3 * both + 6 * MOUNT_S
    held = plan(dataclasses.replace(paper, hold_s=20.0), lab)
    assert held.runs[1].duration_s - planned.runs[1].duration_s == 12 * 15
    assert planned.samples == 3 * (12 + 11 * 5 + 12 + 12 * 5)


def test_narrow_margins_are_warned_of(paper: MeasurementProtocol, lab: Station) -> None:
    assert lab.dynamometer is not None
    assert lab.laser is not None
    sensor = dataclasses.replace(
        lab.dynamometer, channels=3, full_scale_N=PerAxis(x=250, y=500, z=500)
    )
    laser = dataclasses.replace(lab.laser, range_mm=1.7)
    station = dataclasses.replace(lab, dynamometer=sensor, laser=laser)
    x = "pose P1, direction x: "
    assert plan(paper, station).warnings == (
        f"{x}about 1.6 mm expected at 220 N, the laser's range is 1.7 mm: 8 % to spare.",
        f"{x}the dynamometer's x carries 220 N, full scale 250 N: 12 % to spare.",
    )


def limited(paper: MeasurementProtocol, **limits: float) -> MeasurementProtocol:
    """With other values of limits."""
    changed = {n: dataclasses.replace(getattr(paper.limits, n), max=v) for n, v in limits.items()}
    return dataclasses.replace(paper, limits=dataclasses.replace(paper.limits, **changed))


def test_a_force_limit_that_no_reading_reaches(paper: MeasurementProtocol, lab: Station) -> None:
    assert plan(limited(paper, force_N=5000), lab).warnings == tuple(
        f"pose P1, direction {d}: limits.force_N.max is 5000 N, but the dynamometer's full scale "
        "ends at 1000 N: no reading reaches the limit. Set it below."
        for d in "xy"
    )
    assert plan(limited(paper, force_N=1000), lab).warnings == ()
    assert plan(limited(paper, force_N=5000)).warnings == ()  # no station, no full scale


def test_a_limit_that_a_softer_arm_meets(paper: MeasurementProtocol, lab: Station) -> None:
    near = limited(paper, displacement_mm=2.0)
    assert plan(near, lab).warnings == (
        "pose P1, direction x: 1.57 mm +- 35 % expected at 220 N, so it may be 2.11 mm; "
        "limits.displacement_mm.max is 2 mm. Lower the top force, or give "
        "stop_at_displacement_mm.",
    )
    assert plan(limited(paper, displacement_mm=2.2), lab).warnings == ()
    stopped = tuple(dataclasses.replace(r, stop_at_displacement_mm=1.9) for r in paper.runs)
    assert plan(dataclasses.replace(near, runs=stopped), lab).warnings == ()
    narrower = plan(limited(paper, displacement_mm=1.8), lab).warnings
    assert [w.endswith(": 13 % to spare.") for w in narrower] == [True]


@pytest.mark.parametrize(
    ("q_deg", "warned"),
    [
        ("[0.2344, -1.7425, -1.8867, -1.0832, 1.5708, -1.3364]", True),
        ("[0.2344, -17.425, -1.8867, -1.0832, 1.5708, -1.3364]", False),
    ],
)
def test_radians_in_the_place_of_degrees_are_asked_about(q_deg: str, warned: bool) -> None:
    path = PROTOCOLS / "paper_xy.yaml"
    text = path.read_text("utf-8").replace("[13.43, -99.84, -108.10, -62.06, 90.0, -76.57]", q_deg)
    asked = "pose P1: all joints within 1.89 deg of zero, the arm stretched out. If these are"
    assert any(w.startswith(asked) for w in plan(parse_protocol(text, path)).warnings) is warned


def test_eight_channels_share_the_force(paper: MeasurementProtocol, lab: Station) -> None:
    assert lab.dynamometer is not None
    scale = PerAxis(x=250, y=500, z=500)
    sensor = dataclasses.replace(lab.dynamometer, channels=8, full_scale_N=scale)
    assert plan(paper, dataclasses.replace(lab, dynamometer=sensor)).warnings == ()


def test_the_sensors_own_axes_carry_the_force(paper: MeasurementProtocol, lab: Station) -> None:
    assert lab.dynamometer is not None
    turned = dataclasses.replace(
        lab.dynamometer,
        channels=3,
        full_scale_N=PerAxis(x=100, y=250, z=1),
        axes_in_base=((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    )
    assert plan(paper, dataclasses.replace(lab, dynamometer=turned)).warnings == (
        "pose P1, direction x: the dynamometer's y carries 220 N, full scale 250 N: 12 % to spare.",
        "pose P1, direction y: the dynamometer's x carries 82 N, full scale 100 N: 18 % to spare.",
        "pose P1, direction y: limits.force_N.max is 240 N, but the dynamometer's full scale ends "
        "at 100 N: no reading reaches the limit. Set it below.",
    )


def test_a_tool_lengthens_the_lever(paper: MeasurementProtocol) -> None:
    # The tool points down; 220 N along x, 100 mm lower, are 22 Nm more about the level axes.
    poses = {"P1": dataclasses.replace(paper.poses["P1"], tcp_xyz_mm=(0.0, 0.0, 100.0))}
    short, long = plan(paper).runs[0], plan(dataclasses.replace(paper, poses=poses)).runs[0]
    for joint in (1, 2, 3):
        change = long.load_torque_Nm[joint] - short.load_torque_Nm[joint]
        assert abs(change) == pytest.approx(22 * np.cos(np.deg2rad(13.43)), abs=0.05)


def test_long_cycles_and_missing_limits_are_warned_of(paper: MeasurementProtocol) -> None:
    limits = dataclasses.replace(paper.limits, displacement_mm=None)
    slow = dataclasses.replace(paper, hold_s=100.0, limits=limits, runs=paper.runs[:1])
    assert plan(slow).warnings == (
        "pose P1, direction x: 1297 s between two resets of the charge amplifier; its drift stays "
        "a straight line for about 1000 s. Fewer steps or shorter holds.",
        "limits.displacement_mm does not stop the measurement.",
    )


def refusal(protocol: MeasurementProtocol, station: Station | None = None) -> str:
    with pytest.raises(InputError) as caught:
        plan(protocol, station)
    return str(caught.value).removeprefix(str(protocol.path))


def test_loads_beyond_a_joint_are_refused(paper: MeasurementProtocol) -> None:
    runs = (dataclasses.replace(paper.runs[0], stop_at_displacement_mm=1.0, forces_N=(900.0,)),)
    lines = refusal(dataclasses.replace(paper, runs=runs)).splitlines()
    assert lines[0] == (
        ":22:5: runs[0]: joint 3 holds 298 Nm at 900 N, allowed 150 Nm. Lower the top force, or "
        "choose a pose with a shorter lever."
    )


def test_only_what_even_a_much_stiffer_arm_exceeds_is_refused(
    paper: MeasurementProtocol, lab: Station
) -> None:
    assert lab.laser is not None
    # 1.57 mm expected with a stiffness known to 35 %: 1 mm is possible, 0.5 mm is not.
    possible = dataclasses.replace(lab, laser=dataclasses.replace(lab.laser, range_mm=1.0))
    assert (
        "pose P1, direction x: about 1.6 mm expected at 220 N, the laser's range is 1 mm: 57 % too "
        "much, unless the arm is stiffer. Lower the top force, or give stop_at_displacement_mm."
    ) in plan(paper, possible).warnings
    station = dataclasses.replace(lab, laser=dataclasses.replace(lab.laser, range_mm=0.5))
    assert (
        refusal(paper, station)
        .splitlines()[0]
        .endswith(
            "runs[0]: about 1.6 mm expected at 220 N, the laser's range is 0.5 mm. Lower the top "
            "force, or give stop_at_displacement_mm."
        )
    )


def test_a_pose_beyond_the_joints_is_refused(paper: MeasurementProtocol) -> None:
    poses = {"P1": Pose((6.4, 0.0, 0.1, 0.0, 0.1, 0.0), (0.0, 0.0, 0.0), None)}
    protocol = dataclasses.replace(paper, poses=poses)
    assert refusal(protocol).startswith(
        ":9:5: poses.P1: joint 1 at 366.69 deg; allowed: -360 to 360 deg."
    )


def test_json(paper: MeasurementProtocol, lab: Station) -> None:
    document = json.loads(json.dumps(plan(paper, lab).to_json()))
    assert document["schema"] == "rig.plan/1"
    assert document["runs"][0]["forces_N"][-1] == 220.0
    assert len(document["runs"][0]["torque_limit_Nm"]) == 6
