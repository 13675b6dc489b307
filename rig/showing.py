"""Tables that print well, as text and in notebooks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.digits import number

if TYPE_CHECKING:
    import pandas as pd

MOST_ROWS = 40  # of a table that are shown; all are there


class Table:
    """Named columns of equal length; units stand in the names.

    `table["force_N"]` is an array (n,), or a list where a column holds words; iterating gives rows
    as dicts; `to_pandas()` a data frame. Printed, the banners (emulated, incomplete) come first.
    """

    def __init__(
        self,
        columns: Mapping[str, Sequence[Any]],
        *,
        title: str = "",
        banners: Sequence[str] = (),
    ) -> None:
        lengths = {len(values) for values in columns.values()}
        if len(lengths) > 1:
            raise ValueError(f"columns of different lengths: {sorted(lengths)}")
        self._columns = {name: list(values) for name, values in columns.items()}
        self.title = title
        self.banners = tuple(banners)

    @classmethod
    def of_rows(cls, names: Sequence[str], rows: Sequence[Sequence[Any]], **words: Any) -> Table:
        """A table from its rows, each as long as `names`."""
        return cls({name: [row[i] for row in rows] for i, name in enumerate(names)}, **words)

    @property
    def names(self) -> list[str]:
        """Of the columns."""
        return list(self._columns)

    def __len__(self) -> int:
        return len(next(iter(self._columns.values()), []))

    def __getitem__(self, name: str) -> Any:
        try:
            values = self._columns[name]
        except KeyError:
            raise KeyError(f"no column {name}; there are {', '.join(self._columns)}") from None
        if all(v is None or isinstance(v, int | float | np.number) for v in values):
            return np.array([np.nan if v is None else v for v in values])
        return values

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for i in range(len(self)):
            yield {name: values[i] for name, values in self._columns.items()}

    def to_pandas(self) -> pd.DataFrame:
        """The same as a data frame."""
        import pandas as pd

        return pd.DataFrame(self._columns)

    def __repr__(self) -> str:
        return "\n".join([*self.banners, *([self.title] if self.title else []), *self._lines()])

    def _lines(self) -> Iterator[str]:
        cells = [self.names, *self._cells()]
        widths = [max(len(row[i]) for row in cells) for i in range(len(self.names))]
        left = [self._is_text(name) for name in self.names]
        for row in cells:
            yield "  ".join(
                cell.ljust(w) if to_left else cell.rjust(w)
                for cell, w, to_left in zip(row, widths, left, strict=True)
            ).rstrip()
        if len(self) > MOST_ROWS:
            yield f"... {len(self) - MOST_ROWS} more rows"

    def _repr_html_(self) -> str:
        """What a notebook shows; names and texts of the data are escaped."""
        left = [' style="text-align:left"' if self._is_text(n) else "" for n in self.names]
        head = "".join(f"<th{at}>{escape(n)}</th>" for n, at in zip(self.names, left, strict=True))
        body = "".join(
            "<tr>"
            + "".join(f"<td{at}>{escape(c)}</td>" for c, at in zip(row, left, strict=True))
            + "</tr>"
            for row in self._cells()
        )
        banners = "".join(f"<p><b>{escape(line)}</b></p>" for line in self.banners)
        caption = f"<caption>{escape(self.title)}</caption>" if self.title else ""
        rest = len(self) - MOST_ROWS
        more = f"<p>... {rest} more rows</p>" if rest > 0 else ""
        return (
            f"{banners}<table>{caption}<thead><tr>{head}</tr></thead>"
            f"<tbody>{body}</tbody></table>{more}"
        )

    def _is_text(self, name: str) -> bool:
        return any(isinstance(v, str) for v in self._columns[name])

    def _cells(self) -> list[list[str]]:
        columns = [[_cell(v) for v in values[:MOST_ROWS]] for values in self._columns.values()]
        return [list(row) for row in zip(*columns, strict=True)]


def _cell(value: Any) -> str:
    """Four digits of what is measured, all of what is counted; - for what is not defined."""
    if value is None:
        return "-"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return number(float(value))
    return str(value)
