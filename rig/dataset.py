"""Data sets: what a measurement or an imported table is, in memory and from its journal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from rig.errors import InputError
from rig.journal import Record, journal_path, replay
from rig.meta import Meta
from rig.software import software_version
from rig.storage.columns import Values
from rig.yaml.yamlfile import load_yaml_text

Origin = Literal["measured", "emulated", "imported"]
ORIGINS: tuple[Origin, ...] = ("measured", "emulated", "imported")
TEXTS = ("protocol", "station", "meta")


@dataclass(frozen=True)
class Dataset:
    """One measuring session, or one imported table, of n samples in the order of measurement.

    columns: name -> array of shape (n,): float64, int64, bool or text ("U"). Always there:
    time_s, pose ("" without an arm), direction, repetition, branch, step (-1: none, continuous),
    force_N, displacement_mm, discarded. Measured ones also: session_s, target_N, segment, number,
    lateness_s, every signal of the devices, and per device <device>_count, <device>_invalid,
    <device>_age_s; <name>_errors is the standard deviation of the single values within a sample.
    units, long_names: per column. events: what happened, each with `kind`, `text`, and in
    `sample` the number of samples before it. texts: "protocol", "station", "meta" as they were
    given, and "comments" of an imported table. created: ISO 8601 with offset; session_s counts
    from there in measured data.
    """

    path: Path | None
    uuid: str
    created: str
    origin: Origin
    complete: bool
    meta: Meta
    columns: dict[str, Values]
    units: dict[str, str]
    long_names: dict[str, str]
    events: list[dict[str, Any]] = field(default_factory=list)
    texts: dict[str, str] = field(default_factory=dict)
    devices: dict[str, dict[str, str]] = field(default_factory=dict)
    calibration: dict[str, Any] = field(default_factory=dict)
    software: str = ""
    stop_reason: str = ""
    title: str = ""

    @property
    def rows(self) -> int:
        """Number of samples, discarded ones included."""
        return len(self.columns["force_N"])

    @property
    def imported(self) -> bool:
        """True if it came from a table; `origin` is "emulated" where that table says so."""
        return "comments" in self.texts

    @property
    def used(self) -> Values:
        """(n,) bool: samples that were not discarded."""
        return ~self.columns["discarded"]

    def banners(self) -> tuple[str, ...]:
        """What every output has to say of this data set before anything else."""
        lines = []
        if self.origin == "emulated":
            lines.append(
                "EMULATED: these values come from simulated devices; nothing was measured."
            )
        if not self.complete:
            first = self.stop_reason.partition(". ")[0].rstrip(".")  # no remedy of that day
            reason = f" ({first})" if first else ""
            lines.append(f"INCOMPLETE: the measurement did not reach its end{reason}.")
        return tuple(lines)


def from_records(records: list[Record], path: Path | None = None) -> Dataset:
    """The data set that a journal's records tell; InputError when they don't fit together.

    path: of the data set, for messages and for the result.
    """
    from rig.storage.records import Story

    name = str(journal_path(path)) if path else "journal"
    story = Story(records, name)
    start = story.start
    meta_text = story.text("meta")
    origin = start.get("origin")
    if origin not in ORIGINS:
        raise InputError(f'{name}:1: origin is "{origin}"; allowed: {", ".join(ORIGINS)}.')
    return Dataset(
        path=path,
        uuid=str(start.get("uuid", "")),
        created=str(start.get("created", "")),
        origin=cast(Origin, origin),
        complete=story.complete,
        meta=load_yaml_text(meta_text, f"{name}:1: meta", Meta),
        columns=story.columns,
        units=story.units,
        long_names=story.long_names,
        events=story.events,
        texts={key: story.text(key) for key in TEXTS},
        devices=story.devices,
        calibration=story.calibration,
        software=str(start.get("software") or software_version()),
        stop_reason=story.stop_reason,
        title=str(start.get("title", "")),
    )


def write(dataset: Dataset, path: Path) -> None:
    """Writes the HDF5 file under a temporary name, then puts it in place of `path`.

    An older file stays whole until the new one is on disk. InputError if the folder refuses.
    """
    from rig.storage.hdf5 import write_file

    write_file(dataset, path)


def load(path: Path) -> Dataset:
    """The data set of an HDF5 file, or of the journal that lies beside it.

    A journal is there while a measurement goes on or after it was cut short; it then is the truth,
    whatever the HDF5 file holds. InputError naming file, group and column for anything wrong.
    """
    from rig.storage.hdf5read import read_file, read_uuid

    journal = journal_path(path)
    if not journal.exists():
        return read_file(path)
    dataset = from_records(replay(journal), path)
    stored = read_uuid(path)
    if stored and stored != dataset.uuid:
        raise InputError(
            f"{path}: the journal beside it, {journal.name}, belongs to another measurement "
            f"({dataset.uuid} instead of {stored}). Move one of the two elsewhere."
        )
    return dataset


def load_each(paths: Sequence[Path]) -> list[Dataset]:
    """The data sets of several files, in their order; InputError where two are the same: counted
    twice it would narrow the intervals without a new measurement."""
    datasets = [load(path) for path in paths]
    known: dict[str, Path] = {}
    for path, dataset in zip(paths, datasets, strict=True):
        name = dataset.uuid or str(path)
        other = known.get(name)
        known[name] = path
        if other is None:
            continue
        which = "is given twice"
        if other != path:
            which = f"is the same data set as {other} (UUID {dataset.uuid})"
        raise InputError(f"{path}: {which}; every measurement counts once. Leave one of them out.")
    return datasets


def finish(path: Path) -> Dataset:
    """Builds the HDF5 file from the journal beside `path`, reads it back, and removes the journal
    if the measurement is complete. An incomplete one keeps it, to be resumed."""
    from rig.storage.hdf5read import read_file

    journal = journal_path(path)
    dataset = from_records(replay(journal), path)
    write(dataset, path)
    stored = read_file(path)
    if stored.rows != dataset.rows:
        raise InputError(f"{path}: {stored.rows} samples read back, {dataset.rows} written.")
    if stored.complete:
        journal.unlink()
    return stored


def equal(first: Dataset, second: Dataset) -> bool:
    """Same samples, names and texts; paths aside. nan equals nan."""
    if first.columns.keys() != second.columns.keys():
        return False
    same = all(_same(first.columns[n], second.columns[n]) for n in first.columns)
    fields = (
        "uuid",
        "created",
        "origin",
        "complete",
        "meta",
        "units",
        "long_names",
        "events",
        "texts",
        "devices",
        "calibration",
        "software",
        "stop_reason",
        "title",
    )
    return same and all(getattr(first, f) == getattr(second, f) for f in fields)


def _same(a: Values, b: Values) -> bool:
    return a.dtype.kind == b.dtype.kind and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
