"""Figures of an analysis, as the published ones: displacement over force, pointwise stiffness."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.analysis.analyze import Analysis, Direction
from rig.canvas import DISPLACEMENT, FORCE, blank
from rig.digits import number
from rig.plotting import COLOURS, MARKERS, watermark, write_figures
from rig.units import MM_PER_M, N_PER_MM

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(analysis: Analysis, folder: Path) -> list[Path]:
    """Writes curve and pointwise stiffness as PNG and SVG into `folder`; the files written.

    InputError if the folder can't be written to.
    """
    return write_figures(
        folder, lambda: (("curve", curve(analysis)), ("pointwise", pointwise(analysis)))
    )


def curve(analysis: Analysis) -> Figure:
    """Mean displacement over force with its standard deviation, and the line of k."""
    figure, axes = _axes(FORCE, DISPLACEMENT)
    for colour, marker, key, direction in _styles(analysis):
        _curve(axes, direction, key, colour, marker)
    axes.set_title("Displacement over force: mean and standard deviation of the repetitions")
    return _finish(figure, axes, analysis)


def pointwise(analysis: Analysis) -> Figure:
    """Pointwise stiffness over force with its standard deviation, and k."""
    figure, axes = _axes(FORCE, "Stiffness in N/mm")
    for colour, marker, key, direction in _styles(analysis):
        points = direction.result.pointwise
        if not points:
            continue
        sd = np.nan_to_num([p.sd * N_PER_MM for p in points])
        axes.errorbar(
            [p.force for p in points],
            [p.stiffness * N_PER_MM for p in points],
            sd,
            color=colour,
            marker=marker,
            markersize=4,
            capsize=3,
            linewidth=1,
            label=f"{key}: pointwise",
        )
        k = direction.result.k
        if k is not None:
            axes.axhline(
                k.value * N_PER_MM,
                color=colour,
                linestyle="--",
                linewidth=1,
                label=f"{key}: k = {number(k.value * N_PER_MM)} N/mm",
            )
    axes.set_title("Stiffness between neighbouring levels: mean and standard deviation")
    return _finish(figure, axes, analysis)


def _axes(x: str, y: str) -> tuple[Figure, Any]:
    """A figure of its own, outside pyplot: nothing is kept open, no display is needed."""
    figure = blank(7.5, 5.0)
    axes = figure.add_subplot()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    return figure, axes


def _styles(analysis: Analysis) -> Iterator[tuple[str, str, str, Direction]]:
    for i, (key, direction) in enumerate(analysis.directions.items()):
        yield COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)], key, direction


def _curve(axes: Any, direction: Direction, key: str, colour: str, marker: str) -> None:
    r = direction.result
    left_out = r.steps_out
    for branch, fill in (("loading", colour), ("unloading", "white")):
        levels = [p for p in r.levels if p.branch == branch]
        if not levels:
            continue
        axes.errorbar(
            [p.force for p in levels],
            [p.displacement * MM_PER_M for p in levels],
            np.nan_to_num([p.sd * MM_PER_M for p in levels]),
            color=colour,
            marker=marker,
            markerfacecolor=fill,
            markersize=5,
            capsize=3,
            linewidth=1,
            linestyle="-" if branch == "loading" else ":",
            label=f"{key}: {branch}",
        )
    crossed = [p for p in r.levels if p.branch == "loading" and p.step in left_out]
    if crossed:
        axes.plot(
            [p.force for p in crossed],
            [p.displacement * MM_PER_M for p in crossed],
            "x",
            color="black",
            markersize=9,
            label=f"{key}: not counted towards k",
        )
    if r.k is not None:
        counted = [p.force for p in r.levels if p.step not in left_out]
        ends = np.array([min([0.0, *counted]), max([0.0, *counted])])
        u = (r.intercept + ends / r.k.value) * MM_PER_M
        axes.plot(
            ends,
            u,
            color=colour,
            linestyle="--",
            linewidth=1,
            label=f"{key}: k = {number(r.k.value * N_PER_MM)} N/mm",
        )


def _finish(figure: Figure, axes: Any, analysis: Analysis) -> Figure:
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        order = sorted(range(len(labels)), key=lambda i: labels[i].split(":")[0])
        axes.legend(
            [handles[i] for i in order], [labels[i] for i in order], frameon=False, fontsize=8
        )
    else:
        axes.text(0.5, 0.5, "no data", transform=axes.transAxes, ha="center")
    return watermark(figure, analysis.banners, analysis.name)
