"""What all figures share: colours, style, and how they are written."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.banners import marks
from rig.errors import InputError
from rig.storage.files import legible

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's palette without its yellow: told apart by colour-blind readers and in print
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P")
MADE_BY = "rig, with Matplotlib"  # in every file of a figure: only such a file is replaced
METADATA: Any = {"png": {"Software": MADE_BY}, "svg": {"Creator": MADE_BY, "Date": None}}
STYLE: Any = {
    "font.size": 10,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "rig",  # the same data give the same file
}


def named(figure: Figure, name: str) -> Figure:
    """The file that a figure shows, small in a corner: it may leave its folder or page."""
    figure.text(0.995, 0.003, legible(name), fontsize=6, color="0.4", ha="right", va="bottom")
    return figure


def watermark(
    figure: Figure, banners: Iterable[str], name: str, *, size: float = 40, turn: float = 25
) -> Figure:
    """Across the figure, `turn` deg, what must not be overlooked: it may leave the text that says
    so. name: as in `named`."""
    if words := marks(banners):
        figure.text(
            0.5,
            0.5,
            " · ".join(words),
            fontsize=size,
            color="0.5",
            alpha=0.25,
            ha="center",
            va="center",
            rotation=turn,
        )
    return named(figure, name)


def write_figures(folder: Path, figures: Callable[[], Iterable[tuple[str, Figure]]]) -> list[Path]:
    """Draws `figures()`, (name, figure) each, in the common style; writes PNG and SVG.

    Returns the files written. InputError if the folder can't be written to.
    """
    import matplotlib as mpl

    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with mpl.rc_context(STYLE):
            for name, figure in figures():
                written += _written(folder / name, figure)
    except OSError as error:
        raise InputError(
            f"{folder}: the figures can't be written there ({error.strerror}). "
            "Give another folder with --figures."
        ) from error
    return written


def _written(stem: Path, figure: Figure) -> list[Path]:
    """The files of one figure. `savefig` draws each twice, first for the layout alone, which is the
    same in both."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    png, svg = (stem.with_name(f"{stem.name}.{kind}") for kind in METADATA)
    figure.set_dpi(150)
    FigureCanvasAgg(figure).print_png(png, metadata=METADATA["png"])  # type: ignore[no-untyped-call]
    figure.set_layout_engine("none")
    FigureCanvasSVG(figure).print_svg(svg, metadata=METADATA["svg"])  # type: ignore[no-untyped-call]
    return [png, svg]
