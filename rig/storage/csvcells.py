"""From rows of text to columns of numbers and words.

Two readers of one meaning: pandas' parser for whole blocks, and a plain one that reads a block cell
by cell where the fast one stumbles; it either names the first wrong cell or reads what is unusual
and right. The plain one decides what is allowed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import BytesIO
from typing import Any, Literal

import numpy as np

from rig.storage.columns import Values, unit_of
from rig.storage.csvblocks import Block, CsvFile

Reading = Literal["number", "word", "further"]

MISSING = ("", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "n/a", "null", "NULL", "None", "#N/A")
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_INFINITE = {"inf", "+inf", "-inf", "infinity", "+infinity", "-infinity"}
_SPACE_AT_END = re.compile(rb"[ \t]+(?=[,\n])")
_TRUTHS = (b"true", b"True", b"TRUE", b"false", b"False", b"FALSE")
_GROUPED = re.compile(rb"\d_\d")  # a number to Python, and to pandas beside very large ones
_QUOTED = 80


class TextColumns(Exception):
    """Further columns that turned out to hold text; the table is read again with them as words."""

    def __init__(self, names: set[str]) -> None:
        """`names`: of the columns."""
        super().__init__(", ".join(names))
        self.names = names


def parse(file: CsvFile, block: Block, readings: Mapping[str, Reading]) -> dict[str, Values]:
    """Columns of a block: float64 (nan where a cell is empty) or text.

    readings: how each of the file's columns is to be read; "further" ones are numbers as long as
    they can be. InputError for a cell of a "number" column that is none, `TextColumns` for a
    "further" column with text.
    """
    columns = _parse_fast(file, block, readings)
    return _parse_plain(file, block, readings) if columns is None else columns


def _parse_fast(
    file: CsvFile, block: Block, readings: Mapping[str, Reading]
) -> dict[str, Values] | None:
    import pandas as pd

    raw = block.raw
    if _GROUPED.search(raw):
        return None
    if b'"' not in raw and (b" ," in raw or b" \n" in raw or b"\t" in raw):
        raw = _SPACE_AT_END.sub(b"", raw)
    names = [str(i) for i in range(len(file.names))]
    words = {i for i, name in zip(names, file.names, strict=True) if readings[name] == "word"}
    # not "category": that takes 00 and 0 for one word
    dtype: Any = {i: "str" if i in words else "float64" for i in names}
    numbers = [i for i in names if i not in words]
    try:
        frame = pd.read_csv(
            BytesIO(raw),
            header=None,
            names=names,
            index_col=False,
            dtype=dtype,
            engine="c",
            na_values={i: list(MISSING) for i in numbers},
            keep_default_na=False,
            skipinitialspace=True,
            low_memory=False,
            **_exact_floats(pd.__version__),
        )
    except (ValueError, OverflowError, TypeError):
        return None
    if len(frame) != len(block.lines):
        return None
    truths = any(word in raw for word in _TRUTHS)
    columns: dict[str, Values] = {}
    for i, name in zip(names, file.names, strict=True):
        if i in words:
            codes, texts = pd.factorize(frame[i])
            if codes.min() < 0:  # taken for missing
                return None
            columns[name] = np.array([str(t).strip() for t in texts], dtype=str)[codes]
        else:
            columns[name] = frame[i].to_numpy(dtype=np.float64)
            if truths and np.isin(columns[name], (0.0, 1.0)).all():
                return None  # "true" may have become 1
    return columns


def _exact_floats(pandas_version: str) -> dict[str, Any]:
    """From 3.1 on pandas reads every number exactly; before, it had to be asked to."""
    major, minor = (int(part) for part in pandas_version.split(".")[:2])
    return {} if (major, minor) >= (3, 1) else {"float_precision": "round_trip"}


def _parse_plain(file: CsvFile, block: Block, readings: Mapping[str, Reading]) -> dict[str, Values]:
    cells: list[list[Any]] = [[] for _ in file.names]
    text_columns: set[str] = set()
    rows = block.raw.decode("utf-8").split("\n")
    for line, row in zip(block.lines, rows, strict=False):
        for index, (name, cell) in enumerate(zip(file.names, file.split(row, line), strict=True)):
            if readings[name] == "word":
                cells[index].append(cell)
                continue
            value = number(cell)
            if value is None and readings[name] == "number":
                raise not_a_number(file, int(line), name, cell)
            if value is None:
                text_columns.add(name)
            cells[index].append(value)
    if text_columns:
        raise TextColumns(text_columns)
    return {
        name: np.array(values, dtype=str if readings[name] == "word" else np.float64)
        for name, values in zip(file.names, cells, strict=True)
    }


def number(cell: str) -> float | None:
    """Value of a cell: nan if it says that there is none, None if it is no number."""
    if _NUMBER.fullmatch(cell) or cell.lower() in _INFINITE:
        return float(cell)
    return float("nan") if cell in MISSING else None


def not_a_number(file: CsvFile, line: int, name: str, cell: str) -> Exception:
    """The message for a cell without number, with what it probably was meant to be."""
    unit = unit_of(name)
    hint = ""
    if re.fullmatch(r"[-+]?\d+,\d+([eE][-+]?\d+)?", cell):
        hint = f' Write "{cell.replace(",", ".")}".'
    elif match := re.match(r"([-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?) *[A-Za-z%°µ]+$", cell):
        hint = f' Write "{match[1]}"; the unit stands in the column\'s name.'
    wanted = f"a number in {unit}" if unit else "a number"
    return file.error(
        line,
        f'column {name}: "{shown(cell)}" is not a number; wanted: {wanted}, with a point as '
        f"decimal mark.{hint}",
    )


def shown(cell: str) -> str:
    """A cell as it stands in messages."""
    return cell if len(cell) <= _QUOTED else f"{cell[:_QUOTED]}..."
