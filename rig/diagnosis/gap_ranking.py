"""Which effect it is, and how far the gap shrinks: on what was fitted, and on what was withheld."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rig.canvas import blank
from rig.diagnosis.diagnose_text import LEAST_PROBABILITY, less_datum
from rig.diagnosis.gap_layout import BLUE, GREEN, gap_label, log_axis, set_title, shared_legend
from rig.diagnosis.gap_points import Shown
from rig.digits import likely
from rig.plotting import COLOURS
from rig.units import MM_PER_M

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def probabilities(shown: Shown) -> Figure:
    """Probability of every likely word of being the main cause; verdict marked."""
    chances = ranked(shown, LEAST_PROBABILITY)
    alike = {w for e in shown.effects if e.name == shown.verdict for w in e.indistinguishable_from}
    figure = blank(7.5, 1.3 + 0.36 * max(len(chances), 3))
    axes = figure.add_subplot()
    for i, (word, chance) in enumerate(chances.items()):
        chosen = word == shown.verdict
        axes.barh(
            i,
            chance,
            0.7,
            color=BLUE if chosen else "0.75",
            linewidth=0,
            hatch="//" if word in alike else None,
            edgecolor="white",
        )
        note = "  verdict" if chosen else "  can't be told from it here" if word in alike else ""
        axes.text(
            chance + 0.01,
            i,
            f"{likely(chance)}{note}",
            va="center",
            fontsize=9,
            fontweight="bold" if chosen else "normal",
        )
    axes.set_yticks(range(len(chances)), list(chances))
    axes.set_ylim(max(len(chances), 3) - 0.4, -0.6)
    axes.set_xlim(0, 1)  # the labels find room beside it
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("Probability of being the main cause")
    rest = 1 - sum(chances.values())
    axes.set_title(f"Which effect causes the gap (all others together {likely(rest)})", fontsize=11)
    return figure


def ranked(shown: Shown, least: float) -> dict[str, float]:
    """Probability of the words that have at least so much, and of the verdict; falling."""
    in_order = sorted(shown.probabilities.items(), key=lambda item: -item[1])
    return {word: chance for word, chance in in_order if chance >= least or word == shown.verdict}


def withheld(shown: Shown) -> Figure:
    """Before and after, fitted and withheld in turn, beside other effects; noise as a line."""
    entries = [("fitted", shown.before, shown.after, change(shown.before, shown.after), GREEN)]
    for held in shown.held_out:
        text = change(held.before, held.after, held.ci95)
        entries.append((f"withheld {held.fold}", held.before, held.after, text, GREEN))
    for word, after in shown.runners_up.items():
        main = shown.held_out[0]
        entries.append(
            (
                f"withheld {main.fold},\nwith {word} alone",
                main.before,
                after,
                change(main.before, after),
                COLOURS[3],
            )
        )
    figure = blank(8.5, 1.9 + 0.5 * len(entries))
    axes = figure.add_subplot()
    for i, (_, before, after, _, colour) in enumerate(entries):
        b, a = before * MM_PER_M, after * MM_PER_M
        axes.plot([a, b], [i, i], "-", color="0.7", linewidth=2, zorder=1)
        axes.plot(
            b,
            i,
            "o",
            color="black",
            markerfacecolor="white",
            markersize=8,
            label="_" if i else "before",
        )
        axes.plot(a, i, "o", color=colour, markersize=8)
    axes.plot([], [], "o", color=GREEN, label=f"after, {shown.with_what}")
    if shown.runners_up:
        axes.plot([], [], "o", color=COLOURS[3], label="after, with another effect alone")
    axes.axvline(
        shown.noise * MM_PER_M, color=BLUE, linestyle="--", label="noise of the instruments"
    )
    axes.set_yticks(range(len(entries)), [e[0] for e in entries])
    axes.set_ylim(len(entries) - 0.5, -0.7)
    log_axis(axes)
    for i, (_, before, after, text, _) in enumerate(entries):
        _above(axes, float(np.sqrt(max(before * after * MM_PER_M**2, 1e-300))), i, text)
    told = less_datum(h.fold for h in shown.held_out if h.own_datum)
    axes.set_xlabel(
        "\n".join([gap_label(shown.imposed, "Gap", "rms in mm"), told][: 1 + bool(told)])
    )
    set_title(figure, f"How far the gap shrinks {shown.with_what}")
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
    axes.annotate(
        text, (x, y), xytext=(0, 7), textcoords="offset points", ha=side, va="bottom", fontsize=8
    )
