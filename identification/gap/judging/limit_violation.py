"""Whether an explanation breaks the limits of its own words.

Limits are odds in the evidence (`evidence.signs`), and whatever they cost, what else there is may
fit worse still. Where the nearest coefficients that keep them all miss a good part of the gap, the
data do what the word excludes: friction that pushes, a seat that opens, a knee where none may be.
Then it is not that word. What is small beside the gap is the law that differs from those of the
library.

Of ten stand-ins for a word that was withheld nine missed 0.067 to 0.42 of the gap, at 6 to 17
standard deviations, one 0.033. Of explanations that were right and lay further out than 3 standard
deviations six missed 0.013 to 0.060, one (metal that flows back soon) 0.081.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, limits_of
from identification.gap.evidence.signs import nearest
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit
from identification.gap.judging.residuals import excess_response_rms

_TINY = 1e-300
# How well shapes meet a mechanism at best, of what it does: of arms, and of rigs that nobody built
# to be measured; of these, also of the largest coefficient.
_MET, _MET_ARMLESS, _EACH = 0.03, 0.04, 0.05
_FAR, _MISSES = 5.5, 0.06  # standard deviations; of the gap that springs leave


def limit_violation(engine: Engine, explanation: Explanation, fitted: Fit) -> tuple[float, str]:
    """How many times further than is believed the part is that lies farthest outside the limits of
    its word, and that word; 0 and no word where all are kept: by the Mahalanobis distance from
    where they are, or by what is missed there of the gap, all else fitted anew, whichever is less.
    Laws count as no better met than they are, by what the fit leaves too: thousands of readings
    tell more than they mean, and what one law lacks others make up for."""
    met = _MET if engine.bench.data.arm else _MET_ARMLESS
    met *= max(explanation.sizes, default=0.0)
    eta = max(explanation.eta, met, excess_response_rms(engine, fitted))
    looser = fit(engine, replace(explanation, eta=eta), alike=True)
    each = [(_off(engine, part, looser, i), part.word) for i, part in enumerate(looser.parts)]
    most = max(each, default=(0.0, ""))
    return most if most[0] > 0 else (0.0, "")


def _off(engine: Engine, part: Part, fitted: Fit, index: int) -> float:
    limits = limits_of(engine, part.variant)
    asked = limits.asked[0]
    if not asked.any():
        return 0.0
    (w, covariance), rows = fitted.of(index), limits.rows[0, asked]
    if not engine.bench.data.arm:
        covariance = covariance + (_EACH * float(np.abs(w).max())) ** 2 * np.eye(len(w))
    sd = np.sqrt(np.maximum(np.diag(covariance), _TINY))
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    root = sd[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    size = np.linalg.norm(rows @ root, axis=1) + _TINY
    way = nearest((rows @ w - limits.floor[0, asked]) / size, rows @ root / size[:, None])
    missed = engine.bench.rows.rms(fitted.moved(engine, index, root @ way))
    return min(float(np.linalg.norm(way)) / _FAR, missed / max(_MISSES * engine.structural, _TINY))
