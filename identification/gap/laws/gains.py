"""Gains that are off: what the effects of force and displacement share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws.curves import BENT_SLOPE, hinge
from identification.gap.laws.interval import LEAST_FACTOR, Coefficients, Parameter, factors
from identification.gap.laws.law import Law, Term
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant
from identification.uncertainty import TWO_SIDED

SCALES = (0.03, 0.08, 0.2)
_ARMLESS_SCALE = 0.6  # excitations and ranges are set wrong on rigs without an arm
_BENDS = np.diag([1.0, 0.08])  # at full range, of what the gain is off


def _scales(bench: Bench) -> tuple[float, ...]:
    """Of a gain that is the same all over the range."""
    return SCALES if bench.data.arm else (*SCALES, _ARMLESS_SCALE)


def straight_and_bent(
    bench: Bench, word: str, read: Array, column: Callable[[Array], int]
) -> list[Variant]:
    """The gain of a reading (n,) minus one, alone; and, of an arm, with what it has more at full
    range: one spring's curve would be the same. column: from what is read to its place in the pool
    of the bench."""
    straight, top = column(read), float(np.abs(read).max())
    out = [variant(word, "gain", [straight], _scales(bench), positive=False)]
    if bench.data.arm and top > 0:
        both = [straight, column(read * np.abs(read) / top)]
        facts: dict[str, Any] = {"root": _BENDS, "positive": False, "prior": 0.5, "full": top}
        out.append(variant(word, "gain that bends", both, SCALES, **facts))
    return out


def factor(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """Read over true, which is known to a factor. The columns are shares of what was read, but for
    an imposed displacement. Of a gain that bends or changes, the straight line of least squares; of
    one component's gain, with its name."""
    above = v.info.get("share")
    more = BENT_SLOPE if above is None else 1 - 1.5 * above + 0.5 * above**3
    share = np.array([1.0, more])[: len(found.w)]
    off, sd = float(share @ found.w), _nats(bench, v, found, share)
    whole = max(1 + off if bench.imposed else 1 - off, LEAST_FACTOR)
    spread = float(np.exp(min(TWO_SIDED * sd, -np.log(LEAST_FACTOR))))
    value = whole if bench.imposed else 1 / whole
    of = v.info.get("component")
    return {f"factor_{of}" if of else "factor": factors(value, spread, "1")}


def _nats(bench: Bench, v: Variant, found: Coefficients, share: Array) -> float:
    """Standard deviation of the logarithm of the factor that a share of the readings is too much,
    which coefficients (k,) give. Of a response that is read wrongly, what is left is a share of
    what was read, and so of the factor; but as far as springs are uncertain, the share moves in
    proportion to what they carry."""
    off, square = float(share @ found.w), max(float(share @ found.cov @ share), 0.0)
    s, whole = found.softer, max(1 + off if bench.imposed else 1 - off, LEAST_FACTOR)
    springs = sum(float(share @ s.cross[j]) ** 2 / s.variance[j] for j in s.value)
    springs = min(springs, square)
    of_rest = 1.0 if v.word == "displacement_scale" and not bench.imposed else whole
    return float(np.sqrt(springs / whole**2 + (square - springs) / of_rest**2))


def law_of_gain(v: Variant, of: str) -> tuple[Law, Array]:
    """Terms: the share of what is shown that is too much, `1 - 1 / gain`; where it bends, that
    which comes on top in proportion to the reading, or to what of it lies above a range. of:
    what the reading at full range is called."""
    if "component" in v.info:
        return Law({}, (Term("gain", {"axis": str(v.info["component"])}),)), np.ones(1)
    if len(v.columns) == 1:
        return Law({}, (Term("gain"),)), np.ones(1)
    if "above" in v.info:
        return Law({}, (Term("gain"), Term("gain", {"above": float(v.info["above"])}))), np.ones(2)
    return Law({}, (Term("gain"), Term("gain", {of: float(v.info["full"])}))), np.ones(2)


def weighed(read: Array, term: Term, of: str) -> Array:
    """(n,) readings (n,) as a term weighs them."""
    if "above" in term.shape:
        return hinge(read, term.shape["above"])
    return read * np.abs(read) / term.shape[of] if of in term.shape else read
