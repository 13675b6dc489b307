"""Answers give what the true curve shows, not constants that only its own formula knows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rig.worlds.hidden import memory
from rig.worlds.hidden.effect import Unsuited, draw_joint
from rig.worlds.hidden.joint_path import onset, reached
from rig.worlds.hidden.joint_yield import _knee_law
from rig.worlds.hidden.meaning import equal_work_threshold, run_seconds, straight_factor
from rig.worlds.hidden.scene import Scene, make_scene, observe, observe_path
from tests.unit.hidden_scenes import contribution, effect_of, middle, plan_of, scene_of


@pytest.fixture(scope="module")
def scene() -> Scene:
    return scene_of("medium")


def test_a_sharp_knee_gives_its_own_threshold(scene: Scene) -> None:
    drawn = effect_of(scene, "joint_yield", "sharp")
    answers = drawn.parameters(1.0)
    assert answers["threshold_Nm"] == pytest.approx(answers["law_limit_Nm"], rel=1e-6)


@pytest.mark.parametrize("limit", [30.0, 50.0])
def test_a_power_law_has_one_threshold_whatever_its_reference(limit: float) -> None:
    """`limit (x / limit)^5` is one law for all limits, with another size: top (1 - 2/6)."""
    found = equal_work_threshold(lambda x: limit * (x / limit) ** 5, 60.0)
    assert found == pytest.approx(40.0, rel=1e-3)


@pytest.mark.parametrize(
    ("form", "law"),
    [
        ("rounded", "menegotto_pinto"),
        ("ramberg_osgood", "ramberg_osgood"),
        ("two_backstresses", "chaboche"),
    ],
)
def test_the_sharp_knee_of_a_round_one_ends_where_it_ends_with_equal_work(
    scene: Scene, form: str, law: str
) -> None:
    answers = effect_of(scene, "joint_yield", form, 5).parameters(1.0)
    drawn = effect_of(scene, "joint_yield", form, 5)
    joint = drawn.joints[0] - 1
    top = float(np.abs(scene.net[:, joint]).max())
    random = np.random.default_rng(5)
    draw_joint(scene, random)
    limit = reached(scene, joint, random.uniform(0.4, 0.88))
    assert np.abs(scene.weight[:, joint]).max() < limit < top
    follow, _ = _knee_law(limit, law, random)
    x = np.linspace(0.0, top, 4001)
    y = follow(x, np.zeros(len(x), dtype=np.int64))
    knee = answers["threshold_Nm"]
    sharp = y[-1] / (top - knee) * np.maximum(x - knee, 0.0)
    assert answers["law_limit_Nm"] == pytest.approx(limit)
    assert np.trapezoid(y, x) == pytest.approx(np.trapezoid(sharp, x), rel=2e-3)


def test_creep_is_that_of_a_load_that_stood_as_long_as_a_run(scene: Scene) -> None:
    for form in ("standard_solid", "power_law", "logarithmic"):
        drawn = effect_of(scene, "joint_creep", form)
        answers = drawn.parameters(0.2)
        assert answers["run_s"] == run_seconds(scene)
        assert ("creep_fraction" in answers) == (form == "standard_solid")
    burgers = effect_of(scene, "joint_creep", "burgers").parameters(0.2)
    seconds, time_s = burgers["run_s"], burgers["time_s"]
    after = -np.expm1(-seconds / time_s) + seconds / burgers["viscous_s"]
    assert burgers["creep_fraction_of_run"] == pytest.approx(0.2 * after, rel=1e-6)
    drawn = effect_of(scene, "joint_creep", "standard_solid")
    answers = drawn.parameters(0.2)
    time = np.array([0.0, 1e-9, run_seconds(scene)])
    late = memory.retarded(time, np.array([0.0, 1.0, 1.0]), answers["times_s"], answers["weights"])
    assert answers["creep_fraction_of_run"] == pytest.approx(0.2 * late[-1], rel=1e-6)
    assert answers["creep_fraction"] == pytest.approx(0.2)


def test_a_run_lasts_from_its_first_sample_to_its_last(scene: Scene) -> None:
    history = scene.history
    run = history.run[history.sample]
    spans = [np.ptp(history.run_time[run == r]) for r in np.unique(run)]
    assert run_seconds(scene) == pytest.approx(np.mean(spans), abs=0.1)


@pytest.mark.parametrize("form", ["two_rates", "wander", "linear"])
@pytest.mark.parametrize(("design", "which"), [("medium", 3), ("rich", 0)])  # rich: x reversed
def test_drift_over_the_session_is_what_the_force_shows_at_its_end(
    form: str, design: str, which: int
) -> None:
    scene = scene_of(design, which)
    for seed in range(4):
        drawn = effect_of(scene, "force_drift", form, seed)
        added = observe(scene, [drawn.change(2.0)]).force_N - observe(scene).force_N
        along = np.sum(added * scene.unit[scene.history.setup[scene.history.sample]], axis=1)
        assert drawn.parameters(2.0)["drift_over_session_N"] == pytest.approx(along[-1], rel=1e-6)


@pytest.mark.parametrize("form", ["smooth", "soft_flanks", "slow_approach"])
def test_width_of_a_play_is_all_of_it(scene: Scene, form: str) -> None:
    drawn = effect_of(scene, "joint_backlash", form)
    size = middle(drawn)
    _, _, q = contribution(scene, drawn, size)
    went = float(np.ptp(q[:, drawn.joints[0] - 1]))  # to one side only, it goes through half
    assert 0.3 * size < went < 1.001 * drawn.parameters(size)["width_rad"]


def test_a_joint_yields_where_push_and_weights_together_come_to_its_threshold() -> None:
    """Onset of sharp knees in joints that carry weight, in both senses of the push."""
    found = 0
    for seed in range(40):
        scene = scene_of("rich", seed)
        try:
            drawn = effect_of(scene, "joint_yield", "sharp", seed)
        except Unsuited:
            continue
        joint = drawn.joints[0] - 1
        if np.abs(scene.weight[:, joint]).max() < 1.0 or not drawn.onset_N:
            continue
        limit = drawn.parameters(1.0)["threshold_Nm"]
        moved = observe_path(scene, [drawn.change(1.0)]).displacement_mm
        moved = moved - observe_path(scene).displacement_mm
        still = np.abs(scene.net[:, joint]) < limit * 0.999
        first = np.cumsum(~still) == 0  # nothing has reached it yet
        assert np.abs(moved[first]).max(initial=0.0) < 1e-12
        assert np.abs(moved).max() > 1e-6
        found += 1
    assert found > 3


def test_depth_of_a_seat_is_reached_by_the_largest_load(scene: Scene) -> None:
    for form in ("exponential", "hyperbolic", "arctan", "power"):
        drawn = effect_of(scene, "contact_seating", form)
        moved, _, _ = contribution(scene, drawn, 0.05)
        assert drawn.parameters(0.05)["depth_mm"] == pytest.approx(np.ptp(moved), rel=1e-6)


def test_a_bent_gain_is_the_best_straight_one() -> None:
    assert straight_factor(lambda x: 1.1 * x) == pytest.approx(1.1)
    assert straight_factor(lambda x: x**2) == pytest.approx(0.75, rel=1e-3)


def test_a_tool_hangs_on_the_joints_and_its_weight_counts_at_the_onset() -> None:
    plan = plan_of("rich")
    light, heavy = (
        make_scene(replace(plan, tool_kg=kg), np.random.default_rng(3)) for kg in (0.0, 2.0)
    )
    assert np.abs(heavy.weight - light.weight)[:, 2].max() > 5.0
    weight = heavy.weight[:, 1]
    for s, setup in enumerate(heavy.plan.setups):
        arm = float(heavy.levers[s, 1] @ heavy.unit[s])
        limit = abs(weight[s] + arm * 0.9 * setup.top_N)
        if np.sign(weight[s] + arm * setup.top_N) != np.sign(arm) or limit < abs(weight).max():
            continue
        found = onset(heavy, 1, limit)
        assert found[setup.direction] <= 0.9 * setup.top_N * (1 + 1e-9)
        net = [
            abs(weight[i] + float(heavy.levers[i, 1] @ heavy.unit[i]) * found[setup.direction])
            for i, other in enumerate(heavy.plan.setups)
            if other.direction == setup.direction
        ]
        assert min(abs(n - limit) for n in net) < 1e-9 * limit
        return
    pytest.fail("no push goes beyond the weight")
