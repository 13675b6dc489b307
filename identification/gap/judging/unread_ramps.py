"""What hands do on the way from one level to the next, which no reading shows.

A lag shows at the first readings of a hold what the load was before: on a path that somebody's
hands took, quickly or slowly, first fast and then slow. Straight on is the best guess, and no more:
what such a reading misses by a share of what the lag does there is no trouble of its own.

Where loads between readings were put in, a law shows at other levels as well: what acts at those
alone has none of its own there (bursts of a loose plug pass for a lag of whatever load it takes).
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.effects import time_lag
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.imperfection import PATH
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.fit import Fit, fit
from identification.gap.recording.rows import Rows


def unread_ramp_error(engine: Engine, fitted: Fit) -> Array:
    """(n,) m: by how much rows may be off through the unrecorded ramps before them: the share PATH
    of what the fitted lag does there; 0 in running recordings."""
    if engine.bench.rows.continuous:
        return np.zeros(engine.bench.rows.n)
    return np.asarray(PATH * np.abs(fitted.together(engine, {time_lag.WORD})))


def acts_only_after_overshoot(found: SearchResult) -> bool:
    """Whether the largest effect of the best explanation does most of what it does (in squares,
    about the mean of each setup) in the holds beyond which a load went that nobody read, and far
    more of it than the load has there: any law does most at large ones. Not where the other holds
    alone say the same of it."""
    engine, best = found.engine, found.explanations[0]
    if not best.parts:
        return False
    rows = engine.bench.rows
    fitted = fit(engine, best)
    moved = fitted.contribution(engine, 0)[: rows.n]
    both = rows.about_means(np.column_stack([moved, engine.bench.load])) ** 2
    share, load = both[rows.gone_beyond].sum(axis=0) / np.maximum(both.sum(axis=0), _TINY)
    return bool(share > max(_MOST, _MORE * load)) and not _same_elsewhere(engine, best, fitted)


_MOST, _MORE, _TINY = 0.5, 2.0, 1e-300


def _same_elsewhere(engine: Engine, explanation: Explanation, whole: Fit) -> bool:
    """Whether the holds that no load went beyond show the largest effect for sure, and do as much
    to themselves by it as all holds together (whole) have it."""
    rows = engine.bench.rows
    kept = ~rows.gone_beyond
    keep = engine.bench.layout.read_in(kept, kept[rows.edges])
    alone = fit(engine, explanation, keep)
    w, covariance = alone.of(0)
    if w @ np.linalg.lstsq(covariance, w, rcond=None)[0] < _SURE:
        return False
    does, more = (_there(rows, f.contribution(engine, 0)[: rows.n]) for f in (alone, whole))
    return bool(rows.rms(more - does) < _ALIKE * rows.rms(does))


def _there(rows: Rows, moved: Array) -> Array:
    """(n,) what moved in the holds that no load went beyond, about its mean there in each setup; 0
    in the others."""
    counts = np.where(rows.gone_beyond, 0.0, rows.weight)
    mean = np.bincount(rows.setup, counts * moved) / np.maximum(np.bincount(rows.setup, counts), 1)
    return np.where(rows.gone_beyond, 0.0, moved - mean[rows.setup])


_SURE, _ALIKE = 100.0, 0.2  # squares of standard deviations; of what they do
