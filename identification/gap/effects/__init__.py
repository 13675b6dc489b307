"""The library: one file an effect, each a family of shapes. `variants(bench)` fills the pool."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from identification.gap.bench import Bench
from identification.gap.variants import Variant

WORDS = (
    "joint_yield",
    "joint_backlash",
    "joint_nonlinear_stiffness",
    "joint_hysteresis",
    "joint_creep",
    "link_flexibility",
    "base_compliance",
    "base_slip",
    "contact_seating",
    "load_misalignment",
    "force_drift",
    "force_scale",
    "displacement_scale",
    "thermal_drift",
    "zero_shift",
    "time_lag",
    "pose_error",
    "joint_stiffness_error",
)
NEED_ARM = ("link_flexibility", "base_compliance", "base_slip", "pose_error", "load_misalignment")

# What a load that stands can show: where nothing is loaded anew, no stiffness is seen.
STANDING = ("joint_creep", "force_drift", "thermal_drift", "zero_shift")


def library(bench: Bench, words: Iterable[str] = WORDS) -> list[Variant]:
    """All variants of the words; the pool of the bench holds their columns afterwards."""
    out: list[Variant] = []
    idle = bench.rows.continuous and bench.course.stands
    for word in words:
        if idle and word not in STANDING:
            continue
        if word in NEED_ARM and not bench.data.arm:
            continue
        out += import_module(f"identification.gap.effects.{word}").variants(bench)
    return out
