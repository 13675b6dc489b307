"""Figures of `rig couple`: stiffness beside the published one, maps, placement, schedule."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.coupling import load_axes, mirror_axes
from identification.maps import Coupling, Stance, branch_of, stiffness_map
from rig.arrays import Array
from rig.canvas import blank
from rig.coupling.couple_text import PUBLISHED_COUPLED, PUBLISHED_SINGLE, is_published_setup
from rig.digits import brief
from rig.plotting import COLOURS, MARKERS, watermark, write_figures
from rig.units import MM_PER_M, N_PER_MM

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rig.coupling.couple import CouplingResult
    from rig.coupling.coupling_task import TaskResult
    from rig.models.model import ArmModel

_MAP_CELLS = 81
_LABEL = "Stiffness in N/mm"


def draw(result: CouplingResult, folder: Path) -> list[Path]:
    """Writes the figures as PNG and SVG into `folder`; the files written.

    InputError if the folder can't be written to.
    """
    return write_figures(folder, lambda: _figures(result))


def _figures(result: CouplingResult) -> list[tuple[str, Figure]]:
    out = [("stiffness", stiffness(result))]
    # an arm that the closed form does not cover has no map; the rest stands without it
    with suppress(ValueError):
        out.append(("map", maps(result)))
    if result.schedule is not None:
        out.append(("schedule", schedule(result)))
    if result.placement is not None:
        out.append(("placement", place(result.placement)))
    return out


def stiffness(result: CouplingResult) -> Figure:
    """Points along x and y: single and coupled, with standard uncertainties; published beside."""
    figure = blank(7.5, 4.6)
    axes = figure.add_subplot()
    rows: list[tuple[str, Array, Array | None, str]] = []
    if is_published_setup(result):
        rows.append(("single, published", np.array(PUBLISHED_SINGLE), None, COLOURS[0]))
    rows.append(
        ("single", result.single[:2] * N_PER_MM, result.u_single[:2] * N_PER_MM, COLOURS[0])
    )
    if is_published_setup(result):
        rows.append(("coupled, published", np.array(PUBLISHED_COUPLED), None, COLOURS[1]))
    colours = {"rigid": COLOURS[1], "compliant": COLOURS[2], "point": COLOURS[3]}
    for kind, k in result.pair.items():
        own = result.u_pair[kind][:2] * N_PER_MM
        rows.append((f"coupled, {kind}", k[:2] * N_PER_MM, own, colours[kind]))
    for i, (label, values, u, colour) in enumerate(rows):
        at = np.arange(2) + (i - (len(rows) - 1) / 2) * 0.8 / len(rows)
        axes.errorbar(
            at,
            values,
            u,
            fmt=MARKERS[0] if u is not None else MARKERS[1],
            color=colour,
            markerfacecolor=colour if u is not None else "white",
            markersize=5,
            capsize=4,
            label=label,
        )
        for x, v in zip(at, values, strict=True):
            text = f"{v:.1f}" if v < 1000 else f"{v:.0f}"
            look: Any = {"xytext": (7, 0), "textcoords": "offset points", "va": "center"}
            axes.annotate(text, (x, v), fontsize=7.5, **look)
    axes.set_yscale("log")
    _plain_numbers(axes.yaxis)
    axes.margins(x=0.08, y=0.12)
    axes.set_ylabel(f"{_LABEL}, with its standard uncertainty")
    load = "mirror" if result.spec.load_axes == "mirror" else "base"
    axes.set_xticks([0, 1], [f"{a} (coupled: {load} axes)" for a in "xy"])
    axes.grid(visible=False, axis="x")
    beta = np.rad2deg(result.spec.beta)
    axes.set_title(f"One arm and two coupled arms, beta = {beta:g} deg")
    figure.legend(loc="outside lower center", frameon=False, fontsize=8, ncols=3)
    return _finish(figure, result.model)


def maps(result: CouplingResult) -> Figure:
    """Stiffness of the single and of the coupled arms over the mirror plane through the model's
    node, tool and branch as there, along the first load axis that a requirement names (x if none).

    Raises ValueError for an arm that the closed-form inverse does not cover.
    """
    model, spec = result.model, result.spec
    mirror = mirror_axes(spec.beta)
    node = model.arm.fk(model.q, model.tool)
    axis = next((i for r in model.required for i in range(3) if abs(r.direction[i]) > 0.99), 0)
    load = load_axes(spec.beta, spec.load_axes)[:, axis]
    sideways, height = np.linspace(-1.4, 1.4, _MAP_CELLS), np.linspace(-0.4, 1.6, _MAP_CELLS)
    T, Z = np.meshgrid(sideways, height)
    plane = (node[:3, 3] @ mirror[:, 0]) * mirror[:, 0]
    points = plane + T[..., None] * mirror[:, 1] + Z[..., None] * mirror[:, 2]
    branch = branch_of(model.arm, model.q)
    stance = Stance(
        node[:3, 2], model.tool, branch=branch, links=model.links, mounting=model.mounting
    )
    pair = Coupling(spec.beta, spec.kind, spec.half)
    found = [
        stiffness_map(model.arm, points, stance, load, c).stiffness * N_PER_MM for c in (None, pair)
    ]
    figure = blank(10.5, 3.9)
    titles = ("one arm", f"two arms, {spec.described}")
    panels = figure.subplots(1, 2, sharey=True, gridspec_kw={"wspace": 0.08})
    name = f"{'xyz'[axis]} of the {spec.load_axes} axes"
    norm = _colours_of(np.concatenate(found))
    for axes, k, title in zip(panels, found, titles, strict=True):
        image = axes.pcolormesh(
            sideways, height, k, norm=norm, cmap="viridis", shading="nearest", rasterized=True
        )
        axes.set_aspect("equal")
        axes.grid(visible=False)
        axes.plot(node[:3, 3] @ mirror[:, 1], node[2, 3], "+", color="black", markersize=11)
        axes.set_title(f"{title}\nalong {name}", fontsize=10)
        axes.set_xlabel("Along the mirror plane in m")
    panels[0].set_ylabel("Height in m")
    # as high as the maps, whose height follows from their width
    beside = panels[1].inset_axes((1.04, 0.0, 0.045, 1.0))
    beside.grid(visible=False)
    _colour_bar(figure.colorbar(image, cax=beside, label=_LABEL, extend="both", extendfrac=0.03))
    return _finish(figure, model)


def _colours_of(values: Array) -> Any:
    """Colours on a logarithmic scale for all values that are there."""
    from matplotlib.colors import LogNorm

    known = values[np.isfinite(values)]
    # the few cells beside a singularity would take all colours
    low, high = np.quantile(known, [0.01, 0.98]) if known.size else (1.0, 10.0)
    return LogNorm(low, max(high, 1.01 * low))


def _colour_bar(bar: Any) -> None:
    """Numbers at the ends of the colours, and some between."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

    low, high = bar.norm.vmin, bar.norm.vmax
    room = (high / low) ** _ROOM
    ticks = LogLocator(subs=(1.0, 2.0, 3.0, 5.0, 7.0)).tick_values(low, high)
    between = [t for t in ticks if low * room < t < high / room]
    bar.ax.yaxis.set_major_locator(FixedLocator([low, *between, high]))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: brief(v, 3)))


_ROOM = 0.07  # of the colours: nearer to their ends no other number stands


def place(result: TaskResult) -> Figure:
    """Reached over required stiffness for every base distance and angle, the best marked."""
    best = result.best
    figure = blank(7.5, 5.0)
    axes = figure.add_subplot()
    x, y = MM_PER_M * best.distances, np.rad2deg(best.betas)
    margins = best.margins.T
    known = margins[np.isfinite(margins)]
    image = axes.pcolormesh(
        x,
        y,
        margins,
        norm=_colours_of(margins),
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    label = "Reached over required stiffness"
    _colour_bar(figure.colorbar(image, ax=axes, label=label, extend="both"))
    if known.min() < 1 < known.max():
        lines = axes.contour(x, y, margins, levels=[1.0], colors="white", linewidths=1.5)
        axes.clabel(lines, fmt={1.0: "just met"}, fontsize=8)
    axes.plot(
        MM_PER_M * best.base_distance,
        np.rad2deg(best.beta),
        "*",
        color="white",
        markeredgecolor="black",
        markersize=15,
        label="best",
    )
    axes.set_xlabel("Base distance in mm")
    axes.set_ylabel("beta in deg")
    needs = ", ".join(f"{n.name} {n.stiffness * N_PER_MM:g} N/mm" for n in result.model.required)
    axes.set_title(f"Where the second arm should stand for {needs}", fontsize=10)
    axes.grid(visible=False)
    axes.legend(loc="upper right", fontsize=8)
    return _finish(figure, result.model)


def schedule(result: CouplingResult) -> Figure:
    """Required, single and coupled stiffness along the path; shaded where the pair is coupled."""
    assert result.schedule is not None
    plan = result.schedule
    figure = blank(7.5, 4.2)
    axes = figure.add_subplot()
    axes.step(plan.time, plan.required * N_PER_MM, where="post", color="black", label="required")
    axes.plot(plan.time, plan.single * N_PER_MM, color=COLOURS[0], label="single")
    axes.plot(plan.time, plan.coupled * N_PER_MM, color=COLOURS[1], label="coupled")
    # told apart without their colours, too
    shades = {"couple": (COLOURS[1], "coupled", ""), "infeasible": ("red", "infeasible", "///")}
    named: set[str] = set()
    for interval in plan.intervals():
        if interval.state in shades:
            colour, word, hatch = shades[interval.state]
            # a label that begins with _ stays out of the legend: each state is named once
            label = f"_{word}" if word in named else f"state: {word}"
            axes.axvspan(
                interval.start,
                interval.end,
                color=colour,
                alpha=0.15,
                lw=0,
                hatch=hatch,
                label=label,
            )
            named.add(word)
    axes.set_yscale("log")
    _plain_numbers(axes.yaxis)
    axes.set_xlabel("Time in s")
    axes.set_ylabel(_LABEL)
    axes.set_title("When to couple")
    axes.legend(frameon=False, fontsize=8, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.16))
    return _finish(figure, result.model)


def _plain_numbers(axis: Any) -> None:
    """Few ticks on a logarithmic axis, written out."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0, 7.0)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _finish(figure: Figure, model: ArmModel) -> Figure:
    """The model's name; and across the figure what must not be overlooked."""
    return watermark(figure, marks_of_notes([model.note]), Path(model.name).name)


def marks_of_notes(notes: Sequence[str]) -> list[str]:
    """Banners ("EMULATED", "INCOMPLETE") that a model's note begins with."""
    return [word for note in notes for word in ("EMULATED", "INCOMPLETE") if f"{word}:" in note]
