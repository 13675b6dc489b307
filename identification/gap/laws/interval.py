"""A value with its interval, and what the coefficients of an effect say of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.arrays import Array
from identification.uncertainty import TWO_SIDED, TWO_SIDED_90


@dataclass(frozen=True)
class Parameter:
    """value with its 95 % interval; inner: the 90 % one, where no normal law gives it: a threshold
    that may be at one depth or another has two places, and nothing between. most, least: the
    largest and the smallest that is possible: of a threshold the largest load, as none above it is
    seen. by_factors: it is known to a factor, as a time constant is."""

    value: float
    low: float
    high: float
    unit: str
    inner: tuple[float, float] | None = None
    most: float = np.inf
    least: float = -np.inf
    by_factors: bool = False

    @property
    def sd(self) -> float:
        """Of a normal law with this interval."""
        return (self.high - self.low) / (2 * TWO_SIDED)

    @property
    def ci90(self) -> tuple[float, float]:
        """The 90 % interval."""
        if self.inner is not None:
            return self.inner
        nearer = TWO_SIDED_90 / TWO_SIDED
        if self.by_factors:
            low, high = (self.value * (v / self.value) ** nearer for v in (self.low, self.high))
        else:
            low, high = (self.value + nearer * (v - self.value) for v in (self.low, self.high))
        return low, high

    @property
    def cut_at(self) -> float | None:
        """The largest load that was seen, where the interval would have gone on beyond it."""
        return self.most if self.most < np.inf and self.unit != "1" else None

    def over(self, factor: Parameter) -> Parameter:
        """Divided by a factor that is known independently of it."""
        value = self.value / factor.value
        half = (factor.high - factor.low) / 2 / factor.value * abs(value)

        def ends(low: float, high: float, half: float) -> tuple[float, float]:
            off = np.hypot(np.array([low, high]) / factor.value - value, half)
            return value - float(off[0]), value + float(off[1])

        inner = self.inner and ends(*self.inner, half * TWO_SIDED_90 / TWO_SIDED)
        low, high = ends(self.low, self.high, half)
        most = self.most / factor.value
        return replace(self, value=value, low=low, high=high, inner=inner, most=most)

    def possible(self, least: float) -> Parameter:
        """Its intervals by the quantiles of what is possible, from `least` to `most`; most then:
        infinite where all of the 95 % lay below it anyway."""
        if not self.low < self.high:
            return self
        least = max(least, self.least)
        value = float(np.clip(self.value, least, self.most))

        def of(ends: tuple[float, float], deviations: float) -> tuple[float, float]:
            if not self.by_factors:
                return _between(value, ends, deviations, (least, self.most))
            about, low, high, most = np.log([value, *ends, self.most]).tolist()
            low, high = _between(about, (low, high), deviations, (-np.inf, most))
            return float(np.exp(low)), float(np.exp(high))

        low, high = of((self.low, self.high), TWO_SIDED)
        inner, most = of(self.ci90, TWO_SIDED_90), self.most if self.high > self.most else np.inf
        return replace(self, value=value, low=low, high=high, inner=inner, most=most)


def _between(
    value: float, ends: tuple[float, float], deviations: float, possible: tuple[float, float]
) -> tuple[float, float]:
    """Ends of an interval of so many standard deviations, those on either side of the value its
    own, in the distribution that ends where nothing more is possible."""
    from scipy.special import ndtr, ndtri  # its import takes a tenth of a second

    below, above = max(value - ends[0], 0.0) / deviations, max(ends[1] - value, 0.0) / deviations
    first = ndtr((possible[0] - value) / below) if below > 0 else 0.5
    last = ndtr((possible[1] - value) / above) if above > 0 else 0.5
    tail = ndtr(-deviations) * (last - first)
    low, high = (
        value + z * (below if z < 0 else above) for z in ndtri([first + tail, last - tail])
    )
    return min(float(low), value), max(float(high), value)


@dataclass(frozen=True, eq=False)
class ComplianceChange:
    """Relative changes of the springs' compliance beside an effect, by joint: value, variance, and
    covariance (k,) with the effect's coefficients. A joint without a spring of its own is absent.
    """

    value: dict[int, float]
    variance: dict[int, float]
    cross: dict[int, Array]


NOMINAL = ComplianceChange({}, {}, {})


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients (k,) of a part, their covariance (k, k), and the springs beside it."""

    w: Array
    cov: Array
    softer: ComplianceChange

    def linear(self, functional: Array, unit: str, scale: float = 1.0) -> Parameter:
        """A linear function of the coefficients."""
        square = max(float(functional @ self.cov @ functional), 0.0)
        return normal(float(functional @ self.w) * scale, square * scale**2, unit)

    def one(self, index: int, unit: str, scale: float = 1.0) -> Parameter:
        """A single coefficient."""
        return self.linear(np.eye(len(self.w))[index], unit, scale)

    def per_spring(self, functional: Array, joint: int | None, unit: str = "1") -> Parameter:
        """A linear function of coefficients that are in units of a joint's simulated compliance,
        over the compliance that was found: `f / (1 + s)`, by its derivatives."""
        value = float(functional @ self.w)
        square = float(functional @ self.cov @ functional)
        if joint is None or joint not in self.softer.value:
            return normal(value, max(square, 0.0), unit)
        softer = max(1 + self.softer.value[joint], _LEAST_COMPLIANCE)
        ratio = value / softer
        square += ratio**2 * self.softer.variance[joint]
        square -= 2 * ratio * float(functional @ self.softer.cross[joint])
        return normal(ratio, max(square, 0.0) / softer**2, unit)

    def first(self, k: int) -> Coefficients:
        """The first k coefficients alone."""
        s = self.softer
        cross = {j: c[:k] for j, c in s.cross.items()}
        return Coefficients(
            self.w[:k], self.cov[:k, :k], ComplianceChange(s.value, s.variance, cross)
        )

    def without_line(self, joint: int) -> Coefficients:
        """All coefficients but the last, which is what the joint's spring has more."""
        k = len(self.w) - 1
        return self.on_spring(np.eye(k + 1)[k], joint).first(k)

    def on_spring(self, functional: Array, joint: int) -> Coefficients:
        """A linear function of the coefficients counted as compliance of the joint's spring."""
        s, moves = self.softer, self.cov @ functional
        cross = s.cross.get(joint, np.zeros(len(self.w)))
        value = s.value.get(joint, 0.0) + float(functional @ self.w)
        variance = s.variance.get(joint, 0.0) + float(functional @ (moves + 2 * cross))
        softer = ComplianceChange(
            {**s.value, joint: value},
            {**s.variance, joint: variance},
            {**s.cross, joint: cross + moves},
        )
        return replace(self, softer=softer)

    def of_spring(self, joint: int) -> tuple[float, float]:
        """The spring that was found over that simulated, compliances or, of what is imposed as a
        displacement, stiffnesses; and its variance."""
        s = self.softer
        ratio = max(1 + s.value.get(joint, 0.0), _LEAST_COMPLIANCE)
        return ratio, s.variance.get(joint, 0.0)


_LEAST_COMPLIANCE = 0.1  # of the simulated one

LEAST_FACTOR = 1e-6  # of what is simulated: less is not told from nothing


def normal(value: float, variance: float, unit: str) -> Parameter:
    """A value with the 95 % interval of a normal law of that variance."""
    half = TWO_SIDED * variance**0.5
    return Parameter(value, value - half, value + half, unit)


def factors(value: float, spread: float, unit: str) -> Parameter:
    """A value that is known to a factor."""
    return Parameter(value, value / spread, value * spread, unit, by_factors=True)
