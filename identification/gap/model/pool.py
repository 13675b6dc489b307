"""The pool of columns that effects are built from."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array


class Pool:
    """Stacked columns (size,), each but once: shapes often agree on the data that there are, as do
    depths of an axis that one direction alone sees."""

    def __init__(self) -> None:
        self._columns: list[Array] = []
        self._places: dict[int, list[int]] = {}

    def add(self, column: Array) -> int:
        """Index of a column, which is put into the pool if it is not there, in single precision."""
        # what was worked out in another order differs in the last digit; there are two zeros
        single = column.astype("f4") + 0.0
        alike = self._places.setdefault(hash(single.tobytes()), [])
        for place in alike:
            if np.array_equal(single, self._columns[place].astype("f4")):
                return place
        alike.append(len(self))
        self._columns.append(column)
        return alike[-1]

    def __getitem__(self, place: int) -> Array:
        return self._columns[place]

    def __len__(self) -> int:
        return len(self._columns)
