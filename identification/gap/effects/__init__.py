"""The library: one file an effect, each with a declaration at its end (`Effect`)."""

from __future__ import annotations

from collections.abc import Iterable

from identification.gap.effects import (
    base_compliance,
    base_slip,
    contact_seating,
    displacement_scale,
    force_drift,
    force_scale,
    joint_backlash,
    joint_creep,
    joint_hysteresis,
    joint_nonlinear_stiffness,
    joint_stiffness_error,
    joint_yield,
    link_flexibility,
    load_misalignment,
    pose_error,
    thermal_drift,
    time_lag,
    zero_shift,
)
from identification.gap.laws.effect import Effect
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant
from identification.gap.words import NEED_ARM, STANDING, WORDS

_ALL = (
    joint_yield.EFFECT,
    joint_backlash.EFFECT,
    joint_nonlinear_stiffness.EFFECT,
    joint_hysteresis.EFFECT,
    joint_creep.EFFECT,
    link_flexibility.EFFECT,
    base_compliance.EFFECT,
    base_slip.EFFECT,
    contact_seating.EFFECT,
    load_misalignment.EFFECT,
    force_drift.EFFECT,
    force_scale.EFFECT,
    displacement_scale.EFFECT,
    thermal_drift.EFFECT,
    zero_shift.EFFECT,
    time_lag.EFFECT,
    pose_error.EFFECT,
    joint_stiffness_error.EFFECT,
)
EFFECTS: dict[str, Effect] = {effect.word: effect for effect in _ALL}


def library(bench: Bench, words: Iterable[str] = WORDS) -> list[Variant]:
    """All variants of the words; the pool of the bench holds their columns afterwards."""
    out: list[Variant] = []
    idle = bench.rows.continuous and bench.load_history.stands
    for word in words:
        if idle and word not in STANDING:
            continue
        if word in NEED_ARM and not bench.data.arm:
            continue
        out += EFFECTS[word].variants(bench)
    return out
