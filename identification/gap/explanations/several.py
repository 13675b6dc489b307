"""The same trouble in several joints: all gears of an arm rub, creep and bend, some more.

A joint mechanism sits in one joint of a variant. Where that leaves what the same mechanism in
another joint would do, the explanation takes both, as one word: one trouble, seen twice. Only the
joint readings can tell that from a second mechanism, so nothing is looked for without them; but
nothing else goes on as creep does while the load stands, and of a rig without an arm every
direction, which has a compliance of its own, is read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, joined, up_to_likeliest
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, able_beside
from identification.gap.words import IN_JOINTS

MOST = 3  # joints of an arm's word
_BY_ITSELF = frozenset({"joint_creep"})
# Nats that a joint more has to bring: the choice among the first one's shapes is not counted again.
WORTH = 6.0
_HOPELESS = 2000.0  # nats below, from which no other choice of shapes has been seen to come back


def family_of(variants: Sequence[Variant], word: str, beside: tuple[Part, ...]) -> list[Variant]:
    """Variants of a word that may stand beside other parts: not in a joint where it is already; and
    what creeps more than in proportion in one joint does so in all."""
    same = [p.variant for p in beside if p.word == word]
    taken, bent = {v.joint for v in same} - {None}, {v.exceeds_proportion for v in same}
    able = able_beside(variants, {p.word for p in beside})
    mine = (v for v in able if v.word == word and v.joint not in taken)
    return [v for v in mine if not bent or v.exceeds_proportion in bent]


def in_more_joints(engine: Engine, variants: Sequence[Variant], start: Explanation) -> Explanation:
    """With its joint mechanisms in further joints, as far as that is worth it."""
    bench, best = engine.bench, start
    most = MOST if bench.data.arm else bench.data.joints
    for word in sorted(start.words & (IN_JOINTS if _each_seen(bench) else _BY_ITSELF)):
        for _ in range(most - 1):
            if best.eta <= bench.noise.stated:
                break  # there is nothing left for another joint to do
            found = _in_one_more(engine, variants, best, word)
            if found is None or found.log_weight < best.log_weight:
                break
            best = found
    return best


def in_one_joint_each(start: Explanation) -> Explanation:
    """With the largest part of each word alone, not compared with anything yet; as it is, where no
    word has more. Other joints may have made up for what was wrong with the first one's law."""
    first = {p.word: p for p in reversed(start.parts)}
    if len(first) == len(start.parts):
        return start
    parts = tuple(p for p in start.parts if first[p.word] is p)
    return replace(start, parts=parts, log_weight=-inf)


def _each_seen(bench: Bench) -> bool:
    """Whether every joint is read; the compliances of a rig without an arm, one in each direction,
    are."""
    return bench.has_q or not bench.data.arm


def _in_one_more(
    engine: Engine, variants: Sequence[Variant], start: Explanation, word: str
) -> Explanation | None:
    others = [v for v in family_of(variants, word, start.parts) if v.joint is not None]
    if not others or any(p.word == word and p.variant.joint is None for p in start.parts):
        return None
    levels, energy = up_to_likeliest(engine, start.parts)
    scored = score(engine, levels, others, energy)
    found = joined(engine, start.parts, scored, energy, WORTH)
    if found.log_weight < start.log_weight - _HOPELESS:
        return None
    return polished(engine, variants, found)


def polished(engine: Engine, variants: Sequence[Variant], start: Explanation) -> Explanation:
    """Lets every part choose its variant anew, the others given."""
    best = start
    for part in start.parts:  # by itself: what is better may stand in another order
        rest, word = tuple(p for p in best.parts if p is not part), part.word
        levels, energy = up_to_likeliest(engine, rest)
        scored = score(engine, levels, family_of(variants, word, rest), energy)
        again = WORTH * sum(p.word == word for p in rest)
        found = joined(engine, rest, scored, energy, again)
        if found.log_weight > best.log_weight:
            best = found
    return best
