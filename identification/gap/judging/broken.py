"""Whether an explanation breaks the limits of its own words.

Limits are odds in the evidence (`evidence.signs`), and whatever they cost, what else there is may
fit worse still. Coefficients that are many standard deviations from keeping them all say that the
data do what the word excludes: friction that pushes, a seat that opens, a knee where none may be.
Then it is not that word.

Of 74 explanations of arms that were right none was further off than 5.5 (a small creep beside
friction, 4.4, was the farthest); of 12 stand-ins for a word that was withheld, which limits
concern, eight were (6.3 to 13.5).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, limits_of
from identification.gap.evidence.signs import distance
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit
from identification.gap.judging.remains import response_left

# How well shapes meet a mechanism at best, of what it does: of arms, and of rigs that nobody built
# to be measured; of these, also of the largest coefficient.
_MET, _MET_OF_A_BENCH, _EACH = 0.03, 0.04, 0.05


def broken(engine: Engine, explanation: Explanation, fitted: Fit) -> tuple[float, str]:
    """Mahalanobis distance of a part's coefficients from where all its limits are kept, standard
    deviations, of the part that is farthest off, and its word; 0 and no word where all are kept.
    Laws count as no better met than they are, by what the fit leaves too: thousands of readings
    tell more than they mean, and what one law lacks others make up for."""
    met = _MET if engine.bench.data.arm else _MET_OF_A_BENCH
    met *= max(explanation.sizes, default=0.0)
    eta = max(explanation.eta, met, response_left(engine, fitted))
    looser = fit(engine, replace(explanation, eta=eta), alike=True)
    each = [(_off(engine, part, *looser.of(i)), part.word) for i, part in enumerate(looser.parts)]
    most = max(each, default=(0.0, ""))
    return most if most[0] > 0 else (0.0, "")


def _off(engine: Engine, part: Part, w: Array, covariance: Array) -> float:
    limits = limits_of(engine, part.variant)
    asked = limits.asked[0]
    if not asked.any():
        return 0.0
    rows = limits.rows[0, asked]
    if not engine.bench.data.arm:
        covariance = covariance + (_EACH * float(np.abs(w).max())) ** 2 * np.eye(len(w))
    sd = np.sqrt(np.maximum(np.diag(covariance), _TINY))
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    spread = (rows * sd) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    size = np.linalg.norm(spread, axis=1) + _TINY
    return distance((rows @ w - limits.floor[0, asked]) / size, spread / size[:, None])


_TINY = 1e-300
