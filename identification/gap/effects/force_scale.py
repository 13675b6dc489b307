"""Gain of the force chain is off: every direction and pose by the same factor; encoders too. Or
that of one component, whose amplifier is set wrongly: directions that it does not read are right.

Wrong sensitivity or range of a charge amplifier: 2 to 20 %. The gain may bend a little over the
range, as amplifiers and load cells do.

Size: 2 to 20 %.
Prior: either sign, sd out of SCALES, equally likely; of an arm half as much on one that bends
as on one that does not, a fifth as much on that of each component.
Source: tolerances and neighbouring ranges of charge amplifiers; their linearity in data sheets.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.laws.effect import Effect
from identification.gap.laws.gains import SCALES, factor, law_of_gain, straight_and_bent, weighed
from identification.gap.laws.law import Law, Laws
from identification.gap.model.base import component, shown
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant

WORD = "force_scale"


def variants(bench: Bench) -> list[Variant]:
    """The gain of the force minus one, alone; and with what it has more at full range."""
    out = straight_and_bent(bench, WORD, bench.load, lambda read: bench.add(shown(bench, read)))
    return out + [_of_one(bench, axis) for axis in _loaded(bench)]


def _loaded(bench: Bench) -> list[int]:
    """Components of the force of which one may be off while others are right: each that some
    setup loads, and not every one."""
    loaded = np.stack([s.loads for s in bench.data.setups])
    return [a for a in range(3) if loaded[:, a].any() and not loaded[:, a].all()]


def _of_one(bench: Bench, axis: int) -> Variant:
    """Every component has an amplifier of its own."""
    column = bench.add(component(bench, axis))
    return variant(
        WORD,
        f"gain of {'xyz'[axis]}",
        [column],
        SCALES,
        positive=False,
        prior=0.2,
        component="xyz"[axis],
    )


def _describe(_: Bench, v: Variant) -> tuple[Law, Array]:
    return law_of_gain(v, "at_load")


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Less force than read deflects less."""
    return [
        component(bench, "xyz".index(t.shape["axis"]))
        if "axis" in t.shape
        else shown(bench, weighed(bench.load, t, "at_load"))
        for t in law.terms
    ]


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=factor,
    laws=Laws(_describe, _columns, through_springs=True),
    lengths=(),
    finer=None,
)
