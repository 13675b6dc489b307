"""What a data set is, at a glance: attributes and META, no columns."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from rig.errors import InputError

_ROBOT = re.compile(r"^robot:\s*([A-Za-z0-9_.-]+)\s*(?:#.*)?$", re.MULTILINE)
_DIRECTIONS = re.compile(r"^directions:\s*\{(.*)\}\s*(?:#.*)?$", re.MULTILINE)
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
    """Of an HDF5 file whose seal holds. InputError for anything that is no data set."""
    import h5py

    from rig.storage.hdf5 import SCHEMA
    from rig.storage.hdf5read import BROKEN, check_bytes

    check_bytes(path)
    try:
        with h5py.File(path, "r") as file:
            root = file.attrs
            if root.get("schema") != SCHEMA:
                raise InputError(f"{path}: an HDF5 file of another program.")
            robot, directions = _of_meta(file["entry/texts/meta"].asstr()[()], str(path))
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


def journal_summary(journal: Path) -> Summary:
    """Of a journal, from its first line; rows: its samples so far. InputError if it has none."""
    try:
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
    from rig.yamlfile import load_yaml_text

    meta = load_yaml_text(text, name, Meta)
    return meta.robot, tuple(meta.directions)


def _names(inside: str) -> tuple[str, ...]:
    """Names in `x: [1, 0, 0], y: [0, 1, 0]`; none where anything else stands there."""
    return tuple(_NAME.findall(inside)) if not _NAME.sub("", inside).strip() else ()
