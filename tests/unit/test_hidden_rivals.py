"""Which words count as right: those that explain a case as well, found by fitting them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rig.worlds.hidden.draw import draw_case
from rig.worlds.hidden.effect import Effect
from rig.worlds.hidden.gap import rms
from rig.worlds.hidden.label import answers
from rig.worlds.hidden.observed import noise_free_observation, nuisances
from rig.worlds.hidden.rivals import accepted, left_over
from rig.worlds.hidden.words import EFFECTS
from tests.unit.hidden_scenes import effect_of, scene_of

NOISE_MM = 0.003
LINEAR = {"force_scale", "displacement_scale", "joint_stiffness_error"}


def _left(design: str, word: str, form: str, size: float, **recorded: Any) -> dict[str, float]:
    scene = scene_of(design, **recorded)
    drawn = effect_of(scene, word, form)
    return left_over(scene, [drawn.change(size)], NOISE_MM, word)


TEXTBOOK = [
    ("joint_yield", "sharp", 1.0, 0.5),
    ("joint_backlash", "smooth", 3e-4, 1.0),
    ("joint_nonlinear_stiffness", "cubic", 0.2, 0.01),
    ("joint_hysteresis", "maxwell_slip", 0.2, 1.0),
    ("joint_creep", "standard_solid", 0.3, 0.5),
    ("link_flexibility", "both_arms", 0.5, 0.5),
    ("base_compliance", "yaw", 4.0, 0.01),
    ("base_slip", "yaw_sharp", 20.0, 1.0),
    ("contact_seating", "exponential", 0.03, 1.0),
    ("load_misalignment", "each_direction", 1.0, 0.5),
    ("force_drift", "linear", 3.0, 0.1),
    ("force_scale", "reads_low", 0.2, 0.3),
    ("displacement_scale", "reads_low", 0.1, 0.01),
    ("thermal_drift", "linear", 0.3, 0.01),
    ("zero_shift", "every_run", 0.1, 0.01),
    ("time_lag", "laser_delay", 1.5, 0.6),
    ("pose_error", "tool", 1.0, 0.5),
    ("joint_stiffness_error", "one_joint", 0.7, 0.01),
]


@pytest.mark.parametrize(("word", "form", "size", "most"), TEXTBOOK)
def test_the_own_textbook_form_explains_its_word(
    word: str, form: str, size: float, most: float
) -> None:
    """With everything recorded, and far better than springs and gains alone do."""
    left = _left("medium", word, form, size)
    assert left["none"] > 2.0
    assert left[word] < most
    assert set(left) == {*EFFECTS, "none"}


@pytest.mark.parametrize(
    ("word", "form", "size"),
    [
        ("joint_yield", "sharp", 2.0),
        ("joint_backlash", "smooth", 1.5e-3),
        ("base_slip", "yaw_sharp", 20.0),
    ],
)
def test_the_right_shape_is_found_among_many_without_readings(
    word: str, form: str, size: float
) -> None:
    left = _left("rich", word, form, size, q=False, components=False)
    assert left["none"] > 3.0
    assert left[word] < 1.0


def test_nuisances_explain_no_knee_even_without_bounds() -> None:
    """Shapes are chosen before bounds count: a nuisance must not hold the answer."""
    scene = scene_of("rich", q=False, components=False)
    drawn = effect_of(scene, "joint_yield", "sharp")
    seen = noise_free_observation(scene, [drawn.change(2.0)], NOISE_MM)
    base = np.stack(nuisances(seen)[0], axis=1)
    target = seen.stack(seen.displacement)
    rest = target - base @ np.linalg.lstsq(base, target, rcond=None)[0]
    assert rms(rest[: len(seen.rows)]) > 3.0


def test_a_late_force_is_not_zero_where_the_load_is() -> None:
    left = _left("rich", "time_lag", "force_first_order", 2.0, q=False, components=False)
    assert left["time_lag"] < 1.0
    assert min(left[w] for w in EFFECTS if w != "time_lag") > 5.0


def test_what_is_stated_as_uncertain_is_no_effect() -> None:
    """A gain within its uncertainty makes no case: nothing at all explains it as well."""
    scene = scene_of("medium")
    for form, size in (("reads_high", 0.005), ("reads_high", 0.2)):
        drawn = effect_of(scene, "force_scale", form)
        effect = Effect("force_scale", form, True, drawn.change, drawn.parameters, drawn.sizes)
        assert (answers(scene, [(effect, size)], NOISE_MM) is None) == (size < 0.1)


def test_readings_separate_what_no_laser_can() -> None:
    blind = _left("medium", "displacement_scale", "reads_low", 0.2, q=False, components=False)
    assert accepted(blind, "displacement_scale", 20.0) >= LINEAR
    seeing = _left("medium", "displacement_scale", "reads_low", 0.2)
    assert accepted(seeing, "displacement_scale", 20.0) == {"displacement_scale"}


def test_encoders_tell_a_slipping_base_from_a_yielding_joint() -> None:
    blind = _left("paper", "base_slip", "yaw_sharp", 10.0, q=False)
    assert "joint_yield" in accepted(blind, "base_slip", 10.0)
    seeing = _left("paper", "base_slip", "yaw_sharp", 10.0)
    assert "joint_yield" not in accepted(seeing, "base_slip", 10.0)


def test_unloading_tells_a_curved_spring_from_a_yield() -> None:
    unloaded = _left("medium", "joint_nonlinear_stiffness", "k1k2k3", 0.3, q=False)
    assert accepted(unloaded, "joint_nonlinear_stiffness", 10.0) == {"joint_nonlinear_stiffness"}


def test_force_at_zero_load_tells_the_amplifier_from_the_target() -> None:
    left = _left("medium", "force_drift", "warm_up", 3.0, q=False, components=False)
    assert accepted(left, "force_drift", 10.0) == {"force_drift"}


def test_a_poor_textbook_form_does_not_open_the_door() -> None:
    left = dict.fromkeys(EFFECTS, 4.0) | {"none": 10.0}
    assert accepted(left, "joint_yield", 10.0) == {"joint_yield"}
    assert accepted(left, "joint_yield", 100.0) == set(EFFECTS)
    # nor what explains hardly more than nothing at all does
    assert accepted(left | {"none": 5.0}, "joint_yield", 100.0) == {"joint_yield"}


def test_nothing_in_the_library_explains_what_is_unknown() -> None:
    for number in range(3):
        label = draw_case(3, number, word="unknown", design="medium").label
        assert label["accept"] == ["unknown"]
