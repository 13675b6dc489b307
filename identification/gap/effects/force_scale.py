"""Gain of the force chain is off: every direction and pose by the same factor; encoders too.

Wrong sensitivity or range of a charge amplifier: 2 to 20 %.

Size: 2 to 20 %.
Prior: either sign, sd out of SCALES, equally likely.
Source: tolerances and neighbouring ranges of charge amplifiers.
"""

from __future__ import annotations

from identification.gap.bench import Bench
from identification.gap.variants import Variant, variant

WORD = "force_scale"
SCALES = (0.03, 0.08, 0.2)


def variants(bench: Bench) -> list[Variant]:
    """One coefficient: the gain of the force minus one."""
    if bench.imposed:
        column = bench.add(bench.stacked(bench.slope * bench.load))
    else:
        column = bench.add(bench.force_column(-bench.load))
    return [variant(WORD, "gain", [column], SCALES, positive=False)]
