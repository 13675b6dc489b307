"""Which explanation is shown for a verdict: no effect that does not earn its name, and the simpler
explanation that represents it where the verdict leads there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.fit import fit
from identification.gap.explanations.penalties import LEAST_SHARE
from identification.gap.explanations.verdict import (
    AS_STATED,
    FLANKS,
    PASSES_ABOVE,
    TAKES_TWO,
    flanks_of_one_joint,
    simpler_of,
)
from identification.gap.words import BETWEEN_RUNS, DATUM_JUMPS, DRIFTS, LINEAR

# Nats that a second effect has to bring before it is named, and a third one: what that does to some
# channel may be how far the other two's laws are off.
WORTH, WORTH_OF_THIRD = 3.0, 10.0
# A play and a curve of one joint of an arm are one trouble: where one of them explains nearly all,
# the other one takes from its size and gives nothing but freedom (flanks are curved).
WORTH_OF_FLANK = TAKES_TWO
# Nor is a second one named that does less to the gap than LEAST_SHARE of what another does, or a
# third one less than this, however plainly it shows: as far laws are off. In ten runs of the blind
# check 55 of 57 such second effects were not there; of 69 such third ones 42 were not, and 24 stood
# for what another one stood for.
LEAST_OF_THIRD = 0.2
# But it is named where without it the laws would miss more than this, of the stated noise of a
# sample: a curve that does a twentieth of what a yield does, in another direction, is no matter of
# the yield's law.
CLOSELY = 2.0
# And a force that drifts is named where the force without load shows it, beyond so many standard
# deviations (rms): there is no law there that could be off.
SHOWN_WITHOUT_LOAD = 3.0


class Choice(NamedTuple):
    """shown: the explanation that is shown; fuller: that with the effects beside it that do too
    little to be named, if any."""

    shown: Explanation
    fuller: Explanation | None = None


def chosen_of(found: SearchResult, verdict: str) -> Choice:
    """The best explanation that has the verdict among its effects, without effects that bring or do
    too little. The verdict need not be the largest of them: where several words would do for a
    larger one, none of these is likely, but one of them is there."""
    if verdict in ("none", "unknown"):
        return Choice(next(e for e in found.explanations if not e.parts))
    mine = [e for e in found.explanations if verdict in e.words]
    mine = [e for e in mine if not _needless(found, e)] or mine
    held = [e for e in mine if passes_validation(found, e)]
    best = next((e for e in [*held, *mine] if e.adequate), [*held, *mine][0])
    simpler = [e for e in held if e.adequate and e.words < best.words]
    best = _worthwhile(best, simpler, arm=found.engine.bench.data.arm)
    shown = _without_small(found.engine, best, simpler)
    shown = _as_it_speaks(found, shown, verdict)
    return Choice(shown, best if shown is not best else None)


def _as_it_speaks(found: SearchResult, shown: Explanation, verdict: str) -> Explanation:
    """Of an arm: without the effect that would be larger than the verdict, where what is left
    speaks for both: so many nats may be how far its laws are off, and then it has no size of its
    own. Not where springs and gains stand for it: then it has."""
    if not found.engine.bench.data.arm or next(iter(shown.rms_by_word)) == verdict:
        return shown
    fewer = simpler_of(shown, found.explanations, found.kept, arm=True)
    if fewer is None or not fewer.off < AS_STATED or next(iter(fewer.rms_by_word)) != verdict:
        return shown
    return fewer


def _without_small(engine: Engine, best: Explanation, simpler: list[Explanation]) -> Explanation:
    """Without the effects that do too little, the smallest first: what is little beside two may be
    enough beside one."""
    most = CLOSELY * engine.bench.noise.stated  # imperfection (m) that their leaving may need
    close = [e for e in simpler if e.eta <= max(best.eta, most)]
    while True:
        small = _too_small(best)
        fewer = (e for w in small for e in close if e.words == best.words - {w})
        without = next((e for e in fewer if not _shown_without_load(engine, best, e)), None)
        if without is None:
            return best
        best = without


def _shown_without_load(engine: Engine, best: Explanation, fewer: Explanation) -> bool:
    """Whether what fewer effects lack is a drift of the force, and the force without load shows
    it."""
    if best.words - fewer.words != {"force_drift"}:
        return False
    missed = fit(engine, fewer).missed_zeros(engine)
    return bool(missed.size) and float(np.sqrt(np.mean(missed**2))) > SHOWN_WITHOUT_LOAD


def _too_small(explanation: Explanation) -> list[str]:
    """Effects that may be how far the law of another one is off, the smallest first. Only linear
    ones may be what other linear ones lack: no such law bends. A jump of the datum shows without
    load, where no law but a drift's is off; and it has no law that could be off under load."""
    sizes = explanation.rms_by_word
    share = LEAST_SHARE if len(sizes) <= 2 else LEAST_OF_THIRD
    out = []
    for word, size in sorted(sizes.items(), key=lambda i: i[1]):
        if word in DATUM_JUMPS:
            laws = DRIFTS
        else:
            laws = frozenset(sizes) - DATUM_JUMPS - (frozenset() if word in LINEAR else LINEAR)
        if size < share * max((s for w, s in sizes.items() if w in laws), default=0.0):
            out.append(word)
    return out


def _needless(found: SearchResult, explanation: Explanation) -> bool:
    """Whether another explanation speaks for it; for what drifts, which nothing foretells, none."""
    simpler = found.representative_of(explanation)
    return simpler is not None and not (explanation.words - simpler.words) & BETWEEN_RUNS


def _worthwhile(best: Explanation, simpler: list[Explanation], *, arm: bool) -> Explanation:
    """With no effect that brings less than it has to."""
    while True:
        fewer = [e for e in simpler if e.words < best.words and len(e.words) == len(best.words) - 1]
        near = [e for e in fewer if e.log_weight > best.log_weight - _worth(best, e, arm=arm)]
        if not near:
            return best
        best = max(near, key=lambda e: e.log_weight)


def _worth(explanation: Explanation, fewer: Explanation, *, arm: bool) -> float:
    """Nats that the effect has to bring that the one has and the other one, with fewer, has not."""
    if arm and explanation.words - fewer.words <= FLANKS and flanks_of_one_joint(explanation):
        return WORTH_OF_FLANK
    return WORTH if len(explanation.words) <= 2 else WORTH_OF_THIRD


def passes_validation(found: SearchResult, explanation: Explanation) -> bool:
    """Whether it foresees withheld repetitions; where nobody looked, whether nothing that failed is
    contained in it: what is added to a failure does not mend it."""
    kept = found.kept.get(explanation.words)
    if kept is not None:
        return kept > PASSES_ABOVE
    return not any(k <= PASSES_ABOVE and w <= explanation.words for w, k in found.kept.items())
