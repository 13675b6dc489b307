"""Every law of the hidden worlds does what its word says: what returns, what stays, who sees it."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from rig.worlds.hidden.effect import rounded, share_of_joints
from rig.worlds.hidden.gap import rms, structural_gap
from rig.worlds.hidden.label import _joints
from rig.worlds.hidden.scene import Change, Scene
from rig.worlds.hidden.words import EFFECTS
from tests.unit.hidden_scenes import FORM_NAMES, contribution, effect_of, middle, scene_of

ELASTIC = ("joint_nonlinear_stiffness", "contact_seating", "link_flexibility", "base_compliance")
UNSEEN = (
    "link_flexibility",
    "base_compliance",
    "base_slip",
    "contact_seating",
    "zero_shift",
    "thermal_drift",
    "displacement_scale",
)
IN_GEAR = (
    "joint_yield",
    "joint_hysteresis",
    "joint_creep",
    "joint_nonlinear_stiffness",
    "joint_backlash",
    "joint_stiffness_error",
)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return scene_of("rich")


@pytest.fixture(scope="module")
def short() -> Scene:
    return scene_of("medium")


def _forms(words: tuple[str, ...]) -> list[tuple[str, str]]:
    return [(w, f) for w, f in FORM_NAMES if w in words]


def _setup_of(scene: Scene) -> Any:
    return scene.history.setup[scene.history.sample]


@pytest.mark.parametrize(("word", "form"), FORM_NAMES)
def test_every_law_is_seen_and_grows_with_its_size(scene: Scene, word: str, form: str) -> None:
    drawn = effect_of(scene, word, form)
    sizes = np.geomspace(*drawn.sizes, 4)
    seen = [contribution(scene, drawn, s) for s in sizes]
    sums = [rms(moved) + rms(0.01 * force) + rms(1e3 * q) for moved, force, q in seen]
    assert np.all(np.diff(sums) > 0)
    assert json.dumps(rounded(drawn.parameters(float(sizes[1]))))
    if form == "yaw":  # to the laser a softer joint 1; only encoders tell them apart
        return
    # beyond the noise of the best instrument when it is as large as physics allows
    assert rms(structural_gap(scene, [drawn.change(drawn.sizes[1])])) > 1.5e-3


@pytest.mark.parametrize(("word", "form"), _forms(ELASTIC))
def test_elastic_laws_return_and_retrace(scene: Scene, word: str, form: str) -> None:
    drawn = effect_of(scene, word, form)
    moved, _, _ = contribution(scene, drawn, middle(drawn))
    setup, load = _setup_of(scene), scene.history.load[scene.history.sample]
    assert np.abs(moved[load == 0.0]).max() < 1e-9
    for s in np.unique(setup):  # one curve over the load, whatever the branch
        mine = np.argsort(load[setup == s])
        rise = np.abs(np.diff(moved[setup == s][mine]))
        step = np.diff(load[setup == s][mine])
        assert rise[step < 1e-9].max(initial=0.0) < 1e-9


@pytest.mark.parametrize(("word", "form"), _forms(("joint_yield", "base_slip")))
def test_what_has_yielded_stays_while_the_arm_stands(scene: Scene, word: str, form: str) -> None:
    drawn = effect_of(scene, word, form)
    moved, _, _ = contribution(scene, drawn, middle(drawn))
    history, setup = scene.history, _setup_of(scene)
    strongest = setup[np.argmax(np.abs(moved))]
    first = (setup == strongest) & (history.repetition == 1)
    # the laser was zeroed before the first run of the setup
    after = np.flatnonzero(first & (history.branch == 0))[-1]
    top = np.abs(moved[first]).max()
    assert abs(moved[after]) > 0.25 * top
    assert drawn.onset_N
    again = np.flatnonzero((setup == strongest) & (history.repetition == 2))[0]
    if form == "controller_clamp":
        assert abs(moved[again]) < 0.05 * top
    elif form != "yaw_creeping":  # another memory: flow goes on
        assert abs(moved[again]) > 0.2 * top


@pytest.mark.parametrize("form", ["sharp", "rounded", "rate_dependent", "two_backstresses"])
def test_nothing_yields_far_below_the_threshold(scene: Scene, form: str) -> None:
    drawn = effect_of(scene, "joint_yield", form)
    size = middle(drawn)
    joint = drawn.joints[0] - 1
    moved, _, _ = contribution(scene, drawn, size)
    limit = drawn.parameters(size)["threshold_Nm"]
    torque = np.abs(scene.torque[:, joint])
    unloaded = np.maximum.accumulate(torque)[scene.history.sample] < 0.45 * limit
    assert unloaded.any()
    assert np.abs(moved[unloaded]).max() < 0.01 * np.abs(moved).max()


@pytest.mark.parametrize(("word", "form"), _forms(UNSEEN))
def test_encoders_do_not_see_what_is_outside_the_joints(short: Scene, word: str, form: str) -> None:
    drawn = effect_of(short, word, form)
    moved, _, q = contribution(short, drawn, middle(drawn))
    assert rms(moved) > 0
    assert np.abs(q).max() == 0.0


@pytest.mark.parametrize(("word", "form"), _forms(IN_GEAR))
def test_output_encoders_see_exactly_what_the_laser_sees(
    scene: Scene, word: str, form: str
) -> None:
    drawn = effect_of(scene, word, form)
    moved, _, q = contribution(scene, drawn, middle(drawn))
    lever = np.einsum("sij,sj->si", scene.levers, scene.unit)[_setup_of(scene)]
    by_q = 1e3 * np.sum(lever * q, axis=1)
    setup = _setup_of(scene)
    first = np.flatnonzero(np.diff(setup, prepend=-1))
    assert moved == pytest.approx(by_q - by_q[first][setup], abs=1e-9)


def test_motor_encoders_do_not_see_the_gear() -> None:
    motor = scene_of("medium", encoder="motor")
    drawn = effect_of(motor, "joint_yield", "sharp")
    moved, _, q = contribution(motor, drawn, middle(drawn))
    assert rms(moved) > 0
    assert np.abs(q).max() == 0.0


def test_creep_goes_on_while_the_load_is_held_and_recovers(scene: Scene) -> None:
    drawn = effect_of(scene, "joint_creep", "standard_solid")
    moved, _, _ = contribution(scene, drawn, middle(drawn))
    history = scene.history
    setup = _setup_of(scene)[np.argmax(np.abs(moved))]
    run = (_setup_of(scene) == setup) & (history.repetition == 1)
    top = np.flatnonzero(run & (history.step == scene.plan.steps))
    signed = np.sign(moved[top[-1]]) * moved
    assert np.all(np.diff(signed[top]) > 0)
    zero = np.flatnonzero(run & (history.branch == 0))[scene.plan.zero_before :]
    assert np.all(np.diff(signed[zero]) < 0)


@pytest.mark.parametrize("seed", range(6))
def test_backlash_makes_its_step_where_the_net_torque_turns(scene: Scene, seed: int) -> None:
    drawn = effect_of(scene, "joint_backlash", "smooth", seed=seed)
    size = 3e-4
    _, _, q = contribution(scene, drawn, size)
    joint = drawn.joints[0] - 1
    net = (scene.torque + scene.weight[scene.history.setup])[scene.history.sample, joint]
    zone = drawn.parameters(size)["zone_Nm"]
    assert q[net > 4 * zone, joint] == pytest.approx(size / 2, rel=0.01)
    if np.any(net < -4 * zone):
        assert q[net < -4 * zone, joint] == pytest.approx(-size / 2, rel=0.01)


def test_pushing_up_takes_the_weight_off_the_shoulder(scene: Scene) -> None:
    """Weight turns the joints as a load downward at the tool does, never as one upward."""
    pushed_up = scene.levers[:, 1:3] @ np.array([0.0, 0.0, 1.0])
    assert np.all(pushed_up * scene.weight[:, 1:3] < 0)


def test_seating_is_the_same_in_every_direction_and_pose(scene: Scene) -> None:
    drawn = effect_of(scene, "contact_seating", "hyperbolic")
    moved, _, _ = contribution(scene, drawn, 0.02)
    scale = drawn.parameters(0.02)["force_scale_N"]
    load = scene.history.load[scene.history.sample]
    assert moved == pytest.approx(0.02 * load / (load + scale), abs=1e-9)


def test_force_drift_moves_the_force_at_zero_load_and_nothing_else(scene: Scene) -> None:
    drawn = effect_of(scene, "force_drift", "linear")
    moved, force, q = contribution(scene, drawn, 5.0)
    assert np.abs(moved).max() == 0.0
    assert np.abs(q).max() == 0.0
    clock = scene.history.time[scene.history.sample]
    expected = 5.0 * (clock - clock[0]) / scene.history.time[-1]
    assert np.abs(force) == pytest.approx(expected, abs=1e-9)


def test_taring_before_every_run_leaves_what_drifts_within_it() -> None:
    scene = scene_of("medium", tare="run")
    drawn = effect_of(scene, "force_drift", "linear")
    _, force, _ = contribution(scene, drawn, 5.0)
    run = scene.history.run[scene.history.sample]
    first = np.flatnonzero(np.diff(run, prepend=-1))
    assert np.abs(force[first]).max() < 1e-12
    assert np.abs(force).max() < 1.5  # a fraction of the session's 5 N


def test_drift_of_the_target_does_not_care_about_the_load(scene: Scene) -> None:
    drawn = effect_of(scene, "thermal_drift", "linear")
    moved, force, _ = contribution(scene, drawn, 0.1)
    assert np.abs(force).max() == 0.0
    clock, setup = scene.history.time[scene.history.sample], _setup_of(scene)
    for s in np.unique(setup):
        line = np.polyfit(clock[setup == s], moved[setup == s], 1)
        assert moved[setup == s] == pytest.approx(np.polyval(line, clock[setup == s]), abs=1e-9)


def test_shifts_hold_for_whole_runs_against_the_first(scene: Scene) -> None:
    drawn = effect_of(scene, "zero_shift", "every_run")
    moved, _, _ = contribution(scene, drawn, 0.1)
    run = scene.history.run[scene.history.sample]
    shifts = np.array(drawn.parameters(0.1)["shift_mm_by_run"])
    assert moved == pytest.approx(shifts[run], abs=1e-12)
    assert np.all(shifts[:: scene.plan.repetitions] == 0.0)


def test_lag_shows_at_the_first_sample_of_a_hold(scene: Scene) -> None:
    drawn = effect_of(scene, "time_lag", "laser_delay")
    moved, force, _ = contribution(scene, drawn, 1.5)
    history = scene.history
    begins = np.diff(history.step * 3 + history.branch, prepend=-1) != 0
    loading = history.branch == 1
    assert np.all(moved[begins & loading] < 0)
    later = loading & ~begins & ~np.roll(begins, 1) & ~np.roll(begins, 2)
    assert np.abs(moved[later]).max() < 1e-9
    assert np.abs(force).max() == 0.0


def test_lag_of_the_force_leaves_displacement_and_joints_alone(short: Scene) -> None:
    drawn = effect_of(short, "time_lag", "force_window")
    moved, force, q = contribution(short, drawn, 1.5)
    assert np.abs(moved).max() == 0.0
    assert np.abs(q).max() == 0.0
    assert np.abs(force).max() > 0.5


def test_misaligned_load_shows_in_the_other_components(short: Scene) -> None:
    from rig.worlds.hidden.scene import observe

    drawn = effect_of(short, "load_misalignment", "each_direction")
    plain, changed = observe(short), observe(short, [drawn.change(0.5)])
    across = changed.force_N - plain.force_N
    unit = short.unit[_setup_of(short)]
    load = short.history.load[short.history.sample]
    assert np.sum(across * unit, axis=1) == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(across, axis=1) == pytest.approx(0.1 * load, rel=1e-9)


def test_gains_multiply(short: Scene) -> None:
    from rig.worlds.hidden.scene import observe

    plain = observe(short)
    laser = effect_of(short, "displacement_scale", "reads_low").change(0.1)
    assert observe(short, [laser]).displacement_mm == pytest.approx(0.9 * plain.displacement_mm)
    force = effect_of(short, "force_scale", "reads_high").change(0.1)
    assert observe(short, [force]).force_N == pytest.approx(1.1 * plain.force_N)


def test_a_joint_that_stands_off_is_read_at_zero_load(short: Scene) -> None:
    drawn = effect_of(short, "pose_error", "joint")
    _, _, q = contribution(short, drawn, 1.0)
    stands = np.array(drawn.parameters(1.0)["stands_off_rad"])
    zero = short.history.load[short.history.sample] == 0.0
    assert np.abs(stands).max() == pytest.approx(np.radians(2.0))
    assert np.abs(q[zero] - stands).max() < 1e-12


def test_beams_bend_by_the_cube_of_their_length() -> None:
    """A straight arm loaded across at its end: F L^3 / 3 EI for links of one stiffness."""
    from dataclasses import replace

    from rig.worlds.hidden.outer_laws import beam_compliance

    plan = plan_straight()
    scene = scene_of("medium")
    scene = replace(
        scene, plan=plan, tool=np.array([[-1.18425, 0.0, 0.1807]]), unit=np.array([[0.0, 0.0, 1.0]])
    )
    whole = beam_compliance(scene, 0, 0) + beam_compliance(scene, 0, 1)
    assert whole == pytest.approx(1.18425**3 / 3, rel=1e-9)


def plan_straight() -> Any:
    from dataclasses import replace

    from tests.unit.hidden_scenes import plan_of

    plan = plan_of("medium")
    return replace(plan, poses={"P1": np.zeros(6)}, setups=plan.setups[:1])


def test_all_words_have_laws_and_most_have_foreign_ones() -> None:
    from rig.worlds.hidden.draw import FORMS

    for word in EFFECTS:
        assert len(FORMS[word]) >= 2
        assert any(f.fitted for f in FORMS[word])
        if word != "joint_stiffness_error":
            assert any(not f.fitted for f in FORMS[word])
    assert len(FORMS["unknown"]) >= 8


def test_joints_of_the_answers_are_those_that_bear_a_load(scene: Scene) -> None:
    """All six springs are wrong alike; joint 6 turns about the tool's axis, and is pushed there."""
    part = share_of_joints(scene)
    change = Change(springs=np.full(6, 0.5))
    shown = _joints(scene, range(1, 7), change)
    assert 6 not in shown
    assert int(np.argmax(part)) + 1 in shown
    only = Change(springs=np.where(np.arange(6) == int(np.argmax(part)), 0.5, 1.0))
    assert _joints(scene, range(1, 7), only) == [int(np.argmax(part)) + 1]
