"""What gives way anew every time that its load passes a threshold: feet that walk, bolts that
settle, clutches that slip on. By as much every time, or by less and less.

In every pass it follows the load beyond the threshold, and stays: `w sum_n n^-p max(L_n - r, 0)`,
L_n the largest load of the n-th pass so far, p its fading: 0 where it gives way by as much every
time, and 1 where what is left grows with the logarithm of their number, as foundations and ballast
settle under repeated loads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.laws.lasting import lasting
from identification.gap.model.bench import Bench
from identification.gap.model.history import whiles
from identification.gap.model.variants import Variant

WALKS = "walks"  # its knee
BEYOND = (0.18, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # of the range
FADING = (0.0, 0.5, 1.0, 2.0)
_LET_GO = 0.5  # of the threshold: a load below it ends a pass
_LIKELY = 0.5  # against knees that give way once


def walking(
    bench: Bench,
    load: Array,
    top: float,
    column: Callable[[Array], int],
    word: str,
    name: str,
    info: dict[str, Any],
) -> list[Variant]:
    """Variants of neighbouring thresholds on a load (n,) and of neighbouring fadings, between which
    the knee and its own fading lie; none where the response does not go on from run to run. top:
    what the thresholds are shares of."""
    if not bench.data.arm or not bench.moves_on:
        return []
    radius = bench.radii(load, top * np.array(BEYOND))
    r, p = np.meshgrid(radius, FADING, indexing="ij")
    states = walked(load, r.ravel(), p.ravel(), bench.moved)
    if not states.any():
        return []
    columns, out = np.reshape([column(s) for s in states.T], r.shape), list[Variant]()
    facts = {**info, "memory": "", "load": load, "column": column}
    places = list(product(range(len(radius) - 1), range(len(FADING) - 1)))
    for k, fades in places:
        here = np.ix_((k, k + 1), (fades, fades + 1))
        out.append(
            lasting(
                word,
                f"{name} that {WALKS} beyond {radius[k]:.3g}, fading {FADING[fades]:g}",
                columns[here].ravel().tolist(),
                np.eye(4),
                _LIKELY / len(places),
                {**facts, "fading": p[here].ravel()},
                radius=r[here].ravel(),
                knee=WALKS,
                each=True,
            )
        )
    return out


def walked(load: Array, radius: Array, fading: Array, fresh: Flags) -> Array:
    """(n, k) way beyond the thresholds radius (k,) that a load (n,) has gone, pass by pass; the
    passes, counted since the memory was fresh, by n^-fading."""
    out = np.zeros((len(load), len(radius)))
    for r in np.unique(radius):
        mine = np.flatnonzero(radius == r)
        for a, b in whiles(fresh):
            for number, start, end in _passes(np.abs(load[a:b]), r):
                part = load[a + start : a + end]
                beyond = np.maximum(np.maximum.accumulate(np.abs(part)) - r, 0.0)
                way = np.sign(part) * np.diff(beyond, prepend=0.0)
                out[a + start : a + end, mine] = way[:, None] * float(number) ** -fading[mine]
            out[a:b, mine] = np.cumsum(out[a:b, mine], axis=0)
    return out


def _passes(size: Array, radius: float) -> Iterator[tuple[int, int, int]]:
    """Number from 1, first row and end of every pass of a load of that size (n,)."""
    told = np.where(size > radius, 1, np.where(size < _LET_GO * radius, -1, 0))
    last = np.maximum.accumulate(np.where(told != 0, np.arange(len(told)), 0))
    within = np.concatenate([[False], told[last] == 1, [False]])
    turns = np.flatnonzero(within[1:] != within[:-1])
    for number, (start, end) in enumerate(turns.reshape(-1, 2).tolist(), start=1):
        yield number, start, end
