"""A table's bytes: header, comment lines, and blocks of rows that all have the right cell count.

Works on blocks of some megabytes, so that a table of any length is read in constant memory, with
exact line numbers for messages. Knows nothing of what the columns mean.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from rig.errors import InputError
from rig.storage.files import check_regular, neighbours

BLOCK_BYTES = 8_000_000
MOST_COLUMNS = 2_000
_KEPT_COMMENTS = 200
_FOREIGN = (
    (b"PK\x03\x04", "an Excel or zip file; save the sheet as CSV (UTF-8)"),
    (b"\x1f\x8b", "a gzip file; unpack it first"),
    (b"\x89HDF", "an HDF5 file, not a table (CSV); a data set needs no import"),
    (b"PAR1", "a Parquet file; export it as CSV"),
    (b"\xff\xfe", "UTF-16 text; save it as CSV UTF-8"),
    (b"\xfe\xff", "UTF-16 text; save it as CSV UTF-8"),
)
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_COLUMNS_WANTED = "force_N and displacement_mm at least"


@dataclass(frozen=True)
class Block:
    """Rows as bytes, one a line, without blank and comment lines; `lines`: their line numbers."""

    raw: bytes
    lines: NDArray[np.int64]

    def cells(self, row: int) -> list[str]:
        """Cells of one row, spaces around them removed."""
        return split_line(self.raw.split(b"\n", row + 1)[row].decode("utf-8"))


class CsvFile:
    """An open table: `names` of its columns, `comments` so far, and `blocks()`, once."""

    def __init__(self, path: Path) -> None:
        """Opens the file and reads its header; InputError if that is none. Close with `with`."""
        self.path = path
        self.comments: list[str] = []
        self._line = 0
        try:
            check_regular(path, "a table")
            self.size = path.stat().st_size
            self._file: BinaryIO = path.open("rb")
        except FileNotFoundError as error:
            hint = neighbours(path, "*.csv")
            raise InputError(f"{path}: cannot be read: no such file.{hint}") from error
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}.") from error
        try:
            self.names = self._header()
        except InputError:
            self._file.close()
            raise

    def __enter__(self) -> CsvFile:
        """Closes the file at the end of a `with` block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Closes the file."""
        self._file.close()

    @property
    def fraction(self) -> float:
        """How much of the file has been read, 0 to 1."""
        return self._file.tell() / max(1, self.size)

    def error(self, line: int, what: str) -> InputError:
        """A message about one line."""
        return InputError(f"{self.path}:{line}: {what}")

    # ------------------------------------------------------------------ header

    def _header(self) -> list[str]:
        head = self._read(lambda: self._file.read(4))
        for magic, what in _FOREIGN:
            if head.startswith(magic):
                raise InputError(f"{self.path}: {what}.")
        self._file.seek(3 if head[:3] == b"\xef\xbb\xbf" else 0)
        while raw := self._read(self._first_line):
            self._check_text(raw)
            text = raw.decode("utf-8").rstrip("\r\n")
            self._line += 1
            if text.lstrip().startswith("#"):
                self._comment(text)
            elif text.strip():
                return self._names(text)
        what = "empty" if self.size == 0 else "no header row"
        raise InputError(
            f"{self.path}: {what}; wanted: a first row with the names of the columns, "
            f"{_COLUMNS_WANTED}."
        )

    def _first_line(self) -> bytes:
        """The next line; line ends of old Macs (a lone CR) are known here, too."""
        raw = self._file.readline(1_000_000)
        cut = raw.find(b"\r") + 1
        if 0 < cut < len(raw) and raw[cut : cut + 1] != b"\n":
            self._file.seek(cut - len(raw), os.SEEK_CUR)
            raw = raw[:cut]
        return raw

    def _names(self, text: str) -> list[str]:
        if "," not in text:
            self._check_separator(text)
        names = self.split(text, self._line)
        numbers = [n for n in names if _NUMBER.fullmatch(n)]
        if numbers and len(numbers) >= len(names) / 2:
            raise self.error(
                self._line,
                f"no header row: the first row holds numbers ({', '.join(names[:4])} ...); wanted: "
                f"the names of the columns, {_COLUMNS_WANTED}.",
            )
        if len(names) > MOST_COLUMNS:
            raise self.error(
                self._line,
                f"{len(names)} columns; at most {MOST_COLUMNS} are read. Remove those that rig "
                "does not know: they would be kept, and not be used.",
            )
        for index, name in enumerate(names):
            if not name:
                raise self.error(
                    self._line, f"column {index + 1} has no name (a comma too many?); name it."
                )
            if name in names[:index]:
                first = names.index(name) + 1
                raise self.error(
                    self._line,
                    f'the column "{name}" is there twice (columns {first} and {index + 1}); '
                    "rename or remove one.",
                )
        return names

    def _check_separator(self, text: str) -> None:
        for mark, word in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
            if mark in text:
                raise self.error(
                    self._line,
                    f"the columns are separated by {word}; wanted: commas between the columns and "
                    "a point as decimal mark. Save the table so, or replace the characters.",
                )

    def _comment(self, text: str) -> None:
        if len(self.comments) < _KEPT_COMMENTS:
            self.comments.append(text.strip()[:1000])

    # ------------------------------------------------------------------ rows

    def blocks(self) -> Iterator[Block]:
        """All rows, in blocks; InputError at the first that is no row of this table."""
        while raw := self._read(lambda: self._file.read(BLOCK_BYTES)):
            if not raw.endswith(b"\n"):
                raw += self._read(self._file.readline)
            block = self._block(raw)
            if len(block.lines):
                yield block

    def _block(self, raw: bytes) -> Block:
        if b"\r" in raw:
            raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if not raw.endswith(b"\n"):
            raw += b"\n"
        self._check_text(raw)
        octets = np.frombuffer(raw, np.uint8)
        ends = np.flatnonzero(octets == ord("\n"))
        starts = np.concatenate(([0], ends[:-1] + 1))
        lines = self._line + 1 + np.arange(len(ends))
        self._line += len(ends)
        suspects = self._suspects(octets, starts, ends)
        keep = np.ones(len(ends), np.bool_)
        for row in np.flatnonzero(suspects):
            text = raw[starts[row] : ends[row]].decode("utf-8")
            keep[row] = self._is_row(text, int(lines[row]))
        if not keep.all():
            pieces = raw.split(b"\n")
            raw = b"".join(pieces[row] + b"\n" for row in np.flatnonzero(keep))
        return Block(raw, lines[keep])

    def _suspects(
        self, octets: NDArray[np.uint8], starts: NDArray[np.int64], ends: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """(lines,) bool: what is not plainly a row: comment, blank, with quotes, other count."""
        commas = np.flatnonzero(octets == ord(","))
        count = np.searchsorted(commas, ends) - np.searchsorted(commas, starts)
        suspects: NDArray[np.bool_] = count != len(self.names) - 1
        suspects |= np.isin(octets[starts], np.frombuffer(b'# \t"', np.uint8))
        quotes = np.flatnonzero(octets == ord('"'))
        suspects[np.searchsorted(ends, quotes)] = True
        return suspects

    def _is_row(self, text: str, line: int) -> bool:
        if text.lstrip().startswith("#"):
            self._comment(text)
            return False
        if not text.strip():
            return False
        cells = self.split(text, line)
        if len(cells) != len(self.names):
            raise self.error(line, self._wrong_count(text, cells))
        return True

    def _wrong_count(self, text: str, cells: Sequence[str]) -> str:
        wanted = len(self.names)
        what = f"{len(cells)} cell{'s' * (len(cells) != 1)}, but the header names {wanted} columns"
        if len(cells) < wanted:
            missing = ", ".join(self.names[len(cells) :][:4])
            hint = f"nothing for {missing}. Was the file cut off? Complete or remove the row."
            if ";" in text:
                hint = "wanted: commas between the cells, not semicolons."
            return f"{what}; {hint}"
        hint = "Remove what is too much, or name it in the header."
        if (
            len(cells) >= 2 * wanted - 1
            or all(c.lstrip("-+").isdigit() for c in cells if c)
            or _decimal_commas(cells) >= len(cells) - wanted >= _SEVERAL
        ):
            hint = "If the numbers have decimal commas, write points instead."
        return f"{what}. {hint}"

    def split(self, text: str, line: int) -> list[str]:
        """Cells of one line; InputError for quotes that do not match."""
        try:
            return split_line(text)
        except csv.Error as error:
            raise self.error(
                line, f"quotes that do not match ({error}); a cell in quotes must end in its line."
            ) from error

    def _check_text(self, raw: bytes) -> None:
        if b"\0" in raw:
            line = self._line + 1 + raw.count(b"\n", 0, raw.index(b"\0"))
            raise self.error(line, "binary data; a text file is wanted.")
        if raw.isascii():
            return
        try:
            raw.decode("utf-8")
        except UnicodeDecodeError as error:
            line = self._line + 1 + raw.count(b"\n", 0, error.start)
            raise self.error(
                line, f"the byte 0x{raw[error.start]:02X} is no UTF-8 text; save the file as UTF-8."
            ) from error

    def _read(self, read: Callable[[], bytes]) -> bytes:
        try:
            return read()
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read: {error.strerror or error}.") from error


_SEVERAL = 2  # one cell too many has other causes, too


def _decimal_commas(cells: Sequence[str]) -> int:
    """How many numbers may have been cut in two at a decimal comma: digits follow digits."""
    found, row = 0, 0
    while row < len(cells) - 1:
        cut = cells[row].lstrip("-+").isdigit() and cells[row + 1].isdigit()
        found += cut
        row += 1 + cut
    return found


def split_line(text: str) -> list[str]:
    """Cells of one line; raises csv.Error for quotes that do not match."""
    return [cell.strip() for cell in next(csv.reader([text], strict=True, skipinitialspace=True))]


def close_match(word: str, known: Sequence[str]) -> str:
    """A known word so near that a slip of the finger is likely, whatever its capitals; else ""."""
    lower = {name.lower(): name for name in known}
    return lower.get(next(iter(get_close_matches(word.lower(), lower, n=1, cutoff=0.85)), ""), "")
