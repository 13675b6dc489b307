"""What a data set is, at a glance: attributes and META, no columns."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from rig.errors import InputError
from rig.storage.files import check_regular
from rig.storage.seal import BROKEN, SCHEMA

_ROBOT = re.compile(r"^robot:\s*([A-Za-z0-9_.-]+)\s*(?:#.*)?$", re.MULTILINE)
_DIRECTIONS = re.compile(r"^directions:\s*\{(.*)\}\s*(?:#.*)?$", re.MULTILINE)
_TEXTS, _NUMBERS = ("schema", "uuid", "created", "title", "origin"), ("complete", "rows")
_META = "entry/texts/meta"
_NAME = re.compile(r"\s*([A-Za-z0-9_+-]+)\s*:\s*\[[^\]]*\]\s*(?:,|$)")


@dataclass(frozen=True)
class Summary:
    """As in `rig.dataset.Dataset`; directions: names in META's order."""

    uuid: str
    created: str
    title: str
    origin: str
    complete: bool
    rows: int
    robot: str
    directions: tuple[str, ...]


def read_summary(path: Path) -> Summary:
    """Of an HDF5 file whose bytes were checked (`rig.storage.seal.check_bytes`). InputError for
    anything that is no data set."""
    try:
        root, text = _root(path)
        if root["schema"] != SCHEMA:
            raise InputError(f"{path}: an HDF5 file of another program.")
        robot, directions = _of_meta(text, str(path))
        return Summary(
            uuid=str(root["uuid"]),
            created=str(root["created"]),
            title=str(root["title"]).removeprefix("EMULATED: "),
            origin=str(root["origin"]),
            complete=bool(root["complete"]),
            rows=int(root["rows"]),
            robot=robot,
            directions=directions,
        )
    except BROKEN as error:
        first = str(error).split("\n", 1)[0] or type(error).__name__
        raise InputError(f"{path}: damaged: {first}.") from error


def _root(path: Path) -> tuple[dict[str, Any], str]:
    """Attributes of the root, `schema` None in a file of another program, and the text of META.

    A file as this software writes it gives them in a third of the time that any other takes.
    """
    try:
        return as_written(path)
    except BROKEN:
        return by_any_program(path)


def as_written(path: Path) -> tuple[dict[str, Any], str]:
    """By the library's plain calls, text of variable length and whole numbers; one of `BROKEN` for
    anything else."""
    import numpy as np
    from h5py import h5a, h5d, h5f, h5s, string_dtype

    text, number = np.empty((), string_dtype()), np.empty((), np.int64)
    root: dict[str, Any] = {}
    file = h5f.open(os.fsencode(path), h5f.ACC_RDONLY)
    try:
        for name in _TEXTS:
            h5a.open(file, name.encode()).read(text)
            root[name] = text.item().decode("utf-8")
        for name in _NUMBERS:
            h5a.open(file, name.encode()).read(number)
            root[name] = int(number)
        h5d.open(file, _META.encode()).read(h5s.ALL, h5s.ALL, text)
        return root, text.item().decode("utf-8")
    finally:
        file.close()


def by_any_program(path: Path) -> tuple[dict[str, Any], str]:
    """Likewise, whatever types another program has stored them as again."""
    import h5py

    with h5py.File(path, "r") as file:
        if file.attrs.get("schema") != SCHEMA:
            return {"schema": None}, ""
        root = {name: file.attrs[name] for name in (*_TEXTS, *_NUMBERS)}
        texts = {k: v.decode("utf-8") for k, v in root.items() if isinstance(v, bytes)}
        return root | texts, file[_META].asstr()[()]


def journal_summary(journal: Path) -> Summary:
    """Of a journal, from its first line; rows: its samples so far. InputError if it has none."""
    try:
        check_regular(journal, "a journal")
        content = journal.read_bytes()
        start: dict[str, Any] = json.loads(content.split(b"\n", 1)[0])["data"]
        robot, directions = _of_meta(str(start["meta"]), str(journal))
        return Summary(
            uuid=str(start["uuid"]),
            created=str(start["created"]),
            title=str(start.get("title", "")),
            origin=str(start["origin"]),
            complete=False,
            rows=content.count(b'"kind":"sample"'),
            robot=robot,
            directions=directions,
        )
    except OSError as error:
        raise InputError(f"{journal}: cannot be read: {error.strerror or error}.") from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{journal}: its first line is no start of a measurement.") from error


@lru_cache(maxsize=256)
def _of_meta(text: str, name: str) -> tuple[str, tuple[str, ...]]:
    """Robot and directions. What a measurement writes is JSON, what people write mostly has both on
    a line each; anything else is read in full, which takes milliseconds."""
    if text.lstrip().startswith("{"):
        found = json.loads(text)
        return str(found["robot"]), tuple(found["directions"])
    robot, line = _ROBOT.search(text), _DIRECTIONS.search(text)
    if robot and line and (names := _names(line.group(1))):
        return robot.group(1), names
    from rig.meta import Meta
    from rig.yaml.yamlfile import load_yaml_text

    meta = load_yaml_text(text, name, Meta)
    return meta.robot, tuple(meta.directions)


def _names(inside: str) -> tuple[str, ...]:
    """Names in `x: [1, 0, 0], y: [0, 1, 0]`; none where anything else stands there."""
    return tuple(_NAME.findall(inside)) if not _NAME.sub("", inside).strip() else ()
