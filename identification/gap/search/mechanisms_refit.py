"""Mechanisms on the arm as it stands and is loaded: beside a wrong pose, a load across or a force
that is read late, they answer to other torques than simulated, and move the target by other
levers."""

from __future__ import annotations

from functools import partial

from identification.gap.effects import EFFECTS, base_compliance, base_slip
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, conditioned
from identification.gap.explanations.fit import fit
from identification.gap.laws.actual_arm import LawValues, bench_of_actual_arm, changes_torques
from identification.gap.laws.closer import RefinementTarget, evidence
from identification.gap.model.variants import ANSWERS_TO, TO_ACTUAL_BENCH, Variant, place_of
from identification.gap.words import IN_JOINTS

_HOPELESS = 60.0  # nats below what there is: its finer shapes won't do better either


def refit_mechanism_variants(engine: Engine, explanation: Explanation) -> list[Variant]:
    """Variants of a mechanism beside what changes the torques that it answers to, in an explanation
    of the two that leaves more than noise: on the arm as it then stands, at the same place; the
    pool of the bench holds their columns afterwards. None where nothing changes these."""
    bench, parts = engine.bench, explanation.parts
    mine = [p for p in parts if p.word in _ANSWERS]
    if len(parts) != 2 or len(mine) != 1 or not explanation.eta > 0 or not bench.data.arm:
        return []
    other = next(p for p in parts if p is not mine[0])
    if bench.imposed or other.word not in EFFECTS:
        return []
    law, scale = EFFECTS[other.word].laws.of(bench, other.variant)
    if not changes_torques(law):
        return []
    values = scale * fit(engine, explanation).of(parts.index(other))[0]
    to_actual = partial(bench_of_actual_arm, acts=[LawValues(law, values)])
    with engine.on(to_actual(bench)):
        found = _shapes(engine, mine[0], other)
    return [
        v.known_by(_WHERE, **{TO_ACTUAL_BENCH: to_actual, ANSWERS_TO: other.word}) for v in found
    ]


_ANSWERS = IN_JOINTS | {base_slip.WORD, base_compliance.WORD}
_WHERE = ", on the arm as it stands"


def _shapes(engine: Engine, part: Part, other: Part) -> list[Variant]:
    """Of a part's word at its place, on the engine's bench, those of the grid and finer ones about
    the best of them, beside another part."""
    effect = EFFECTS[part.word]
    grid = [v for v in effect.variants(engine.bench) if place_of(v) == place_of(part.variant)]
    levels, energy = conditioned(engine, (Part(other.variant, other.scale),))
    beside = sorted(score(engine, levels, grid, energy), key=evidence, reverse=True)
    now = score(engine, levels, [part.variant], energy)[0]
    if not beside or effect.finer is None:
        return grid
    if beside[0].log_evidence < now.log_evidence - _HOPELESS:
        return grid
    alone = sorted(score(engine, engine.levels, grid), key=evidence, reverse=True)
    families = {other.word: score(engine, engine.levels, [other.variant]), part.word: alone}
    return [
        *grid,
        *effect.finer(RefinementTarget(engine, families, [other.word, part.word], alone, beside)),
    ]
