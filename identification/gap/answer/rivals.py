"""The two explanations that a next measurement is to tell apart, each with one of two words.

What a word does on the present data is its fitted forms; what it could do elsewhere are shapes that
explain these data about as well, beside everything else that is there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from identification.arrays import Array
from identification.gap.answer.equivalent_places import PLACE, equivalent_place
from identification.gap.answer.forms import Form, describe, lasting, law_of, lawful
from identification.gap.evidence.compare import Scored, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, SearchResult, conditioned
from identification.gap.explanations.fit import fit
from identification.gap.laws.law import Law
from identification.gap.model.variants import Variant, able_beside

_SHAPES = 8  # of each word, the best on the present data
_WITHIN = 12.0  # nats below the best that a shape may lie


@dataclass(frozen=True, eq=False)
class Rival:
    """One of the two words: the forms that were fitted with it, changes (m,) of the springs,
    and shapes that the first of them may take, with their weights on the present data (log) and
    units. further: of the word's other forms (it may sit in several joints), which every shape has
    beside it, the part, law and unit. rest: forms of the other words beside it, as far as they
    last. eta m: imperfection that the laws are seen to have."""

    word: str
    forms: tuple[Form, ...]
    springs: Array
    shapes: tuple[tuple[Variant, Law, Array, float], ...]
    further: tuple[tuple[Part, Law, Array], ...] = ()
    rest: tuple[Form, ...] = ()
    eta: float = 0.0


def rival_of(found: SearchResult, chosen: Explanation, first: str, word: str) -> Rival | None:
    """The explanation with `word` in the place of `first`, else by itself."""
    wanted = (chosen.words - {first}) | {word}
    by_words = {e.words: e for e in found.explanations}
    explanation = by_words.get(wanted) or by_words.get(frozenset([word]))
    if explanation is None:
        return None
    engine = found.engine
    fitted = fit(engine, explanation)
    described = [describe(engine.bench, p, *fitted.of(i)) for i, p in enumerate(explanation.parts)]
    part, *others = (p for p in explanation.parts if p.word == word)
    rest = tuple(p for p in explanation.parts if p is not part)
    able = able_beside(found.variants, {p.word for p in rest})
    return Rival(
        word,
        tuple(lawful(f) for f in described if f.word == word),
        engine.base.softer(fitted.base, engine.bench.data.joints),
        _shapes(engine, [v for v in able if v.word == word], part, rest),
        tuple((p, *law_of(engine.bench, p.variant)) for p in others),
        tuple(lasting(f) for f in described if f.word != word),
        explanation.eta,
    )


def same_elsewhere(
    found: SearchResult, chosen: Explanation, first: Rival, word: str
) -> Rival | None:
    """The first explanation's law at the other word's place, where the data see no difference."""
    part = next((p for p in chosen.parts if p.word == first.word), None)
    if part is None or word not in ("joint_yield", "base_slip"):
        return None
    fitted = fit(found.engine, chosen)
    w, _ = fitted.of(chosen.parts.index(part))
    twin = equivalent_place(found.engine, part, w, chosen.eta)
    if twin is None or twin.word != word:
        return None
    shapes = tuple(
        (replace(v, word=word), twin.moved(law), unit * twin.factor**-2, weight)
        for v, law, unit, weight in first.shapes
        if all(law.constants.get(k) == first.forms[0].law.constants.get(k) for k in PLACE)
    )
    further = tuple(
        (replace(p, variant=replace(p.variant, word=word)), twin.moved(law), unit * twin.factor**-2)
        for p, law, unit in first.further
    )
    forms = tuple(twin.form(f) for f in first.forms)
    return replace(first, word=word, forms=forms, shapes=shapes, further=further)


def _shapes(
    engine: Engine, variants: list[Variant], part: Part, rest: tuple[Part, ...]
) -> tuple[tuple[Variant, Law, Array, float], ...]:
    """The fitted shape, and the best others of different laws within reach of it, all beside the
    rest of the explanation: alone, they would stand in for what that explains."""
    fitted = part.variant
    levels, already = conditioned(engine, rest)
    ranked: list[Scored] = sorted(
        score(engine, levels, variants, already), key=lambda s: -s.log_evidence
    )
    best = ranked[0].log_evidence
    # what the truth is drawn from has a weight, whatever was found nearer since
    weight = {id(s.variant): max(s.log_evidence, best - _WITHIN) for s in ranked}
    near = [
        s.variant for s in ranked if s.log_evidence > best - _WITHIN and s.variant is not fitted
    ]
    # shapes that look alike to these data may differ elsewhere: joints and axes first, then laws
    kinds: dict[object, Variant] = {}
    for v in near:
        kinds.setdefault(v.differs_by, v)
    order = [fitted, *kinds.values(), *(v for v in near if v not in kinds.values())][:_SHAPES]
    return tuple((v, *law_of(engine.bench, v), weight.get(id(v), best)) for v in order)
