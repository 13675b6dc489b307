"""Paths that ask for stiffness: the schedule, and every row that makes no path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rig.coupling.couple import couple
from rig.errors import InputError
from rig.models.model import load_model
from rig.models.robot import MODELS


def test_path_file(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text(
        "time_s,direction_x,direction_y,direction_z,required_N_per_mm\n# cut\n"
        "0,1,0,0,50\n1,1,0,0,150\n2,1,0,0,50\n"
    )
    result = couple(MODELS / "F1.yaml", samples=0, path=path)
    assert [i["state"] for i in result.to_json()["schedule"]] == ["single", "couple", "single"]
    path.write_text("time_s,direction_x,direction_y,direction_z,required_N_per_mm\n0,1,0,0,lots\n")
    with pytest.raises(InputError, match=r'path\.csv:2: required_N_per_mm is "lots"'):
        couple(MODELS / "F1.yaml", samples=0, path=path)


def test_a_path_through_poses(tmp_path: Path) -> None:
    """Each row in its own pose, links and mounting counted as in the model's table."""
    f1 = load_model(MODELS / "F1.yaml")
    other = f1.q + np.array([0.3, 0.2, -0.1, 0, 0, 0])
    rows = "".join(
        f"{t},{','.join(repr(float(v)) for v in q)},0,1,0,100\n" for t, q in ((0, f1.q), (1, other))
    )
    head = ",".join(f"q{j}_rad" for j in range(1, 7))
    path = tmp_path / "path.csv"
    path.write_text(f"time_s,{head},direction_x,direction_y,direction_z,required_N_per_mm\n{rows}")
    text = (MODELS / "F1.yaml").read_text()
    extra = "link_segments: robot\nmounting: {tilt_Nm_per_rad: 5e5, turn_Nm_per_rad: 5e5}\n"
    (tmp_path / "m.yaml").write_text(text + extra)
    for model in (MODELS / "F1.yaml", tmp_path / "m.yaml"):
        result = couple(model, samples=0, path=path)
        assert result.schedule is not None
        assert result.schedule.single[0] == pytest.approx(result.single[1])
        assert result.schedule.coupled[0] == pytest.approx(result.pair["rigid"][1])
        assert result.schedule.single[1] != pytest.approx(result.single[1], rel=0.01)


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("1,0,1,0,-5", ":4: required_N_per_mm is -5 N/mm; wanted: at least 0 N/mm"),
        ("-1,0,1,0,5", ":4: time_s goes back to -1 s"),
        ("1,1,1,0,5", ":4: direction_x, _y, _z have length 1.41421; wanted: a unit vector"),
        ("1,0,1,0", ':4: required_N_per_mm is ""'),
        ("1,0,1,inf,5", ':4: direction_z is "inf"; wanted: a finite number'),
    ],
)
def test_bad_rows_of_a_path(tmp_path: Path, row: str, says: str) -> None:
    path = tmp_path / "path.csv"
    head = "time_s,direction_x,direction_y,direction_z,required_N_per_mm\n"
    path.write_text(f"# a comment\n{head}0,1,0,0,50\n{row}\n")
    with pytest.raises(InputError) as caught:
        couple(MODELS / "F1.yaml", samples=0, path=path)
    assert str(caught.value).startswith(f"{path}{says}")


def test_a_path_beyond_the_joints(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    head = ",".join(f"q{j}_rad" for j in range(1, 7))
    path.write_text(
        f"time_s,{head},direction_x,direction_y,direction_z,required_N_per_mm\n"
        "0,0,-1,7,0,1,0,0,1,0,50\n"
    )
    with pytest.raises(
        InputError, match=r"path\.csv:2: q3_rad is 7 rad; wanted: -6\.283 to 6\.283"
    ):
        couple(MODELS / "F1.yaml", samples=0, path=path)
    path.write_text(path.read_text().replace("q3_rad", "q33_rad"))
    with pytest.raises(InputError, match=r"path\.csv:1: the column q3_rad is missing; the header"):
        couple(MODELS / "F1.yaml", samples=0, path=path)


def test_all_missing_columns_of_a_path_are_named_and_all_that_are_wanted(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("time_s,x,y,z,stiffness_N_per_mm\n0,1,0,0,50\n")
    with pytest.raises(InputError) as caught:
        couple(MODELS / "F1.yaml", samples=0, path=path)
    assert str(caught.value) == (
        f"{path}:1: the columns direction_x, direction_y, direction_z, required_N_per_mm are "
        "missing; the header has time_s, x, y, z, stiffness_N_per_mm. Wanted: time_s, direction_x, "
        "direction_y, direction_z, required_N_per_mm; q1_rad ... q6_rad, all or none of them."
    )
