"""Which explanation is shown for a verdict: no effect more than earns its name."""

from __future__ import annotations

from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.penalties import LEAST_SHARE
from identification.gap.explanations.verdict import FORESAW
from identification.gap.words import BETWEEN_RUNS, DATUM_JUMPS, DRIFTS, LINEAR

WORTH = 3.0  # nats that one effect more has to bring before it is named;
# a third one more: what it does to some channel may be how far the other two's laws are off.
WORTH_OF_THIRD = 10.0
# Nor is one named that moves less than such a share of what another does, however plainly it shows:
# as far laws are off. In ten runs of the blind check 55 of 57 second effects below that share were
# wrong, and of 69 third ones below this one 42; 24 more stood for what another one stood for.
LEAST_OF_THIRD = 0.2


def chosen_of(found: SearchResult, verdict: str) -> Explanation:
    """The best explanation with the verdict among its effects, but for those that are petty. A
    larger one may stand beside it that is one of several alike: none of these is the likeliest main
    cause, and together they are there."""
    if verdict in ("none", "unknown"):
        return next(e for e in found.explanations if not e.parts)
    mine = [e for e in found.explanations if verdict in e.words]
    mine = [e for e in mine if not _needless(found, e)] or mine
    held = [e for e in mine if foresees(found, e)]
    best = next((e for e in [*held, *mine] if e.good), [*held, *mine][0])
    simpler = [e for e in held if e.good and e.words < best.words]
    best = _worthwhile(best, simpler)
    petty = _petty(best)
    return next(
        (e for e in simpler if e.words < best.words and best.words - e.words <= petty), best
    )


def _petty(explanation: Explanation) -> set[str]:
    """Effects that may be how far another one's law is off. No law bends that is linear; and a jump
    of the datum shows without load, where only a drift's law is off."""
    sizes = explanation.troubles
    share, out = LEAST_SHARE if len(sizes) < _THREE else LEAST_OF_THIRD, set()
    for word, size in sizes.items():
        laws = {w: s for w, s in sizes.items() if w not in LINEAR or word in LINEAR}
        if word in DATUM_JUMPS:
            laws = {w: s for w, s in sizes.items() if w in DRIFTS}
        if size < share * max(laws.values(), default=0.0):
            out.add(word)
    return out


_THREE = 3


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
