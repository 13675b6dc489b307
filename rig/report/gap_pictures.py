"""The figures of a diagnosis that a report shows, with their captions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from rig.diagnosis.gap_curve import curve
from rig.diagnosis.gap_map import gap_map
from rig.diagnosis.gap_points import held_table, point_table, remainder_table
from rig.diagnosis.gap_ranking import withheld
from rig.diagnosis.gap_residual import remaining
from rig.report.document import Figure
from rig.report.drawing import draw
from rig.report.figures import watermark
from rig.report.gap_view import GapView

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plot

    from rig.diagnosis.gap_points import Table

Rows = tuple[tuple[object, ...], ...]


def gap_figures(view: GapView, names: Sequence[str]) -> Iterator[Figure]:
    """Curve, map, withheld data, remainder, as far as they are named."""
    r, p, rest = view.shown, view.points, view.rest
    known: dict[str, tuple[str, Callable[[], Plot], Callable[[], Table]]] = {
        "curve": (
            "Measurement, and the simulation before and after the effects.",
            lambda: curve(r, p),
            lambda: point_table(r, p),
        ),
        "map": (
            "Where the gap lies, before and after: over force and over time.",
            lambda: gap_map(r, p),
            lambda: point_table(r, p),
        ),
        "withheld": (
            "How far the gap shrinks: fitted, and on data that were withheld.",
            lambda: withheld(r),
            lambda: held_table(r),
        ),
        "remainder": (
            "What repeats and stays unexplained, with its uncertainty.",
            lambda: remaining(r, p, rest),
            lambda: remainder_table(r, rest),
        ),
    }
    for name in names:
        caption, plot, table = known[name]
        header, rows = _columns(table())
        yield draw(
            f"{view.stem}_gap_{name}",
            caption,
            caption,
            _marked(plot, view.banners),
            header=header,
            rows=rows,
            png=view.png,
        )


def _marked(plot: Callable[[], Plot], banners: tuple[str, ...]) -> Callable[[], Plot]:
    return lambda: watermark(plot(), banners)


def _columns(table: Table) -> tuple[tuple[str, ...], Rows]:
    header = tuple(table)
    return header, tuple(zip(*(list(table[k]) for k in header), strict=True))
