"""Files that are whole or not there."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rig.errors import InputError, did_you_mean

_MOST_NAMED = 40
_NO_UTF8 = re.compile("[\ud800-\udfff]")  # what Python puts in the place of such bytes
ENDINGS = (".h5", ".hdf5")  # of data sets, in any case of letters


def check_ending(path: Path) -> None:
    """InputError for a new data set whose name says it is something else."""
    if path.suffix.lower() not in ENDINGS:
        raise InputError(
            f"{path}: a data set is an HDF5 file; allowed endings: {', '.join(ENDINGS)}. "
            f"Choose another name with -o, such as {path.with_suffix('.h5').name}."
        )


def check_regular(path: Path, wanted: str) -> None:
    """InputError for a pipe or a device, whose opening alone may wait for ever. wanted: what is
    to be read there."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise InputError(
            f"{path}: is a pipe or a device, which can be read once only; {wanted} is read more "
            "often. Write it to a file, and give that."
        )


def legible(name: str | Path) -> str:
    """A file's name, or text that holds one, as it can be shown and stored: bytes that are no UTF-8
    become replacement characters."""
    return _NO_UTF8.sub("\N{REPLACEMENT CHARACTER}", str(name))


@contextmanager
def in_place_of(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`; on success its file is synced and takes the place of `path`.

    InputError if the folder or the disk refuses; the older file is then untouched.
    """
    try:
        descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        os.close(descriptor)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(0o644)
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            temporary.replace(path)
            sync_folder(path.parent)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(
            f"{path}: cannot be written: {reason}. Choose another folder, or make room."
        ) from error


def check_folder(path: Path, option: str = "") -> None:
    """Before long work whose result would be lost; InputError where the folder is not there."""
    if not path.parent.is_dir():
        raise InputError(
            f"{option}{path}: the folder {path.parent} does not exist. Create it first."
        )


def check_writable(path: Path) -> None:
    """InputError where no new file can be made beside `path`. It is tried: permissions alone do not
    tell (/proc, a medium that is full or write-protected, a name that is too long)."""
    try:
        descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        os.close(descriptor)
        Path(name).unlink()
    except OSError as error:
        raise InputError(
            f"{path}: nothing can be written into the folder {path.parent} "
            f"({error.strerror or error}). Choose another with -o."
        ) from error


def neighbours(path: Path, *patterns: str) -> str:
    """For a file that is not there: the one that may have been meant, by what stands before the
    ending, or those that there are; nothing where there are none."""
    there = path.parent.is_dir()
    found = sorted(f for p in patterns for f in path.parent.glob(p)) if there else []
    near = {p.stem: p.name for p in found[:_MOST_NAMED]}
    return did_you_mean(path.stem, near, near.__getitem__)


def sync_folder(folder: Path) -> None:
    """Makes names in a folder durable; on Windows the file system does it by itself."""
    if sys.platform == "win32":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
