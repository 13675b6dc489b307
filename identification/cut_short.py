"""Repetitions that were cut short: interrupted, skipped, or stopped at a limit far below the
others' largest force.

On a curved characteristic k is an average over the levels, so the k of a repetition without the
upper ones is another quantity, and its distance from the others' no scatter. On the published curve
in x, whose slope halves on the way, a repetition that ends at nine tenths has a k that is 2 %
higher, as much as repetitions scatter there; one that ends at four fifths 4 %, at half 12 %. So
nine tenths is the limit: above it the missing levels drown in the scatter, below they would be it.

A running recording is not looked at: its repetitions are cycles, whose amplitudes may differ by
design.
"""

from __future__ import annotations

import math

from identification.curve import Curve, Point

NEARLY = 0.9  # of the largest force, or of the displacement there: far enough to count


def cut_short(curve: Curve) -> dict[int, str]:
    """Repetition -> why it does not count.

    Cut short is what lacks the level of the largest force and came near neither that force nor the
    displacement there: a specimen that has softened reaches its displacement, and counts.
    """
    loading = [p for p in curve.points if p.branch == "loading"]
    valid = [p for p in loading if math.isfinite(p.force) and math.isfinite(p.displacement)]
    if not curve.held or not valid:
        return {}
    top = max(valid, key=lambda p: abs(p.force))
    reasons = {}
    for repetition in dict.fromkeys(p.repetition for p in valid):
        own = [p for p in valid if p.repetition == repetition]
        reached_top = any(p.repetition == repetition and p.step == top.step for p in loading)
        if not reached_top and not _near(own, top):
            force = max(abs(p.force) for p in own)
            reasons[repetition] = (
                f"repetition {repetition} ended at {force:.4g} of {abs(top.force):.4g} N: "
                "left out of the mean"
            )
    return reasons


def _near(own: list[Point], top: Point) -> bool:
    force = max(abs(p.force) for p in own)
    displacement = max(abs(p.displacement) for p in own)
    return force >= NEARLY * abs(top.force) or displacement >= NEARLY * abs(top.displacement)
