"""Of two curves, the levels that both have.

Where a curve is bent, k is an average over its levels: two such k differ where the levels do,
though the arm is the same. So bent curves are compared over what was measured in both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from identification.curve import Curve
from identification.levels import Level, grid_of
from identification.stiffness import Options, Stiffness, analyze_curve
from identification.straight import leaves_line

_SAME = 0.02  # of a level's force: so far two levels may lie apart and be the same
_SAME_RANGE = 0.1  # of the largest force: so far the ends of two ranges may lie apart
_FEWEST = 2


@dataclass(frozen=True)
class Side:
    """A curve and what was found of it."""

    curve: Curve
    found: Stiffness

    @property
    def levels(self) -> list[Level]:
        """Those that count towards k."""
        return counting(self.found)

    @property
    def bent(self) -> bool:
        """Whether the levels that count leave a straight line."""
        used = grid_of(self.curve.points, "loading").keep(p.step for p in self.levels)
        return bool(leaves_line(used, origin=self.curve.origin))

    def only(self, levels: list[Level]) -> Stiffness:
        """k by the same choice over these levels alone."""
        steps = {p.step for p in levels}
        points = tuple(p for p in self.curve.points if p.branch == "loading" and p.step in steps)
        choice = self.found.choice
        options = Options(choice.weighting, choice.intercept, keep_after_knee=True)
        return analyze_curve(replace(self.curve, points=points), options)


def counting(found: Stiffness) -> list[Level]:
    """Loading levels that count towards k."""
    return [p for p in found.levels if p.branch == "loading" and p.step not in found.steps_out]


def span(levels: list[Level]) -> tuple[float, float]:
    """The lowest and the highest force; zeros without levels."""
    forces = [p.force for p in levels]
    return (min(forces), max(forces)) if forces else (0.0, 0.0)


def other_ranges(a: Stiffness, b: Stiffness) -> bool:
    """Whether the two k rest on ranges of force that differ by more than a tenth."""
    ranges = [span(counting(side)) for side in (a, b)]
    apart = max(abs(x - y) for x, y in zip(*ranges, strict=True))
    return bool(apart > _SAME_RANGE * max(map(abs, ranges[0])))


def averages_differ(a: Side, b: Side) -> bool:
    """Whether the two k are averages over different levels of a bent curve."""
    if a.curve.held and b.curve.held:
        same = len(in_common(a, b)[0]) == len(a.levels) == len(b.levels)
    else:
        same = not other_ranges(a.found, b.found)
    return not same and (a.bent or b.bent)


def in_common(a: Side, b: Side) -> tuple[list[Level], list[Level]]:
    """Levels of a and of b at the same forces, pair by pair."""
    mine, others, left = [], [], b.levels
    for level in a.levels:
        near = min(left, key=lambda p: abs(p.force - level.force), default=None)
        if near is not None and abs(near.force - level.force) <= _SAME * abs(level.force):
            mine.append(level)
            others.append(near)
            left = [p for p in left if p is not near]
    return mine, others


def over_common_levels(a: Side, b: Side) -> tuple[Stiffness, Stiffness] | None:
    """Both k over the levels that both have; None where these are too few, or give no k."""
    mine, others = in_common(a, b)
    if len(mine) < _FEWEST:
        return None
    found = a.only(mine), b.only(others)
    return None if found[0].k is None or found[1].k is None else found
