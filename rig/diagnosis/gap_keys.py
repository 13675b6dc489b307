"""The keys of effects in a model file: what each is called, its unit, and which belong together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from identification.gap.effects import base_slip, contact_seating, joint_creep
from identification.gap.effects.link_flexibility import PLACED, STRAINS
from identification.gap.laws import lags, lost_motion
from identification.gap.laws.friction_law import FRICTION_LAWS, GROWS, SLIP_AT_A_STRENGTH
from identification.gap.laws.law import (
    ACROSS,
    ANEW,
    AS_IT_STANDS,
    HUNG,
    HUNG_LOST,
    KEPT,
    LOST,
    WORKED,
)
from rig.units import MM_PER_M

# What an entry says besides its law; kept, not interpreted.
SEEN_TO = "seen_to_N"
ABOUT = (
    "name",
    SEEN_TO,
    "dataset",
    "emulated",
    "probability",
    "share_of_gap",
    "form",
    "parameters",
    "contained_in",
)
SPRINGS = "joint_stiffness_Nm_per_rad"
CONTAINED = "contained_in"  # its numbers stand in another key of the model file


@dataclass(frozen=True)
class Key:
    """A key of the file: SI value times `factor`; kind: number, positive, size (0 or more), share
    (0 to 1), count, text, vector, six (numbers), flag, springs. count: from 1 in the file, from 0
    inside; springs: six stiffnesses in the file, six compliances inside."""

    name: str
    kind: str = "number"
    factor: float = 1.0
    options: tuple[str, ...] = ()


_MEMORY = Key("memory", "text", options=(KEPT, ACROSS, LOST, WORKED, HUNG, HUNG_LOST, ANEW))
_SIDES = ("x", "y", "z")
CONSTANTS: dict[str, Key] = {
    "joint": Key("joint", "count"),
    "memory": _MEMORY,
    "forgets": Key("memory", "text", options=(ANEW,)),
    joint_creep.STOOD_ON: Key(joint_creep.STOOD_ON, "share"),
    joint_creep.RESTED: Key("rest_between_runs_s", "size"),
    "flow_time": Key("flow_time_s", "size"),
    "flow_exponent": Key("flow_exponent", "positive"),
    "axis": Key("axis", "text", options=tuple(base_slip.AXES)),
    "depth": Key("axis_below_base_mm", factor=MM_PER_M),
    "law": Key("law", "text", options=FRICTION_LAWS),
    "placed": Key("placed", "text", options=PLACED),
    "zone": Key("zone_Nm", "positive"),
    "crossing": Key("crossing", "text", options=("weight", "load")),
    "kind": Key("kind", "text", options=(*lost_motion.KINDS, *lost_motion.UNEVEN)),
    "tool": Key("tool_kg"),
    "preload": Key("preload_Nm"),
    "way": Key("kind", "text", options=(*lags.KINDS, "window")),
    "measured_to": Key("measured_to_Nm", "positive"),
    "saturates": Key("saturates_at_Nm", "positive"),
    "channel": Key("channel", "text", options=("displacement", "force")),
    "lag": Key("lag_s", "positive"),
    "path": Key(
        "path",
        "text",
        options=("linear", "root", "exponential", "rates", "free", "temperature", "each run"),
    ),
    "about": Key("about_joint_stiffness_Nm_per_rad", "springs"),
    "about_offset": Key("about_offset_m", "vector"),
    "about_angles": Key("about_angles_rad", "six"),
    "about_turn": Key("about_turn_rad", "vector"),
    "only_in": Key("only_in_pose", "text"),
    "unread": Key("joint_readings_do_not_show_it", "flag"),
    "quantity": Key("quantity", "text", options=("force", "displacement")),
    AS_IT_STANDS: Key("answers_to_the_other_effects", "flag"),
}
SHAPES: dict[str, Key] = {
    "threshold": Key("threshold_Nm", "positive"),
    "grows_beyond": Key("grows_beyond_Nm", "positive"),
    "walks_beyond": Key("walks_beyond_Nm", "positive"),
    "fading": Key("fades_with_power_of_passes", "size"),
    "returns_beyond": Key("returns_beyond_Nm", "positive"),
    "ratchets_beyond": Key("ratchets_beyond_Nm", "positive"),
    "after": Key("after_Nm", "positive"),
    "strength": Key("friction_Nm", "positive"),
    "slackens": Key("slackens_beyond_Nm", "positive"),
    "reach": Key("reach_Nm", "positive"),
    "grows_to": Key("grows_with_net_torque_to_Nm", "positive"),
    "grows_with_push_to": Key("grows_with_push_to_Nm", "positive"),
    "beyond": Key("beyond_Nm", "positive"),
    "net_above": Key("net_torque_above_Nm"),
    "net_beyond": Key("net_torque_beyond_Nm", "positive"),
    "retardation_time": Key("retardation_time_s", "positive"),
    "joint": Key("joint", "count"),
    "segment": Key("segment", "count"),
    "strain": Key("strain", "text", options=STRAINS),
    "run": Key("run", "count"),
    "axis": Key("axis", "text", options=_SIDES),
    "law": Key("law", "text", options=tuple(contact_seating.LAWS)),
    "force_scale": Key("force_scale_N", "positive"),
    "rubs": Key("friction_N", "positive"),
    "along": Key("along", "vector"),
    "across": Key("across", "vector"),
    "at_load": Key("at_N", "positive"),
    "power": Key("power_of_load", "positive"),
    "drags_over": Key("drags_over_N", "positive"),
    "at_response": Key("at_mm", "positive", factor=MM_PER_M),
    "above": Key("above_mm", "positive", factor=MM_PER_M),
    "time_constant": Key("time_constant_s", "positive"),
    "at": Key("at_s"),
    "sensor": Key("sensor", "text", options=("mean", "1", "2", "3", "4", "5", "6")),
    "pose": Key("pose", "text"),
    "direction": Key("direction", "text"),
    "first": Key("first", "flag"),
    "lasts": Key("lasts", "flag"),
}
_COEFFICIENTS: dict[str, Key] = {
    "compliance": Key("compliance_rad_per_Nm"),
    "compliance_quadratic": Key("compliance_rad_per_Nm2"),
    "compliance_even": Key("even_compliance_rad_per_Nm2"),
    "compliance_cubic": Key("compliance_rad_per_Nm3"),
    "compliance_xy": Key("compliance_xy_rad_per_Nm"),
    "width": Key("width_rad"),
    "rub": Key("rub_rad"),
    "place": Key("place_rad"),
    "rest": Key("reading_at_rest_rad"),
    "over_nominal": Key("compliance_over_nominal"),
    "depth": Key("depth_mm", factor=MM_PER_M),
    "tangent": Key("tangent"),
    "as_read": Key("share_of_force_across_as_read"),
    "gives": Key("compliance_across_over_nominal_times_tangent"),
    "offset": Key("offset_mm", factor=MM_PER_M),
    "angle": Key("angle_rad"),
    "turn": Key("turn_rad"),
    "gain": Key("excess_share_of_reading"),
    "share": Key("share"),
    "shift": Key("shift_mm", factor=MM_PER_M),
}
_DRIFTS = {
    "drift": "",
    "drift_rate": "_per_s",
    "drift_per_root": "_per_sqrt_s",
    "drift_knot": "",
    "drift_per_kelvin": "_per_K",
}
for _name, _unit in _DRIFTS.items():
    _stem = "drift_at" if _name == "drift_knot" else "drift"
    _COEFFICIENTS[f"{_name} force"] = Key(f"{_stem}_N{_unit}")
    _COEFFICIENTS[f"{_name} displacement"] = Key(f"{_stem}_mm{_unit}", factor=MM_PER_M)


MAY_BE_MISSING = (
    "measured_to",
    "saturates",
    "about",
    "tool",
    "flow_exponent",
    "placed",
    "forgets",
    joint_creep.STOOD_ON,
    joint_creep.RESTED,
    "only_in",
    "unread",
    AS_IT_STANDS,
)


Kind = tuple[str, tuple[str, ...]]  # of terms: a coefficient, and names of its shape
Values = Mapping[str, tuple[str, ...]]  # of constants


@dataclass(frozen=True)
class Grammar:
    """What the laws of a word are written with: constants, and the kinds of terms. only_with: of
    those of either that do not go with every law, other constants, and the values of these that
    they go with."""

    constants: tuple[str, ...]
    terms: tuple[Kind, ...]
    only_with: Mapping[Kind | str, Values] = field(default_factory=dict)


_PLAYS = (
    ("compliance", ("threshold",)),
    ("compliance", ("grows_beyond",)),
    ("compliance", ("walks_beyond", "fading")),
    ("compliance", ("returns_beyond", "after")),
    ("compliance", ("ratchets_beyond", "after")),
)
_GOES = ((), ("at_load",), ("at_load", "power"), ("drags_over",), ("at_load", "drags_over"))
_REACHES = (("compliance", ("reach",)), *(("compliance", ("reach", grows)) for grows in GROWS))
_STRENGTH = ("compliance", ("strength",))
_SLACKENS = ("compliance", ("slackens",))
_BY_A_REACH = tuple(law for law in FRICTION_LAWS if law not in SLIP_AT_A_STRENGTH)
_PATHS: dict[Kind, tuple[str, ...]] = {  # and the courses in time that are written so
    ("drift", ("time_constant",)): ("exponential", "rates"),
    ("drift_rate", ()): ("linear", "rates"),
    ("drift_per_root", ()): ("root",),
    ("drift_knot", ("at",)): ("free",),
    ("drift_per_kelvin", ("sensor",)): ("temperature",),
}
_ALONG: dict[Kind, tuple[str, ...]] = {(c, (*s, "along")): path for (c, s), path in _PATHS.items()}
_OF_RUNS: dict[Kind, tuple[str, ...]] = {("drift", ("run", "along")): ("each run",)}
_LATE: dict[Kind, tuple[str, ...]] = {
    ("drift_per_kelvin", ("sensor", "time_constant", "along")): ("temperature",)
}


def _on(paths: Mapping[Kind, tuple[str, ...]]) -> dict[Kind | str, Values]:
    return {kind: {"path": courses} for kind, courses in paths.items()}


GRAMMAR: dict[str, Grammar] = {
    "joint_yield": Grammar(
        ("joint", "memory", "flow_time", "flow_exponent", AS_IT_STANDS),
        (*_PLAYS, ("compliance", ())),
    ),
    "base_slip": Grammar(
        ("axis", "depth", "memory", "flow_time", "flow_exponent", AS_IT_STANDS), _PLAYS
    ),
    "joint_hysteresis": Grammar(
        ("joint", "law", "memory", "measured_to", "saturates", "tool", AS_IT_STANDS),
        (
            _STRENGTH,
            _SLACKENS,
            *_REACHES,
            ("compliance", ()),
        ),
        {
            _STRENGTH: {"law": SLIP_AT_A_STRENGTH},
            _SLACKENS: {"law": ("Iwan",), "memory": (KEPT,)},  # no weight hangs on a specimen
            **{reach: {"law": _BY_A_REACH} for reach in _REACHES},
            "saturates": {"law": ("Prandtl",)},
        },
    ),
    "joint_backlash": Grammar(
        ("joint", "zone", "crossing", "kind", "tool", "preload", AS_IT_STANDS),
        (
            ("width", ()),
            ("rub", ()),
            ("place", ("pose", "direction", "first")),
            ("rest", ("pose",)),
        ),
    ),
    "joint_nonlinear_stiffness": Grammar(
        ("joint", "measured_to", "tool", AS_IT_STANDS),
        (
            ("compliance", ("beyond",)),
            ("compliance", ("net_above",)),
            ("compliance", ("net_beyond",)),
            ("compliance", ()),
            ("compliance_quadratic", ()),
            ("compliance_even", ()),
            ("compliance_cubic", ()),
        ),
    ),
    "joint_creep": Grammar(
        ("joint", "forgets", joint_creep.STOOD_ON, joint_creep.RESTED, AS_IT_STANDS),
        (
            ("compliance", ("retardation_time",)),
            ("compliance_quadratic", ("retardation_time",)),
        ),
    ),
    "joint_stiffness_error": Grammar((), (("compliance", ("joint",)),)),
    "link_flexibility": Grammar(("placed",), (("over_nominal", ("segment", "strain")),)),
    "base_compliance": Grammar(
        ("depth", AS_IT_STANDS),
        (("compliance", ("axis",)), ("compliance_xy", ()), ("compliance", ("axis", "beyond"))),
    ),
    "contact_seating": Grammar(
        (), (("depth", ("law", "force_scale")), ("depth", ("law", "force_scale", "rubs")))
    ),
    "load_misalignment": Grammar(
        ("about",),
        tuple(("tangent", ("along", "across", *more)) for more in (*_GOES, ("run",)))
        + tuple(("tangent", ("along", "across", *more, "pose")) for more in _GOES[:3])
        + tuple(("gives", ("along", *more)) for more in (*_GOES, ("across",)))
        + (("as_read", ()),),
    ),
    "pose_error": Grammar(
        ("about", "about_offset", "about_angles", "about_turn", "only_in", "unread"),
        (("offset", ("axis",)), ("angle", ("joint",)), ("turn", ("axis",))),
    ),
    "force_scale": Grammar(("about",), (("gain", ()), ("gain", ("at_load",)), ("gain", ("axis",)))),
    "displacement_scale": Grammar(
        (), (("gain", ()), ("gain", ("at_response",)), ("gain", ("above",)))
    ),
    "time_lag": Grammar(("channel", "way", "lag", "about"), (("share", ()),)),
    "force_drift": Grammar(
        ("path", "quantity", "about"),
        (*_PATHS, *_ALONG, *_OF_RUNS),
        _on(_PATHS | _ALONG | _OF_RUNS),
    ),
    "thermal_drift": Grammar(
        ("path", "quantity"),
        (*_ALONG, *_LATE),
        _on(_ALONG | _LATE),
    ),
    "zero_shift": Grammar((), (("shift", ("run", "lasts")),)),
}


def coefficient_key(name: str, constants: Mapping[str, Any]) -> Key:
    """The key of a coefficient; that of a drift depends on what drifts."""
    return _COEFFICIENTS.get(name) or _COEFFICIENTS[f"{name} {constants['quantity']}"]


def kinds(grammar: Grammar, constants: Mapping[str, Any]) -> Iterator[Kind]:
    """The kinds of terms that go with these constants."""
    for kind in grammar.terms:
        needed = grammar.only_with.get(kind, {})
        if all(constants.get(constant) in values for constant, values in needed.items()):
            yield kind


def keys_of(grammar: Grammar, constants: Mapping[str, Any]) -> Iterator[str]:
    """The keys of every kind of term, in words."""
    for coefficient, shape in kinds(grammar, constants):
        names = [SHAPES[n].name for n in shape]
        yield "(" + ", ".join([*names, coefficient_key(coefficient, constants).name]) + ")"
