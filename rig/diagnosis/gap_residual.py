"""What the chosen explanation leaves: sample by sample, and as far as it repeats."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from identification.gap.answer.remainder import Remainder
from identification.gap.data import BRANCH_NAMES
from rig.canvas import blank
from rig.diagnosis.gap_curve import axes_of, noise_band
from rig.diagnosis.gap_layout import (
    BLUE,
    GREY,
    MANY,
    ORANGE,
    SENSES,
    drive_label,
    gap_label,
    label_below,
    panels,
    set_title,
    shared_legend,
)
from rig.diagnosis.gap_points import RISING, Points, Shown, session_clock
from rig.plotting import COLOURS
from rig.units import MM_PER_M

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def residual(shown: Shown, points: Points) -> Figure:
    """What the chosen explanation leaves, over force and over the session's time."""
    figure = blank(11.0, 4.6)
    left, right = figure.subplots(1, 2, sharey=True)
    driven = points.displacement if shown.imposed else points.force
    elapsed, unit = session_clock(points)
    for axes, x in ((left, driven), (right, elapsed)):
        axes.axhline(0, color="0.4", linewidth=0.8, zorder=1)
        _residual_points(shown, points, axes, x)
    for setup in range(len(shown.setups)):
        mine = points.setup == setup
        if mine.any():
            noise_band(left, driven[mine], points.noise[mine])
    noise_band(right, elapsed, points.noise)
    left.set_xlabel(drive_label(shown.imposed))
    assumed = not shown.clock and len(np.unique(points.run)) > 1
    right.set_xlabel(f"Time in the session in {unit}" + ", rests assumed" * assumed)
    left.set_ylabel(gap_label(shown.imposed, "Left"))
    set_title(
        figure,
        f"Left {shown.with_what}: {shown.after * MM_PER_M:.3g} mm rms of single samples; the "
        f"instruments alone leave {shown.noise * MM_PER_M:.3g} mm",
    )
    shared_legend(figure, [left])
    return figure


def _residual_points(shown: Shown, points: Points, axes: Any, x: Any) -> None:
    count = len(shown.setups)
    many = len(x) > MANY
    for setup in range(count):
        for sense, label, _, _, marker in SENSES:
            here = (points.setup == setup) & (points.sense == sense)
            if not here.any():
                continue
            colour = COLOURS[setup % len(COLOURS)]
            axes.plot(
                x[here],
                points.gap_after[here],
                marker,
                color=colour,
                markerfacecolor=colour if sense == RISING else "white",
                markersize=2 if many else 4,
                markeredgewidth=0.6 if many else 0.9,
                label=f"{shown.setup_name(setup)}: {label}",
                rasterized=many,
            )
    zero = points.sense == 0
    if zero.any():
        axes.plot(x[zero], points.gap_after[zero], "x", color=GREY, markersize=4, label="zero load")


def remaining(shown: Shown, points: Points, rest: Remainder) -> Figure:
    """What repeats of the residual, as a smooth curve with its uncertainty, over the residuals of
    all runs, setup by setup."""
    figure, grid, numbers = panels(len(shown.setups))
    for (axes,), setup in zip(grid, numbers, strict=True):
        axes.axhline(0, color="0.4", linewidth=0.8)
        for sense, label, edge, fill, marker in SENSES:
            _left_by_runs(shown, points, axes, setup, sense, f"{label}: single runs")
            here = np.flatnonzero((rest.setup == setup) & _of_sense(rest, sense))
            here = here[np.argsort(rest.load[here], kind="stable")]
            if not here.size:
                continue
            x = rest.displacement[here] * MM_PER_M if shown.imposed else rest.load[here]
            mean, sd = rest.mean[here] * MM_PER_M, rest.sd[here] * MM_PER_M
            axes.errorbar(
                x,
                rest.residual[here] * MM_PER_M,
                2 * rest.noise[here] * MM_PER_M,
                fmt=marker,
                color=edge,
                elinewidth=0.8,
                markerfacecolor=fill,
                markersize=4,
                label=f"{label}: mean, ±2 sd of its scatter",
            )
            axes.fill_between(x, mean - 2 * sd, mean + 2 * sd, color=edge, alpha=0.2, linewidth=0)
            axes.plot(x, mean, "-", color=edge, linewidth=2, label=f"{label}: repeats, ±2 sd")
        axes.set_title(shown.setup_name(setup), fontsize=10)
    label_below(grid, drive_label(shown.imposed))
    label = gap_label(shown.imposed, "Left unexplained").replace(" (", "\n(")
    figure.supylabel(label, fontsize=10)
    set_title(figure, _remainder_title(shown, rest))
    shared_legend(figure, [axes for (axes,) in grid])
    return figure


def _left_by_runs(
    shown: Shown, points: Points, axes: Any, setup: int, sense: int, label: str
) -> None:
    """Residual of every run as a faint line."""
    x, _, _ = axes_of(shown, points)
    colour = BLUE if sense == RISING else ORANGE
    for run in np.unique(points.run[(points.setup == setup) & (points.sense == sense)]):
        path = (points.run == run) & (points.sense == sense)
        # a running recording would join the ends of its cycles
        style = "." if shown.continuous else "-"
        axes.plot(
            x[path],
            points.gap_after[path],
            style,
            color=colour,
            linewidth=0.7,
            markersize=2,
            alpha=0.45,
            label=label,
            rasterized=np.count_nonzero(path) > MANY,
        )


def _of_sense(rest: Remainder, sense: int) -> Any:
    """(k,) levels of a sense; cycles that rest at levels count as loading."""
    known = np.where(rest.branch == 3, RISING, rest.branch)
    return known == sense


def _remainder_title(shown: Shown, rest: Remainder) -> str:
    low, high = (edge * MM_PER_M for edge in rest.ci95)
    differs = _unrepeated(rest, finer=shown.continuous)
    if rest.largest is None and rest.visits <= 1:
        return f"Left {shown.with_what}: {differs}"
    if rest.largest is None:
        seen = f"nothing that repeats for sure (95 %: below {high:.2g} mm rms)"
        return f"Left {shown.with_what}: {seen}; {differs}"
    e = rest.largest
    where = ", ".join(w for w in (e.pose, e.direction, BRANCH_NAMES[e.branch]) if w)
    at = f"{e.displacement * MM_PER_M:.3g} mm" if shown.imposed else f"{e.force:.4g} N"
    return (
        f"Left {shown.with_what}: {rest.rms * MM_PER_M:.2g} mm rms repeat "
        f"(95 %: {low:.2g} to {high:.2g}), most at {where}, {at}: {e.mean * MM_PER_M:.2g} mm; "
        f"{differs}"
    )


def _unrepeated(rest: Remainder, *, finer: bool) -> str:
    """finer: of a load that runs, whose levels are classes, what repeats may be finer than they."""
    if rest.visits <= 1:
        return "each load was met once, so that what repeats can't be told"
    if rest.unrepeated_rms == 0:
        return "beside it, noise"
    more = "is finer or does not repeat" if finer else "does not repeat"
    return f"{'another ' * rest.clear}{rest.unrepeated_rms * MM_PER_M:.2g} mm rms {more}"
