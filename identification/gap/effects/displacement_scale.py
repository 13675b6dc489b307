"""Gain of the laser is off (tilt, wrong range): every direction by one factor, encoders disagree.

A target tilted by 20 degrees reads 6 % off; a wrong range 20 %.

Size: 1 % (10 degrees of tilt: 1.5 %) to 20 %.
Prior: either sign, sd out of SCALES, equally likely.
Source: cosine of the target's tilt; neighbouring ranges of laser sensors.
"""

from __future__ import annotations

from identification.gap.bench import Bench
from identification.gap.variants import Variant, variant

WORD = "displacement_scale"
SCALES = (0.03, 0.08, 0.2)


def variants(bench: Bench) -> list[Variant]:
    """One coefficient: the gain of the displacement minus one."""
    column = bench.add(bench.outside_column(bench.line))
    return [variant(WORD, "gain", [column], SCALES, positive=False)]
