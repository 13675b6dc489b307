"""Gain of the laser is off (tilt, wrong range): every direction by one factor, encoders disagree.

A target tilted by 20 degrees reads 6 % off; a wrong range 20 %. Triangulation bends over its range,
and a sensor that changes its range has two gains.

Size: 1 % (10 degrees of tilt: 1.5 %) to 20 %.
Prior: either sign, sd out of SCALES, equally likely; of an arm half of it on a gain that
bends or changes.
Source: cosine of the target's tilt; neighbouring ranges of laser sensors; their linearity.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.laws.curves import hinge
from identification.gap.laws.effect import Effect
from identification.gap.laws.gains import SCALES, factor, law_of_gain, straight_and_bent, weighed
from identification.gap.laws.law import Law, Laws
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant

WORD = "displacement_scale"
# Of the largest reading; what changes earlier is a seat.
CHANGES_AT = (0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85)


def variants(bench: Bench) -> list[Variant]:
    """The gain of the displacement minus one, alone; and with what it has more at full range."""
    line, top = bench.line, float(np.abs(bench.line).max())
    out = straight_and_bent(bench, WORD, line, lambda read: bench.add(bench.outside_column(read)))
    if bench.data.arm and top > 0:
        straight = out[0].columns[0]
        out += [_of_two_ranges(bench, straight, share, top) for share in CHANGES_AT]
    return out


def _of_two_ranges(bench: Bench, straight: int, share: float, top: float) -> Variant:
    """Beyond a share of the largest reading (m) the gain is another one."""
    beyond = bench.add(bench.outside_column(hinge(bench.line, share * top)))
    prior = 0.5 / len(CHANGES_AT)
    return variant(
        WORD,
        f"gain that changes at {share:g}",
        [straight, beyond],
        SCALES,
        positive=False,
        prior=prior,
        above=share * top,
        share=share,
    )


def _describe(_: Bench, v: Variant) -> tuple[Law, Array]:
    return law_of_gain(v, "at_response")


def _columns(bench: Bench, law: Law) -> list[Array]:
    """A share of the response to the load."""
    return [bench.outside_column(weighed(bench.line, t, "at_response")) for t in law.terms]


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=factor,
    laws=Laws(_describe, _columns),
    lengths=(),
    finer=None,
)
