"""YAML files into typed values, with every problem of the file in one message.

The file is composed into nodes that know their line and column, turned into plain values by
YAML 1.2's rules (`1e3` is a number, `yes` is text), and validated strictly against a pydantic
model or an annotated dataclass. Problems are located, worded with the unit that the key states,
and collected; nothing is ever coerced from text to number or from number to truth value.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import TypeAdapter, ValidationError

from rig.errors import InputError, close_to, closest, did_you_mean
from rig.storage.files import neighbours
from rig.yaml import yamlwords as words
from rig.yaml.yamlnodes import PLAIN_NUMBER, Key, Place, Problem, Reader, address, compose, refuse

T = TypeVar("T")
_UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")

MAX_BYTES = 250_000  # the longest files of this kind have a few thousand


@dataclass
class Document(Generic[T]):
    """A validated file that can still say where each of its values stands."""

    name: str
    text: str
    value: T
    places: dict[Key, Place] = field(repr=False)

    def problem(self, path: Key, what: str) -> Problem:
        """A problem with the value at `path` (or the nearest enclosing one that is in the file)."""
        return _problem(self.places, path, what)

    def at(self, path: Key) -> str:
        """`FILE:LINE:COLUMN` of the value at `path`, for messages of later work."""
        return address(self.name, self.problem(path, ""))

    def refuse(self, problems: Sequence[Problem]) -> None:
        """Raises one InputError for all problems; returns when there are none."""
        if problems:
            refuse(self.name, problems)


def load_yaml(path: Path, type_: type[T]) -> T:
    """Reads and validates a file; `type_`: a pydantic model or an annotated dataclass.

    Raises InputError with one line per problem: `FILE:LINE:COLUMN: key.path: what is wrong; what
    is allowed`.
    """
    return read_document(path, type_).value


def load_yaml_text(text: str, name: str, type_: type[T]) -> T:
    """As `load_yaml`, for text that messages call `name`."""
    return read_document_text(text, name, type_).value


Check = Callable[[T], Iterable[tuple[Key, str]]]


def read_document(path: Path, type_: type[T], check: Check[T] | None = None) -> Document[T]:
    """As `load_yaml`, keeping text and places.

    `check` yields (path, what is wrong) for what does not hold across keys. Its findings join the
    others, also where nothing but mistyped words is wrong with the shape.
    """
    return read_document_text(read_text(path), str(path), type_, check)


def read_text(path: Path) -> str:
    """Text of a small UTF-8 file; raises InputError for anything that is none."""
    try:
        if path.is_dir():
            raise InputError(f"{path}: a folder; a YAML file is wanted.")
        if not path.exists():
            raise InputError(f"{path}: no such file.{neighbours(path, '*.y*ml')}")
        if not path.is_file():
            raise InputError(f"{path}: not a regular file; a YAML file is wanted.")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise InputError(
                f"{path}: {size / 1e3:.0f} kB; these files have at most {MAX_BYTES / 1e3:.0f} kB. "
                "Is it a YAML file?"
            )
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}.") from error
    return _decode(raw, str(path))


def _decode(raw: bytes, name: str) -> str:
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(f"{name}: UTF-16 text; save the file as UTF-8.")
    if raw.startswith(b"\x89HDF"):
        raise InputError(f"{name}: an HDF5 file; a YAML file is wanted.")
    if b"\0" in raw:
        raise InputError(f"{name}: binary data; a YAML text file is wanted.")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        byte = raw[error.start]
        raise InputError(
            f"{name}:{line}: the byte 0x{byte:02X} is no UTF-8 text; save the file as UTF-8."
        ) from error


def read_document_text(
    text: str, name: str, type_: type[T], check: Check[T] | None = None
) -> Document[T]:
    """As `read_document`, for text that messages call `name`."""
    reader = Reader()
    data = reader.read(compose(text, name))
    if not isinstance(data, dict):
        found = words.value_words(data, "")
        refuse(name, [*reader.problems, Problem(1, 1, f"{found}; `key: value` lines are wanted.")])
    value = _validate(data, reader, type_, name)
    if value is not None and check is not None:
        for path, what in check(value):
            if not reader.is_bad(path):
                reader.problems.append(_problem(reader.places, path, what))
    if reader.problems or value is None:
        refuse(name, reader.problems, more=value is None and check is not None)
    return Document(name, text, value, reader.places)


def place_in_text(text: str, name: str, path: Key) -> str:
    """`NAME:LINE:COLUMN` of the value at `path` (or the nearest enclosing one) in text that is not
    validated; InputError for text that is no YAML."""
    reader = Reader()
    reader.read(compose(text, name))
    return address(name, _problem(reader.places, path, ""))


_KINDS = {
    "rig.protocol": "a protocol",
    "rig.station": "a station",
    "rig.robot": "a robot's nominal model",
}
_NAMELESS = {
    "Meta": "the META of a table",
    "ModelFile": "an arm's model, as `rig identify --write-model` writes",
}


def _check_kind(data: dict[str, object], reader: Reader, schema: words.Schema, name: str) -> None:
    """InputError for a file that says it is another kind: every key of it would be wrong."""
    kind = _kind(data.get("schema"))
    consts = [node.get("const") for node in words.schemas_at(schema, ("schema",))]
    wanted = next((k for k in map(_kind, consts) if k is not None), None)
    if wanted is not None and "schema" not in data:
        known = words.known_keys(words.schemas_at(schema, ()))
        if 2 * sum(key in known for key in data) < len(data):
            what = f"this is not {_KINDS[wanted]}: it says no schema, and most of its keys are "
            refuse(name, [Problem(1, 1, f"{what}others. Check the name.")])
    if kind is None or kind == wanted:
        return
    nameless = _NAMELESS.get(str(schema.get("title")), "another kind of file")
    other = nameless if wanted is None else _KINDS[wanted]
    what = f"this is {_KINDS[kind]}; wanted: {other}. Give that file's path."
    refuse(name, [_problem(reader.places, ("schema",), what)])


def _kind(schema: object) -> str | None:
    """The kind without its version, of what is one."""
    kind = schema.partition("/")[0] if isinstance(schema, str) else None
    return kind if kind in _KINDS else None


def _validate(data: dict[str, object], reader: Reader, type_: type[T], name: str) -> T | None:
    """The value, also when only mistyped words stood in its way; problems go to the reader, but for
    another kind of file."""
    adapter: TypeAdapter[T] = TypeAdapter(type_)
    first = _attempt(adapter, data)  # (named: or mypy infers T | None for the adapter)
    value, errors = first
    if errors or _any_bool(data):
        schema = adapter.json_schema(mode="validation")
        _check_kind(data, reader, schema, name)
        judge = _Judge(data, reader, schema)
        judge.add(errors)
        if errors and judge.correct():
            second = _attempt(adapter, data)
            value, errors = second
            judge.add(errors)
    return value


def _attempt(adapter: TypeAdapter[T], data: object) -> tuple[T | None, list[Any]]:
    try:
        return adapter.validate_json(json.dumps(data), strict=True), []
    except ValidationError as error:
        return None, list(error.errors(include_url=False))


def _any_bool(data: object) -> bool:
    if isinstance(data, dict | list):
        return any(map(_any_bool, data.values() if isinstance(data, dict) else data))
    return isinstance(data, bool)


class _Judge:
    """Turns validation errors into located problems in plain words."""

    def __init__(self, data: object, reader: Reader, schema: words.Schema) -> None:
        self._data = data
        self._reader = reader
        self._schema = schema
        self._renames: dict[Key, str | None] = {}  # unknown key -> known one, None: to be dropped
        self._words: dict[Key, str] = {}  # mistyped word -> the one that was probably meant
        self._put_off: list[Key] = []  # words of another alternative, of which something is wrong

    def add(self, errors: Sequence[Any]) -> None:
        """Words a validation's errors; places that have a problem already are left alone."""
        # Unknown keys first: what they stand for is then not called missing.
        for error in sorted(errors, key=lambda e: str(e["type"]) not in _UNKNOWN_KEY):
            self._error(str(error["type"]), self._path(error["loc"]), error)
        if not self._reader.problems:  # then it is they that don't go together
            for path in self._put_off:
                what = f'"{self._at(path)}" does not go with what stands beside it.'
                self._reader.complain(path, self._reader.places[path], what)
        # JSON's true equals the literal 1 to the validator; to whoever wrote it, it does not.
        for path, value in _leaves(self._data, ()):
            if isinstance(value, bool):
                nodes = words.schemas_at(self._schema, path)
                if nodes and not any(_takes_bool(n) for n in nodes):
                    self._value_problem(path, value)

    def correct(self) -> bool:
        """Puts what was probably meant into the data and drops unknown keys; True if it did.

        Only to find what else is wrong: the file is refused all the same.
        """
        for path, meant in self._renames.items():
            parent = self._at(path[:-1])
            value = parent.pop(path[-1])
            if meant is not None and meant not in parent:
                parent[meant] = value
                self._reader.rename(path, meant)
        for path, word in self._words.items():
            self._at(path[:-1])[path[-1]] = word
        return bool(self._renames or self._words)

    def _path(self, loc: Sequence[str | int]) -> Key:
        """The validator's location without the names of alternatives, which no file contains."""
        path: Key = ()
        for n, part in enumerate(loc):
            known = (*path, part) in self._reader.places
            if known or (n == len(loc) - 1 and words.schemas_at(self._schema, (*path, part))):
                path = (*path, part)
        return path

    def _error(self, kind: str, path: Key, error: Any) -> None:
        reader = self._reader
        if reader.is_bad(path) or self._of_other_kind(error["loc"]):
            return
        if kind in ("missing", "missing_argument") and path not in reader.places:
            self._missing(path)
        elif kind in _UNKNOWN_KEY:
            self._unknown_key(path)
        elif kind in ("value_error", "assertion_error"):
            what = str(error.get("ctx", {}).get("error", error["msg"]))
            what = what if what.endswith((".", "?")) else f"{what}."
            reader.complain(path, reader.places[path], what)
        elif kind == "literal_error" and self._fits_another(path):
            self._put_off.append(path)
        else:
            self._value_problem(path, self._at(path))

    def _of_other_kind(self, loc: Sequence[str | int]) -> bool:
        """Whether an error is that of an alternative which the file does not take: a mapping shows
        by its keys which one it is."""
        path: Key = ()
        for part in loc:
            if (*path, part) in self._reader.places:
                path = (*path, part)
                continue
            meant = self._meant(path)
            if meant is not None and part != meant and not self._is_key(path, part):
                return True
        return False

    def _meant(self, path: Key) -> str | None:
        """The name of the one alternative that knows most keys of a mapping; None where there are
        no alternatives, or none knows any."""
        nodes = words.schemas_at(self._schema, path)
        value = self._at(path)
        if len(nodes) < 2 or not isinstance(value, dict):
            return None
        fits = [sum(key in words.known_keys([node]) for key in value) for node in nodes]
        best = max(fits)
        return str(nodes[fits.index(best)].get("title")) if best and fits.count(best) == 1 else None

    def _is_key(self, path: Key, part: str | int) -> bool:
        """Whether a part of an error's place is a key that the file could have there."""
        return bool(words.schemas_at(self._schema, (*path, part)))

    def _fits_another(self, path: Key) -> bool:
        """Whether a word is one of another alternative, of which something else is wrong."""
        return self._at(path) in _texts(words.schemas_at(self._schema, path))

    def _missing(self, path: Key) -> None:
        key, above = path[-1], path[:-1]
        if isinstance(key, int):  # a list too short for its fixed length
            self._value_problem(above, self._at(above))
        elif key not in [m for p, m in self._renames.items() if p[:-1] == above]:
            at = self._reader.keys.get(above, self._reader.places[above])
            nodes = words.schemas_at(self._schema, path)
            allowed = words.allowed_words(self._schema, nodes, words.unit_of(path))
            self._reader.complain(path, at, f"is missing; wanted: {allowed or 'a value'}.")

    def _unknown_key(self, path: Key) -> None:
        reader, key, above = self._reader, str(path[-1]), path[:-1]
        known = words.known_keys(words.schemas_at(self._schema, above))
        free = [k for k in known if (*above, k) not in reader.places]
        hint = did_you_mean(key, free or known)
        if key.isdecimal() and self._at(path) is None:  # {range_mm: 1,5}
            hint = " A comma ends a value here; write a point as decimal mark."
        reader.complain(path, reader.keys.get(path, reader.places[path]), f"unknown key.{hint}")
        self._renames[path] = closest(key, free)

    def _value_problem(self, path: Key, value: object) -> None:
        if self._reader.is_bad(path):
            return
        unit = words.unit_of(path)
        nodes = words.schemas_at(self._schema, path)
        allowed = words.allowed_words(self._schema, nodes, unit)
        what = f"{words.value_words(value, unit)} is not allowed"
        what += f"; wanted: {allowed}." if allowed else "."
        self._reader.complain(path, self._reader.places[path], what + _hint(value, nodes))
        meant = closest(value, _texts(nodes)) if isinstance(value, str) else None
        if meant is not None:
            self._words[path] = meant

    def _at(self, path: Key) -> Any:
        value: Any = self._data
        for key in path:
            value = value[key]
        return value


def _leaves(data: object, path: Key) -> list[tuple[Key, object]]:
    if isinstance(data, dict):
        return [leaf for k, v in data.items() for leaf in _leaves(v, (*path, k))]
    if isinstance(data, list):
        return [leaf for i, v in enumerate(data) for leaf in _leaves(v, (*path, i))]
    return [(path, data)]


def _takes_bool(node: words.Schema) -> bool:
    options = _options(node)
    if options:
        return any(isinstance(option, bool) for option in options)
    return node.get("type", "boolean") == "boolean"


def _hint(value: object, nodes: Sequence[words.Schema]) -> str:
    """What probably happened, for the mistakes that YAML makes easy."""
    kinds = {node.get("type") for node in nodes}
    if isinstance(value, str) and kinds & {"number", "integer"}:
        if re.fullmatch(r"[-+]?[0-9]+,[0-9]+", value):
            return " Write a point as decimal mark."
        if PLAIN_NUMBER.fullmatch(value):
            return " Write it without quotes."
        if PLAIN_NUMBER.match(value):
            return " Write the number alone; the unit stands in the key."
    if "boolean" in kinds and str(value).lower() in ("yes", "no", "on", "off", "y", "n"):
        return " This is text in YAML 1.2; write true or false."
    if isinstance(value, int | float) and "string" in kinds and not _texts(nodes):
        return " Put it in quotes if it is a name."
    if isinstance(value, str):
        options = _texts(nodes)
        return close_to(value, options) if len(options) > 1 else ""
    return ""


def _texts(nodes: Sequence[words.Schema]) -> list[str]:
    return [o for n in nodes for o in _options(n) if isinstance(o, str)]


def _options(node: words.Schema) -> list[object]:
    options = node.get("enum", [node["const"]] if "const" in node else [])
    return list(options) if isinstance(options, list) else []


def _problem(places: dict[Key, Place], path: Key, what: str) -> Problem:
    near = path
    while near not in places:
        near = near[:-1]
    where = words.place(path)
    return Problem(*places[near], f"{where}: {what}" if where else what)
