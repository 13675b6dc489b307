"""What hands do on the way from one level to the next, which no reading shows.

A lag shows at the first readings of a hold what the load was before: on a path that somebody's
hands took, quickly or slowly, first fast and then slow. Straight on is the best guess, and no more:
what such a reading misses by a share of what the lag does there is no trouble of its own.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.effects import time_lag
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.imperfection import PATH
from identification.gap.explanations.fit import Fit


def open_to_hands(engine: Engine, fitted: Fit) -> Array:
    """(n,) m by which the rows may be off because nobody saw the path that a lag repeats; 0 in a
    recording that runs on, which shows it."""
    n = engine.bench.rows.n
    if engine.bench.rows.continuous:
        return np.zeros(n)
    late = [i for i, p in enumerate(fitted.parts) if p.word == time_lag.WORD]
    moved = sum((fitted.contribution(engine, i)[:n] for i in late), np.zeros(n))
    return np.asarray(PATH * np.abs(moved))
