"""What the figures of a diagnosis are drawn from. Loads nothing that draws: who diagnoses leaves
that to others."""

from __future__ import annotations

from dataclasses import dataclass

from identification.gap.answer.remainder import Remainder, remainder
from rig.diagnosis.diagnose import Diagnosis
from rig.diagnosis.gap_points import Points, Shown, points, shown


@dataclass(frozen=True, eq=False)
class GapView:
    """What the figures of a diagnosis are drawn from, small enough to be handed to another process.

    stem: what the figures' names begin with.
    """

    shown: Shown
    points: Points
    rest: Remainder
    banners: tuple[str, ...]
    stem: str
    png: bool


def view_of(diagnosis: Diagnosis, stem: str, *, png: bool) -> GapView:
    """Of a diagnosis."""
    r = diagnosis.result
    rest = remainder(r.engine, r.fit)
    return GapView(shown(r), points(r), rest, diagnosis.banners, stem, png)
