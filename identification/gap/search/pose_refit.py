"""Where arm and tool stand, looked at anew beside the other effects of an explanation: these must
not decide it."""

from __future__ import annotations

from identification.gap.effects import pose_error
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation
from identification.gap.model.variants import Variant


def refit_pose_variants(engine: Engine, explanation: Explanation) -> list[Variant]:
    """Variants of a wrong pose in an explanation, through where it is found to be beside the other
    effects; the pool of the bench holds their columns afterwards. None where it is alone, or stands
    there already."""
    out = []
    for part in explanation.parts:
        rest = tuple(p for p in explanation.parts if p is not part)
        if part.word != pose_error.WORD or not rest:
            continue
        found = pose_error.refined(engine, part.variant, rest)
        if pose_error.elsewhere(part.variant, found):
            out.append(found.found_beside(p.word for p in rest))
    return out
