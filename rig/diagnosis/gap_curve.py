"""Measurement, simulation before and after, and the gap between them, setup by setup."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.diagnosis.gap_layout import (
    GREEN,
    GREY,
    MANY,
    SENSES,
    answer_label,
    drive_label,
    first_column,
    label_below,
    noise_axis,
    panels,
    set_title,
    shared_legend,
)
from rig.diagnosis.gap_points import RISING, Points, Shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NOISE = "noise, ±2 standard deviations"
_BEYOND = 4.0  # times what was measured: what is simulated leaves the panel, else it hides that


def curve(shown: Shown, points: Points) -> Figure:
    """Measurement and simulation before and after, one panel per pose and direction; below each,
    measured minus simulated, which the curves alone would hide, beside the noise.

    Displacement over force; where the displacement was imposed, force over displacement.
    """
    figure, grid, numbers = panels(len(shown.setups), below=True)
    scale = axes_of(shown, points)[2]
    noise = 2 * float(np.median(points.noise * scale))
    for (upper, lower), setup in zip(grid, numbers, strict=True):
        _curve_panel(shown, points, upper, setup)
        _gap_panel(shown, points, lower, setup)
        upper.set_title(shown.setup_name(setup), fontsize=10)
    noise_axis(grid[0][1], noise, float(np.abs(points.gap_before * scale).max()))  # they share it
    for upper, lower in first_column(grid):
        upper.set_ylabel(answer_label(shown.imposed))
        lower.set_ylabel("Gap in N" if shown.imposed else "Gap in mm")
    label_below(grid, drive_label(shown.imposed))
    set_title(figure, f"Measured, and simulated before and after ({shown.with_what})")
    shared_legend(figure, [axes for pair in grid for axes in pair])
    figure.align_ylabels()
    return figure


def axes_of(shown: Shown, points: Points) -> tuple[Any, Any, Any]:
    """What drives the rig, what answers (n,), and mm to the answer's unit (n,)."""
    if shown.imposed:
        return points.displacement, points.force, 1 / points.stated
    return points.force, points.displacement, np.ones(len(points.force))


def _curve_panel(shown: Shown, points: Points, axes: Any, setup: int) -> None:
    mine = points.setup == setup
    x, y, scale = axes_of(shown, points)
    many = np.count_nonzero(mine) > MANY
    for sense, label, edge, fill, marker in SENSES:
        here = mine & (points.sense == sense)
        if here.any():
            axes.plot(
                x[here],
                y[here],
                marker,
                color=edge,
                markerfacecolor=fill,
                markersize=2 if many else 4,
                markeredgewidth=0.5 if many else 0.9,
                label=f"measured, {label}",
                rasterized=many,
                zorder=4 if many else 2,  # many lines would hide small dots
            )
    zero = mine & (points.sense == 0)
    if zero.any():
        axes.plot(x[zero], y[zero], "x", color=GREY, markersize=4, label="measured, zero load")
    in_order = np.flatnonzero(mine)[np.argsort(x[mine], kind="stable")]
    for i, way in enumerate(legs(points, x, setup) if shown.remembers else [in_order]):
        axes.plot(
            x[way],
            (points.before * scale)[way],
            "--",
            color="black",
            linewidth=1.2,
            label="_" if i else "simulated before",
            zorder=3,
        )
    for i, leg in enumerate(legs(points, x, setup)):
        axes.plot(
            x[leg],
            (points.after * scale)[leg],
            "-" if len(leg) > 1 else ".",
            color=GREEN,
            linewidth=0.6 if many else 1.1,
            markersize=4,
            zorder=3,
            label="_" if i else "simulated after (each run)",
        )
    told = np.concatenate([y[mine], (points.after * scale)[mine]])
    low, high = float(told.min()), float(told.max())
    if np.ptp((points.before * scale)[mine]) > _BEYOND * (high - low) > 0:
        margin = 0.5 * (high - low)
        axes.set_ylim(low - margin, high + margin)


def _gap_panel(shown: Shown, points: Points, axes: Any, setup: int) -> None:
    """Measured minus simulated, before and after, run by run."""
    x, _, scale = axes_of(shown, points)
    mine = np.flatnonzero(points.setup == setup)
    noise_band(axes, x[mine], (points.noise * scale)[mine])
    axes.axhline(0, color="0.4", linewidth=0.8)
    many = len(mine) > MANY  # whose lines would be a tangle
    for leg in legs(points, x, setup):
        for gap, colour, line, what in (
            (points.gap_before, "black", "--", "before"),
            (points.gap_after, GREEN, "-", "after"),
        ):
            dots = many or len(leg) == 1
            axes.plot(
                x[leg],
                (gap * scale)[leg],
                linestyle="" if dots else line,
                marker="." if dots else "",
                markersize=2 if many else 5,
                color=colour,
                linewidth=0.9 if what == "before" else 1.1,
                rasterized=many,
                label=f"gap {what}: {'each point' if many else 'load taken off'}" if dots else "_",
            )


def noise_band(axes: Any, x: Any, noise: Any) -> None:
    """Of every point its own, sd (n,): a soft direction turns the same force noise into more, a
    hold of few samples averages less of it away."""
    order = np.argsort(x, kind="stable")
    edge = 2 * noise[order]
    look = {"color": "0.5", "alpha": 0.25, "linewidth": 0, "zorder": 0, "label": _NOISE}
    if np.ptp(x) > 0:
        axes.fill_between(x[order], -edge, edge, **look)
    else:  # nothing would be seen of it
        axes.axhspan(-edge.max(), edge.max(), **look)


def legs(points: Points, x: Any, setup: int) -> Iterator[Any]:
    """Of every run of a setup the numbers of the points that a line may join: it ends where the
    load was taken off with no look on the way.

    x (n,): what drives the rig.
    """
    for run in np.unique(points.run[points.setup == setup]):
        path = np.flatnonzero(points.run == run)
        off = (points.sense[path[:-1]] == RISING) & (points.sense[path[1:]] == 0)
        far = np.abs(np.diff(x[path])) > 0.5 * np.ptp(x[path])
        yield from np.split(path, 1 + np.flatnonzero(off & far))
