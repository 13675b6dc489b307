"""What stands where a result is to go: a result replaces its own kind only, and says so."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rig.cli.options import say
from rig.digits import counted
from rig.errors import InputError
from rig.plotting import MADE_BY

_HEAD_BYTES = 4096


@contextmanager
def replacing(
    places: Iterable[tuple[str, str, Path]], drawn: Iterable[Path] = ()
) -> Iterator[None]:
    """Around the work; option, parameter and path of what it writes, and what stands where it draws
    figures. Says afterwards which files it replaced. InputError before it where another kind of
    file stands; pipes and devices are let be.
    """
    stood = [
        _Standing(option, _kind(name, path), path)
        for option, name, path in places
        if path.is_file()
    ]
    figures = [_Standing("--figures", _OF_DRAWN.get(path.suffix), path) for path in drawn]
    try:
        yield
    finally:
        for one in stood:
            if one.is_replaced():
                say(f"{one.path}: replaced; an earlier {one.what} stood there")
        if count := sum(one.is_replaced() for one in figures):
            folder = figures[0].path.parent
            say(f"{folder}: {counted(count, 'file')} replaced; earlier figures stood there")


class _Kind(NamedTuple):
    """What a file of this kind is called, and how it begins."""

    name: str
    begins: str


_PROTOCOL = _Kind(
    "protocol written by rig", r"# (To tell \w+ from \w+\. |Poses and directions that would tell)"
)
_ARM = _Kind("arm exported by rig", r"<(mujoco|robot) [^>]*>\s*<!-- Joint springs in Nm/rad")
_OF_OPTION = {
    "json_file": _Kind("JSON written by rig", r'\s*\{\s*"schema":\s*"rig\.'),
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


_OF_DRAWN = {
    ".png": _Kind("figure drawn by rig", f"(?s).*?{MADE_BY}"),
    ".svg": _Kind("figure drawn by rig", f"(?s).*?{MADE_BY}"),
    ".csv": _Kind("table written by rig", r"(#.*\n)*# rig (diagnose|report)\b"),
}


def _kind(parameter: str, path: Path) -> _Kind | None:
    return _OF_OPTION.get(parameter) or _OF_ENDING.get(path.suffix.lower())


class _Standing:
    """A file that stands where a result is to go. InputError where it is of another kind; an empty
    one is of any."""

    def __init__(self, option: str, kind: _Kind | None, path: Path) -> None:
        self.path = path
        self.what = "one" if kind is None else kind.name
        self._before = _made(path)
        head = _head(path) if kind else ""
        if kind and head and not re.match(kind.begins, head):
            raise InputError(
                f"{option} {path}: exists and is no {kind.name}, so it is not replaced. "
                f"Give another {'folder' if option == '--figures' else 'name'}, or move it away."
            )

    def is_replaced(self) -> bool:
        """Asked once the work is done."""
        return _made(self.path) not in (None, self._before)


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
