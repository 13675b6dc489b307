"""What was found out about data sets, kept per user: a cache, safe to delete at any time.

Keyed by the SHA-256 at the end of a data set (`rig.storage.hdf5`), so that copies and renamed files
are known again, and a changed file is another one. Data sets themselves are never written to.
`RIG_CACHE` names another folder; empty, nothing is kept. Whatever goes wrong with the cache, it is
as if nothing were known: no command fails for it.
"""

from __future__ import annotations

import json
import os
import sqlite3
import sys
from collections.abc import Iterable, Mapping
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from rig import schemas
from rig.software import software_version

_TABLE = """CREATE TABLE IF NOT EXISTS found (
    sha256 TEXT, kind TEXT, software TEXT, value TEXT, PRIMARY KEY (sha256, kind))"""
_MANY = 500  # placeholders in one question; SQLite allows 999 at least
_PATIENCE_S = 0.5  # for another process that writes


def cache_folder() -> Path | None:
    """Where the catalogue lies; None if nothing is to be kept."""
    named = os.environ.get("RIG_CACHE")
    if named is not None:
        return Path(named) if named else None
    home = "LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"
    base = os.environ.get(home)
    return (Path(base) if base else Path.home() / ".cache") / "stiffness-rig"


def recall(digests: Iterable[str]) -> dict[str, dict[str, Any]]:
    """digest -> kind -> value, of what this version of the software found."""
    out: dict[str, dict[str, Any]] = {}
    wanted = list(digests)
    with suppress(sqlite3.Error, OSError, ValueError, RuntimeError):
        folder = cache_folder()
        if folder is None or not _file(folder).exists():
            return out
        with closing(sqlite3.connect(_file(folder), timeout=_PATIENCE_S)) as db:
            for start in range(0, len(wanted), _MANY):
                some = wanted[start : start + _MANY]
                marks = ",".join("?" * len(some))
                rows = db.execute(
                    f"SELECT sha256, kind, value FROM found WHERE software = ? "
                    f"AND sha256 IN ({marks})",
                    [software_version(), *some],
                )
                for digest, kind, value in rows:
                    out.setdefault(digest, {})[kind] = json.loads(value)
    return out


def remember(kind: str, values: Mapping[str, Any]) -> None:
    """Keeps a value (what JSON can hold) of that kind per digest; empty digests are left out."""
    with suppress(sqlite3.Error, OSError, RuntimeError):
        folder = cache_folder()
        if folder is None:
            return
        folder.mkdir(parents=True, exist_ok=True)
        software = software_version()
        rows = [(d, kind, software, json.dumps(v)) for d, v in values.items() if d]
        with closing(sqlite3.connect(_file(folder), timeout=_PATIENCE_S)) as db, db:
            db.execute(_TABLE)
            db.executemany("INSERT OR REPLACE INTO found VALUES (?, ?, ?, ?)", rows)


def remember_result(dataset: Path, found: Mapping[str, Any]) -> None:
    """Keeps what `rig list` shows of the JSON of an analysis or a diagnosis made with default
    options, unless a journal says that the file is not the last word."""
    from rig.journal import journal_path
    from rig.storage.seal import seal_of

    with suppress(OSError):
        if journal_path(dataset).exists():
            return
        digest = seal_of(dataset)
        if found["schema"] == schemas.ANALYSIS:
            remember("stiffness", {digest: stiffness_of(found)})
        elif found["schema"] == schemas.DIAGNOSIS:
            verdict = found["verdict"]
            share = found["probabilities"][verdict]
            remember("verdict", {digest: {"word": verdict, "probability": share}})


def stiffness_of(analysis: Mapping[str, Any]) -> dict[str, Any]:
    """direction -> k with its uncertainty (null where undefined), of the JSON of an analysis."""
    return {
        key: {k: v for k, v in d["stiffness_N_per_mm"].items() if k != "degrees_of_freedom"}
        for key, d in analysis["directions"].items()
    }


def _file(folder: Path) -> Path:
    return folder / "catalogue.sqlite"
