"""Effects as they stand in a model file: every number with its unit in the key, read and written.

Inside, laws are SI (`identification.gap.forms`); here lengths are mm, joints count from 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.gap.effects import WORDS
from identification.gap.forms import Form, Law, Term
from identification.gap.forms.law import ACROSS, KEPT, LOST, WORKED
from rig.errors import did_you_mean
from rig.model import ArmModel
from rig.model_schema import ModelFile
from rig.yamlfile import read_document

# What an entry says besides its law; kept, not interpreted.
ABOUT = (
    "name",
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
_MOST = 1e12


@dataclass(frozen=True)
class Key:
    """A key of the file: SI value times `factor`; kind: number, positive, count, text, vector,
    flag, springs. count: from 1 in the file, from 0 inside; springs: six stiffnesses in the file,
    six compliances inside."""

    name: str
    kind: str = "number"
    factor: float = 1.0
    options: tuple[str, ...] = ()


_MEMORY = Key("memory", "text", options=(KEPT, ACROSS, LOST, WORKED))
_SIDES = ("x", "y", "z")
_CONSTANTS: dict[str, Key] = {
    "joint": Key("joint", "count"),
    "memory": _MEMORY,
    "flow_time": Key("flow_time_s"),
    "axis": Key("axis", "text", options=_SIDES),
    "depth": Key("axis_below_base_mm", factor=1e3),
    "law": Key("law", "text", options=("Iwan", "Dahl", "Bouc-Wen")),
    "zone": Key("zone_Nm", "positive"),
    "crossing": Key("crossing", "text", options=("weight", "load")),
    "kind": Key("kind", "text", options=("free", "friction", "friction 3")),
    "way": Key("kind", "text", options=("delay", "filter")),
    "measured_to": Key("measured_to_Nm", "positive"),
    "channel": Key("channel", "text", options=("displacement", "force")),
    "lag": Key("lag_s", "positive"),
    "path": Key("path", "text", options=("linear", "root", "exponential", "free", "temperature")),
    "about": Key("about_joint_stiffness_Nm_per_rad", "springs"),
    "quantity": Key("quantity", "text", options=("force", "displacement")),
}
_SHAPES: dict[str, Key] = {
    "threshold": Key("threshold_Nm", "positive"),
    "returns_beyond": Key("returns_beyond_Nm", "positive"),
    "ratchets_beyond": Key("ratchets_beyond_Nm", "positive"),
    "after": Key("after_Nm", "positive"),
    "strength": Key("friction_Nm", "positive"),
    "reach": Key("reach_Nm", "positive"),
    "beyond": Key("beyond_Nm", "positive"),
    "retardation_time": Key("retardation_time_s", "positive"),
    "joint": Key("joint", "count"),
    "segment": Key("segment", "count"),
    "run": Key("run", "count"),
    "axis": Key("axis", "text", options=_SIDES),
    "axes": Key("axes", "text", options=("xx", "xy", "xz", "yy", "yz", "zz")),
    "law": Key("law", "text", options=("exponential", "hyperbolic")),
    "force_scale": Key("force_scale_N", "positive"),
    "along": Key("along", "vector"),
    "across": Key("across", "vector"),
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
    "width": Key("width_rad"),
    "rub": Key("rub_rad"),
    "place": Key("place_rad"),
    "over_nominal": Key("compliance_over_nominal"),
    "depth": Key("depth_mm", factor=1e3),
    "tangent": Key("tangent"),
    "offset": Key("offset_mm", factor=1e3),
    "offset_product": Key("offset_product_mm2", factor=1e6),
    "angle": Key("angle_rad"),
    "gain": Key("excess_share_of_reading"),
    "share": Key("share"),
    "shift": Key("shift_mm", factor=1e3),
}
_DRIFTS = {"drift": "", "drift_rate": "_per_s", "drift_per_root": "_per_sqrt_s", "drift_knot": "",
           "drift_per_kelvin": "_per_K"}  # fmt: skip
for _name, _unit in _DRIFTS.items():
    _stem = "drift_at" if _name == "drift_knot" else "drift"
    _COEFFICIENTS[f"{_name} force"] = Key(f"{_stem}_N{_unit}")
    _COEFFICIENTS[f"{_name} displacement"] = Key(f"{_stem}_mm{_unit}", factor=1e3)


_MAY_BE_MISSING = ("measured_to", "about")


@dataclass(frozen=True)
class _Grammar:
    """What the laws of a word are written with: constants, and the kinds of terms: coefficient -> shape names."""

    constants: tuple[str, ...]
    terms: tuple[tuple[str, tuple[str, ...]], ...]


_PLAYS = (
    ("compliance", ("threshold",)),
    ("compliance", ("returns_beyond", "after")),
    ("compliance", ("ratchets_beyond", "after")),
)
_PATHS = (
    ("drift", ("time_constant",)),
    ("drift_rate", ()),
    ("drift_per_root", ()),
    ("drift_knot", ("at",)),
    ("drift_per_kelvin", ("sensor",)),
)
_GRAMMAR: dict[str, _Grammar] = {
    "joint_yield": _Grammar(("joint", "memory", "flow_time"), _PLAYS),
    "base_slip": _Grammar(("axis", "depth", "memory", "flow_time"), _PLAYS),
    "joint_hysteresis": _Grammar(
        ("joint", "law", "memory"), (("compliance", ("strength",)), ("compliance", ("reach",)))
    ),
    "joint_backlash": _Grammar(
        ("joint", "zone", "crossing", "kind"),
        (("width", ()), ("rub", ()), ("place", ("pose", "direction", "first"))),
    ),
    "joint_nonlinear_stiffness": _Grammar(
        ("joint", "measured_to"),
        (
            ("compliance", ("beyond",)),
            ("compliance", ()),
            ("compliance_quadratic", ()),
            ("compliance_even", ()),
            ("compliance_cubic", ()),
        ),
    ),
    "joint_creep": _Grammar(("joint",), (("compliance", ("retardation_time",)),)),
    "joint_stiffness_error": _Grammar((), (("compliance", ("joint",)),)),
    "link_flexibility": _Grammar((), (("over_nominal", ("segment",)),)),
    "base_compliance": _Grammar(("depth",), (("compliance", ("axis",)),)),
    "contact_seating": _Grammar((), (("depth", ("law", "force_scale")),)),
    "load_misalignment": _Grammar(("about",), (("tangent", ("along", "across")),)),
    "pose_error": _Grammar(
        ("about",), (("offset", ("axis",)), ("offset_product", ("axes",)), ("angle", ("joint",)))
    ),
    "force_scale": _Grammar(("about",), (("gain", ()),)),
    "displacement_scale": _Grammar((), (("gain", ()),)),
    "time_lag": _Grammar(("channel", "way", "lag"), (("share", ()),)),
    "force_drift": _Grammar(("path", "quantity", "about"), _PATHS),
    "thermal_drift": _Grammar(
        ("path", "quantity"), tuple((c, (*shape, "along")) for c, shape in _PATHS)
    ),
    "zero_shift": _Grammar((), (("shift", ("run", "lasts")),)),
}


class FormError(ValueError):
    """An entry that is no effect: `path` of keys below the entry, and what is wrong there."""

    def __init__(self, path: tuple[str | int, ...], what: str) -> None:
        super().__init__(what)
        self.path = path


# --- writing -------------------------------------------------------------------------------------


def to_entry(form: Form, about: Mapping[str, Any]) -> dict[str, Any]:
    """The entry of a form, in the order in which a person reads it."""
    constants = form.law.constants
    out: dict[str, Any] = dict(about)
    for name in (n for n in _GRAMMAR[form.word].constants if n in constants):
        out[_CONSTANTS[name].name] = _outward(_CONSTANTS[name], constants[name])
    keys = [_coefficient(t.coefficient, constants) for t in form.law.terms]
    factor = np.array([k.factor for k in keys])
    covariance = form.covariance * np.outer(factor, factor)
    out["terms"] = [
        {
            **{_SHAPES[n].name: _outward(_SHAPES[n], v) for n, v in t.shape.items()},
            k.name: float(value * k.factor),
            "sd": float(np.sqrt(max(covariance[i, i], 0.0))),
        }
        for i, (t, k, value) in enumerate(zip(form.law.terms, keys, form.values, strict=True))
    ]
    if len(keys) > 1:
        out["covariance"] = [[float(c) for c in row] for row in covariance]
    return out


def _coefficient(name: str, constants: Mapping[str, Any]) -> Key:
    return _COEFFICIENTS.get(name) or _COEFFICIENTS[f"{name} {constants['quantity']}"]


def _outward(key: Key, value: Any) -> Any:
    if key.kind == "count":
        return int(value) + 1
    if key.kind in ("text", "flag"):
        return value
    if key.kind == "vector":
        return [float(v) for v in value]
    if key.kind == "springs":
        return [1 / float(v) for v in value]
    return float(value) * key.factor


# --- reading -------------------------------------------------------------------------------------


def from_entry(entry: Mapping[str, Any]) -> Form:
    """The form of an entry. Raises FormError with the place in it."""
    word = _word(entry)
    grammar = _GRAMMAR[word]
    allowed = [_CONSTANTS[n].name for n in grammar.constants]
    _only(entry, (*ABOUT, *allowed, "terms", "covariance"), ())
    constants = {
        n: _inward(_CONSTANTS[n], entry, ())
        for n in grammar.constants
        if n not in _MAY_BE_MISSING or _CONSTANTS[n].name in entry
    }
    written = entry.get("terms")
    if not isinstance(written, list) or not written:
        raise FormError(("terms",) if "terms" in entry else (), "wants a list of terms.")
    terms, values, factors, sds = [], [], [], []
    for i, one in enumerate(written):
        place = ("terms", i)
        if not isinstance(one, Mapping):
            raise FormError(place, "a term is a mapping of keys to numbers.")
        term, key = _term(grammar, constants, one, place)
        terms.append(term)
        factors.append(key.factor)
        values.append(float(_inward(key, one, place)))
        sds.append(_number(one.get("sd", 0.0), (*place, "sd")) / key.factor)
    covariance = _covariance(entry, np.array(factors), np.array(sds))
    return Form(word, Law(constants, tuple(terms)), np.array(values), covariance)


def _word(entry: Mapping[str, Any]) -> str:
    name = entry.get("name")
    if name is None:
        raise FormError(
            (),
            "an effect without a name is none that rig simulate can compute; wanted: `name`, one "
            f"of {', '.join(WORDS)}. With `effects: []` the springs alone are simulated.",
        )
    if name not in _GRAMMAR:
        raise FormError(
            ("name",),
            f'the effect "{name}" is none that rig simulate can compute.'
            f"{did_you_mean(str(name), WORDS)} Known: {', '.join(WORDS)}. With `effects: []` the "
            "springs alone are simulated.",
        )
    return str(name)


def _term(
    grammar: _Grammar, constants: Mapping[str, Any], one: Mapping[str, Any],
    place: tuple[str | int, ...],
) -> tuple[Term, Key]:  # fmt: skip
    """The kind of term whose keys these are."""
    for coefficient, shape in _kinds(grammar, constants):
        key = _coefficient(coefficient, constants)
        names = {key.name, *(_SHAPES[n].name for n in shape)}
        if set(one) - {"sd"} == names:
            return Term(coefficient, {n: _inward(_SHAPES[n], one, place) for n in shape}), key
    known = " or ".join(_keys_of(grammar, constants))
    raise FormError(place, f"has the keys {', '.join(map(str, one))}; wanted: {known}.")


_PATH_OF = {"drift": "exponential", "drift_rate": "linear", "drift_per_root": "root",
            "drift_knot": "free", "drift_per_kelvin": "temperature"}  # fmt: skip


def _kinds(
    grammar: _Grammar, constants: Mapping[str, Any]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """The kinds of terms that go with these constants."""
    for coefficient, shape in grammar.terms:
        path, law = _PATH_OF.get(coefficient), constants.get("law", "")
        fits = path in (None, constants.get("path"))
        if shape in (("strength",), ("reach",)):
            fits = (law == "Iwan") == (shape == ("strength",))
        if fits:
            yield coefficient, shape


def _keys_of(grammar: _Grammar, constants: Mapping[str, Any]) -> Iterator[str]:
    for coefficient, shape in _kinds(grammar, constants):
        names = [_SHAPES[n].name for n in shape]
        yield "(" + ", ".join([*names, _coefficient(coefficient, constants).name]) + ")"


def _inward(key: Key, entry: Mapping[str, Any], place: tuple[str | int, ...]) -> Any:
    if key.name not in entry:
        raise FormError(place, f"lacks the key {key.name}.")
    value, at = entry[key.name], (*place, key.name)
    if key.kind == "text":
        if not isinstance(value, str) or (key.options and value not in key.options):
            wanted = ", ".join(key.options) if key.options else "a name"
            raise FormError(at, f"{value!r} is not allowed; allowed: {wanted}.")
        return value
    if key.kind == "flag":
        if not isinstance(value, bool):
            raise FormError(at, f"{value!r} is not allowed; allowed: true or false.")
        return value
    if key.kind == "vector":
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise FormError(at, "wants three numbers.")
        return tuple(_number(v, at) for v in value)
    if key.kind == "springs":
        return _springs(value, at)
    number = _number(value, at)
    if key.kind == "count":
        most = {"joint": 6, "segment": 2}.get(key.name, 1_000_000)
        if number != int(number) or not 1 <= number <= most:
            raise FormError(at, f"{value!r} is not allowed; allowed: whole numbers, 1 to {most}.")
        return int(number) - 1
    if key.kind == "positive" and not number > 0:
        raise FormError(at, f"{number:g} is not allowed; allowed: above 0.")
    return number / key.factor


def _springs(value: Any, at: tuple[str | int, ...]) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or len(value) != 6:
        raise FormError(at, "wants six joint stiffnesses in Nm/rad.")
    numbers = [_number(v, at) for v in value]
    if not min(numbers) > 0:
        raise FormError(at, f"{min(numbers):g} Nm/rad is no spring; allowed: above 0.")
    return tuple(1 / v for v in numbers)


def _number(value: Any, at: tuple[str | int, ...]) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < _MOST:
        raise FormError(at, f"{value!r} is not allowed; allowed: a number below {_MOST:g}.")
    return float(value)


def _only(entry: Mapping[str, Any], allowed: tuple[str, ...], place: tuple[str | int, ...]) -> None:
    for key in entry:
        if key not in allowed:
            hint = did_you_mean(str(key), allowed)
            raise FormError((*place, str(key)), f'the key "{key}" is not known here.{hint}')


def _covariance(entry: Mapping[str, Any], factor: Any, sd: Any) -> Any:
    written = entry.get("covariance")
    if written is None:
        return np.diag(sd**2)
    k, at = len(factor), ("covariance",)
    if not isinstance(written, list) or len(written) != k:
        raise FormError(at, f"wants {k} rows of {k} numbers, one a term.")
    rows = []
    for row in written:
        if not isinstance(row, list) or len(row) != k:
            raise FormError(at, f"wants {k} rows of {k} numbers, one a term.")
        rows.append([_number(v, at) for v in row])
    return np.array(rows) / np.outer(factor, factor)


@dataclass(frozen=True, eq=False)
class ModelEffects:
    """Effects of a model file; contained: words whose numbers stand in the springs already."""

    forms: tuple[Form, ...]
    contained: tuple[str, ...]


def effects_of(model: ArmModel) -> ModelEffects:
    """The effects of a model in absolute units. Raises InputError with every problem found."""
    found, contained, problems = [], [], []
    for i, entry in enumerate(model.effects):
        try:
            form = from_entry(entry)
        except FormError as error:
            problems.append((("effects", i, *error.path), str(error)))
            continue
        if entry.get(CONTAINED) == SPRINGS:
            contained.append(form.word)
        else:
            found.append(form)
    if problems:
        document = read_document(Path(model.name), ModelFile)
        document.refuse([document.problem(place, what) for place, what in problems])
    return ModelEffects(tuple(found), tuple(contained))
