"""What stands where a result is to go: a result replaces its own kind only, and says so."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rig.cli.options import say
from rig.errors import InputError

_HEAD_BYTES = 4096


@contextmanager
def replacing(places: Iterable[tuple[str, str, Path]]) -> Iterator[None]:
    """Around the work; option, parameter and path of what it writes. Says afterwards which files it
    replaced. InputError before it where another kind of file stands; pipes and devices are let be.
    """
    stood = [_Standing(option, name, path) for option, name, path in places if path.is_file()]
    try:
        yield
    finally:
        for told in (one.told() for one in stood):
            if told is not None:
                say(told)


class _Kind(NamedTuple):
    """What a file of this kind is called, and how it begins."""

    name: str
    begins: str


_PROTOCOL = _Kind(
    "protocol written by rig", r"# (To tell \w+ from \w+\. |Poses and directions that would tell)"
)
_ARM = _Kind("arm exported by rig", r"<(mujoco|robot) [^>]*>\s*<!-- Joint springs in Nm/rad")
_OF_OPTION = {
    "json_file": _Kind("JSON", r"\s*\{"),
    "csv": _Kind("table of curves", r"(#.*\n)*pose,direction,force_N,displacement_mm"),
    "write_model": _Kind(
        "model written by rig", r"# (The simulation with what rig diagnose|Identified from )"
    ),
    "write_protocol": _PROTOCOL,
    "next_file": _PROTOCOL,
    "export_mujoco": _ARM,
    "export_urdf": _ARM,
}
_OF_ENDING = {
    ".html": _Kind("page", r"(?i)\s*<!doctype html"),
    ".htm": _Kind("page", r"(?i)\s*<!doctype html"),
    ".pdf": _Kind("PDF", r"%PDF"),
    ".csv": _Kind("table exported by rig", r"(#.*\n)*# rig\.table/"),
    ".parquet": _Kind("Parquet table", "PAR1"),
}


class _Standing:
    """A file that stands where the result of an option is to go. InputError where it is of another
    kind; an empty one is of any."""

    def __init__(self, option: str, parameter: str, path: Path) -> None:
        self._path = path
        self._kind = _OF_OPTION.get(parameter) or _OF_ENDING.get(path.suffix.lower())
        self._before = _made(path)
        head = _head(path) if self._kind else ""
        if self._kind and head and not re.match(self._kind.begins, head):
            raise InputError(
                f"{option} {path}: exists and is no {self._kind.name}, so it is not replaced. "
                "Give another name, or move it away."
            )

    def told(self) -> str | None:
        """What to say once the work is done; None where the file still stands."""
        if _made(self._path) == self._before:
            return None
        what = "one" if self._kind is None else self._kind.name
        return f"{self._path}: replaced; an earlier {what} stood there"


def _made(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns


def _head(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES).decode("utf-8", "replace")
    except OSError:
        return ""  # what cannot be read can be no better judged than an empty file
