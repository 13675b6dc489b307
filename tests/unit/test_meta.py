"""META.yaml: what it may hold, its defaults, and how it is refused."""

from __future__ import annotations

import pytest

from rig.errors import InputError
from rig.meta import Meta
from rig.yaml.yamlfile import load_yaml_text
from tests.unit.example_data import META, META_SPECIMEN


def meta(text: str) -> Meta:
    return load_yaml_text(text, "META.yaml", Meta)


def test_defaults() -> None:
    full, specimen = meta(META), meta(META_SPECIMEN)
    assert (full.joint_encoder, full.datum, full.tare, full.imposed) == (
        "output",
        "setup",
        "session",
        None,
    )
    assert specimen.instruments.force.gain_relative_sd == 0.005
    assert specimen.instruments.displacement.gain_relative_sd == 0.003
    assert specimen.poses == {}
    assert meta(META.split("simulation")[0]).simulation is None
    assert meta(META.replace(", tcp_xyz_mm: [0, 0, 50]", "")).poses["P1"].tcp_xyz_mm == (0, 0, 0)


def test_simulated_springs_may_be_off_several_times() -> None:
    said = "joint_stiffness_relative_sd: 0.1"
    assert said in META
    found = meta(META.replace(said, said.replace("0.1", "1.5"))).simulation
    assert found is not None
    assert found.joint_stiffness_relative_sd == 1.5


def test_directions_come_out_as_unit_vectors() -> None:
    vector = meta(META.replace("[0, 1, 0]", "[0.7071, -0.7071, 0]")).directions["y"]
    assert sum(c * c for c in vector) == pytest.approx(1, abs=1e-15)
    assert vector[1] == -vector[0]


REFUSED = [
    (
        "[1, 0, 0]",
        "[1, 1, 0]",
        "x has the length 1.41421; wanted: a unit vector. Did you mean [0.707107, 0.707107, 0]?",
    ),
    ("[1, 0, 0]", "[0, 0, 0]", "x is [0, 0, 0], which points nowhere; wanted: a unit vector."),
    ("{x: [1, 0, 0], y: [0, 1, 0]}", "{}", "names no direction; wanted: at least one"),
    ("x: [1", "a/b: [1", 'the name "a/b" is not allowed; wanted: 1 to 60 characters without'),
    (
        "q_rad: [0.1",
        "q_rad: [-99.8",
        "joint 1 stands at -99.8 rad; wanted: -6.283 to 6.283 rad. Are these degrees?",
    ),
    ("0.6]", "0.6, 1]", "poses.P1.q_rad"),
    ("37000", "0", "simulation.joint_stiffness_Nm_per_rad[0]"),
    ("robot: ur10e", "robot: ur10", 'the robot "ur10" is not known. Did you mean "ur10e"?'),
    ("robot: ur10e", "robot: none", "poses are given, but robot is none"),
    (
        "poses: {P1: {q_rad: [0.1, -1.2, 1.3, -0.4, 1.5, 0.6], tcp_xyz_mm: [0, 0, 50]}}",
        "",
        "poses are missing; the robot ur10e needs at least one.",
    ),
    (
        "joint_stiffness_Nm_per_rad: [37000, 57000, 18000, 7100, 7500, 8000]",
        "stiffness_N_per_mm: {x: 1, y: 1}",
        "simulation of ur10e wants joint_stiffness_Nm_per_rad",
    ),
    ("gain_relative_sd: 0.005", "gain_relative_sd: 1.5", "instruments.force.gain_relative_sd"),
    (
        "joint_stiffness_relative_sd: 0.1",
        "joint_stiffness_relative_sd: 10",
        "joint_stiffness_relative_sd: 10 is not allowed; wanted: a number from 0 to 5.",
    ),
    ("gain_relative_sd: 0.005", "gain_sd: 0.005", 'Did you mean "gain_relative_sd"?'),
]
REFUSED_SPECIMEN = [
    (
        "stiffness_N_per_mm: {x: 95.0}",
        "joint_stiffness_Nm_per_rad: [1, 1, 1, 1, 1, 1]",
        "the simulation of robot: none wants stiffness_N_per_mm, one number a direction",
    ),
    ("{x: 95.0}", "{z: 95.0}", 'names the direction "z", which is not among the directions.'),
    (
        "directions: {x: [1, 0, 0]}",
        "directions: {x: [1, 0, 0], y: [0, 1, 0]}",
        'stiffness_N_per_mm lacks the direction "y"',
    ),
]


@pytest.mark.parametrize(("old", "new", "message"), REFUSED)
def test_refused(old: str, new: str, message: str) -> None:
    assert old in META
    with pytest.raises(InputError) as told:
        meta(META.replace(old, new))
    assert message in str(told.value)
    assert str(told.value).startswith("META.yaml:")


@pytest.mark.parametrize(("old", "new", "message"), REFUSED_SPECIMEN)
def test_refused_without_an_arm(old: str, new: str, message: str) -> None:
    with pytest.raises(InputError) as told:
        meta(META_SPECIMEN.replace(old, new))
    assert message in str(told.value)
