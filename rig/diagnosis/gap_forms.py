"""Effects as they stand in a model file: every number with its unit in the key, read and written.

Inside, laws are SI (`identification.gap.answer.forms`); here lengths are mm, joints count from 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identification.gap.answer.forms import Form, lasting
from identification.gap.laws.law import Law, Term
from identification.gap.words import WORDS
from rig.diagnosis.gap_keys import (
    ABOUT,
    CONSTANTS,
    CONTAINED,
    GRAMMAR,
    MAY_BE_MISSING,
    SHAPES,
    SPRINGS,
    Grammar,
    Key,
    coefficient_key,
    keys_of,
    kinds,
)
from rig.errors import close_to, did_you_mean
from rig.models.model import ArmModel
from rig.models.model_schema import ModelFile
from rig.yaml.yamlfile import read_document

_MOST = 1e12


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
    for name in (n for n in GRAMMAR[form.word].constants if n in constants):
        out[CONSTANTS[name].name] = _outward(CONSTANTS[name], constants[name])
    keys = [coefficient_key(t.coefficient, constants) for t in form.law.terms]
    factor = np.array([k.factor for k in keys])
    covariance = form.covariance * np.outer(factor, factor)
    out["terms"] = [
        {
            **{SHAPES[n].name: _outward(SHAPES[n], v) for n, v in t.shape.items()},
            k.name: float(value * k.factor),
            "sd": float(np.sqrt(max(covariance[i, i], 0.0))),
        }
        for i, (t, k, value) in enumerate(zip(form.law.terms, keys, form.values, strict=True))
    ]
    if len(keys) > 1:
        out["covariance"] = [[float(c) for c in row] for row in covariance]
    return out


def _outward(key: Key, value: Any) -> Any:
    if key.kind == "count":
        return int(value) + 1
    if key.kind in ("text", "flag"):
        return value
    if key.kind in ("vector", "six"):
        return [float(v) for v in value]
    if key.kind == "springs":
        return [1 / float(v) for v in value]
    return float(value) * key.factor


# --- reading -------------------------------------------------------------------------------------


def from_entry(entry: Mapping[str, Any]) -> Form:
    """The form of an entry. Raises FormError with the place in it."""
    word = _word(entry)
    grammar = GRAMMAR[word]
    allowed = [CONSTANTS[n].name for n in grammar.constants]
    _only(entry, (*ABOUT, *allowed, "terms", "covariance"), ())
    constants = {
        n: _inward(CONSTANTS[n], entry, ())
        for n in grammar.constants
        if n not in MAY_BE_MISSING or CONSTANTS[n].name in entry
    }
    for n in constants:
        for other, allowing in grammar.only_with.get(n, {}).items():
            if constants.get(other) not in allowing:
                raise FormError(
                    (CONSTANTS[n].name,),
                    f"goes with {CONSTANTS[other].name} {' or '.join(allowing)} only, not with "
                    f"{constants.get(other)}.",
                )
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
    if not isinstance(name, str) or name not in GRAMMAR:
        raise FormError(
            ("name",),
            f'the effect "{name}" is none that rig simulate can compute.'
            f"{close_to(str(name), WORDS)} Known: {', '.join(WORDS)}. With `effects: []` the "
            "springs alone are simulated.",
        )
    return name


def _term(
    grammar: Grammar,
    constants: Mapping[str, Any],
    one: Mapping[str, Any],
    place: tuple[str | int, ...],
) -> tuple[Term, Key]:
    """The kind of term whose keys these are."""
    for coefficient, shape in kinds(grammar, constants):
        key = coefficient_key(coefficient, constants)
        names = {key.name, *(SHAPES[n].name for n in shape)}
        if set(one) - {"sd"} == names:
            return Term(coefficient, {n: _inward(SHAPES[n], one, place) for n in shape}), key
    known = " or ".join(keys_of(grammar, constants))
    raise FormError(place, f"has the keys {', '.join(map(str, one))}; wanted: {known}.")


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
    if key.kind in ("vector", "six"):
        count = 3 if key.kind == "vector" else 6
        if not isinstance(value, list | tuple) or len(value) != count:
            raise FormError(at, f"wants {'three' if count == 3 else 'six'} numbers.")
        return tuple(_number(v, at) for v in value)
    if key.kind == "springs":
        return _springs(value, at)
    return _counted(key, value, at) if key.kind == "count" else _sized(key, value, at)


def _counted(key: Key, value: Any, at: tuple[str | int, ...]) -> int:
    most = {"joint": 6, "segment": 2}.get(key.name, 1_000_000)
    number = _number(value, at)
    if number != int(number) or not 1 <= number <= most:
        raise FormError(at, f"{value!r} is not allowed; allowed: whole numbers, 1 to {most}.")
    return int(number) - 1


def _sized(key: Key, value: Any, at: tuple[str | int, ...]) -> float:
    number = _number(value, at)
    if key.kind == "size" and number < 0:
        raise FormError(at, f"{number:g} is not allowed; allowed: 0 or more.")
    if key.kind == "positive" and not number > 0:
        raise FormError(at, f"{number:g} is not allowed; allowed: above 0.")
    if key.kind == "share" and not 0 <= number <= 1:
        raise FormError(at, f"{number:g} is not allowed; allowed: 0 to 1.")
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

    @property
    def lasting(self) -> tuple[Form, ...]:
        """What the next session meets again: the measured session's own left out."""
        return tuple(f for f in map(lasting, self.forms) if f.law.terms)

    @property
    def left_behind(self) -> tuple[str, ...]:
        """Words of which nothing lasts, each once."""
        return left_behind(self.forms)


def left_behind(forms: Sequence[Form]) -> tuple[str, ...]:
    """Words of which nothing lasts beyond the measured session, each once."""
    stay = {f.word for f in forms if lasting(f).law.terms}
    return tuple(dict.fromkeys(f.word for f in forms if f.word not in stay))


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
