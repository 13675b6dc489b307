"""What goes through the springs (a load across, a drift or a gain of the force, a lag), with the
springs as they are found to be beside the other effects of an explanation: these must not decide
them, nor must what the simulation says of them."""

from __future__ import annotations

import numpy as np

from identification.gap.effects import EFFECTS, pose_error
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation
from identification.gap.laws.springs_found import springs_found
from identification.gap.model.variants import Variant

_MOVED = 0.02  # of a spring: less is no other variant


def relinearised_variants(engine: Engine, explanation: Explanation) -> list[Variant]:
    """Variants of such effects in an explanation that leaves more than noise; the pool of the bench
    holds their columns afterwards. None where springs are where they were. Where arm and tool stand
    is found with the springs anyway (`refit_pose_variants`)."""
    bench, out = engine.bench, []
    for part in explanation.parts if explanation.eta > 0 else ():
        effect = EFFECTS.get(part.word)  # a trouble that no word names has none
        if effect is None or not effect.laws.through_springs or part.word == pose_error.WORD:
            continue
        laws = effect.laws
        rest = tuple(p for p in explanation.parts if p is not part)
        compliance = springs_found(laws, engine, part, rest, explanation.eta)
        about = part.variant.about
        before = bench.compliance if about is None else about
        if np.abs(compliance / before - 1).max() > _MOVED:
            again = laws.about_springs(bench, part.variant, compliance)
            out.append(again.found_beside(p.word for p in rest))
    return out
