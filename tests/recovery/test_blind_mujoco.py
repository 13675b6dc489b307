"""The arm of MuJoCo's hinges behaves as the physics says, and its cases are whole."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco")

from rig.blind.case import generator, write_dataset
from rig.blind.mujoco_arm import RAMP_S, Hinge, MujocoArm, places
from rig.blind.mujoco_effects import Hidden
from rig.blind.mujoco_rig import EFFECTS, draw_case
from rig.blind.mujoco_session import Design, session
from rig.dataset import load
from rig.worlds.arm import place

Q = np.deg2rad([13.43, -99.84, -108.10, -62.06, 90.0, -76.57])
SPRINGS = np.array([37201.0, 56946.0, 18110.0, 7108.0, 7533.0, 8000.0])
TOOL = place(Q).tool(np.zeros(3))
Y = np.array([0.0, 1.0, 0.0])


def arm(*further: Hinge) -> MujocoArm:
    spots = places(Q)
    joints = [Hinge(f"joint{j + 1}", *spots[f"joint{j + 1}"], SPRINGS[j]) for j in range(6)]
    return MujocoArm(Q, TOOL, [*joints, *further])


def in_joint1(stiffness: float, **more: Any) -> Hinge:
    return Hinge("joint1", *places(Q)["joint1"], stiffness, reference=SPRINGS[0], **more)


def test_elastic_equilibrium_agrees_with_our_own_kinematics() -> None:
    force = np.array([150.0, 40.0, -60.0])
    turned = np.zeros(6)
    for _ in range(60):  # torque at the deflected arm, by fixed point
        now = place(Q + turned)
        turned = now.levers(now.tool(np.zeros(3))) @ force / SPRINGS
    moved = place(Q + turned).tool(np.zeros(3)) - TOOL
    engine = arm()
    engine.load(force)
    assert np.linalg.norm(moved) > 1e-3
    assert engine.displacement() == pytest.approx(moved, abs=2e-8)
    assert engine.turned() == pytest.approx(turned, abs=2e-8)


def test_small_turns_leave_the_laws_and_take_the_geometry_away() -> None:
    force = np.array([150.0, 40.0, -60.0])
    linear = place(Q).levers(TOOL).T @ (place(Q).levers(TOOL) @ force / SPRINGS)
    spots = places(Q)
    slip = in_joint1(20000.0, friction_Nm=20.0)
    joints = [Hinge(f"joint{j + 1}", *spots[f"joint{j + 1}"], SPRINGS[j]) for j in range(6)]
    small = MujocoArm(Q, TOOL, joints, turns=0.01)
    small.load(force)
    assert small.displacement() == pytest.approx(linear, abs=2e-7)
    large = arm()
    large.load(force)
    assert np.abs(large.displacement() - linear).max() > 2e-6
    slipped = []
    for turns in (1.0, 0.01):
        engine = MujocoArm(Q, TOOL, [*joints, slip], turns)
        engine.load(60.0 * Y)
        slipped.append(engine.turned()[6])
    assert slipped[1] == pytest.approx(slipped[0], rel=5e-3)
    assert slipped[0] > 1e-4


@pytest.mark.parametrize("turns", [1.0, 0.01])
def test_sliders_in_series_follow_their_play_operators(turns: float) -> None:
    lever = float((place(Q).levers(TOOL) @ Y)[0])
    spots, k, strengths = places(Q), 4e5, np.array([2.0, 8.0, 25.0])
    joints = [Hinge(f"joint{j + 1}", *spots[f"joint{j + 1}"], SPRINGS[j]) for j in range(6)]
    sliders = [in_joint1(k, friction_Nm=f) for f in strengths]
    engine = MujocoArm(Q, TOOL, [*joints, *sliders], turns)
    state = np.zeros(3)
    for force in (30.0, 60.0, 90.0, 60.0, 30.0, 0.0, 30.0, 60.0):
        engine.load(force * Y)
        torque = lever * force
        state = np.clip(state, (torque - strengths) / k, (torque + strengths) / k)
        assert engine.turned()[6:] == pytest.approx(state, abs=1.5e-6)


def test_dry_friction_holds_below_its_threshold_and_keeps_what_slipped() -> None:
    lever = float((place(Q).levers(TOOL) @ Y)[0])
    engine = arm(in_joint1(20000.0, friction_Nm=40.0))
    threshold_N = 40.0 / lever
    engine.load(0.95 * threshold_N * Y)
    assert abs(engine.turned()[6]) < 2e-6
    engine.load(1.5 * threshold_N * Y)
    slipped = engine.turned()[6]
    assert slipped == pytest.approx(0.5 * 40.0 / 20000.0, rel=0.02)
    engine.load(np.zeros(3))
    assert engine.turned()[6] == pytest.approx(slipped, rel=0.01)  # 20 Nm can't turn it back
    engine.give_back(6)
    assert abs(engine.turned()[6]) < 1e-12


def test_a_play_is_crossed_once_and_not_taken_back() -> None:
    hinge = in_joint1(
        0.0, stop_stiffness=8e5, stop_rad=1e-4, friction_Nm=0.3, damping=SPRINGS[0] / 30
    )
    engine = arm(hinge)
    engine.load(30.0 * Y)
    assert engine.turned()[6] == pytest.approx(1e-4, rel=0.4)
    assert engine.turned()[6] > 1e-4
    engine.load(np.zeros(3))
    assert engine.turned()[6] == pytest.approx(1e-4, rel=0.05)


def test_a_damped_spring_creeps_with_its_time_constant() -> None:
    k = 1e5
    engine = arm(in_joint1(k, damping=20.0 * k))
    engine.load(40.0 * Y)
    before = engine.turned()[6]
    engine.hold(20.0)
    after = engine.turned()[6]
    final = float((place(Q).levers(TOOL) @ Y)[0]) * 40.0 / k
    assert (final - after) / (final - before) == pytest.approx(np.exp(-1.0), rel=0.02)


def test_what_creeps_has_crept_as_long_as_the_recorded_clock_says() -> None:
    time, top, k = 12.0, 90.0, 1e5
    design = Design(
        poses={"P1": Q},
        tool=np.zeros(3),
        forces={"y": top},
        steps=2,
        samples=5,
        repetitions=1,
        noise_mm=0.001,
        noise_N=0.1,
        stated=SPRINGS,
        relative_sd=0.05,
        rest_s=0.0,
    )
    slow = in_joint1(k, damping=time * k)
    rows = session(design, SPRINGS, Hidden("joint_creep", "", "", {}, (1,), (slow,), creeps=True))
    lever = float((place(Q).levers(TOOL) @ Y)[0])
    state, before, now, fine, crept = 0.0, 0.0, rows[0].session_s, 0.01, []
    for row in rows:  # Kelvin-Voigt, along the ramp of the screw and through the hold
        steps = round((row.session_s - now) / fine) or 1
        ramp = np.minimum(np.arange(1, steps + 1) * fine / RAMP_S, 1.0)
        for share in ramp if row.force != before else np.ones(steps):
            at = before + share * (row.force - before)
            state += fine / time * (lever * at / k - state)
        now, before = row.session_s, row.force
        crept.append(state + lever * row.force / SPRINGS[0])
    turned = np.array([row.turned[0] for row in rows])
    assert turned == pytest.approx(np.array(crept), abs=0.02 * lever * top / k)


def test_a_second_spring_stiffens_reversibly() -> None:
    spots = places(Q)["joint1"]
    engine = MujocoArm(Q, TOOL, [Hinge("joint1", *spots, 30000.0, 20000.0, 5e-4)])
    lever = float((place(Q).levers(TOOL) @ Y)[0])
    for force in (10.0, 60.0, 10.0):
        engine.load(force * Y)
        torque = lever * force
        soft = torque / 30000.0
        expected = soft if soft < 5e-4 else (torque + 20000.0 * 5e-4) / 50000.0
        assert engine.turned()[0] == pytest.approx(expected, rel=5e-3)


def test_the_same_seed_draws_the_same_case_and_its_data_set_is_marked(tmp_path: Path) -> None:
    draw, words = generator("mujoco")
    assert words == EFFECTS
    first, again = (draw(9, 5, word="joint_yield") for _ in range(2))
    assert first.label["truth"] == first.label["accept"] == ["joint_yield"]
    assert first.label["where"]["seen_by_encoders"]
    assert len(first.label["where"]["joints"]) == 1
    assert first.label == again.label
    assert all(np.array_equal(first.columns[n], again.columns[n]) for n in first.columns)
    write_dataset(first, tmp_path / "a.h5")
    assert load(tmp_path / "a.h5").origin == "emulated"


def test_answers_fit_the_word() -> None:
    label = draw_case(9, 3, word="base_compliance").label
    assert label["truth"] == ["base_compliance"]
    assert label["accept"][0] == "base_compliance"
    assert 1.5 <= label["snr"] <= 60.0
    assert label["where"]["joints"] == []
    assert not label["where"]["seen_by_encoders"]
