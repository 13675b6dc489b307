"""What marks a file as a data set, and its bytes as whole: looked at before the HDF5 library is.

The layout is that of `rig.storage.hdf5`. Nothing here needs the HDF5 library, so that a folder of
known files is listed without loading it.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

from rig.errors import InputError
from rig.storage.files import ENDINGS, check_regular, neighbours

SCHEMA = "rig.dataset"
SEAL = b"\n# rig.dataset sha256 "
# What h5py raises on files that are damaged in one way or another.
BROKEN = (
    OSError,
    RuntimeError,
    KeyError,
    ValueError,
    TypeError,
    AttributeError,
    IndexError,
    OverflowError,
    MemoryError,
    RecursionError,
)
_MAGIC = b"\x89HDF\r\n\x1a\n"


def damaged(path: Path, what: str) -> InputError:
    """The message about a file that is not what was written. Only a measurement that was cut short
    keeps its journal; with that beside it the file itself is not read."""
    return InputError(
        f"{path}: damaged: {what} Restore it from a copy. Without one: lay {path.name}.journal "
        "beside it, if the measurement was cut short, and `rig` reads that instead; import a table "
        "again with `rig import`."
    )


def check_bytes(path: Path) -> str:
    """Magic number and seal, before the HDF5 library sees the file; InputError where they fail.
    The SHA-256 that the seal states, "" where another program has left none."""
    sha256, wrong = "", ""
    try:
        if path.is_dir():
            raise InputError(
                f"{path}: a folder; a data set (.h5) is wanted. `rig list {path}` shows those in "
                "it."
            )
        check_regular(path, "a data set")
        with path.open("rb") as file:
            head = file.read(len(_MAGIC))
            if head == _MAGIC:
                sha256, wrong = _checked_seal(file)
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        hint = neighbours(path, *(f"*{e}" for e in ENDINGS)) if missing else ""
        reason = "no such file" if missing else error.strerror
        raise InputError(f"{path}: cannot be read: {reason}.{hint}") from error
    if head != _MAGIC:
        found = "an empty file" if not head else "no HDF5 file"
        hint = " A table comes in with `rig import`." if path.suffix in (".csv", ".txt") else ""
        raise InputError(f"{path}: {found}; a data set (.h5) is wanted.{hint}")
    if wrong:
        raise damaged(path, wrong)
    return sha256


def seal_of(path: Path) -> str:
    """SHA-256 of the bytes as the file's last line states it, unchecked; "" where there is none, or
    where something was cut off or added. OSError if the file can't be read."""
    length = len(SEAL) + 65
    with path.open("rb") as file:
        head = file.read(48)
        size = file.seek(0, os.SEEK_END)
        if len(head) < 48 or not head.startswith(_MAGIC) or head[8] != 0 or size < length:
            return ""
        end = file.seek(size - length)
        line = file.read()
    stated = int.from_bytes(head[40:48], "little")
    if end != stated or not line.startswith(SEAL):
        return ""
    return line[len(SEAL) : -1].decode("ascii", "replace")


def _checked_seal(file: BinaryIO) -> tuple[str, str]:
    """SHA-256 of the bytes, "" without a seal; and what is wrong with them, "" for nothing.

    The file knows where its HDF5 data end (layout of the superblock: HDF5 File Format
    Specification, II.A, version 0, which `write_file` asks for). Behind there stands the seal, or
    nothing if another program has changed the file.
    """
    file.seek(0)
    head = file.read(48)
    size = file.seek(0, os.SEEK_END)
    if len(head) < 48 or head[8] != 0:  # another version of the superblock: another program's file
        return "", ""
    end = int.from_bytes(head[40:48], "little")
    if size < end:
        return "", f"{size} bytes are left of {end}: cut off while copying?"
    file.seek(0)
    sha = hashlib.sha256()
    rest = end
    while rest and (piece := file.read(min(rest, 1 << 20))):
        sha.update(piece)
        rest -= len(piece)
    seal = SEAL + sha.hexdigest().encode() + b"\n"
    if size == end:
        return "", ""
    if file.read(len(seal) + 1) == seal:
        return sha.hexdigest(), ""
    return "", "its bytes have changed since it was written."
