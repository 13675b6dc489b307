"""How the figures of a diagnosis are laid out: panels, titles, legends."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.canvas import DISPLACEMENT, FORCE, blank
from rig.diagnosis.gap_points import FALLING, RISING
from rig.plotting import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN = COLOURS[0], COLOURS[1], COLOURS[2]
GREY = "0.45"
SENSES = ((RISING, "loading", BLUE, BLUE, "o"), (FALLING, "unloading", ORANGE, "white", "s"))
MANY = 400  # points of a panel beyond which markers hide each other
_MOST_PANELS = 12


def drive_label(imposed: bool) -> str:
    """Axis of what drives the rig: the force, or the displacement where that is imposed."""
    return DISPLACEMENT if imposed else FORCE


def answer_label(imposed: bool) -> str:
    """Axis of what answers."""
    return drive_label(not imposed)


def gap_label(imposed: bool, what: str, unit: str = "in mm") -> str:
    """Axis of a gap, which of an imposed displacement is one of the force."""
    return f"{what} {unit}" + (" (force over simulated stiffness)" if imposed else "")


def panels(setups: int, *, below: bool = False) -> tuple[Figure, list[list[Any]], list[int]]:
    """One panel for each of so many setups (a second one below it, if asked), up to `_MOST_PANELS`;
    their axes; the setups shown. All lower panels, or all panels, share their y axis."""
    shown = list(range(min(setups, _MOST_PANELS)))
    columns = min(len(shown), 3 if len(shown) > 4 or len(shown) == 3 else 2)
    lines = -(-len(shown) // columns)
    figure = blank(
        7.5 if columns == 1 else 4.2 * columns + 0.6, 1.4 + (4.4 if below else 3.3) * lines
    )
    heights = [3.0, 1.6] * lines if below else None
    deep = 2 if below else 1
    axes = figure.subplots(
        lines * deep,
        columns,
        squeeze=False,
        height_ratios=heights,
        sharey=False if below else "all",
    )
    grid = []
    for i in range(lines * columns):
        line, column = divmod(i, columns)
        stack = list(axes[line * deep : (line + 1) * deep, column])
        for one in stack:
            one.set_visible(i < len(shown))
        if below:
            stack[0].sharex(stack[1])
            stack[0].tick_params(labelbottom=False)
            stack[1].sharey(axes[1, 0]) if i else None
        grid.append(stack)
    return figure, grid[: len(shown)], shown


def first_column(grid: list[list[Any]]) -> list[list[Any]]:
    """The stacks of panels at the left edge."""
    return [stack for stack in grid if stack[0].get_subplotspec().is_first_col()]


def label_below(grid: list[list[Any]], label: str) -> None:
    """The x label below the last panel of every column."""
    for i, stack in enumerate(grid):
        column = stack[-1].get_subplotspec().colspan.start
        after = (other[-1].get_subplotspec().colspan.start for other in grid[i + 1 :])
        if column not in after:
            stack[-1].set_xlabel(label)


def set_title(figure: Figure, text: str) -> None:
    """Over the whole figure, in as many lines as its width asks for."""
    figure.suptitle("\n".join(wrap(text, int(10.5 * figure.get_size_inches()[0]))), fontsize=11)


def shared_legend(figure: Figure, everywhere: list[Any]) -> None:
    """One legend below, every label once."""
    found: dict[str, Any] = {}
    for axes in everywhere:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    if found:
        # about 13 characters an inch at that size, six for the handle and the space between
        fitting = int(13 * figure.get_size_inches()[0] / (max(map(len, found)) + 6))
        figure.legend(
            list(found.values()),
            list(found),
            loc="outside lower center",
            frameon=False,
            fontsize=8,
            ncols=max(1, min(len(found), fitting)),
        )


def noise_axis(axes: Any, noise: float, most: float) -> None:
    """A y axis for what reaches from the noise to `most`: linear within the noise, logarithmic
    beyond it; linear throughout where that is less than a decade."""
    from matplotlib.ticker import FixedLocator, NullLocator

    if not 0 < 10 * noise < most < np.inf:
        return
    axes.set_yscale("symlog", linthresh=noise, linscale=0.5)
    lowest, highest = np.ceil(np.log10(2 * noise)), np.floor(np.log10(most))
    decades = 10.0 ** np.arange(highest, lowest - 1, -np.ceil((highest - lowest + 1) / 3))
    axes.yaxis.set_major_locator(FixedLocator([*-decades, 0.0, *decades[::-1]]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(lambda v, _: f"{v:g}".replace("-", "\N{MINUS SIGN}"))


def log_axis(axes: Any) -> None:
    """A logarithmic x axis with numbers written out."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.margins(x=0.12)
