"""What a report is asked to hold, and what its data sets are called in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rig.storage.files import legible


@dataclass(frozen=True)
class Wishes:
    """What else the report should hold. made: ISO 8601 time that it shows as its own; png: figures
    as PNG too; processes: that diagnose beside the rest, 0 for none."""

    couple: Path | None = None
    gap: bool = True
    made: str = ""
    png: bool = False
    processes: int = 0


@dataclass(frozen=True)
class Named:
    """A data set's file, what it is called, and what the names of its figures begin with."""

    path: Path
    label: str
    stem: str


def named(paths: Sequence[Path]) -> list[Named]:
    """Names for data sets: those of the files, whole paths where two are the same; all different as
    beginnings of names."""
    names = [p.name for p in paths]
    taken: set[str] = set()
    found: list[Named] = []
    for n, path in enumerate(paths, start=1):
        stem = file_stem(path.stem)
        stem = stem if stem.lower() not in taken else f"{stem}_{n}"
        taken.add(stem.lower())
        label = legible(path.name if names.count(path.name) == 1 else path)
        found.append(Named(path, label, stem))
    return found


def file_stem(wanted: str) -> str:
    """A name that every file system takes."""
    return "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "_" for c in wanted)[:80]
