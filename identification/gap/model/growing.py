"""Arrays that more rows are put below, again and again."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from identification.arrays import Array

_AHEAD = 1.5  # of what is needed: then few additions move what is there


class Growing:
    """Rows (k, n); room for more is taken ahead, so that adding a few hardly ever copies all."""

    def __init__(self, rows: Array) -> None:
        """rows (k, n): the first ones."""
        self.values = self._room = rows

    def put(self, parts: Iterable[Array]) -> None:
        """Puts parts (k_i, n) below. What `values` was before stays as it was."""
        below = list(parts)
        start, count = len(self.values), len(self.values) + sum(map(len, below))
        if count > len(self._room):
            # what is never added to takes no memory, as nobody writes there
            self._room = np.empty((int(_AHEAD * count), self.values.shape[1]))
            self._room[:start] = self.values
        np.concatenate(below, out=self._room[start:count])
        self.values = self._room[:count]
