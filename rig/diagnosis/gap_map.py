"""Map of the gap: every pose, direction, branch and repetition over force, and over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from identification.arrays import Array, Flags
from rig.canvas import blank
from rig.diagnosis.gap_layout import drive_label
from rig.diagnosis.gap_points import FALLING, RISING, Points, Shown, session_clock
from rig.units import MM_PER_M

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BINS = 40  # of force, for running recordings
_COLOURS = "PuOr_r"  # orange against purple: told apart by colour-blind readers
_BRANCHES = {RISING: "loading", FALLING: "unloading"}
_LET_GO = "back at zero"  # nothing was read on the way there


def gap_map(r: Shown, p: Points) -> Figure:
    """Gap before and after as colours: above over force, line by line; below over time.

    Colours are linear within the noise, logarithmic beyond it, alike in all panels: what is pale
    is noise.
    """
    lines = _lines(r, p)
    height = min(0.34 * len(lines) + 1.2, 9.0)
    figure = blank(12.0, height + 4.6)
    panels = figure.subplots(2, 2, sharex="row", sharey="row", height_ratios=[height, 2.9])
    norm = _norm(p)
    titles = (
        f"before: {r.before * MM_PER_M:.3g} mm rms",
        f"after: {r.after * MM_PER_M:.3g} mm rms",
    )
    for j, (gap, title) in enumerate(zip((p.gap_before, p.gap_after), titles, strict=True)):
        image = _strips(r, p, panels[0, j], lines, gap, norm)
        _over_time(r, p, panels[1, j], gap, norm)
        panels[0, j].set_title(title, fontsize=10)
    panels[0, 0].set_yticks(range(len(lines)), [name for name, _ in lines])
    panels[0, 0].set_ylim(len(lines) - 0.4, -0.6)
    bar = figure.colorbar(image, ax=panels, shrink=0.8, aspect=40)
    _ticks(bar, norm)
    how = "\n(force over simulated stiffness)" if r.imposed else ""
    bar.set_label(f"Measured minus simulated in mm{how};\npale: within the noise")
    figure.suptitle("Where the gap lies: one strip per repetition, the first on top", fontsize=11)
    return figure


def _lines(r: Shown, p: Points) -> list[tuple[str, Flags]]:
    """(name, points) per setup and branch; zero load before the highest load of a run belongs to
    loading, that after it to unloading, of which there may be nothing else."""
    sense = p.sense.copy()
    for run in np.unique(p.run):
        path = np.flatnonzero(p.run == run)
        top = path[np.argmax(np.abs(p.force[path]))]
        zero = path[p.sense[path] == 0]
        sense[zero] = np.where(zero <= top, RISING, FALLING)
    out = []
    for s in range(len(r.setups)):
        for branch, word in _BRANCHES.items():
            mine = (p.setup == s) & (sense == branch)
            if mine.any():
                named = word if np.any(p.sense[mine] == branch) else _LET_GO
                out.append((f"{r.setup_name(s)}: {named}", mine))
    return out


def _norm(p: Points) -> Any:
    from matplotlib.colors import SymLogNorm

    noise = 2 * float(np.median(p.noise))
    most = max(float(np.abs(p.gap_before).max()), float(np.abs(p.gap_after).max()), 2 * noise)
    return SymLogNorm(noise, vmin=-most, vmax=most, base=10, linscale=0.35)


def _strips(
    r: Shown, p: Points, axes: Any, lines: list[tuple[str, Flags]], gap: Array, norm: Any
) -> Any:
    """One rectangle per point: as wide as its share of the force, as high as its repetition's."""
    from matplotlib.collections import PolyCollection

    x = _driven(r, p)
    boxes, colours = [], []
    for i, (_, mine) in enumerate(lines):
        repetitions = np.unique(p.repetition[mine])
        high = 0.84 / len(repetitions)
        for k, repetition in enumerate(repetitions):
            here = mine & (p.repetition == repetition)
            top = i - 0.42 + k * high
            for low, up, value in _cells(x[here], gap[here], float(np.ptp(x)) or 1.0):
                boxes.append([(low, top), (up, top), (up, top + high), (low, top + high)])
                colours.append(value)
    image = PolyCollection(
        boxes,
        array=np.array(colours),
        cmap=_COLOURS,
        norm=norm,
        edgecolors="face",
        linewidths=0.2,
        rasterized=len(boxes) > 2000,
    )
    axes.add_collection(image)
    axes.autoscale_view()
    axes.set_facecolor("0.93")
    axes.grid(visible=False)
    axes.set_xlabel(drive_label(r.imposed))
    return image


def _cells(x: Array, gap: Array, span: float) -> list[tuple[float, float, float]]:
    """(from, to, gap): borders half-way between neighbouring values; many points in bins, each
    with as many of them."""
    if len(x) > _BINS and np.ptp(x) > 0:
        edges = np.quantile(x, np.linspace(0, 1, _BINS + 1))
        edges = np.unique(np.concatenate([edges[:1], edges[1:][np.diff(edges) > 0.004 * span]]))
        number = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
        count = np.bincount(number, minlength=len(edges) - 1)
        sums = np.bincount(number, weights=gap, minlength=len(edges) - 1)
        return [(edges[b], edges[b + 1], sums[b] / count[b]) for b in np.flatnonzero(count)]
    order = np.argsort(x, kind="stable")
    at, values = x[order], gap[order]
    half = np.diff(at) / 2
    least = 0.01 * span
    left = np.concatenate([[least], half]) if len(at) > 1 else np.array([least])
    right = np.concatenate([half, [least]]) if len(at) > 1 else np.array([least])
    # the outer cells are as wide outwards as inwards, and none vanishes
    left[0], right[-1] = max(least, right[0]), max(least, left[-1])
    left, right = np.maximum(left, least / 4), np.maximum(right, least / 4)
    return list(zip(at - left, at + right, values, strict=True))


def _over_time(r: Shown, p: Points, axes: Any, gap: Array, norm: Any) -> None:
    time, unit = session_clock(p)
    axes.scatter(
        time,
        _driven(r, p),
        c=gap,
        cmap=_COLOURS,
        norm=norm,
        s=14,
        linewidths=0.3,
        edgecolors="0.5",
        rasterized=len(time) > 1000,
    )
    axes.set_facecolor("0.93")
    axes.set_xlabel(f"Time in the session in {unit}")
    if axes.get_subplotspec().is_first_col():
        axes.set_ylabel(drive_label(r.imposed))


def _driven(r: Shown, p: Points) -> Array:
    return p.displacement if r.imposed else p.force


def _ticks(bar: Any, norm: Any) -> None:
    """The noise's border and decades beyond it, written out."""
    noise, most = norm.linthresh, norm.vmax
    decades = 10.0 ** np.arange(np.ceil(np.log10(noise * 2.5)), np.log10(most))
    ticks = np.concatenate([[noise], decades])
    bar.set_ticks(np.concatenate([-ticks[::-1], [0.0], ticks]))
    bar.ax.yaxis.set_major_formatter(lambda v, _: f"{v:.2g}".replace("-", "\N{MINUS SIGN}"))
    bar.ax.minorticks_off()
