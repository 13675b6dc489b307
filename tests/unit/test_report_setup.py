"""The drawing of the setup, and the figures that bear the name of what they show."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from rig.analysis.quality import Plateau, RunZeros
from rig.meta import Meta, MetaPose
from rig.plotting import named
from rig.report import figures
from rig.report.setup_drawing import Load, arm_setup, laser_sign
from tests.unit.example_data import dataset

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
BOTH_SENSES = [
    Load(f"{sign:+d}"[0] + name, (sign * x, sign * y, sign * z))
    for name, (x, y, z) in AXES.items()
    for sign in (1, -1)
]
ONE_LINE = [Load("x_30", AXES["x"]), Load("x_60", AXES["x"]), Load("x", AXES["x"])]
POSE = MetaPose(q_rad=(0.234, -1.743, -1.887, -1.083, 1.571, -1.336), tcp_xyz_mm=(0, 0, 0))
ASKEW = [Load("across", AXES["y"]), Load("askew", (0.0, 0.7, 0.7))]


@pytest.mark.parametrize("sign", [1, -1, None])
@pytest.mark.parametrize("loads", [BOTH_SENSES, ONE_LINE, ASKEW], ids=["ISO 9283", "x", "askew"])
def test_no_name_of_a_load_lies_over_another(loads: list[Load], sign: int | None) -> None:
    figure = arm_setup(Meta.model_construct(robot="ur10e", poses={"P1": POSE}), "P1", loads, sign)
    figure.canvas.draw()
    for axes in figure.axes:
        names = [text for text in axes.texts if text.get_text()]
        assert {text.get_text() for text in names} == {load.name for load in loads}
        for one, other in combinations(names, 2):
            boxes = one.get_window_extent(), other.get_window_extent()
            assert not boxes[0].overlaps(boxes[1]), (one.get_text(), other.get_text())


def laser_ahead(sign: int | None, vector: tuple[float, float, float]) -> list[float]:
    """How far ahead of the point of load the laser stands along the motion, mm, from above."""
    figure = arm_setup(
        Meta.model_construct(robot="ur10e", poses={"P1": POSE}), "P1", [Load("x", vector)], sign
    )
    axes = figure.axes[0]
    (point,) = [
        line for line in axes.lines if line.get_markersize() == 8 and line.get_marker() == "o"
    ]
    lasers = [line for line in axes.lines if line.get_marker() == "D"]
    at = np.array([point.get_xdata()[0], point.get_ydata()[0]])
    return [
        float((np.array([one.get_xdata()[0], one.get_ydata()[0]]) - at) @ np.array(vector[:2]))
        for one in lasers
    ]


@pytest.mark.parametrize("vector", [AXES["x"], AXES["y"], (-1.0, 0.0, 0.0)])
def test_the_laser_stands_where_its_sign_says(vector: tuple[float, float, float]) -> None:
    """A push that makes the distance longer (sign 1) is seen from behind."""
    assert laser_ahead(1, vector) == [pytest.approx(-280)]
    assert laser_ahead(-1, vector) == [pytest.approx(280)]
    assert laser_ahead(None, vector) == []


def test_the_sign_is_that_of_the_data_set() -> None:
    assert laser_sign({"laser": {"sign": -1}, "dynamometer": {}}) == -1
    assert laser_sign({"laser": {"sign": 1}}) == 1
    assert laser_sign({"laser": "?"}) is None
    assert laser_sign({}) is None


@pytest.mark.parametrize(("mm", "shown", "unit"), [(2e-5, 0.02, "µm"), (0.3, 0.3, "mm")])
def test_displacements_without_load_have_a_unit_that_suits_them(
    mm: float, shown: float, unit: str
) -> None:
    zeros = (RunZeros("P1", "x", 1, (Plateau(0.0, 0.0, 0.0), Plateau(60.0, 0.1, -mm))),)
    figure = figures.quality("arm.h5", dataset(), zeros)
    (axes,) = [a for a in figure.axes if a.get_ylabel().startswith("Displacement")]
    assert axes.get_ylabel() == f"Displacement at\nzero load, {unit}"
    assert axes.lines[0].get_ydata()[1] == pytest.approx(-shown)


def test_no_bar_of_the_joints_ends_on_the_axis() -> None:
    prior = {"joint_stiffness_Nm_per_rad": [6e4] * 3 + [8e3] * 3, "relative_sd": [0.35] * 6}
    springs = [{"value": 4e4, "ci95": [3e4, 5e4]}] * 3 + [{"value": 8e3, "ci95": [4.1e3, 15e3]}] * 3
    found = {"prior": prior, "joint_stiffness_Nm_per_rad": springs, "identified": [True] * 6}
    (axes,) = figures.joints([("arm.h5", found)], []).axes
    low, high = axes.get_ylim()
    ends = [end for bar in axes.patches for end in (bar.get_y(), bar.get_y() + bar.get_height())]
    assert low < 0.99 * min(ends)
    assert 1.01 * max(ends) < high


def test_figures_bear_the_name_of_their_data_set() -> None:
    quality = figures.quality("arm.h5", dataset(), ())
    assert [t.get_text() for t in quality.texts] == ["EMULATED", "arm.h5"]
    prior = {"joint_stiffness_Nm_per_rad": [1e4] * 6, "relative_sd": [0.3] * 6}
    springs = [{"value": 1e4, "ci95": [9e3, 11e3]}] * 6
    found = {"prior": prior, "joint_stiffness_Nm_per_rad": springs, "identified": [True] * 6}
    one = figures.joints([("arm.h5", found)], [])
    assert one.texts[-1].get_text() == "arm.h5"
    several = figures.joints([("a.h5", found), ("b.h5", found)], [])
    assert [t.get_text() for t in several.texts if t.get_text()] == []  # the legend names them
    assert named(one, "again").texts[-1].get_text() == "again"
