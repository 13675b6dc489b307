"""What explanations leave of a recording without an arm, looked at row by row.

The levels of imperfection are a coarse grid, and one that fits stretches of fifty rows: they rank
explanations, but they don't say how much of the gap is left. For those that matter that is looked
up in the data.
"""

from __future__ import annotations

from dataclasses import replace
from math import log

import numpy as np

from identification.gap.bench import way_back
from identification.gap.evidence import Engine
from identification.gap.fit import fit
from identification.gap.noise import bursts
from identification.gap.penalties import CURVES
from identification.gap.search import LAW_REMAINDER, REMAINDER, SOFT, Explanation, Found, weighed

# An elastic curve that falls while it is pushed on: a snap, a slip, a crack are likelier.
SNAPS, _FALL = 0.1, 0.15  # share that is kept; fall, of the range, that is none of noise
# What is stated of a bench's instruments is known to a factor of two (GUM G.4.2: a type B estimate
# is worth few degrees of freedom): what is left below twice that is no structure.
_UNSURE = 3**0.5  # of it, beyond it in quadrature
IN_SPELLS = 0.1  # share that is kept by laws of load and time where readings scatter in spells
_LOOKED_AT, _WITHIN = 12, 40.0  # explanations, and nats below the best, that are looked at


def looked_up(found: Found) -> Found:
    """The posterior with what the best explanations of a recording without an arm really leave; of
    levels that rest, after a look for readings that scatter in spells, as nothing here makes them.
    """
    data = found.engine.bench.data
    if bursts(data):
        doubted = [replace(e, log_good=e.log_good + log(IN_SPELLS)) for e in found.explanations]
        return weighed(replace(found, explanations=tuple(doubted)), found.kept)
    if data.arm:
        return found
    best = found.explanations[0].log_weight
    out = [
        _judged(found.engine, e)
        if e.parts and i < _LOOKED_AT and e.log_weight > best - _WITHIN
        else e
        for i, e in enumerate(found.explanations)
    ]
    return weighed(replace(found, explanations=tuple(out)), found.kept)


def _judged(engine: Engine, explanation: Explanation) -> Explanation:
    """With the share of its weight that it keeps by what it leaves beyond the noise."""
    bench, n = engine.bench, engine.bench.rows.n
    weight = bench.rows.weight / bench.rows.weight.sum()
    left = engine.target[:n] - fit(engine, explanation).response
    square = float(weight @ left**2) - float(weight @ bench.noise.response**2)
    most = max(
        REMAINDER * engine.structural,
        LAW_REMAINDER * max(explanation.sizes),
        _UNSURE * bench.noise.stated,
    )
    share = 1 / (1 + (np.sqrt(max(square, 0.0)) / most) ** SOFT)
    if explanation.words & CURVES and _falls(engine):
        share *= SNAPS
    else:
        share = max(share, float(np.exp(explanation.log_good - explanation.log_weight)))
    return replace(explanation, log_good=explanation.log_weight + float(np.log(max(share, 1e-300))))


def _falls(engine: Engine) -> bool:
    """Whether the response goes back in a single pull whose load goes on."""
    bench = engine.bench
    if not bench.once or not bench.always_moves:
        return False
    fall = way_back(np.abs(bench.response - bench.response[0]))
    return bool(fall > _FALL * np.ptp(bench.response))
