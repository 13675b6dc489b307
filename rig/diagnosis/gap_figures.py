"""Figures of a diagnosis: where the gap lies, which effect, how far it shrinks, what remains."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.gap.answer.remainder import Remainder, remainder
from identification.gap.data import BRANCH_NAMES
from rig.canvas import blank
from rig.diagnosis.diagnose import Diagnosis
from rig.diagnosis.diagnose_text import LEAST_PROBABILITY
from rig.diagnosis.gap_layout import (
    answer_label,
    drive_label,
    first_column,
    label_below,
    log_axis,
    noise_axis,
    panels,
    set_title,
    shared_legend,
)
from rig.diagnosis.gap_map import gap_map
from rig.diagnosis.gap_points import (
    FALLING,
    RISING,
    Points,
    Shown,
    Table,
    held_table,
    point_table,
    points,
    remainder_table,
    session_clock,
    shown,
    write_table,
)
from rig.digits import likely
from rig.errors import InputError
from rig.plotting import COLOURS, watermark, write_figures
from rig.units import MM_PER_M

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN = COLOURS[0], COLOURS[1], COLOURS[2]
GREY = "0.45"
_SENSES = ((RISING, "loading", BLUE, BLUE, "o"), (FALLING, "unloading", ORANGE, "white", "s"))
_NOISE = "noise, ±2 standard deviations"
_MANY = 400  # points of a panel beyond which markers hide each other


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
        self.r: Shown = shown(result)
        self.points: Points = points(result)
        self.remainder: Remainder = remainder(result.engine, result.fit)

    def figures(self) -> Iterator[tuple[str, Figure]]:
        """(name, figure) one after the other: only one is held in memory."""
        yield "gap_curve", self._finish(curve(self.r, self.points))
        yield "gap_map", self._finish(gap_map(self.r, self.points))
        yield "gap_residual", self._finish(residual(self.r, self.points))
        yield "gap_probabilities", self._finish(probabilities(self.r))
        yield "gap_withheld", self._finish(withheld(self.r))
        yield "gap_remainder", self._finish(remaining(self.r, self.points, self.remainder))

    def tables(self) -> Iterator[tuple[str, Table]]:
        """(name, numbers): curve, map and residual share one table."""
        yield "gap_points", point_table(self.r, self.points)
        ranked = _ranked(self.r, 0.0)
        yield "gap_probabilities", {"word": list(ranked), "probability": list(ranked.values())}
        yield "gap_withheld", held_table(self.r)
        yield "gap_remainder", remainder_table(self.r, self.remainder)

    def comments(self) -> tuple[str, ...]:
        """First lines of every table."""
        return (*self.banners, f"rig diagnose {self.name}: {self.r.verdict}")

    def _finish(self, figure: Figure) -> Figure:
        """The data set's name; and across the figure what must not be overlooked."""
        return watermark(figure, self.banners, self.name)


def curve(r: Shown, p: Points) -> Figure:
    """Measurement and simulation before and after, one panel per pose and direction; below each,
    measured minus simulated, which the curves alone would hide, beside the noise.

    Displacement over force; where the displacement was imposed, force over displacement.
    """
    figure, grid, numbers = panels(len(r.setups), below=True)
    scale = _axes_of(r, p)[2]
    noise = 2 * float(np.median(p.noise * scale))
    for (upper, lower), s in zip(grid, numbers, strict=True):
        _curve_panel(r, p, upper, s)
        _gap_panel(r, p, lower, s)
        upper.set_title(r.setup_name(s), fontsize=10)
    noise_axis(grid[0][1], noise, float(np.abs(p.gap_before * scale).max()))  # they share it
    for upper, lower in first_column(grid):
        upper.set_ylabel(answer_label(r.imposed))
        lower.set_ylabel("Gap in N" if r.imposed else "Gap in mm")
    label_below(grid, drive_label(r.imposed))
    set_title(figure, f"Measured, and simulated before and after ({_after(r)})")
    shared_legend(figure, [axes for pair in grid for axes in pair])
    return figure


def _axes_of(r: Shown, p: Points) -> tuple[Any, Any, Any]:
    """What drives the rig, what answers (n,), and mm to the answer's unit (n,)."""
    if r.imposed:
        return p.displacement, p.force, 1 / p.stated
    return p.force, p.displacement, np.ones(len(p.force))


def _curve_panel(r: Shown, p: Points, axes: Any, s: int) -> None:
    mine = p.setup == s
    x, y, scale = _axes_of(r, p)
    many = np.count_nonzero(mine) > _MANY
    for sense, label, edge, fill, marker in _SENSES:
        here = mine & (p.sense == sense)
        if here.any():
            axes.plot(x[here], y[here], marker, color=edge, markerfacecolor=fill,
                      markersize=1.5 if many else 4, markeredgewidth=0.5 if many else 0.9,
                      label=f"measured, {label}", rasterized=many, zorder=2)  # fmt: skip
    zero = mine & (p.sense == 0)
    if zero.any():
        axes.plot(x[zero], y[zero], "x", color=GREY, markersize=4, label="measured, zero load")
    order = np.flatnonzero(mine)[np.argsort(x[mine], kind="stable")]
    axes.plot(x[order], (p.before * scale)[order], "--", color="black", linewidth=1.2,
              label="simulated before", zorder=3)  # fmt: skip
    for i, leg in enumerate(legs(p, x, s)):
        axes.plot(x[leg], (p.after * scale)[leg], "-" if len(leg) > 1 else ".", color=GREEN,
                  linewidth=1.1, markersize=4, zorder=3,
                  label="_" if i else "simulated after (each run)")  # fmt: skip
    told = np.concatenate([y[mine], (p.after * scale)[mine]])
    low, high = float(told.min()), float(told.max())
    if np.ptp((p.before * scale)[mine]) > _BEYOND * (high - low) > 0:
        margin = 0.5 * (high - low)
        axes.set_ylim(low - margin, high + margin)


_BEYOND = 4.0  # times what was measured: what is simulated leaves the panel, else it hides that


def _gap_panel(r: Shown, p: Points, axes: Any, s: int) -> None:
    """Measured minus simulated, before and after, run by run."""
    x, _, scale = _axes_of(r, p)
    mine = np.flatnonzero(p.setup == s)
    _noise_band(axes, x[mine], (p.noise * scale)[mine])
    axes.axhline(0, color="0.4", linewidth=0.8)
    for leg in legs(p, x, s):
        look = {"marker": "." if len(leg) == 1 else "", "markersize": 4}
        before, after = (p.gap_before * scale)[leg], (p.gap_after * scale)[leg]
        axes.plot(x[leg], before, linestyle="--", color="black", linewidth=0.9, **look)
        axes.plot(x[leg], after, linestyle="-", color=GREEN, linewidth=1.1, **look)


def _noise_band(axes: Any, x: Any, noise: Any) -> None:
    """Of every point its own, sd (n,): a soft direction turns the same force noise into more, a
    hold of few samples averages less of it away."""
    order = np.argsort(x, kind="stable")
    edge = 2 * noise[order]
    look = {"color": "0.5", "alpha": 0.25, "linewidth": 0, "zorder": 0, "label": _NOISE}
    if np.ptp(x) > 0:
        axes.fill_between(x[order], -edge, edge, **look)
    else:  # nothing would be seen of it
        axes.axhspan(-edge.max(), edge.max(), **look)


def legs(p: Points, x: Any, s: int) -> Iterator[Any]:
    """Of every run of a setup the numbers of the points that a line may join: it ends where the
    load was taken off with no look on the way.

    x (n,): what drives the rig.
    """
    for run in np.unique(p.run[p.setup == s]):
        path = np.flatnonzero(p.run == run)
        off = (p.sense[path[:-1]] == RISING) & (p.sense[path[1:]] == 0)
        far = np.abs(np.diff(x[path])) > 0.5 * np.ptp(x[path])
        yield from np.split(path, 1 + np.flatnonzero(off & far))


def residual(r: Shown, p: Points) -> Figure:
    """What the chosen explanation leaves, over force and over the session's time."""
    figure = blank(11.0, 4.6)
    left, right = figure.subplots(1, 2, sharey=True)
    elapsed, unit = session_clock(p)
    for axes, x in ((left, p.displacement if r.imposed else p.force), (right, elapsed)):
        axes.axhline(0, color="0.4", linewidth=0.8, zorder=1)
        _residual_points(r, p, axes, x)
    for s in range(len(r.setups)):
        mine = p.setup == s
        if mine.any():
            _noise_band(left, (p.displacement if r.imposed else p.force)[mine], p.noise[mine])
    _noise_band(right, elapsed, p.noise)
    left.set_xlabel(drive_label(r.imposed))
    assumed = not r.clock and len(np.unique(p.run)) > 1
    right.set_xlabel(f"Time in the session in {unit}" + ", rests assumed" * assumed)
    left.set_ylabel(_gap_label(r, "Left"))
    set_title(
        figure,
        f"Left {_after(r)}: {r.after * MM_PER_M:.3g} mm rms of single samples; the instruments "
        f"alone leave {r.noise * MM_PER_M:.3g} mm",
    )
    shared_legend(figure, [left])
    return figure


def _residual_points(r: Shown, p: Points, axes: Any, x: Any) -> None:
    count = len(r.setups)
    many = len(x) > _MANY
    for s in range(count):
        for sense, label, _, _, marker in _SENSES:
            here = (p.setup == s) & (p.sense == sense)
            if not here.any():
                continue
            colour = COLOURS[s % len(COLOURS)]
            axes.plot(x[here], p.gap_after[here], marker, color=colour,
                      markerfacecolor=colour if sense == RISING else "white",
                      markersize=2 if many else 4, markeredgewidth=0.6 if many else 0.9,
                      label=f"{r.setup_name(s)}: {label}", rasterized=many)  # fmt: skip
    zero = p.sense == 0
    if zero.any():
        axes.plot(x[zero], p.gap_after[zero], "x", color=GREY, markersize=4, label="zero load")


def probabilities(r: Shown) -> Figure:
    """Probability of every word above half a percent of being the main cause; verdict marked."""
    ranked = _ranked(r, LEAST_PROBABILITY)
    alike = {w for e in r.effects if e.name == r.verdict for w in e.indistinguishable_from}
    figure = blank(7.5, 1.3 + 0.36 * max(len(ranked), 3))
    axes = figure.add_subplot()
    for i, (word, p) in enumerate(ranked.items()):
        chosen = word == r.verdict
        axes.barh(i, p, 0.7, color=BLUE if chosen else "0.75", linewidth=0,
                  hatch="//" if word in alike else None, edgecolor="white")  # fmt: skip
        note = "  verdict" if chosen else "  can't be told from it here" if word in alike else ""
        axes.text(p + 0.01, i, f"{likely(p)}{note}", va="center", fontsize=9,
                  fontweight="bold" if chosen else "normal")  # fmt: skip
    axes.set_yticks(range(len(ranked)), list(ranked))
    axes.set_ylim(max(len(ranked), 3) - 0.4, -0.6)
    axes.set_xlim(0, 1)  # the labels find room beside it
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("Probability of being the main cause")
    rest = 1 - sum(ranked.values())
    axes.set_title(f"Which effect causes the gap (all others together {likely(rest)})",
                   fontsize=11)  # fmt: skip
    return figure


def withheld(r: Shown) -> Figure:
    """Before and after, fitted and withheld in turn, beside other effects; noise as a line."""
    entries = [("fitted", r.before, r.after, change(r.before, r.after), GREEN)]
    for h in r.held_out:
        text = change(h.before, h.after, h.ci95)
        entries.append((f"withheld {h.fold}", h.before, h.after, text, GREEN))
    for word, after in r.runners_up.items():
        main = r.held_out[0]
        entries.append((f"withheld {main.fold},\nwith {word} instead", main.before, after,
                        change(main.before, after), COLOURS[3]))  # fmt: skip
    figure = blank(8.5, 1.9 + 0.5 * len(entries))
    axes = figure.add_subplot()
    for i, (_, before, after, _, colour) in enumerate(entries):
        b, a = before * MM_PER_M, after * MM_PER_M
        axes.plot([a, b], [i, i], "-", color="0.7", linewidth=2, zorder=1)
        axes.plot(b, i, "o", color="black", markerfacecolor="white", markersize=8,
                  label="_" if i else "before")  # fmt: skip
        axes.plot(a, i, "o", color=colour, markersize=8)
    axes.plot([], [], "o", color=GREEN, label=f"after, {_after(r)}")
    if r.runners_up:
        axes.plot([], [], "o", color=COLOURS[3], label="after, with another effect instead")
    axes.axvline(r.noise * MM_PER_M, color=BLUE, linestyle="--", label="noise of the instruments")
    axes.set_yticks(range(len(entries)), [e[0] for e in entries])
    axes.set_ylim(len(entries) - 0.5, -0.7)
    log_axis(axes)
    for i, (_, before, after, text, _) in enumerate(entries):
        _above(axes, float(np.sqrt(max(before * after * MM_PER_M**2, 1e-300))), i, text)
    axes.set_xlabel(_gap_label(r, "Gap", "rms in mm"))
    set_title(figure, f"How far the gap shrinks {_after(r)}")
    shared_legend(figure, [axes])
    return figure


def change(before: float, after: float, ci95: tuple[float, float] | None = None) -> str:
    """`26.5 times smaller (18 to 38.9)`. ci95: of before over after; none where it is not known."""
    if before <= 0 or after <= 0:
        return "unchanged" if before == after else ""
    grows = after > before
    factor, word = (after / before, "larger") if grows else (before / after, "smaller")
    text = f"{factor:.3g} times {word}"
    if ci95 is None or not 0 < ci95[0] < ci95[1] < np.inf:
        return text
    low, high = (1 / ci95[1], 1 / ci95[0]) if grows else ci95
    return f"{text} ({low:.3g} to {high:.3g})"


def _above(axes: Any, x: float, y: float, text: str) -> None:
    """Text above a point of a logarithmic x axis; near an edge it runs inwards."""
    low, high = np.log(axes.get_xlim())
    share = (np.log(x) - low) / (high - low)
    side = "right" if share > 0.75 else "left" if share < 0.25 else "center"
    axes.annotate(text, (x, y), xytext=(0, 7), textcoords="offset points", ha=side, va="bottom",
                  fontsize=8)  # fmt: skip


def remaining(r: Shown, p: Points, m: Remainder) -> Figure:
    """What repeats of the residual, as a smooth curve with its uncertainty, over the residuals of
    all runs, setup by setup."""
    figure, grid, numbers = panels(len(r.setups))
    for (axes,), s in zip(grid, numbers, strict=True):
        axes.axhline(0, color="0.4", linewidth=0.8)
        for sense, label, edge, fill, marker in _SENSES:
            _left_by_runs(r, p, axes, s, sense, f"{label}: single runs")
            here = np.flatnonzero((m.setup == s) & _of_sense(m, sense))
            here = here[np.argsort(m.load[here], kind="stable")]
            if not here.size:
                continue
            x = m.displacement[here] * MM_PER_M if r.imposed else m.load[here]
            mean, sd = m.mean[here] * MM_PER_M, m.sd[here] * MM_PER_M
            axes.plot(x, m.residual[here] * MM_PER_M, marker, color=edge, markerfacecolor=fill,
                      markersize=4, label=f"{label}: mean")  # fmt: skip
            axes.fill_between(x, mean - 2 * sd, mean + 2 * sd, color=edge, alpha=0.2, linewidth=0)
            axes.plot(x, mean, "-", color=edge, linewidth=2, label=f"{label}: repeats, ±2 sd")
        axes.set_title(r.setup_name(s), fontsize=10)
    label_below(grid, drive_label(r.imposed))
    figure.supylabel(_gap_label(r, "Left unexplained"), fontsize=10)
    set_title(figure, _remainder_title(r, m))
    shared_legend(figure, [axes for (axes,) in grid])
    return figure


def _left_by_runs(r: Shown, p: Points, axes: Any, s: int, sense: int, label: str) -> None:
    """Residual of every run as a faint line."""
    x, _, _ = _axes_of(r, p)
    colour = BLUE if sense == RISING else ORANGE
    for run in np.unique(p.run[(p.setup == s) & (p.sense == sense)]):
        path = (p.run == run) & (p.sense == sense)
        # a running recording would join the ends of its cycles
        style = "." if r.continuous else "-"
        axes.plot(x[path], p.gap_after[path], style, color=colour, linewidth=0.7, markersize=2,
                  alpha=0.45, label=label, rasterized=np.count_nonzero(path) > _MANY)  # fmt: skip


def _of_sense(m: Remainder, sense: int) -> Any:
    """(k,) levels of a sense; cycles that rest at levels count as loading."""
    known = np.where(m.branch == 3, RISING, m.branch)
    return known == sense


def _remainder_title(r: Shown, m: Remainder) -> str:
    low, high = (edge * MM_PER_M for edge in m.ci95)
    differs = _unrepeated(m)
    if m.largest is None:
        seen = f"nothing that repeats for sure (95 %: below {high:.2g} mm rms)"
        return f"Left {_after(r)}: {seen}; {differs}"
    e = m.largest
    where = ", ".join(w for w in (e.pose, e.direction, BRANCH_NAMES[e.branch]) if w)
    at = f"{e.displacement * MM_PER_M:.3g} mm" if r.imposed else f"{e.force:.4g} N"
    return (
        f"Left {_after(r)}: {m.rms * MM_PER_M:.2g} mm rms repeat (95 %: {low:.2g} to {high:.2g}), "
        f"most at {where}, {at}: {e.mean * MM_PER_M:.2g} mm; {differs}"
    )


def _unrepeated(m: Remainder) -> str:
    if m.visits <= 1:
        return "each load was met once, so that what repeats can't be told"
    if m.unrepeated_rms == 0:
        return "beside it, noise"
    return f"another {m.unrepeated_rms * MM_PER_M:.2g} mm rms is finer or does not repeat"


def _ranked(r: Shown, least: float) -> dict[str, float]:
    ranked = sorted(r.probabilities.items(), key=lambda item: -item[1])
    return {word: p for word, p in ranked if p >= least or word == r.verdict}


def _after(r: Shown) -> str:
    """What stands in the simulation after."""
    if r.effects:
        return "with " + " + ".join(dict.fromkeys(e.name for e in r.effects))
    return "with springs and gains refitted"


def _gap_label(r: Shown, what: str, unit: str = "in mm") -> str:
    return f"{what} {unit}" + (" (force over simulated stiffness)" if r.imposed else "")
