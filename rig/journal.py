"""The append-only journal: the truth while measuring.

One JSON object a line, with a number and a CRC each. `append` returns after fsync: what it
acknowledged survives kill -9 and a loss of power (of a run that is emulated faster than real time:
kill -9). The HDF5 file is only ever built from it.
"""

from __future__ import annotations

import errno
import json
import math
import os
import sys
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.errors import InputError, MeasurementStopped
from rig.storage.files import check_regular, sync_folder

KINDS = ("start", "descriptor", "sample", "event", "stop")
SCHEMA = "rig.journal/1"
_PREFIX = '{"crc":"'
_CRC_DIGITS = 8
_BODY_AT = len(_PREFIX) + _CRC_DIGITS + len('",')
_ASKING_S = 0.2  # `is_being_written` holds the lock for far less


class JournalError(MeasurementStopped):
    """The journal can't be written any more: disk full, medium gone. What it holds is kept."""


@dataclass(frozen=True, slots=True)
class Record:
    """One line. Numbers that are none (nan) read back as None."""

    number: int
    kind: str
    data: dict[str, Any]


def journal_path(dataset: Path) -> Path:
    """The journal lies beside its data set."""
    return dataset.parent / f"{dataset.name}.journal"  # a folder has no name to replace


class Journal:
    """An open journal, locked against a second writer. Made by `create` or `reopen`."""

    def __init__(self, path: Path, descriptor: int, synced: bool = True) -> None:
        """Use `create` or `reopen`."""
        self.path = path
        self._synced = synced
        self.records: list[Record] = []  # what `reopen` found
        self._fd = descriptor
        # Records, and bytes of them: acknowledged, and with the one being written. Each pair is
        # assigned as one, for a signal may raise KeyboardInterrupt between any two statements.
        self._done = (0, 0)
        self._begun = (0, 0)
        self._failed = ""

    @classmethod
    def create(cls, path: Path, start: Mapping[str, Any], synced: bool = True) -> Journal:
        """A new journal that begins with a start record; InputError if it exists already.

        synced: False where a clock runs ahead: what is emulated a hundred times faster than it
        could be measured would stand still for a minute while a disk takes its time.
        """
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        try:
            descriptor = os.open(path, flags, 0o644)
        except FileExistsError:
            raise InputError(
                f"{path}: a journal of an earlier measurement is there. "
                "Go on with it (--resume), or choose another name for the data set."
            ) from None
        except OSError as error:
            raise InputError(
                f"{path}: cannot be created: {error.strerror or error}. "
                "Choose another folder with -o."
            ) from error
        journal = cls(path, descriptor, synced)
        try:
            _lock(descriptor, path)
            journal.append("start", {"schema": SCHEMA, **start})
            sync_folder(path.parent)
        except (InputError, JournalError, OSError):
            journal.close()
            path.unlink(missing_ok=True)
            raise
        return journal

    @classmethod
    def reopen(cls, path: Path, synced: bool = True) -> Journal:
        """Goes on with a journal; a torn last line, and nothing else, is cut off. synced: as for
        `create`.

        `records` then holds what was there. InputError if it is missing, damaged before its last
        line, or being written by another process.
        """
        try:
            descriptor = os.open(path, os.O_RDWR | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise InputError(
                f"{path}: cannot be opened: {error.strerror or error}. "
                "Without its journal a measurement can't be resumed."
            ) from error
        journal = cls(path, descriptor, synced)
        try:
            _lock(descriptor, path)
            journal._resume()
        except (InputError, OSError):
            journal.close()
            raise
        return journal

    def _resume(self) -> None:
        content = self.path.read_bytes()
        self.records, good = _parse(content, self.path)
        os.ftruncate(self._fd, good)
        os.lseek(self._fd, good, os.SEEK_SET)
        if content[good - 1 : good] != b"\n":  # killed between the record and its line end
            self._write(b"\n")
            good += 1
        self._begun = self._done = (len(self.records), good)

    def append(self, kind: str, data: Mapping[str, Any]) -> int:
        """Writes one record and returns its number once it is on disk.

        kind: one of `KINDS`; data: what JSON can hold, numbers of numpy too; nan becomes null.
        JournalError when the disk refuses; the journal then ends at its last whole record and
        takes no more.
        """
        if kind not in KINDS:
            raise ValueError(f'record kind "{kind}" is not one of {", ".join(KINDS)}')
        if self._failed:
            raise JournalError(self._failed)
        number, size = self._settled()
        line = _line(number, kind, data)
        self._begun = (number + 1, size + len(line))
        self._write(line)
        self._done = self._begun
        return number

    def _settled(self) -> tuple[int, int]:
        """Records and bytes so far. A record that a signal interrupted counts where it was written
        whole, and is cut off where it was not; else the next one would bear its number too."""
        if self._begun != self._done:
            if os.lseek(self._fd, 0, os.SEEK_CUR) >= self._begun[1]:
                self._done = self._begun
            else:
                os.ftruncate(self._fd, self._done[1])
                os.lseek(self._fd, self._done[1], os.SEEK_SET)
                self._begun = self._done
        return self._done

    def close(self) -> None:
        """Releases the lock; may be called twice."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def __enter__(self) -> Journal:
        """Closes itself at the end of a `with` block."""
        return self

    def __exit__(self, *_: object) -> None:
        """As `close`."""
        self.close()

    def _write(self, line: bytes) -> None:
        try:
            rest = memoryview(line)
            while rest:
                rest = rest[os.write(self._fd, rest) :]
            if self._synced:
                os.fsync(self._fd)
        except OSError as error:
            raise self._give_up(error) from error

    def _give_up(self, error: OSError) -> JournalError:
        self._failed = (
            f"{self.path}: record {self._done[0]} could not be written: {error.strerror or error}. "
            f"Everything up to record {self._done[0] - 1} is kept. Unload the arm, make room "
            "or repair the disk, and go on with --resume."
        )
        try:
            os.ftruncate(self._fd, self._done[1])
        except OSError:
            self._failed += " (Its torn last line will be dropped then.)"
        return JournalError(self._failed)


def replay(path: Path) -> list[Record]:
    """All records; a torn last line is passed over, damage before it is an InputError."""
    try:
        check_regular(path, "a journal")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}.") from error
    return _parse(content, path)[0]


def _line(number: int, kind: str, data: Mapping[str, Any]) -> bytes:
    fields = {"number": number, "kind": kind, "data": _plain(data)}
    body = json.dumps(fields, ensure_ascii=False, allow_nan=False, separators=(",", ":"))[1:]
    raw = body.encode("utf-8", "backslashreplace")
    return f'{_PREFIX}{zlib.crc32(raw):08x}",'.encode() + raw + b"\n"


def _plain(value: object) -> object:
    """Values of JSON: numpy's numbers and arrays become Python's, what is not finite None."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    raise TypeError(f"a journal record cannot hold {type(value).__name__}")


def _parse(content: bytes, path: Path) -> tuple[list[Record], int]:
    """Records, and the number of bytes up to the end of the last whole one."""
    records: list[Record] = []
    at = 0
    while at < len(content):
        end = content.find(b"\n", at)
        stop = len(content) if end < 0 else end
        line = content[at:stop]
        record = _record(line)
        if record is None:
            # A torn record has lost its end. After a loss of power it may also be filled with
            # zeros. Anything else in a finished line was changed after it had been acknowledged.
            if end < 0 or (b"\0" in line and not content[stop:].strip(b"\0\n")):
                break
            raise _damaged(path, len(records), "its checksum does not fit")
        if record.number != len(records):
            raise _damaged(path, len(records), f"it has the number {record.number}")
        records.append(record)
        at = stop if end < 0 else end + 1
    if not records:
        raise InputError(f"{path}: holds no whole record. Remove it, and measure anew.")
    schema = records[0].data.get("schema")
    if records[0].kind != "start" or schema != SCHEMA:
        raise InputError(
            f"{path}: its first record is no start of {SCHEMA} but {records[0].kind} of {schema}. "
            "It was written by another program or version."
        )
    return records, at


def _damaged(path: Path, number: int, what: str) -> InputError:
    return InputError(
        f"{path}:{number + 1}: damaged: {what} (record {number}). Restore the file from a copy, "
        f"or cut it off before line {number + 1} to keep the {number} records before it."
    )


def _record(line: bytes) -> Record | None:
    """The record of a line, or None where the line is none or has changed."""
    body = line[_BODY_AT:]
    head = f'{_PREFIX}{zlib.crc32(body):08x}",'.encode()
    if line[:_BODY_AT] != head:
        return None
    try:
        fields = json.loads(b"{" + body)
        return Record(int(fields["number"]), str(fields["kind"]), dict(fields["data"]))
    except (ValueError, KeyError, TypeError):
        return None


def is_being_written(path: Path) -> bool:
    """Whether a measurement holds the journal now. False, too, where that can't be asked."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    except OSError:
        return False
    try:
        _take_lock(descriptor, exclusive=False)
    except OSError as refused:
        return refused.errno in (errno.EACCES, errno.EAGAIN, errno.EDEADLK)
    finally:
        os.close(descriptor)  # and with it the lock
    return False


def _lock(descriptor: int, path: Path) -> None:
    """The operating system releases the lock when the process ends, however it ends."""
    deadline = time.monotonic() + _ASKING_S
    while True:
        try:
            return _take_lock(descriptor, exclusive=True)
        except OSError:
            if time.monotonic() > deadline:
                raise InputError(
                    f"{path}: another measurement is writing this journal. "
                    "End it, or choose another name."
                ) from None
        time.sleep(_ASKING_S / 20)


def _take_lock(descriptor: int, *, exclusive: bool) -> None:
    """OSError where another process has it."""
    if sys.platform == "win32":
        import msvcrt

        # Windows locks are mandatory: one byte far beyond the end, so that reading goes on.
        os.lseek(descriptor, 1 << 40, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        os.lseek(descriptor, 0, os.SEEK_SET)
    else:
        import fcntl

        fcntl.flock(descriptor, (fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH) | fcntl.LOCK_NB)
