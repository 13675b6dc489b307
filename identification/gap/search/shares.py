"""How large each effect of an arm is: what it adds to the gap, as the laser shows it.

The displacement is zeroed at the first reading of a setup (or of a run), the force at the start of
the session; what the six springs can take over within three standard deviations of what was stated
is no gap. So a jump of the datum counts in full, and a bending link by what no springs can give.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from identification.arrays import Ints
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import BOUND
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit

_NATS = 15.0  # below the best: explanations that no longer matter
_COUNTS = 0.05  # of what an effect moves: so much of it is a gap, whatever the springs could give


def measured(engine: Engine, ranked: Iterable[Explanation]) -> list[Explanation]:
    """The explanations (best first) with these sizes, sets that matter; the others, and those of a
    bench, whose one spring is part of every law, as they are."""
    out = list(ranked)
    if not engine.bench.data.arm:
        return out
    least = out[0].log_weight - _NATS
    return [sized(engine, e) if len(e.words) > 1 and e.log_weight > least else e for e in out]


def sized(engine: Engine, e: Explanation) -> Explanation:
    """The explanation with these sizes."""
    fitted = fit(engine, e)
    return e.sized(size_of(engine, fitted, i) for i in range(len(e.parts)))


def size_of(engine: Engine, fitted: Fit, index: int) -> float:
    """rms (m) of what a part adds to the gap."""
    from scipy.optimize import lsq_linear  # a tenth of a second, for sets alone

    rows, springs = engine.bench.rows, engine.base.index("spring")
    moved = fitted.contribution(engine, index)[: rows.n]
    if fitted.parts[index].word != "force_drift":  # the laser knows nothing of the force's zero
        moved = moved - moved[_zeroed_at(engine)]
    root = np.sqrt(rows.weight / rows.weight.sum())
    A = (engine.base.columns[: rows.n, springs] * engine.base.sd[springs]) * root[:, None]
    pulls, bound = fitted.pulls[springs], BOUND * engine.base.sd[springs]
    # what is stated of a stiffness: its inverse goes further to the soft side
    softest = BOUND / np.maximum(1 - bound, _LEAST)
    limits = np.minimum(-BOUND / (1 + bound) - pulls, -_ROOM), np.maximum(softest - pulls, _ROOM)
    triangle = np.asarray(np.linalg.qr(np.column_stack([A, moved * root]), mode="r"))
    A, y = triangle[:, :-1], triangle[:, -1]
    left = float(np.sqrt(2 * lsq_linear(A, y, limits, method="bvls").cost))
    return max(left, _COUNTS * rows.rms(moved))


_ROOM = 1e-6  # a spring at its limit
_LEAST = 0.05  # of a stiffness: less is not stated


def _zeroed_at(engine: Engine) -> Ints:
    """(n,) row at which the laser read zero."""
    rows = engine.bench.rows
    group = rows.run if engine.bench.data.datum == "repetition" else rows.setup
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    return np.asarray(first[number], dtype=np.int64)
