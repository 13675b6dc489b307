"""The report's own figures: joints, data quality, comparison of data sets, words of the gap."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.uncertainty import TWO_SIDED
from rig import plotting
from rig.analysis.analyze import Analysis
from rig.analysis.quality import RunZeros
from rig.canvas import DISPLACEMENT, FORCE, blank
from rig.dataset import Dataset
from rig.plotting import COLOURS, MARKERS
from rig.report.compare import aligned
from rig.units import KNM, MM_PER_M, N_PER_MM

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Json = dict[str, Any]
_SMALL_MM = 0.05  # displacements below are shown in µm
MOST_POINTS = 4000  # of a recording that are drawn: more than a page has dots


def watermark(figure: Figure, banners: Sequence[str], name: str = "") -> Figure:
    """What must not be overlooked, across the figure: it may leave the page without its text. name:
    of the data set, where the figure shows one."""
    return plotting.watermark(figure, banners, name, size=34, turn=18)


def joints(sets: Sequence[tuple[str, Json]], banners: Sequence[str]) -> Figure:
    """Joint stiffness with 95 % intervals over the prior's; filled where identified.

    sets: (label, rig.joints/1) each.
    """
    figure, axes = _axes(7.5, 3.8, "Joint", "Torsional stiffness in kNm/rad")
    x = np.arange(1, 7)
    prior = sets[0][1]["prior"]
    middle = KNM * np.array(prior["joint_stiffness_Nm_per_rad"])
    spread = np.exp(TWO_SIDED * np.array(prior["relative_sd"]))
    axes.bar(
        x,
        middle * (spread - 1 / spread),
        0.8,
        bottom=middle / spread,
        color="0.88",
        label="prior, 95 %",
        zorder=1,
    )
    step = 0.5 / max(1, len(sets))
    for i, (label, result) in enumerate(sets):
        quantities = result["joint_stiffness_Nm_per_rad"]
        value = KNM * np.array([q["value"] for q in quantities])
        ci = KNM * np.array([q["ci95"] for q in quantities])
        at = x + (i - (len(sets) - 1) / 2) * step
        colour, known = COLOURS[i % len(COLOURS)], np.array(result["identified"], dtype=bool)
        axes.errorbar(
            at,
            value,
            (value - ci[:, 0], ci[:, 1] - value),
            fmt="none",
            color=colour,
            capsize=4,
            zorder=3,
        )
        for which, fill, word in ((known, colour, "identified"), (~known, "white", "not to 5 %")):
            if which.any():
                axes.plot(
                    at[which],
                    value[which],
                    MARKERS[i % len(MARKERS)],
                    color=colour,
                    markerfacecolor=fill,
                    markersize=7,
                    zorder=4,
                    label=f"{label}: {word}",
                )
    axes.use_sticky_edges = False  # the lowest bar would end on the axis, as if cut off there
    axes.set_yscale("log")
    plain_numbers(axes.yaxis)
    axes.set_xticks(x)
    axes.grid(visible=False, axis="x")
    axes.legend(frameon=False, fontsize=8)
    return watermark(figure, banners, sets[0][0] if len(sets) == 1 else "")


def quality_recorded(dataset: Dataset, zeros: Sequence[RunZeros]) -> bool:
    """Whether `quality` has anything to show."""
    return bool(_panels(dataset, zeros))


def quality(name: str, dataset: Dataset, zeros: Sequence[RunZeros]) -> Figure:
    """Over the session: lateness, zero of force and displacement, joint temperatures, where
    something of it was recorded. name: of the data set."""
    columns = dataset.columns
    panels = [panel for _, panel in _panels(dataset, zeros)]
    figure = blank(7.5, 1.75 * len(panels) + 0.5)
    rows = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    for axes, panel in zip(rows, panels, strict=True):
        panel(axes, dataset, zeros)
        axes.tick_params(labelsize=8)
    rows[-1].set_xlabel("Time of the session in min" if "session_s" in columns else "Run")
    if "session_s" not in columns:
        rows[-1].xaxis.get_major_locator().set_params(integer=True)
    return watermark(figure, dataset.banners(), name)


Panel = Callable[[Any, Dataset, Sequence[RunZeros]], None]


def quality_caption(dataset: Dataset, zeros: Sequence[RunZeros]) -> str:
    """What `quality` shows of this data set."""
    return f"Over the session: {', '.join(words for words, _ in _panels(dataset, zeros))}."


def _panels(dataset: Dataset, zeros: Sequence[RunZeros]) -> list[tuple[str, Panel]]:
    """(what it shows, panel) for everything that was recorded."""
    columns = dataset.columns
    found: list[tuple[str, Panel]] = []
    if "session_s" in columns and "lateness_s" in columns:
        found.append(("how late the slots were", _lateness))
    if zeros:
        found += [("force", _force_zero), ("and displacement at zero load", _displacement_zero)]
    if "session_s" in columns and "temperature1_C" in columns:
        found.append(("joint temperatures", _temperature))
    return found


def _minutes(dataset: Dataset) -> tuple[Any, Any]:
    rows = np.arange(0, dataset.rows, max(1, -(-dataset.rows // MOST_POINTS)))
    return dataset.columns["session_s"][rows].astype(float) / 60, rows


def _lateness(axes: Any, dataset: Dataset, _: Sequence[RunZeros]) -> None:
    minutes, rows = _minutes(dataset)
    late = 1e3 * dataset.columns["lateness_s"][rows].astype(float)
    axes.plot(minutes, late, ".", color=COLOURS[0], markersize=3)
    axes.set_ylabel("Slot late\nby, ms", fontsize=8)
    axes.set_yscale("symlog", linthresh=10)
    plain_ticks(axes.yaxis)


def _force_zero(axes: Any, dataset: Dataset, zeros: Sequence[RunZeros]) -> None:
    _plateaus(axes, dataset, zeros, "force")
    axes.set_ylabel("Force at zero\nload, N", fontsize=8)
    axes.legend(frameon=False, fontsize=7, ncols=4, loc="best")


def _displacement_zero(axes: Any, dataset: Dataset, zeros: Sequence[RunZeros]) -> None:
    unit, scale = small_mm(max(abs(p.displacement) for run in zeros for p in run.plateaus))
    _plateaus(axes, dataset, zeros, "displacement", scale)
    axes.set_ylabel(f"Displacement at\nzero load, {unit}", fontsize=8)


def small_mm(value: float) -> tuple[str, float]:
    """Unit to show a displacement of so many mm in, and the factor to it."""
    return ("µm", 1e3) if 0 < value < _SMALL_MM else ("mm", 1.0)


def _plateaus(
    axes: Any, dataset: Dataset, zeros: Sequence[RunZeros], what: str, scale: float = 1.0
) -> None:
    on_clock = "session_s" in dataset.columns
    setups = list(dict.fromkeys((r.pose, r.direction) for r in zeros))
    named: set[tuple[str, str]] = set()
    for number, run in enumerate(zeros, start=1):
        i = setups.index((run.pose, run.direction))
        at = [p.time / 60 if on_clock else number + 0.1 * k for k, p in enumerate(run.plateaus)]
        label = run.direction if not run.pose else f"{run.pose}, {run.direction}"
        # what begins with _ stays out of the legend: every setup is named once
        label = f"_{label}" if (run.pose, run.direction) in named else label.lstrip("_")
        named.add((run.pose, run.direction))
        axes.plot(
            at,
            [scale * getattr(p, what) for p in run.plateaus],
            color=COLOURS[i % len(COLOURS)],
            marker=MARKERS[i % len(MARKERS)],
            markersize=4,
            linewidth=1,
            label=label,
        )


def _temperature(axes: Any, dataset: Dataset, _: Sequence[RunZeros]) -> None:
    minutes, rows = _minutes(dataset)
    for joint in range(1, 7):
        column = dataset.columns.get(f"temperature{joint}_C")
        if column is not None:
            axes.plot(
                minutes, column[rows], color=COLOURS[joint - 1], linewidth=1, label=f"joint {joint}"
            )
    axes.set_ylabel("Temperature,\n°C", fontsize=8)
    axes.legend(frameon=False, fontsize=7, ncols=6, loc="best")


def compared_k(sets: Sequence[tuple[str, Analysis]], banners: Sequence[str]) -> Figure:
    """k of every data set and direction with its 95 % interval."""
    names = aligned([a for _, a in sets])
    figure, axes = _axes(7.5, 3.8, "Direction", "Stiffness k in N/mm")
    step = 0.6 / max(1, len(sets))
    for i, (label, analysis) in enumerate(sets):
        at, value, low, high = [], [], [], []
        for n, keys in enumerate(names.values()):
            key = keys[i]
            k = None if key is None else analysis.directions[key].result.k
            if k is not None:
                at.append(n + (i - (len(sets) - 1) / 2) * step)
                value.append(k.value * N_PER_MM)
                low.append((k.value - k.interval[0]) * N_PER_MM)
                high.append((k.interval[1] - k.value) * N_PER_MM)
        axes.errorbar(
            at,
            value,
            (low, high),
            fmt=MARKERS[i % len(MARKERS)],
            capsize=4,
            color=COLOURS[i % len(COLOURS)],
            markersize=6,
            label=label,
        )
    axes.set_xticks(range(len(names)), list(names))
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.grid(visible=False, axis="x")
    axes.legend(frameon=False, fontsize=8)
    return watermark(figure, banners)


def compared_curves(
    name: str,
    keys: Sequence[str | None],
    sets: Sequence[tuple[str, Analysis]],
    banners: Sequence[str],
) -> Figure:
    """The curves of one direction over each other, with their standard deviations.

    keys: what each data set calls it.
    """
    figure, axes = _axes(7.5, 3.8, FORCE, DISPLACEMENT)
    for i, ((label, analysis), key) in enumerate(zip(sets, keys, strict=True)):
        direction = None if key is None else analysis.directions[key]
        for branch, line in (("loading", "-"), ("unloading", ":")):
            levels = [] if direction is None else direction.result.levels
            mine = [p for p in levels if p.branch == branch]
            if mine:
                axes.errorbar(
                    [p.force for p in mine],
                    [p.displacement * MM_PER_M for p in mine],
                    np.nan_to_num([p.sd * MM_PER_M for p in mine]),
                    linestyle=line,
                    marker=MARKERS[i % len(MARKERS)],
                    capsize=3,
                    markersize=4 + 3 * min(2, len(sets) - 1 - i),
                    markerfacecolor="none",
                    color=COLOURS[i % len(COLOURS)],
                    linewidth=1,
                    label=f"{label}: {branch}",
                )
    axes.set_title(f"Direction {name}", fontsize=10)
    axes.legend(frameon=False, fontsize=8)
    return watermark(figure, banners)


def _axes(width: float, height: float, x: str, y: str) -> tuple[Figure, Any]:
    figure = blank(width, height)
    axes = figure.add_subplot()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    return figure, axes


def plain_numbers(axis: Any) -> None:
    """Few ticks on a logarithmic axis, written out (formulas are off in reports)."""
    from matplotlib.ticker import LogLocator, NullLocator

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_locator(NullLocator())
    plain_ticks(axis)


def plain_ticks(axis: Any) -> None:
    """Tick labels without formulas."""
    from matplotlib.ticker import StrMethodFormatter

    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
