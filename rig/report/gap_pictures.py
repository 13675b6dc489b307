"""The figures of a diagnosis that a report shows, with their captions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from rig.diagnose import Diagnosis
from rig.gap_figures import curve, remaining, withheld
from rig.gap_map import gap_map
from rig.gap_points import held_table, point_table, points, remainder_table
from rig.report.document import Figure
from rig.report.drawing import draw
from rig.report.figures import watermark

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plot

    from rig.gap_points import Table

Rows = tuple[tuple[object, ...], ...]


def gap_figures(diagnosis: Diagnosis, stem: str, *, png: bool) -> Iterator[Figure]:
    """Curve, map, withheld data, remainder; their names begin with `stem`."""
    from identification.gap.remainder import remainder

    r = diagnosis.result
    p = points(r)
    rest = remainder(r.engine, r.fit)

    def one(name: str, caption: str, plot: Callable[[], Plot], table: Table) -> Figure:
        marked = lambda: watermark(plot(), diagnosis.banners)  # noqa: E731
        header, rows = _columns(table)
        return draw(f"{stem}_{name}", caption, caption, marked, header=header, rows=rows, png=png)

    yield one("gap_curve", "Measurement, and the simulation before and after the effects.",
              lambda: curve(r, p), point_table(r, p))  # fmt: skip
    yield one("gap_map", "Where the gap lies, before and after: over force and over time.",
              lambda: gap_map(r, p), point_table(r, p))  # fmt: skip
    yield one("gap_withheld", "How far the gap shrinks: fitted, and on data that were withheld.",
              lambda: withheld(r), held_table(r))  # fmt: skip
    yield one("gap_remainder", "What repeats and stays unexplained, with its uncertainty.",
              lambda: remaining(r, p, rest), remainder_table(r, rest))  # fmt: skip


def _columns(table: Table) -> tuple[tuple[str, ...], Rows]:
    header = tuple(table)
    return header, tuple(zip(*(list(table[k]) for k in header), strict=True))
