"""Whether two data sets differ: k of the same pose and direction, tested.

The difference k_b - k_a has the scatter between the repetitions of both sides (type A, n - 1
degrees of freedom each) and their gains. Where both were measured with the same instruments, and
those say so by their serial numbers, one gain moves both k the same way, and only the difference of
its effects counts; otherwise the gains are independent. Degrees of freedom after Welch and
Satterthwaite, probability from Student's t, two-sided; with several comparisons at once, adjusted
after Holm (Scand. J. Statist. 6 (1979) 65), so that 5 % is the risk of one false alarm in all of
them. Where the curves are bent and the levels differ, k over the common levels is compared
(`common_levels`). What mounting the arm or the instruments anew does to k is not in the scatter of
one session.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from identification.stiffness import Stiffness
from identification.uncertainty import Contribution, Quantity, combined
from rig.analysis.analyze import Analysis, Direction, quantity
from rig.dataset import Dataset
from rig.digits import counted
from rig.reduce import curves
from rig.report.common_levels import (
    Side,
    averages_differ,
    counting,
    in_common,
    other_ranges,
    over_common_levels,
    span,
)
from rig.units import N_PER_MM

LEVEL = 0.05
_IDENTITY = (
    "serial_number",
    "daq_serial_number",
    "serial",
    "model",
    "device",
    "full_scale_N",
    "sensitivity_pC_per_N",
    "range_mm",
)


@dataclass(frozen=True)
class Pair:
    """One pose and direction in the first data set and in a later one, by its number. N/m; ratio of
    the later one over the first.

    p: of so large a difference by chance; adjusted: for all comparisons of the report. force_N:
    lowest and highest of the levels compared, where these are not all that count towards k."""

    second: int
    key: str
    difference: Quantity
    ratio: Quantity
    p: float
    adjusted: float
    remarks: tuple[str, ...]
    force_N: tuple[float, float] | None = None

    @property
    def differs(self) -> bool:
        """Whether the adjusted probability is below 5 %."""
        return self.adjusted < LEVEL

    def to_json(self) -> dict[str, Any]:
        """Plain values; N/mm."""
        return {
            "first": 0,
            "second": self.second,
            "direction": self.key,
            "force_N": None if self.force_N is None else list(self.force_N),
            "difference_N_per_mm": quantity(self.difference, N_PER_MM),
            "ratio": quantity(self.ratio),
            "p": self.p,
            "p_adjusted": self.adjusted,
            "differs": self.differs,
            "remarks": list(self.remarks),
        }


@dataclass(frozen=True)
class Unlike:
    """A pose and direction whose two k are not the same quantity, and why."""

    second: int
    key: str
    reason: str

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"first": 0, "second": self.second, "direction": self.key, "reason": self.reason}


@dataclass(frozen=True)
class Comparison:
    """What could be tested, and what could not."""

    pairs: tuple[Pair, ...] = ()
    unlike: tuple[Unlike, ...] = ()


def compare(sets: Sequence[tuple[Dataset, Analysis]]) -> Comparison:
    """Every later data set against the first, direction by direction where both have a k."""
    if not sets:
        return Comparison()
    found: list[Pair | Unlike] = []
    first_data, first = sets[0]
    for i, (data, analysis) in enumerate(sets[1:], start=1):
        shared = same_instruments(first_data, data)
        for key, (mine, other) in aligned([first, analysis]).items():
            if mine is None or other is None:
                continue
            a, b = first.directions[mine], analysis.directions[other]
            if a.result.k is not None and b.result.k is not None:
                sides = _side(first_data, a), _side(data, b)
                found.append(_compared(i, key, *sides, shared=shared))
    pairs = adjusted([p for p in found if isinstance(p, Pair)])
    return Comparison(tuple(pairs), tuple(u for u in found if isinstance(u, Unlike)))


def _side(data: Dataset, direction: Direction) -> Side:
    return Side(curves(data)[direction.pose, direction.direction], direction.result)


def _compared(second: int, key: str, a: Side, b: Side, *, shared: bool) -> Pair | Unlike:
    """k against k, over the common levels where the k as they are would not be comparable."""
    if not averages_differ(a, b):
        return paired(second, key, a.found, b.found, shared=shared)
    whole = _shown(a.found, b.found)
    common = in_common(a, b)[0]
    both = over_common_levels(a, b)
    if both is None:
        reason = (
            "the curve is bent, so k is an average over its levels, and of these the two have "
            f"{counted(len(common), 'level')} in common ({whole}). Measure both at the same levels"
        )
        return Unlike(second, key, reason)
    pair = paired(second, key, *both, shared=shared)
    remark = (
        f"compared over the {len(common)} levels that both have: the curve is bent, and the k "
        f"above rest on other levels ({whole})"
    )
    return replace(pair, remarks=(remark, *pair.remarks), force_N=span(common))


def same_instruments(a: Dataset, b: Dataset) -> bool:
    """Whether dynamometer and laser name themselves, with a serial number, the same in both."""
    for device in ("dynamometer", "laser"):
        one, other = (d.devices.get(device, {}) for d in (a, b))
        known = [k for k in _IDENTITY if k in one or k in other]
        serials = [one[k] for k in known if "serial" in k and one.get(k) not in (None, "", "none")]
        if not serials or any(one.get(k) != other.get(k) for k in known):
            return False
    return True


def aligned(sets: Sequence[Analysis]) -> dict[str, list[str | None]]:
    """Directions side by side: name -> what each data set calls it, None where it has none.

    The same pose and direction are one, by the name that it has first (`x` in a data set with one
    pose is `P1/x` in another one); else the same name, if poses have other names.
    """
    found: dict[str, list[str | None]] = {}
    for i, analysis in enumerate(sets):
        for key, direction in analysis.directions.items():
            name = _known(found, sets, direction) or key
            if name in found and found[name][i] is not None:
                name = f"{direction.pose}/{direction.direction}"
            found.setdefault(name, [None] * len(sets))[i] = key
    return found


def _known(
    found: dict[str, list[str | None]], sets: Sequence[Analysis], direction: Direction
) -> str | None:
    """The name of the same pose and direction in an earlier data set."""
    for name, keys in found.items():
        for key, analysis in zip(keys, sets, strict=True):
            if key is None:
                continue
            other = analysis.directions[key]
            if (other.pose, other.direction) == (direction.pose, direction.direction):
                return name
    return None


def paired(second: int, key: str, a: Stiffness, b: Stiffness, *, shared: bool) -> Pair:
    """k of b against k of a. shared: the same instruments, whose gains cancel."""
    assert a.k is not None
    assert b.k is not None
    difference = b.k.value - a.k.value
    total = combined(difference, _budget(a, b, 1.0, 1.0, shared=shared))
    ratio = b.k.value / a.k.value
    relative = _budget(a, b, 1 / abs(a.k.value), 1 / abs(b.k.value), shared=shared)
    quotient = combined(ratio, [replace(c, u=abs(ratio) * c.u) for c in relative])
    p = probability(total)
    return Pair(second, key, total, quotient, p, p, _remarks(a, b))


def _budget(
    a: Stiffness, b: Stiffness, scale_a: float, scale_b: float, *, shared: bool
) -> list[Contribution]:
    """Contributions to the difference of a and b, each times its scale."""
    sides = [
        [replace(c, u=c.u * scale) for c in side.budget if c.counted]
        for side, scale in ((a, scale_a), (b, scale_b))
    ]
    if not shared:
        return [*sides[0], *sides[1]]
    budget = [c for side in sides for c in side if not c.common]
    gains = [{c.name: c for c in side if c.common} for side in sides]
    for name, mine in gains[0].items():
        other = gains[1].get(name)
        budget.append(mine if other is None else replace(mine, u=abs(mine.u - other.u)))
    return [*budget, *(c for name, c in gains[1].items() if name not in gains[0])]


def probability(difference: Quantity) -> float:
    """Two-sided probability of a difference at least so large where there is none."""
    if difference.value == 0:
        return 1.0
    if not difference.u > 0:
        return 0.0
    t = abs(difference.value) / difference.u
    if math.isinf(difference.dof):
        return math.erfc(t / math.sqrt(2))
    from scipy.special import stdtr

    return float(2 * stdtr(difference.dof, -t))


def adjusted(pairs: list[Pair]) -> list[Pair]:
    """All comparisons of a report together, after Holm: the k-th smallest p of m is multiplied by
    m - k + 1, and never falls below the ones before."""
    order = sorted(range(len(pairs)), key=lambda i: pairs[i].p)
    highest = 0.0
    out = list(pairs)
    for rank, i in enumerate(order):
        highest = max(highest, min(1.0, (len(pairs) - rank) * pairs[i].p))
        out[i] = replace(pairs[i], adjusted=highest)
    return out


def _remarks(a: Stiffness, b: Stiffness) -> tuple[str, ...]:
    """Why the two k may not be the same quantity, in sentences."""
    found = []
    if a.choice != b.choice:
        found.append(f"the lines differ ({a.choice.label}; {b.choice.label})")
    if other_ranges(a, b):
        found.append(f"they rest on other ranges of force ({_shown(a, b)})")
    if min(len(a.by_repetition), len(b.by_repetition)) < 2:
        found.append("a single repetition shows no scatter, so the stated uncertainty stands in")
    if not a.status == b.status == "ok":
        found.append("a straight line describes one of them badly")
    return tuple(found)


def _shown(a: Stiffness, b: Stiffness) -> str:
    """The ranges of the forces that count towards k."""
    ranges = [span(counting(side)) for side in (a, b)]
    return "; ".join(f"{low:.4g} to {high:.4g} N" for low, high in ranges)
