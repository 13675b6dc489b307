"""What is wrong in one component, in one pose, or seats face by face, and mountings that open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arm import tool_offset
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.effects.base_compliance import bent_column, moments
from identification.gap.effects.force_scale import component
from identification.gap.model.bench import make_bench
from rig.models.robot import load_robot
from tests.conformance.gap_designs import TCP_MM, TRUE, Array, Q, linear
from tests.explained import explained
from tests.unit.test_gap_running import SPRING, running


def of_each(data: GapData, values: list[Array] | list[float]) -> Array:
    """What belongs to its setup, for every sample."""
    return np.asarray(values)[data.setup]


@pytest.mark.slow
@pytest.mark.parametrize("axis", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_the_gain_of_one_component_is_no_gain_of_all(axis: int) -> None:
    data = linear("rich")
    reads = of_each(data, [1.12 if s.unit_vector[axis] else 1.0 for s in data.setups])
    found = explained(replace(data, force=reads * data.force))
    assert found.names == ("force_scale",)
    factor = found.effects[0].parameters[f"factor_{'xyz'[axis]}"]
    assert factor.low < 1.12 < factor.high


def test_a_component_that_reads_too_much_shows_across_a_push_askew_to_it() -> None:
    data, slant = linear("rich"), np.array([1.0, 1.0, 0.0]) / 2**0.5
    across = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]]) / [[2**0.5], [1.0]]
    askew = tuple(replace(s, unit_vector=slant, tangents=across) for s in data.setups)
    bench = make_bench(replace(data, setups=askew))
    shown = component(bench, 0)[bench.layout.tangential].reshape(2, -1)
    np.testing.assert_allclose(shown[0], bench.rows.hold_means(bench.load) / 2, atol=1e-9)
    assert not shown[1].any()


def test_means_of_holds_count_every_sample() -> None:
    rows = make_bench(linear("rich")).rows
    values = np.column_stack([rows.displacement, rows.time])
    assert len(np.unique(rows.weight)) > 1
    for hold, mean in enumerate(rows.hold_means(values)):
        mine = rows.hold == hold
        wanted = np.average(values[mine], axis=0, weights=rows.weight[mine])
        np.testing.assert_allclose(mean, wanted, rtol=1e-12)
    np.testing.assert_array_equal(rows.hold_means(rows.time), rows.hold_means(values)[:, 1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("poses", "read", "label"),
    [pytest.param("P2", True, "in P2", marks=pytest.mark.slow), ("P1 P2", False, "unread")],
)
def test_an_arm_that_stands_elsewhere_in_one_pose_or_unread(
    poses: str, read: bool, label: str
) -> None:
    """By 2 degrees in the shoulder, as the reading shows as well, or a zero that was lost does
    not."""
    data, off, arm = linear("rich"), np.zeros(6), load_robot("ur10e")
    off[1] = 0.035
    there = np.array([s.pose in poses for s in data.setups])
    tool = tool_offset(np.array(TCP_MM) * 1e-3)
    true = of_each(
        data,
        [
            arm.jacobian(np.array(Q[s.pose]) + p * off, tool)[:3].T @ s.unit_vector
            for s, p in zip(data.setups, there, strict=True)
        ],
    )
    lever = of_each(data, [s.lever for s in data.setups])
    torque = true * data.force[:, None]
    moved = (true * torque - lever**2 * data.force[:, None]) @ (1 / TRUE)
    assert data.q is not None
    q = data.q + (torque - lever * data.force[:, None]) / TRUE
    q = q + read * np.outer(there[data.setup], off)
    found = explained(replace(data, displacement=data.displacement + moved, q=q))
    assert found.verdict == "pose_error"
    angle = found.effects[0].parameters["angle_joint2"]
    assert angle.value == pytest.approx(0.035, rel=0.05)
    assert f"{label}, as they are" in found.effects[0].label


@pytest.mark.slow
def test_faces_that_seat_one_after_the_other() -> None:
    data = linear("rich")
    push = np.abs(data.force)
    depth = 2e-5 * (1 - np.exp(-push / 6)) + 5e-5 / (1 + np.exp(-(push - 34) / 3))
    found = explained(replace(data, displacement=data.displacement + depth * np.sign(data.force)))
    assert found.names == ("contact_seating",)
    assert found.effects[0].parameters["depth"].value == pytest.approx(70e-3, rel=0.1)  # mm


@pytest.mark.slow
@pytest.mark.parametrize(
    ("design", "until", "label"),
    [
        pytest.param("rich", "setup", "some stays", marks=pytest.mark.slow),
        ("bench", "setup", "some stays"),
        ("rich", "run", "some stays until the next run"),
    ],
)
def test_what_is_bedded_in_may_stay_so(design: str, until: str, label: str) -> None:
    """Half of a seat comes back, half of it is pressed flat for good, or until the screw is set on
    anew for the next run; of an arm in every direction anew."""
    data = linear(design)
    push, so_far, last = np.abs(data.force), 0.0, -1
    most = np.zeros(len(push))
    for i, (f, part) in enumerate(zip(push, getattr(data, until), strict=True)):
        so_far, last = max(f, so_far if part == last else 0.0), int(part)
        most[i] = so_far
    top = float(push.max())
    depth = sum(3e-5 * (1 - np.exp(-size / (0.1 * top))) for size in (push, most))
    found = explained(replace(data, displacement=data.displacement + depth))
    assert found.verdict == "contact_seating"
    assert found.effects[0].label == f"exponential 0.1, {label}"
    assert found.effects[0].parameters["depth"].value == pytest.approx(60e-3, rel=0.1)  # mm


def test_no_seat_stays_where_nothing_comes_back() -> None:
    """A pull whose force trembles."""
    force = np.linspace(0.0, 60.0, 300) + np.random.default_rng(1).normal(0, 0.6, 300)
    labels = [
        v.label
        for v in library(
            make_bench(running(force, force / SPRING, imposed="force")), ["contact_seating"]
        )
    ]
    assert labels
    assert not any("stays" in label for label in labels)


def test_a_plate_may_open_anywhere() -> None:
    """Bends of the library's come near to one between them."""
    bench = make_bench(linear("rich"))
    m = moments(bench, 0.0)
    feet = next(v for v in library(bench, ["base_compliance"]) if v.label.endswith("on feet"))
    columns = np.array([bench.columns[c] for c in feet.columns])
    axis = int(feet.info["axes"][0])
    top = float(np.abs(m[:, axis] * bench.load).max())
    for share in (0.15, 0.36, 0.48, 0.62):
        opened = bent_column(bench, m[:, axis], m[:, axis] * bench.load, share * top)
        left = opened - columns.T @ np.linalg.lstsq(columns.T, opened, rcond=None)[0]
        assert np.linalg.norm(left) < 0.06 * np.linalg.norm(opened)


@pytest.mark.slow
def test_a_laser_that_changes_its_range_has_two_gains() -> None:
    data = linear("rich")
    beyond = np.sign(data.displacement) * np.maximum(np.abs(data.displacement) - 0.8e-3, 0.0)
    found = explained(replace(data, displacement=data.displacement + 0.15 * beyond))
    assert found.verdict == "displacement_scale"
    assert found.effects[0].label.startswith("gain that changes at")


@pytest.mark.slow
def test_a_joint_that_hardens_alike_in_both_senses_gives_way_to_new_loads_only() -> None:
    """Whichever way they push: what had been borne before is borne again (isotropic hardening)."""
    data = linear("rich")
    lever = of_each(data, [s.lever for s in data.setups])[:, 0]
    torque, most, at = lever * data.force, 0.0, 15.0
    flowed, so_far, pose = [], 0.0, ""
    for t, setup in zip(torque, data.setup, strict=True):
        if data.setups[setup].pose != pose:
            most, so_far, pose = 0.0, 0.0, data.setups[setup].pose
        if abs(t) > max(most, at):
            so_far += np.sign(t) * (abs(t) - max(most, at))
            most = abs(t)
        flowed.append(so_far)
    give = np.array(flowed) / TRUE[0]
    assert data.q is not None
    q = data.q + np.outer(give, np.eye(6)[0])
    found = explained(replace(data, displacement=data.displacement + lever * give, q=q))
    assert found.verdict == "joint_yield"
    assert found.where.joints == (1,)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("encoder", "seen"),
    [pytest.param("output", False, marks=pytest.mark.slow), ("motor", False), ("", None)],
)
def test_what_no_joint_does_no_reading_shows(encoder: str, seen: bool | None) -> None:
    data = linear("rich")
    depth = 3e-5 * np.sign(data.force) * (1 - np.exp(-np.abs(data.force) / 6))
    data = replace(
        data,
        displacement=data.displacement + depth,
        output_encoder=encoder == "output",
        q=data.q if encoder else None,
    )
    found = explained(data)
    assert found.verdict == "contact_seating"
    assert found.where.seen_by_encoders is seen


def test_feet_under_a_weight_do_not_stop_giving() -> None:
    bench = make_bench(linear("rich"))
    for v in library(bench, ["base_compliance"]):
        if v.label.endswith("on feet"):
            only = np.zeros(len(v.columns))
            only[: len(v.info["axes"])] = 1.0
            first = len(only) - len(v.info["bends_Nm"])
            for left, allowed in ((0.6, True), (0.4, False)):
                pressed = only.copy()
                pressed[first] = left - 1
                assert bool(np.all(v.within @ pressed >= 0)) is allowed


def test_a_laser_changes_its_gain_beyond_a_quarter_of_its_reading() -> None:
    labels = [v.label for v in library(make_bench(linear("rich")), ["displacement_scale"])]
    shares = [float(v.split(" at ")[1]) for v in labels if "changes" in v]
    assert shares
    assert min(shares) >= 0.25
