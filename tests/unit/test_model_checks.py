"""Model files whose numbers have another unit or another size than an arm's are noticed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification import workspace
from rig.coupling.couple import CouplingResult, couple
from rig.errors import InputError
from rig.models.model import load_model
from rig.models.robot import MODELS, load_robot
from rig.models.simulate import simulate

PAPER_XY = Path(__file__).parents[2] / "protocols" / "paper_xy.yaml"
SPRINGS = "[37201, 56946, 18110, 7108, 7533, 8000]"
DH = (
    "dh: {d_m: [0.1807, 0, 0, 0.17415, 0.11985, 0.11655], "
    "a_m: [0, -0.6127, -0.57155, 0, 0, 0], alpha_rad: [1.5708, 0, 0, 1.5708, -1.5708, 0]}"
)


def changed(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    """F1.yaml with words changed, as m.yaml."""
    text = (MODELS / "F1.yaml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "m.yaml").write_text(text)
    return tmp_path / "m.yaml"


def refusal(path: Path) -> str:
    """The message without the folder, lines without their columns."""
    with pytest.raises(InputError) as caught:
        couple(path, samples=0)
    return re.sub(
        r"m\.yaml:(\d+):\d+", r"m.yaml:\1", str(caught.value).replace(f"{path}", path.name)
    )


def test_lengths_of_links_in_millimetres_are_refused(tmp_path: Path) -> None:
    """They had asked for a grid of cells that no machine holds."""
    millimetres = DH.replace("0.1807", "180.7").replace("-0.6127", "-612.7")
    assert refusal(changed(tmp_path, ("robot: ur10e", millimetres))) == (
        "m.yaml:4: dh.d_m[0]: 180.7 m is not allowed; wanted: a number from -5 to 5 m.\n"
        "m.yaml:4: dh.a_m[1]: -612.7 m is not allowed; wanted: a number from -5 to 5 m."
    )


def test_the_cells_of_a_large_arm_are_larger(tmp_path: Path) -> None:
    """The largest that is allowed: 500 cells a side at most, whatever the number of samples."""
    huge = "dh: {d_m: [5, 5, 5, 5, 5, 5], a_m: [5, 5, 5, 5, 5, 5], alpha_rad: [1, 1, 1, 1, 1, 1]}"
    arm = load_model(changed(tmp_path, ("robot: ur10e", huge))).arm
    half = np.full(6, 2.0)
    reached = workspace.sample(replace(arm, q_min=-half, q_max=half), 20_000)
    assert max(reached.cells.shape[:2]) < 600
    assert workspace.sample(load_robot("ur10e"), 1_000_000).cell == pytest.approx(0.0079, rel=0.01)


@pytest.mark.parametrize(
    ("tool", "told"),
    [
        ("length_mm: 100000", "tool.length_mm: 100000 mm is not allowed; wanted: a number from 0 "),
        ("length_mm: -5", "tool.length_mm: -5 mm is not allowed; wanted: a number from 0 to 2000"),
        (
            "flange_T_tcp: [[1,0,0,0],[0,1,0,0],[0,0,1,280],[0,0,0,1]]",
            "tool.flange_T_tcp[2][3]: 280 m is no tool; allowed: -2 to 2 m. The last column is in "
            "m.",
        ),
    ],
)
def test_tools_that_are_none(tmp_path: Path, tool: str, told: str) -> None:
    assert refusal(changed(tmp_path, ("length_mm: 0", tool))).startswith(f"m.yaml:6: {told}")


def test_springs_in_another_unit_are_asked_about_and_keep_their_digits(tmp_path: Path) -> None:
    path = changed(tmp_path, (SPRINGS, "[37.2, 56.9, 18.1, 7.1, 7.5, 8]"))
    text = couple(path, samples=0).to_text()
    asked = (
        "joint_stiffness_Nm_per_rad: from 7.1 to 56.9 Nm/rad, about 0.00082 times those of ur10e. "
        "Is the unit Nm/rad (not kNm/rad)?"
    )
    assert f"Note: {path}:7:29: {asked}" in text
    rows = [line.split() for line in text.splitlines()]
    assert ["single", "0.096", "(0.0073)", "0.057", "(0.0050)", "0.030", "(0.0022)"] in rows
    assert any(asked in note for note in simulate(path, PAPER_XY).notes)


def test_springs_of_an_arm_that_no_file_describes(tmp_path: Path) -> None:
    soft = changed(tmp_path, ("robot: ur10e", DH), (SPRINGS, "[37.2, 56.9, 18.1, 7.1, 7.5, 8]"))
    (asked,) = load_model(soft).doubts
    assert asked.endswith("from 7.1 to 56.9 Nm/rad; are these kNm/rad? Nm/rad are wanted.")
    assert load_model(changed(tmp_path, ("robot: ur10e", DH))).doubts == ()
    assert load_model(MODELS / "F2.yaml").doubts == ()


RADIANS = "[0.2344, -1.7425, -1.8867, -1.0832, 1.5708, -1.3364]"
ASKED = "all joints within 1.89 deg of zero, the arm stretched out. If these are radians, write"


def test_radians_in_the_place_of_degrees_are_asked_about(tmp_path: Path) -> None:
    degrees = "[13.43, -99.84, -108.10, -62.06, 90.0, -76.57]"
    path = changed(tmp_path, (degrees, RADIANS))
    (asked,) = load_model(path).doubts
    assert asked == f"{path}:5:15: pose.q_deg: {ASKED} q_rad."
    protocol = tmp_path / "p.yaml"
    protocol.write_text(PAPER_XY.read_text("utf-8").replace(degrees, RADIANS))
    notes = simulate(MODELS / "F1.yaml", protocol).notes
    assert any(note.startswith(f"pose P1: {ASKED}") for note in notes)


def test_effects_of_unknown_words_are_refused(tmp_path: Path) -> None:
    told = refusal(changed(tmp_path, ("effects: []", "effects: [{name: joint_yeild}]")))
    assert told.startswith("m.yaml:9: effects[0]")
    assert "joint_yield" in told


def test_a_beam_of_no_diameter_is_told_as_such(tmp_path: Path) -> None:
    beam = "kind: {beam: {material: steel, diameter_mm: 0, half_length_mm: 50}}"
    assert refusal(changed(tmp_path, ("kind: rigid", beam))) == (
        "m.yaml:14: coupling.kind.beam.diameter_mm: 0 mm is not allowed; wanted: a number above 0 "
        "mm."
    )


def test_a_kind_that_nobody_knows_is_told_all_kinds(tmp_path: Path) -> None:
    told = refusal(changed(tmp_path, ("kind: rigid", "kind: {rope: 3}")))
    assert "a mapping with beam or a mapping with compliance_m_rad_per_N_Nm" in told


def test_a_singular_pose_has_a_line_and_a_remedy(tmp_path: Path) -> None:
    told = refusal(changed(tmp_path, ("-62.06, 90.0,", "-62.06, 0.0,")))
    assert told.startswith("m.yaml:5: pose: (13.43, -99.84, -108.1, -62.06, 0, -76.57) deg: ")
    assert told.endswith(
        "Give one in which the arm is neither stretched out nor folded (UR arms: with q5 away from "
        "0 and 180 deg)."
    )


def apart(tmp_path: Path, distance: str, tool: str = "length_mm: 0") -> CouplingResult:
    path = changed(
        tmp_path, ("distance_mm: 1500", f"distance_mm: {distance}"), ("length_mm: 0", tool)
    )
    row = "time_s,direction_x,direction_y,direction_z,required_N_per_mm\n"
    table = tmp_path / "path.csv"
    table.write_text(f"{row}0,1,0,0,20\n1,1,0,0,150\n")
    return couple(path, samples=0, path=table)


def test_arms_that_cannot_meet_do_not_couple(tmp_path: Path) -> None:
    result = apart(tmp_path, "5000")
    assert [d["state"] for d in result.to_json()["decision"]] == ["infeasible", "infeasible"]
    assert [i["state"] for i in result.to_json()["schedule"]] == ["single", "infeasible"]
    assert (
        "Note: base_distance_mm: at 5000 mm the arms can't meet, so what one arm does not reach is "
        "infeasible. The coupled stiffness is that of the pose, as if they met."
    ) in result.to_text()


def test_a_long_tool_bridges_the_distance(tmp_path: Path) -> None:
    for distance, tool, meet in (
        ("1500", "length_mm: 0", True),
        ("2700", "length_mm: 0", False),
        ("2700", "length_mm: 200", True),
        ("3100", "length_mm: 200", False),
    ):
        notes = apart(tmp_path, distance, tool).notes
        assert any("can't meet" in note for note in notes) != meet


def test_a_workspace_of_few_samples_says_so() -> None:
    few = couple(MODELS / "F1.yaml", samples=1000)
    (sampled,) = few.to_json()["workspace_others_m3"]
    assert sampled["single"] < 0.85 * 6.35
    assert sampled["hit_once_ratio"] == pytest.approx(0.27, abs=0.05)
    (note,) = [n for n in few.notes if "few samples" in n]
    assert note.startswith("The Monte Carlo workspace rests on few samples: 27 % of the single ")
    many = couple(MODELS / "F1.yaml", samples=300_000)
    assert many.to_json()["workspace_others_m3"][0]["hit_once_ratio"] < 0.02
    assert not any("few samples" in n for n in many.notes)


def test_what_few_samples_miss_is_about_what_one_alone_found() -> None:
    arm = load_robot("ur10e")
    for samples in (1000, 10_000):
        found = workspace.monte_carlo(arm, 1.5, samples)
        missing = 1 - found.single / 6.346
        assert 0.3 * found.thin < missing < 1.2 * found.thin


def test_a_pose_and_a_tool_that_are_not_the_protocols(tmp_path: Path) -> None:
    notes = simulate(MODELS / "F2.yaml", PAPER_XY).notes
    assert notes[1:] == (
        "The model's own pose, (29.52, -169.7, 110.7, -121.1, 60.48, -180) deg, is not used: the "
        "curves are those of the protocol's P1.",
        "The model's tool, (0, 0, 280) mm from the flange, is not used: in pose P1 the protocol "
        "loads the point tcp_xyz_mm (0, 0, 0) mm. Put the tool there if it is mounted.",
    )
    assert len(simulate(MODELS / "F1.yaml", PAPER_XY).notes) == 1  # the same pose, and no tool
