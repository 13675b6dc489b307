"""Figures of a diagnosis, and the numbers behind them, as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from identification.gap.answer.remainder import Remainder, remainder
from rig.diagnosis.diagnose import Diagnosis
from rig.diagnosis.gap_curve import curve
from rig.diagnosis.gap_map import gap_map
from rig.diagnosis.gap_points import (
    Points,
    Shown,
    Table,
    held_table,
    point_table,
    points,
    remainder_table,
    shown,
    write_table,
)
from rig.diagnosis.gap_ranking import probabilities, ranked, withheld
from rig.diagnosis.gap_residual import remaining, residual
from rig.errors import InputError
from rig.plotting import watermark, write_figures
from rig.storage.files import legible

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(diagnosis: Diagnosis, folder: Path, name: str = "") -> list[Path]:
    """Writes every figure as PNG and SVG and its numbers as CSV into `folder`; the files written.

    name: of the data set, put into a corner. InputError if the folder can't be written to.
    """
    drawing = _Drawing(diagnosis, name or diagnosis.dataset)
    written = write_figures(folder, drawing.figures)
    try:
        for stem, table in drawing.tables():
            path = folder / f"{stem}.csv"
            write_table(table, drawing.comments(), path)
            written.append(path)
    except OSError as error:
        raise InputError(
            f"{folder}: the tables can't be written there ({error.strerror}). "
            "Give another folder with --figures."
        ) from error
    return written


class _Drawing:
    """What all figures of one diagnosis share."""

    def __init__(self, diagnosis: Diagnosis, name: str) -> None:
        self.banners, self.name = diagnosis.banners, name
        result = diagnosis.result
        self.shown: Shown = shown(result)
        self.points: Points = points(result)
        self.remainder: Remainder = remainder(result.engine, result.fit)

    def figures(self) -> Iterator[tuple[str, Figure]]:
        """(name, figure) one after the other: only one is held in memory."""
        yield "gap_curve", self._finish(curve(self.shown, self.points))
        yield "gap_map", self._finish(gap_map(self.shown, self.points))
        yield "gap_residual", self._finish(residual(self.shown, self.points))
        yield "gap_probabilities", self._finish(probabilities(self.shown))
        yield "gap_withheld", self._finish(withheld(self.shown))
        yield "gap_remainder", self._finish(remaining(self.shown, self.points, self.remainder))

    def tables(self) -> Iterator[tuple[str, Table]]:
        """(name, numbers): curve, map and residual share one table."""
        yield "gap_points", point_table(self.shown, self.points)
        chances = ranked(self.shown, 0.0)
        yield "gap_probabilities", {"word": list(chances), "probability": list(chances.values())}
        yield "gap_withheld", held_table(self.shown)
        yield "gap_remainder", remainder_table(self.shown, self.remainder)

    def comments(self) -> tuple[str, ...]:
        """First lines of every table."""
        return (*self.banners, f"rig diagnose {legible(self.name)}: {self.shown.verdict}")

    def _finish(self, figure: Figure) -> Figure:
        """The data set's name; and across the figure what must not be overlooked."""
        return watermark(figure, self.banners, self.name)
