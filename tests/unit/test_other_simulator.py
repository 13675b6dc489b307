"""The table of another simulator's curves: what it gives, and every way to be none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from identification.gap.data import GapData
from rig.dataset import load
from rig.diagnosis.gap_data import gap_data
from rig.diagnosis.other_simulator import with_curves
from rig.errors import InputError
from rig.tables import import_table
from tests.unit.cli_bench import META, TABLE

HEAD = "direction,force_N,displacement_mm\n"


@pytest.fixture
def data(tmp_path: Path) -> GapData:
    """Forces 0, 20 ... 100 N along x, three times."""
    (tmp_path / "t.csv").write_text(TABLE)
    (tmp_path / "m.yaml").write_text(META)
    import_table(tmp_path / "t.csv", tmp_path / "m.yaml", tmp_path / "d.h5")
    return gap_data(load(tmp_path / "d.h5"))


def simulated_mm(data: GapData, folder: Path, text: str) -> list[float]:
    """At 0, 20 ... 100 N."""
    (folder / "c.csv").write_text(text)
    (curve,) = with_curves(data, folder / "c.csv").curves or ()
    return [1e3 * u for u in curve.at(data.force[:6])]


def test_straight_between_the_points_and_beyond_them(data: GapData, tmp_path: Path) -> None:
    rows = "# an FE program's\nx,70,0.6\nx,20,0.1\ny,20,9\nx,40,0.3\n"
    assert simulated_mm(data, tmp_path, HEAD + rows) == pytest.approx(
        [-0.1, 0.1, 0.3, 0.5, 0.7, 0.9]
    )


@pytest.mark.parametrize(
    ("again", "ends_mm"),
    [
        ("100,1.2", (0.0, 1.1)),
        ("0,-0.1", (-0.05, 1.0)),
        ("0.00000000001,-0.1", (-0.05, 1.0)),  # the rounding of whoever wrote the table
        ("99.99999999999,1.2", (0.0, 1.1)),
    ],
)
def test_points_at_one_force_count_as_their_mean(
    data: GapData, tmp_path: Path, again: str, ends_mm: tuple[float, float]
) -> None:
    rows = f"x,0,0\nx,20,0.2\nx,80,0.8\nx,100,1\nx,{again}\n"
    low, high = ends_mm
    assert simulated_mm(data, tmp_path, HEAD + rows) == pytest.approx(
        [low, 0.2, 0.4, 0.6, 0.8, high]
    )


def test_beyond_two_points_at_the_largest_force_nothing_explodes(
    data: GapData, tmp_path: Path
) -> None:
    found = simulated_mm(data, tmp_path, HEAD + "x,0,0\nx,80,0.7\nx,80,0.9\n")
    assert found == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("x,0,0\nx,20 N,1\n", 'c.csv:3: column force_N: "20 N" is not a number; wanted: a number'),
        ("x,0,0\nx,20,soft\n", 'c.csv:3: column displacement_mm: "soft" is not a number'),
        ("x,0,0\n\nx,20,\n", "c.csv:4: column displacement_mm: an empty cell is not allowed;"),
        ("x,0,0\nx,nan,1\n", 'c.csv:3: column force_N: "nan" is not allowed; wanted: a finite num'),
        ("x,0,0\nx,20,inf\n", 'c.csv:3: column displacement_mm: "inf" is not allowed'),
        ("x,0,0\nx,20\n", "c.csv:3: 2 cells, but the header names 3 columns"),
        ("x,20,0.1\nx,20,0.3\n", "c.csv: 2 rows for pose -, direction x, all at one force;"),
        ("y,0,0\ny,20,0.3\n", "c.csv: 0 rows for pose -, direction x; wanted: at least 2"),
        ("", "c.csv: 0 rows for pose -, direction x"),
        (
            "x,100,1\nx,0,0\nx,100,9\n",
            "c.csv: lines 2, 4: displacements that are 8 mm apart at one force, 100 N (pose -, "
            "direction x); wanted: one displacement at every force.",
        ),
    ],
)
def test_a_table_that_holds_no_curves(data: GapData, tmp_path: Path, rows: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        simulated_mm(data, tmp_path, HEAD + rows)
    assert str(caught.value).startswith(f"{tmp_path}/{says}")


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("x,0,0\nx,95,0.95\n", None),
        (
            "x,0,0\nx,50,0.5\n",
            "The curve of direction x was simulated from 0 to 50 N, measured from 0 to 100 N: it "
            "was taken to go straight on beyond its ends.",
        ),
        (
            "x,0,0\nx,60,0.5\nx,60,0.7\nx,100,1\n",
            "The curve of direction x has values that are 0.2 mm apart at 60 N: their mean was "
            "taken.",
        ),
        ("x,0,0\nx,60,0.595\nx,60,0.605\nx,100,1\n", None),
        (
            "x,0,5\nx,100,6\n",
            "The curve of direction x shows 5 mm without load, where the laser reads zero: that "
            "counts in what the simulation misses, and in no effect.",
        ),
        ("x,10,0.1\nx,100,1\n", None),
    ],
)
def test_what_is_odd_about_curves_is_said(
    data: GapData, tmp_path: Path, rows: str, says: str | None
) -> None:
    (tmp_path / "c.csv").write_text(HEAD + rows)
    notes = with_curves(data, tmp_path / "c.csv").notes[len(data.notes) :]
    assert notes == (() if says is None else (says,))


@pytest.mark.parametrize("slope", [0.01, 0.013])  # mm/N; META states 0.01
def test_a_rig_without_an_arm_is_as_stiff_as_its_curves(
    data: GapData, tmp_path: Path, slope: float
) -> None:
    """As if META had that stiffness: thresholds and noise in mm go by it."""
    (tmp_path / "c.csv").write_text(HEAD + f"x,0,0\nx,100,{100 * slope}\n")
    found = with_curves(data, tmp_path / "c.csv")
    assert found.compliance == pytest.approx([1e-3 * slope])


def test_a_force_that_stands_still_has_no_range_to_cover(data: GapData, tmp_path: Path) -> None:
    drifts = replace(data, force=1e-3 * data.force)  # N: its noise
    (tmp_path / "c.csv").write_text(HEAD + "x,0,0\nx,100,1\n")
    assert with_curves(drifts, tmp_path / "c.csv").notes == drifts.notes


@pytest.mark.parametrize(
    "rows", ["x,0,0\nx,32,0.5\n", "x,0,0\nx,0.000000001,1\n", "x,70,1\nx,200,2\n"]
)
def test_curves_over_less_than_a_third_of_the_range_are_refused(
    data: GapData, tmp_path: Path, rows: str
) -> None:
    with pytest.raises(InputError, match="measured from 0 to 100 N; wanted: curves over the range"):
        simulated_mm(data, tmp_path, HEAD + rows)


@pytest.mark.parametrize(
    ("head", "says"),
    [
        ("direction,force_N", "lacks the column displacement_mm; wanted: pose, direction, force_N"),
        ("branch,force_N,displacement_mm", "these curves depend on the path"),
        ("time_s,branch,force_N,displacement_mm", "these are readings in time"),
    ],
)
def test_a_header_that_does_not_fit(data: GapData, tmp_path: Path, head: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        simulated_mm(data, tmp_path, head + "\n")
