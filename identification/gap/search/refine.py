"""Finer shapes of the words that stand out alone, as their effects say (`Effect.finer`)."""

from __future__ import annotations

from identification.gap.effects import EFFECTS
from identification.gap.evidence.compare import Scored, by_word, closest, marginal
from identification.gap.evidence.engine import Engine
from identification.gap.laws.closer import WINDOW, RefinementTarget, nearly_leads, scored_beside
from identification.gap.model.variants import Variant

_LEADING = 6  # words that are refined


def refine(engine: Engine, singles: list[Scored]) -> list[Variant]:
    """Finer shapes of the words that stand out among single effects and that a grid meets badly:
    thresholds and zones make the evidence piecewise smooth, offsets act by their squares."""
    families = by_word(singles)
    least = engine.levels[0].log_base + WINDOW
    ranked = sorted(families, key=lambda w: -marginal(families[w]))[:_LEADING]
    beside = _beside_first(engine, families, ranked)
    clean = closest(families[ranked[0]]).level == 0  # the leading word leaves nothing but noise
    out: list[Variant] = []
    for name in ranked:
        finer = EFFECTS[name].finer
        if finer is None or marginal(families[name]) < least:
            continue
        alone, others = (
            sorted(s, key=lambda s: -s.log_evidence) for s in (families[name], beside.get(name, []))
        )
        word = RefinementTarget(engine, families, ranked, alone, others)
        if not clean or nearly_leads(word):
            out += finer(word)
    return out


def _beside_first(
    engine: Engine, families: dict[str, list[Scored]], ranked: list[str]
) -> dict[str, list[Scored]]:
    """Scores of the words that grids meet badly beside the leading word: what that does must not
    decide where a smaller effect is looked for."""
    family = [s.variant for w in ranked[1:] if EFFECTS[w].beside for s in families[w]]
    return by_word(scored_beside(engine, families, ranked, family)) if family else {}
