"""The words of the diagnosis, and what holds of each; the order is that of results."""

from __future__ import annotations

from typing import Literal

Kind = Literal[
    "in a joint",  # may sit in several joints of an arm at once
    "mechanism",  # a family of shapes that a neighbour's law may mimic, no linear law
    "linear",  # elasticity, gains and leverage: as exact as the springs of the base
    "instrument",  # in the force or its direction: the encoders can't tell
    "arm",  # needs an arm
    "standing",  # shows while a load stands; what needs one anew does not
    "curve",  # of the load: one direction without joint readings can't tell these apart
    "friction",  # what gives way does not come back by itself
    "drift",  # a path in time that no other run foretells
]
KINDS: dict[str, tuple[Kind, ...]] = {
    "joint_yield": ("in a joint", "mechanism", "friction"),
    "joint_backlash": ("in a joint", "mechanism"),
    "joint_nonlinear_stiffness": ("in a joint", "mechanism", "curve"),
    "joint_hysteresis": ("in a joint", "mechanism", "friction"),
    "joint_creep": ("in a joint", "mechanism", "standing"),
    "link_flexibility": ("linear", "arm"),
    "base_compliance": ("linear", "arm"),
    "base_slip": ("mechanism", "friction", "arm"),
    "contact_seating": ("mechanism", "curve"),
    "load_misalignment": ("linear", "instrument"),
    "force_drift": ("instrument", "drift", "standing"),
    "force_scale": ("linear", "instrument"),
    "displacement_scale": ("linear",),
    "thermal_drift": ("drift", "standing"),
    "zero_shift": ("standing",),
    "time_lag": ("instrument",),
    "pose_error": ("linear", "instrument", "arm"),
    "joint_stiffness_error": ("linear",),
}
WORDS = tuple(KINDS)


def words_of(kind: Kind) -> frozenset[str]:
    """Words of which that holds."""
    return frozenset(word for word, kinds in KINDS.items() if kind in kinds)


IN_JOINTS = words_of("in a joint")
MECHANISMS = words_of("mechanism")
LINEAR = words_of("linear")
INSTRUMENTS = words_of("instrument")
NEED_ARM = words_of("arm")
STANDING = words_of("standing")
CURVES = words_of("curve")
FRICTION = words_of("friction")
DRIFTS = words_of("drift")
DATUM_JUMPS = frozenset({"zero_shift"})  # shows without load, and at once
BETWEEN_RUNS = DRIFTS | DATUM_JUMPS  # what one run does so, no other run foretells
SPRINGS = "joint_stiffness_error"  # the linear law of the joints' springs, which mechanisms share
LATE = frozenset({"joint_creep", "time_lag"})  # what comes after the load

# Troubles of running recordings that no word names (unmodelled_running.py): what they explain is
# `unknown`.
JERKS, DAMAGE, SOFTENING, WANDERS = "jerks", "damage", "softening", "wanders"
UNMODELLED = (JERKS, DAMAGE, SOFTENING, WANDERS)
