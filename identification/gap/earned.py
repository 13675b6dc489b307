"""Whether explanations earn their weight on withheld repetitions.

An explanation is fitted without a repetition and judged on it. One that is far off there has fitted
this session and nothing that repeats: it loses weight, softly about the limit, to one with fewer of
the same effects, or to `unknown`.
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.heldout import folds, held_out
from identification.gap.search import Explanation, Found, weighed

FAILS = 2.5  # times the noise: then a repetition was not foreseen
CLOSED = 0.1  # of the structure: if no more is left of it, it was foreseen all the same
SHARP = 4.0  # how fast weight is lost about the limit, per factor e
_LOOKED_AT, _WITHIN = 6, 9.0  # explanations, and nats below the best, that are looked at


def earned(found: Found) -> Found:
    """The posterior after a look at withheld repetitions; as it was where there are none."""
    fold = folds(found.engine).get("repetition")
    if fold is None:
        return found
    kept: dict[frozenset[str], float] = {}
    for _ in range(_LOOKED_AT):
        todo = [e for e in _weighty(found, kept) if e.words not in kept]
        if not todo:
            break
        kept[todo[0].words] = _kept(
            found, held_out(found.engine, todo[0], "repetition", fold).after
        )
    return weighed(found, kept)


def _weighty(found: Found, kept: dict[frozenset[str], float]) -> list[Explanation]:
    """Explanations with effects that matter, the heaviest (with what it keeps) first."""
    weight = {
        e.words: e.log_weight + float(np.log(kept.get(e.words, 1.0) + 1e-300))
        for e in found.explanations
        if e.parts
    }
    if not weight:
        return []
    best = max(weight.values())
    matter = [e for e in found.explanations if e.parts and weight[e.words] > best - _WITHIN]
    heavy = [e for e in matter if e.words in kept]
    fewer = [
        e
        for e in found.explanations
        if e.parts and e.good and any(e.words < h.words for h in heavy if kept[h.words] < 0.5)
    ]
    return [*matter, *[e for e in fewer if e not in matter]]


def _kept(found: Found, after: float) -> float:
    """Share of the weight that is kept after leaving `after` (rms m) on withheld repetitions."""
    engine = found.engine
    limit = max(FAILS * noise_of(engine.bench), CLOSED * engine.structural)
    return float(1 / (1 + (after / limit) ** SHARP))


def noise_of(bench: Bench) -> float:
    """rms that the instruments alone would leave in single samples, m."""
    noise, weight = bench.noise, bench.rows.weight
    count = np.ones(bench.rows.n) if bench.rows.continuous else weight
    square = noise.response**2 * count + noise.hold**2 + noise.run**2
    return float(np.sqrt(weight @ square / weight.sum()))


def sample_rms(bench: Bench, values: Array) -> float:
    """rms over samples: that of the rows, and the scatter of the samples within rows."""
    weight = bench.rows.weight
    return float(np.sqrt(weight @ (values**2 + bench.scatter) / weight.sum()))
