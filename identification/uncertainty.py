"""Standard uncertainties put together as the GUM (JCGM 100:2008) does it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

# Standard deviations on either side of a normal 95 % interval, and of a 90 % one.
TWO_SIDED, TWO_SIDED_90 = 1.959963984540054, 1.6448536269514722


@dataclass(frozen=True)
class Contribution:
    """One line of an uncertainty budget.

    u: standard uncertainty in the unit of the result; dof: its degrees of freedom (inf: stated,
    not observed). counted False: listed for the reader, and already contained in another line.
    common: the same error in every result of the session (a gain), which cancels in a ratio.
    """

    name: str
    kind: Literal["A", "B"]
    u: float
    dof: float = math.inf
    counted: bool = True
    common: bool = False


@dataclass(frozen=True)
class Quantity:
    """A value with its standard uncertainty, effective degrees of freedom and 95 % interval."""

    value: float
    u: float
    dof: float
    interval: tuple[float, float]


def combined(value: float, budget: Sequence[Contribution]) -> Quantity:
    """Root of the sum of squares, Welch-Satterthwaite (GUM G.4.1), interval from Student's t."""
    counted = [line for line in budget if line.counted and line.u > 0]
    u = math.sqrt(sum(line.u**2 for line in counted))
    loss = sum((line.u / u) ** 4 / line.dof for line in counted) if u > 0 else 0.0
    dof = 1.0 / loss if loss > 0 else math.inf
    half = coverage_factor(dof) * u
    return Quantity(value, u, dof, (value - half, value + half))


def coverage_factor(dof: float) -> float:
    """Student's t for a two-sided 95 % interval; `dof` may be any number above 0, or inf."""
    if math.isinf(dof):
        return TWO_SIDED
    from scipy.special import stdtrit

    return float(stdtrit(dof, 0.975))
