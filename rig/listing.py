"""`rig list`: the data sets of a folder, with what is known of them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rig import schemas
from rig.catalogue import recall, remember, stiffness_of
from rig.digits import likely, number
from rig.errors import InputError
from rig.journal import is_being_written, journal_path, replay
from rig.storage.files import ENDINGS
from rig.storage.seal import check_bytes
from rig.storage.summary import Summary, journal_summary, read_summary
from rig.terminal import Progress

_JOURNAL = ".journal"


@dataclass(frozen=True)
class Entry:
    """One data set. file: relative to the folder. stiffness: per direction as in JSON, None where
    nobody analysed it yet; verdict: word and probability, likewise. open: a journal lies beside;
    running: a measurement is writing it."""

    file: str
    summary: Summary
    stiffness: Mapping[str, Any] | None
    verdict: Mapping[str, Any] | None
    open: bool
    running: bool = False

    @property
    def state(self) -> str:
        """What must not be overlooked."""
        s = self.summary
        whole = "RUNNING" if self.running else "complete" if s.complete else "INCOMPLETE"
        return f"{whole}, EMULATED" if s.origin == "emulated" else f"{whole}, {s.origin}"

    @property
    def stiffness_text(self) -> str:
        """`x 95.94, y 57.42` in N/mm; undefined where the data define none; - if not known yet."""
        if self.stiffness is None:
            return "-"
        values = {d: q["value"] for d, q in self.stiffness.items()}
        return ", ".join(
            f"{d} {'undefined' if v is None else number(v)}" for d, v in values.items()
        )


@dataclass(frozen=True)
class Listing:
    """Entries by file, and (file, reason) of what was left out. width: columns of a terminal; a
    table that is wider gives each file two lines."""

    folder: Path
    entries: tuple[Entry, ...]
    skipped: tuple[tuple[str, str], ...]
    width: int | None = None

    def to_json(self) -> dict[str, Any]:
        """Schema rig.list/1; null for what is not known yet."""
        return {
            "schema": schemas.LIST,
            "folder": str(self.folder),
            "datasets": [_json(e) for e in self.entries],
            "skipped": [{"file": f, "reason": r} for f, r in self.skipped],
        }

    def to_text(self) -> str:
        """A table, and a line for every file left out."""
        lines = list(self._lines())
        lines += [f"Left out: {file}: {reason}" for file, reason in self.skipped]
        return "\n".join(lines)

    def banners(self) -> tuple[str, ...]:
        """What has to be said before anything else."""
        emulated = sum(e.summary.origin == "emulated" for e in self.entries)
        if not emulated:
            return ()
        return (
            f"EMULATED: {emulated} of {len(self.entries)} data sets come from simulated devices; "
            "nothing was measured there.",
        )

    def _lines(self) -> Iterator[str]:
        if not self.entries:
            yield f"{self.folder}: no data sets ({', '.join(ENDINGS)})."
            return
        yield from self.banners()
        rows = [_HEADER, *map(_cells, self.entries)]
        table = list(_table(rows, range(len(_HEADER))))
        if self.width is None or max(map(len, table)) <= self.width:
            yield from table
        else:
            yield from _narrow(rows)
        running = ", ".join(e.file for e in self.entries if e.running)
        if running:
            yield f"Being measured now: {running}."
        begun = ", ".join(e.file for e in self.entries if e.open and not e.running)
        if begun:
            yield f"With a journal: {begun}; `rig measure --resume FILE` goes on there."
        unknown = [e for e in self.entries if e.stiffness is None]
        if unknown:
            # What `rig analyze` finds beside a journal is not kept: it is not the last word.
            other = "" if any(e.open for e in unknown) else " or `rig analyze FILE`"
            yield f"k -: not analysed yet; `rig list --analyze`{other} does it."


def list_folder(
    folder: Path, *, analyze: bool = False, progress: Progress | None = None
) -> Listing:
    """The data sets in a folder and below it, hidden folders left out. analyze: k is computed where
    it is not known yet. InputError if there is no such folder; nothing else stops it."""
    if not folder.is_dir():
        what = "a file" if folder.exists() else "no such folder"
        raise InputError(f"{folder}: {what}; a folder with data sets is wanted.")
    seals, skipped = _sealed(folder, list(_files(folder)), progress)
    known = recall({s for s in seals.values() if s})
    fresh: dict[str, Any] = {}
    entries = []
    for path, seal in seals.items():
        try:
            entries.append(_entry(folder, path, known.get(seal, {}), seal, fresh))
        except InputError as error:
            skipped.append(_left_out(folder, path, error))
    remember("summary", fresh)
    if analyze:
        entries = _analyzed(folder, entries, seals, skipped, progress)
    return Listing(folder, tuple(entries), tuple(sorted(skipped)))


def _files(folder: Path) -> Iterator[Path]:
    """Data sets by their ending, and those of which there is only a journal yet; sorted."""
    for here, folders, names in os.walk(folder):
        folders[:] = sorted(f for f in folders if not f.startswith("."))
        wanted = {n for n in names if n.lower().endswith(ENDINGS) and not n.startswith(".")}
        wanted |= {
            n.removesuffix(_JOURNAL)
            for n in names
            if n.endswith(_JOURNAL) and n.removesuffix(_JOURNAL).lower().endswith(ENDINGS)
        }
        yield from (Path(here) / n for n in sorted(wanted))


def _sealed(
    folder: Path, files: Sequence[Path], progress: Progress | None
) -> tuple[dict[Path, str], list[tuple[str, str]]]:
    """Key of the catalogue per file, "" for what can't be looked up, and what is left out. Every
    byte is read each time: the last line of a damaged file is mostly what it was."""
    seals, skipped = {}, []
    for i, path in enumerate(files):
        try:
            seals[path] = "" if journal_path(path).exists() else check_bytes(path)
        except InputError as error:
            skipped.append(_left_out(folder, path, error))
        if progress:
            progress("reading", (i + 1) / len(files))
    return seals, skipped


def _left_out(folder: Path, path: Path, error: InputError) -> tuple[str, str]:
    return str(path.relative_to(folder)), str(error).removeprefix(f"{path}: ")


def _entry(
    folder: Path, path: Path, found: Mapping[str, Any], seal: str, fresh: dict[str, Any]
) -> Entry:
    name, journal = str(path.relative_to(folder)), journal_path(path)
    if journal.exists():
        summary = journal_summary(journal)
        replay(journal)  # a damaged one can't be resumed, and says so
        running = is_being_written(journal)
        return Entry(name, summary, None, None, open=True, running=running)
    if "summary" in found:
        kept = found["summary"]
        summary = Summary(**{**kept, "directions": tuple(kept["directions"])})
    else:
        summary = read_summary(path)
        fresh[seal] = dict(vars(summary))
    return Entry(name, summary, found.get("stiffness"), found.get("verdict"), open=False)


def _analyzed(
    folder: Path,
    entries: list[Entry],
    seals: Mapping[Path, str],
    skipped: list[tuple[str, str]],
    progress: Progress | None,
) -> list[Entry]:
    """The entries with k, also of open ones; what can't be analysed is left out with its reason."""
    from rig.analysis.analyze import analyze
    from rig.dataset import load

    out = []
    for i, entry in enumerate(entries):
        path = folder / entry.file
        if entry.stiffness is None:
            try:
                found = stiffness_of(analyze(load(path)).to_json())
            except InputError as error:
                skipped.append(_left_out(folder, path, error))
                continue
            remember("stiffness", {seals[path]: found})
            out.append(replace(entry, stiffness=found))
        else:
            out.append(entry)
        if progress:
            progress("analysing", (i + 1) / len(entries))
    return out


def _json(e: Entry) -> dict[str, Any]:
    summary = vars(e.summary)
    return {
        "file": e.file,
        **{k: summary[k] for k in ("uuid", "created", "title", "robot")},
        "directions": list(e.summary.directions),
        "samples": e.summary.rows,
        "origin": e.summary.origin,
        "complete": e.summary.complete,
        "journal": e.open,
        "running": e.running,
        "stiffness_N_per_mm": None if e.stiffness is None else dict(e.stiffness),
        "verdict": None if e.verdict is None else dict(e.verdict),
    }


_HEADER = ("file", "date", "robot", "directions", "k N/mm", "verdict", "samples", "state")


def _cells(e: Entry) -> tuple[str, ...]:
    s = e.summary
    return (
        e.file,
        s.created[:16].replace("T", " "),
        s.robot,
        " ".join(s.directions),
        e.stiffness_text,
        "-" if e.verdict is None else f"{e.verdict['word']} {likely(e.verdict['probability'])}",
        str(s.rows),
        e.state,
    )


def _table(rows: list[tuple[str, ...]], columns: Iterable[int]) -> Iterator[str]:
    widths = {i: max(len(row[i]) for row in rows) for i in columns}
    for row in rows:
        cells = (row[i].rjust(w) if i == 6 else row[i].ljust(w) for i, w in widths.items())
        yield "  ".join(cells).rstrip()


def _narrow(rows: list[tuple[str, ...]]) -> Iterator[str]:
    """Two lines a file: what it is, and what is known of it."""
    for row, line in zip(rows, _table(rows, (0, 1, 2, 6)), strict=True):
        yield line
        yield "  " + "; ".join((row[7], *row[3:6]))
