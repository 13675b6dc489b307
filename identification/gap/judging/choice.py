"""Which explanation is shown for a verdict: no effect more than earns its name."""

from __future__ import annotations

from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.penalties import LEAST_SHARE
from identification.gap.explanations.verdict import FORESAW, TAKES_MORE, TAKES_TWO, spokesman
from identification.gap.judging.earned import noise_of
from identification.gap.words import BETWEEN_RUNS, LINEAR

WORTH = 3.0  # nats that one effect more has to bring before it is named;
# a third one more: what it does to some channel may be how far the other two's laws are off.
WORTH_OF_THIRD = 10.0
# A third effect that moves less than this of the noise, and a small share of what the largest does,
# is how far the other two's laws are off, however plainly a channel without noise shows it; but a
# drift, or a jump of the datum, shows without load, where no law is off.
BELOW_NOISE = 0.6


def chosen_of(found: SearchResult, verdict: str) -> Explanation:
    """The best explanation with the verdict as its largest effect. Where that is far worse than
    those with a larger one beside it, the one with fewer effects that made it the verdict, if any;
    else the larger one is one of several alike, and the best of these is shown."""
    if verdict in ("none", "unknown"):
        return next(e for e in found.explanations if not e.parts)
    mine = [e for e in found.explanations if verdict in e.words]
    mine = [e for e in mine if not _needless(found, e)] or mine
    first = [e for e in mine if e.parts[0].word == verdict]
    most = TAKES_MORE if mine[0].words <= LINEAR else TAKES_TWO
    told = spokesman(found, mine[0])
    if first and first[0].log_weight > mine[0].log_weight - most:
        mine = first
    elif told is not None and told in first:
        mine = [e for e in first if e.words <= told.words]
    held = [e for e in mine if foresees(found, e)]
    best = next((e for e in [*held, *mine] if e.good), [*held, *mine][0])
    simpler = [e for e in held if e.good and e.words < best.words]
    best = _worthwhile(best, simpler)
    if len(best.words) < 3:
        return best
    troubles = best.troubles
    least = min(LEAST_SHARE * max(troubles.values()), BELOW_NOISE * noise_of(found.engine.bench))
    petty = {w for w, size in troubles.items() if size < least} - BETWEEN_RUNS
    return next((e for e in simpler if best.words - e.words <= petty), best)


def _needless(found: SearchResult, explanation: Explanation) -> bool:
    """Whether another explanation speaks for it; for what drifts, which nothing foretells, none."""
    simpler = found.speakers.get(explanation.words)
    return simpler is not None and not (explanation.words - simpler.words) & BETWEEN_RUNS


def _worthwhile(best: Explanation, simpler: list[Explanation]) -> Explanation:
    """With no effect that brings less than it has to."""
    while True:
        worth = WORTH if len(best.words) < 3 else WORTH_OF_THIRD
        fewer = [e for e in simpler if e.words < best.words and len(e.words) == len(best.words) - 1]
        near = [e for e in fewer if e.log_weight > best.log_weight - worth]
        if not near:
            return best
        best = max(near, key=lambda e: e.log_weight)


def foresees(found: SearchResult, explanation: Explanation) -> bool:
    """Whether it foresees withheld repetitions; where nobody looked, whether nothing that failed is
    contained in it: what is added to a failure does not mend it."""
    kept = found.kept.get(explanation.words)
    if kept is not None:
        return kept > FORESAW
    return not any(k <= FORESAW and w <= explanation.words for w, k in found.kept.items())
