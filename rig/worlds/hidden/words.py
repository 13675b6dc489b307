"""The words a hidden effect can have, and the quantities that stand for it."""

from __future__ import annotations

EFFECTS: tuple[str, ...] = (
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
WORDS: tuple[str, ...] = (*EFFECTS, "none", "unknown")

IN_JOINTS = frozenset(
    {
        "joint_yield",
        "joint_backlash",
        "joint_nonlinear_stiffness",
        "joint_hysteresis",
        "joint_creep",
        "joint_stiffness_error",
    }
)
# Seen by the laser, never by encoders; the rest acts on the force or is ambiguous.
OUTSIDE_JOINTS = frozenset(
    {
        "link_flexibility",
        "base_compliance",
        "base_slip",
        "contact_seating",
        "displacement_scale",
        "thermal_drift",
        "zero_shift",
    }
)
# Paths in time: the session's clock is recorded where they are drawn.
ON_THE_CLOCK = frozenset({"force_drift", "thermal_drift"})
