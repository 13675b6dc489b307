"""A closer look at a word that stands out among single effects: what the effects' own ways of it
have in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from identification.arrays import Array
from identification.gap.evidence.compare import Scored, closest, marginal, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, conditioned
from identification.gap.explanations.fit import fit
from identification.gap.laws.law import Laws
from identification.gap.laws.springs_found import about_springs
from identification.gap.model.variants import Variant, place_of

_REFINED = 2  # joints, or axes, at which it is refined
_CLOSE = 0.2  # of the first look's steps
_LOOKS = 6  # at most, at one share of the steps
_FAR = 60.0  # nats below the best of them
WINDOW = 12.0  # nats above `none` that a word must have to be refined


@dataclass(frozen=True, eq=False)
class RefinementTarget:
    """A word that stands out: its variants alone, and beside the leading word, best first; ranked:
    the leading words, whose scores are families."""

    engine: Engine
    families: dict[str, list[Scored]]
    ranked: list[str]
    alone: list[Scored]
    beside: list[Scored]

    @property
    def name(self) -> str:
        """What it is."""
        return self.alone[0].variant.word


def shows(word: RefinementTarget) -> bool:
    """Whether it is worth closer looks."""
    return seen(word) or nearly_leads(word)


def seen(word: RefinementTarget) -> bool:
    """Whether it explains something beside the leading word, or is that."""
    return not word.beside or word.beside[0].log_evidence > _lead(word) + WINDOW


def nearly_leads(word: RefinementTarget) -> bool:
    """Whether it explains alone nearly as much as the leading word does."""
    none = max(level.log_base for level in word.engine.levels)
    mine, first = (marginal(word.families[n]) - none for n in (word.name, word.ranked[0]))
    return mine > _NEARLY * first


_NEARLY = 0.7  # of what the leading word brings, nats above `none`


def _lead(word: RefinementTarget) -> float:
    return closest(word.families[word.ranked[0]]).log_evidence


def closing_in(
    word: RefinementTarget,
    refined: Callable[..., list[Variant]],
    starts: list[Scored],
    closer: tuple[float, ...] = (_CLOSE,),
    *,
    to_the_last: bool = False,
) -> list[Variant]:
    """Iterative refinement of the grid about what was found: `refined` gives a variant's
    neighbours, the finer the smaller their share of a step. What is best moves along narrow valleys
    (a zone is as wide as its crossing is far), so each grid but the finest is moved after the best
    variant until that stays. Returns the variants that were tried but those far worse; the last
    grid is scored for this only with `to_the_last`."""
    engine = word.engine
    fresh = [v for s in starts for v in refined(engine.bench, s.variant)]
    finer, found = list(fresh), list[Scored]()
    for share in closer if fresh else ():
        best: Variant | None = None
        for _ in range(_LOOKS if share > closer[-1] else 1):
            found += scored(word, fresh)
            last, best = best, max(found, key=evidence).variant
            if best is last:
                break
            fresh = refined(engine.bench, best, share)
        finer += fresh
    if to_the_last:
        found += scored(word, fresh)
    best_of = max(map(evidence, found), default=0.0)
    far = {s.variant for s in found if s.log_evidence < best_of - _FAR}
    return [v for v in finer if v not in far]


def scored(word: RefinementTarget, family: list[Variant]) -> list[Scored]:
    """Scores of some of its variants: beside the leading word, where it explains something there;
    of a rival of that, which explains the same, alone."""
    if not seen(word):
        return score(word.engine, word.engine.levels, family)
    return scored_beside(word.engine, word.families, word.ranked, family)


def scored_beside(
    engine: Engine, families: dict[str, list[Scored]], ranked: list[str], family: list[Variant]
) -> list[Scored]:
    """Scores of a word's variants beside the leading word; alone, where it leads itself."""
    first = closest(families[ranked[0]])
    if not family or family[0].word == ranked[0]:
        return score(engine, engine.levels, family)
    levels, energy = conditioned(engine, (Part(first.variant, first.scale),))
    return score(engine, levels, family, energy)


def evidence(scored: Scored) -> float:
    """By which scores are sorted."""
    return scored.log_evidence


class Estimate(NamedTuple):
    """Most probable coefficients (k,) of a variant, relative changes (m,) of the springs'
    compliance, and the imperfection (m) they are likeliest with."""

    coefficients: Array
    softer: Array
    eta: float


def estimate(engine: Engine, variant: Variant, beside: tuple[Part, ...] = ()) -> Estimate:
    """What is most probable with a variant whose columns the engine may not know yet, beside other
    parts."""
    return estimates(engine, [variant], beside)[0]


def estimates(
    engine: Engine, variants: list[Variant], beside: tuple[Part, ...] = ()
) -> list[Estimate]:
    """The same of several variants, each for itself."""
    levels, energy = conditioned(engine, beside)
    scored = score(engine, levels, variants, energy)
    return [_estimate(engine, s, beside) for s in scored]


def _estimate(engine: Engine, found: Scored, beside: tuple[Part, ...]) -> Estimate:
    eta = engine.levels[found.level].eta
    parts = (Part(found.variant, found.scale), *beside)
    fitted = fit(engine, Explanation(parts, 0.0, eta, (0.0,), 0.0))
    softer = engine.base.softer(fitted.base, engine.bench.data.joints)
    return Estimate(fitted.of(0)[0], softer, float(eta))


def places(
    alone: list[Scored],
    beside: list[Scored],
    able: Callable[[Variant], bool] = lambda _: True,
    most: int = _REFINED,
) -> list[Scored]:
    """The best of the `most` best joints, or axes, beside the leading word, and the best alone:
    of two words that explain the same neither has a place beside the other. able: of those."""
    by_place: dict[object, Scored] = {}
    first = [s for s in alone if able(s.variant)][:1]
    for s in (s for s in beside or alone if able(s.variant)):
        by_place.setdefault(place_of(s.variant), s)
    found = [*first, *list(by_place.values())[:most]]
    return [s for i, s in enumerate(found) if s.variant not in [f.variant for f in found[:i]]]


def best_about_springs(laws: Laws, word: RefinementTarget) -> list[Variant]:
    """The best alone and beside the leading word, with the springs as they are."""
    best = dict.fromkeys(s[0].variant for s in (word.alone, word.beside) if s)
    return [about_springs(laws, word.engine, v) for v in best]
