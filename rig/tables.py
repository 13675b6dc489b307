"""Tables of measurements: bringing them in from CSV."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from pathlib import Path

import numpy as np

from rig.contradictions import contradictions
from rig.dataset import Dataset, Origin, write
from rig.digits import counted
from rig.errors import InputError, close_to, did_you_mean
from rig.journal import journal_path
from rig.meta import Meta
from rig.oddities import oddities
from rig.scale import off_scale, wrong_sign
from rig.software import software_version
from rig.storage import csvcells
from rig.storage.columns import (
    BRANCHES,
    JOINT_C,
    KNOWN,
    NO_STEP,
    SAMPLE_NUMBER,
    SPECIMEN_C,
    TABLE_COLUMNS,
    Column,
    Values,
    empty,
    unit_of,
)
from rig.storage.csvblocks import Block, CsvFile, close_match
from rig.storage.files import check_ending, legible
from rig.terminal import Progress, silent
from rig.yaml.yamlfile import read_document

_EMULATED_MARK = "# EMULATED:"
_INCOMPLETE_MARK = "# INCOMPLETE:"
# Of the identities of imported tables: any UUID would do, as long as it stays this one.
_TABLES = uuid.UUID("5ddc5a0e-4c0a-4a3b-9c5e-0b7f3e1d6a42")
_LISTED = 12  # columns of a header that lacks one
_BIGGEST_COUNT = 2**53  # the largest number up to which float64 holds every whole number


def import_table(
    csv: Path, meta_yaml: Path, out: Path | None = None, progress: Progress | None = None
) -> Dataset:
    """The data set of a table and its META.yaml; written to `out` if that is given.

    A table that says it comes from emulated devices stays marked so. A column `discarded` (0 or 1)
    is honoured; other unknown columns are kept and ignored. The same table and META give the same
    UUID, however often and under whatever names they are imported. InputError names file, line,
    column and value of the first thing wrong, or file and place in META.yaml.
    """
    document = read_document(meta_yaml, Meta)
    if out is not None:
        _check_target(out)
    table = _Table(csv, document.value, str(meta_yaml))
    columns = table.read(progress or silent)
    found = contradictions(document.value, columns)
    document.refuse([document.problem(path, what) for path, what in found])
    for notes_of in (oddities, wrong_sign, off_scale):
        table.notes += notes_of(document.value, columns)
    dataset = _dataset(csv, table, columns, document.value, document.text)
    if out is not None:
        (progress or silent)("writing", 0.0)
        write(dataset, out)
        (progress or silent)("writing", 1.0)
    return dataset


def _check_target(out: Path) -> None:
    """Imported data sets may be made anew; measurements are never written over."""
    from rig.storage.hdf5read import holds_import

    check_ending(out)
    if journal_path(out).exists():
        raise InputError(f"{out}: a measurement is under way there (journal). Choose another name.")
    if out.exists() and not holds_import(out):
        raise InputError(
            f"{out}: exists and is no imported data set, so it is not overwritten. "
            "Choose another name, or move it away."
        )


def _dataset(
    csv: Path, table: _Table, columns: dict[str, Values], meta: Meta, meta_text: str
) -> Dataset:
    comments = table.comments
    origin: Origin = "imported"
    if any(c.startswith(_EMULATED_MARK) for c in comments):
        origin = "emulated"
    incomplete = [c for c in comments if c.startswith(_INCOMPLETE_MARK)]
    texts = {"protocol": "", "station": "", "meta": meta_text, "comments": "\n".join(comments)}
    events = [{"sample": 0, "kind": "import", "text": f"imported from {legible(csv.name)}"}]
    events += [{"sample": 0, "kind": "note", "text": note} for note in table.notes]
    return Dataset(
        path=None,
        uuid=_identity(csv, meta_text),
        created=datetime.now().astimezone().isoformat(timespec="seconds"),
        origin=origin,
        complete=not incomplete,
        meta=meta,
        columns=columns,
        units={name: unit_of(name) for name in columns},
        long_names={name: _long_name(name) for name in columns} | table.stand_ins,
        events=events,
        texts=texts,
        software=software_version(),
        stop_reason="said by the imported table" if incomplete else "imported",
        title=legible(csv.name),
    )


def _identity(csv: Path, meta_text: str) -> str:
    """UUID of what was measured: of the bytes of the table and of META, not of their names."""
    with csv.open("rb") as file:
        table = hashlib.file_digest(file, "sha256").hexdigest()
    meta = hashlib.sha256(meta_text.encode()).hexdigest()
    return str(uuid.uuid5(_TABLES, f"{table} {meta}"))


def _long_name(name: str) -> str:
    return KNOWN[name].long_name if name in KNOWN else name.replace("_", " ")


class _Table:
    """One table on its way to columns."""

    def __init__(self, path: Path, meta: Meta, meta_name: str) -> None:
        self._path = path
        self._meta = meta
        self._meta_name = meta_name
        self.comments: list[str] = []
        self.notes: list[str] = []
        self.stand_ins: dict[str, str] = {}  # meanings of columns that were not given

    def read(self, progress: Progress) -> dict[str, Values]:
        """All columns, checked and completed."""
        words: set[str] = set()
        while True:
            try:
                with CsvFile(self._path) as file:
                    return self._read(file, words, progress)
            except csvcells.TextColumns as found:
                words |= found.names

    def _read(self, file: CsvFile, words: set[str], progress: Progress) -> dict[str, Values]:
        self._check_names(file)
        readings = {name: _reading(name, words) for name in file.names}
        parts: dict[str, list[Values]] = {name: [] for name in file.names}
        for block in file.blocks():
            for name, values in csvcells.parse(file, block, readings).items():
                column = KNOWN[name] if name in TABLE_COLUMNS else None
                checked = self._checked(file, block, column, values) if column else values
                parts[name].append(checked)
            progress("reading", file.fraction)
        self.comments = file.comments
        given = {name: np.concatenate(p) for name, p in parts.items() if p}
        if not given:
            raise InputError(f"{self._path}: no samples; there is nothing below the header.")
        return self._completed(given)

    def _check_names(self, file: CsvFile) -> None:
        for column in KNOWN.values():
            if column.required and column.name not in file.names:
                near = close_match(column.name, file.names)
                more = len(file.names) - _LISTED
                names = [*file.names[:_LISTED], *([f"and {more} more"] if more > 0 else [])]
                raise InputError(
                    f"{self._path}: the column {column.name} is missing; the header has "
                    f"{', '.join(names)}.{_meant(near, column.unit)}"
                )
        self.notes = []
        for name in file.names:
            near = "" if name in KNOWN else close_match(name, TABLE_COLUMNS)
            if near and near not in file.names:
                self.notes.append(f'column "{name}" is kept and ignored; is "{near}" meant?')

    # ------------------------------------------------------------------ one block of a column

    def _checked(self, file: CsvFile, block: Block, column: Column, values: Values) -> Values:
        if column.kind == "word":
            return self._checked_words(file, block, column, values)
        if column.finite:
            bad = np.flatnonzero(~np.isfinite(values))
            if len(bad):
                raise self._cell(
                    file,
                    block,
                    column.name,
                    bad[0],
                    "every row needs a finite value",
                    " Leave rows without one out of the table.",
                )
        low, high = self._limits(column)
        bad = np.flatnonzero((values < low) | (values > high))
        if len(bad):
            what = f"allowed: {low:.8g} {column.unit} to {high:.8g} {column.unit}"
            lost = " Where the sensor failed, leave the cell empty." * (column.unit == "degC")
            raise self._cell(file, block, column.name, bad[0], what, f" Is the unit right?{lost}")
        if column.kind == "flag":
            bad = np.flatnonzero(~np.isin(values, (0.0, 1.0)))
            if len(bad):
                raise self._cell(file, block, column.name, bad[0], "wanted: 0 or 1")
            return np.equal(values, 1.0)
        return self._counts(file, block, column, values) if column.kind == "count" else values

    def _limits(self, column: Column) -> tuple[float, float]:
        if column.unit == "degC":
            return SPECIMEN_C if self._meta.robot == "none" else JOINT_C
        return -column.largest, column.largest

    def _counts(self, file: CsvFile, block: Block, column: Column, values: Values) -> Values:
        lowest, wanted = 1, "wanted: a whole number, 1, 2, 3 ..."
        if column.name == "step":
            # below NO_STEP is room for numbers below 0 until all rows are there
            values = np.where(np.isnan(values), NO_STEP, np.where(values < 0, values - 1, values))
            lowest, wanted = -_BIGGEST_COUNT, "wanted: a whole number, or nothing (continuous)"
        with np.errstate(invalid="ignore"):
            good = (values >= lowest) & (values < _BIGGEST_COUNT) & (values == np.floor(values))
        bad = np.flatnonzero(~good)
        if len(bad):
            if abs(values[bad[0]]) >= _BIGGEST_COUNT:
                end, sign = ("largest", "") if values[bad[0]] > 0 else ("smallest", "-")
                wanted += f"; the {end} one is {sign}{_BIGGEST_COUNT - 1}"
            raise self._cell(file, block, column.name, bad[0], wanted)
        return values.astype(np.int64)

    def _checked_words(self, file: CsvFile, block: Block, column: Column, words: Values) -> Values:
        known = self._known_words(column.name)
        bad = np.flatnonzero(~np.isin(words, known))
        if not len(bad):
            return words
        word = str(words[bad[0]])
        hint = did_you_mean(word, known) if word and known != [""] else ""
        if column.name == "branch":
            what, hint = f"allowed: {', '.join(BRANCHES)}", close_to(word, known)
        elif self._meta.robot == "none" and column.name == "pose":
            what = f"robot: none in {self._meta_name} has no poses; remove the column"
        else:
            what = f"{self._meta_name} does not define it"
        raise self._cell(file, block, column.name, bad[0], what, hint)

    def _known_words(self, name: str) -> list[str]:
        if name == "branch":
            return list(BRANCHES)
        if name == "direction":
            return list(self._meta.directions)
        return [""] if self._meta.robot == "none" else list(self._meta.poses)

    def _cell(
        self, file: CsvFile, block: Block, name: str, row: int, what: str, hint: str = ""
    ) -> InputError:
        cell = block.cells(row)[file.names.index(name)]
        unit = unit_of(name)
        value = f'"{csvcells.shown(cell)}"' if cell else "an empty cell"
        with_unit = f"{value} ({unit})" if unit and cell else value
        line = int(block.lines[row])
        return file.error(line, f"column {name}: {with_unit} is not allowed; {what}.{hint}")

    # ------------------------------------------------------------------ what the table leaves out

    def _completed(self, given: dict[str, Values]) -> dict[str, Values]:
        rows = len(given["force_N"])
        defaults: dict[str, Callable[[], Values]] = {
            "time_s": lambda: np.arange(rows, dtype=np.float64),
            "pose": lambda: self._only("pose", self._meta.poses, rows, given),
            "direction": lambda: self._only("direction", self._meta.directions, rows, given),
            "repetition": lambda: np.ones(rows, np.int64),
            "branch": lambda: np.full(rows, "cycle"),
            "step": lambda: np.full(rows, NO_STEP, np.int64),
            "discarded": lambda: empty("flag", rows),
        }
        columns: dict[str, Values] = {}
        for name in TABLE_COLUMNS:
            if name in given:
                columns[name] = given.pop(name)
            elif name in defaults:
                columns[name] = defaults[name]()
                if name == "time_s":
                    self.stand_ins[name] = SAMPLE_NUMBER
        columns["step"] = self._steps(columns["step"])
        self._note_order(columns)
        return columns | given

    def _steps(self, steps: Values) -> Values:
        """Steps of a load the other way, numbered -1, -2 ..., go on behind the others; nothing but
        0 and -1 is a continuous measurement, as data sets and their Parquet tables hold it."""
        below = steps < NO_STEP
        if not below.any():
            return steps
        if steps.max() <= 0 and steps.min() == NO_STEP - 1:
            return np.where(below, NO_STEP, steps)
        last, other = max(int(steps.max()), 0), NO_STEP - steps[below]
        kept = steps.copy()
        kept[below] = last + other
        low, high = int(other.min()), int(other.max())
        self.notes.append(
            f"steps below 0 are numbered on: -{low} is {last + low}"
            + (f" ... -{high} is {last + high}" if high > low else "")
        )
        return kept

    def _only(self, what: str, defined: Iterable[str], rows: int, further: Iterable[str]) -> Values:
        """The one that META defines, for a column that is missing. further: names of columns among
        which it may stand, misspelt."""
        names = list(defined)
        if what == "pose" and self._meta.robot == "none":
            return empty("word", rows)
        if len(names) > 1:
            near = close_match(what, list(further))
            add = f'Rename the column "{near}"' if near else "Add the column"
            raise InputError(
                f"{self._path}: the column {what} is missing, and {self._meta_name} defines "
                f"{len(names)}: {', '.join(names)}. {add}, or leave one in META."
            )
        return np.full(rows, names[0])

    def _note_order(self, columns: Mapping[str, Values]) -> None:
        """Rows stand in the order of measurement; a clock that goes back is worth a word."""
        self._check_order(columns)
        run = [columns[n] for n in ("pose", "direction", "repetition")]
        same = np.logical_and.reduce([c[1:] == c[:-1] for c in run])
        back = np.flatnonzero(same & (np.diff(columns["time_s"]) < 0))
        if len(back):
            often = counted(len(back), "time")
            self.notes.append(f"time_s goes back {often}, first at sample {back[0] + 2}")
        if "session_s" in columns and np.any(np.diff(columns["session_s"]) < 0):
            at = int(np.flatnonzero(np.diff(columns["session_s"]) < 0)[0])
            self.notes.append(f"session_s goes back, first at sample {at + 2}")

    def _check_order(self, columns: Mapping[str, Values]) -> None:
        """InputError for rows in another order than they were measured in."""
        name = "session_s" if "session_s" in columns else "time_s"
        clock = columns[name]
        change, low = np.diff(clock), float(clock.min())
        if len(clock) > _FEW and np.all(change <= 0) and np.any(change < 0):
            raise InputError(
                f"{self._path}: {name} counts down, from {clock[0]:g} to {clock[-1]:g} s. Turn it "
                "round, so that it grows from sample to sample."
            )
        # one of runs, of steps or of days starts anew with each of them, at about its least
        anew = clock[1:] <= low + _STARTS * float(np.ptp(clock))
        back = np.flatnonzero((change < 0) & ~anew)
        if len(back) < _FEW or len(back) < _OUT_OF_ORDER * (len(clock) - 1):
            return
        at = int(back[0])
        raise InputError(
            f"{self._path}: the rows are not in the order of measurement: {name} goes back "
            f"{len(back)} times (but for starts anew) in {len(clock)} samples, first from "
            f"{clock[at]:g} to {clock[at + 1]:g} s at sample {at + 2}. Sort the rows by the time "
            "they were taken at."
        )


_FEW, _OUT_OF_ORDER = 5, 0.1  # times; share of the steps
_STARTS = 0.1  # of what a clock counts


def _meant(near: str, unit: str) -> str:
    """What to do with a column whose name is nearly that of a missing one, in `unit`."""
    if not near:
        return ""
    if near.lower().endswith(f"_{unit.lower()}"):
        return f' Is it "{near}"? Rename it.'
    return f' Is it "{near}"? Convert its values to {unit}, then rename it.'


def _reading(name: str, words: set[str]) -> csvcells.Reading:
    if name in TABLE_COLUMNS:
        return "word" if KNOWN[name].kind == "word" else "number"
    return "word" if name in words else "further"
