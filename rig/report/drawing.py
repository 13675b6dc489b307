"""From a matplotlib figure to SVG that can stand in a page beside others, and to PNG."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rig.plotting import METADATA, STYLE
from rig.report.document import Figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plot

PNG_DPI = 150
_ID = re.compile(r'\b(id|xlink:href|href)="(#?)([^"]+)"')
_URL = re.compile(r"url\(#([^)]+)\)")
_HEAD = re.compile(r"<svg\b[^>]*>", re.DOTALL)
_METADATA = re.compile(r"<metadata>.*?</metadata>\s*", re.DOTALL)
_VIEW = re.compile(r'viewBox="([^"]+)"')


@contextmanager
def style(*, mathematics: bool = False) -> Iterator[None]:
    """The common style. mathematics False: a `$` in a name is a `$`, and no formula begins."""
    import matplotlib as mpl

    with mpl.rc_context({**STYLE, "text.parse_math": mathematics, "svg.fonttype": "path"}):
        yield


def draw(
    name: str,
    caption: str,
    alt: str,
    plot: Callable[[], Plot],
    *,
    header: tuple[str, ...] = (),
    rows: tuple[tuple[object, ...], ...] = (),
    png: bool = False,
    mathematics: bool = False,
) -> Figure:
    """Draws `plot()` in the common style. png: as PNG too, at 150 dots per inch."""
    with style(mathematics=mathematics):
        figure = plot()
        svg = svg_of(figure, name)
        picture = _png(figure) if png else None
    return Figure(name, caption, alt, svg, header, rows, picture)


def svg_of(figure: Plot, name: str) -> str:
    """SVG text, one element; its ids begin with `name`, so that figures of a page don't mix."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    # `savefig` draws everything twice, first for the layout alone, and what comes out is the same
    canvas = FigureCanvasSVG(figure)
    canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    return alone(buffer.getvalue(), name)


def alone(svg: str, name: str) -> str:
    """An SVG file's element without prologue, size and metadata, and with ids of its own."""
    prefix = re.sub(r"[^A-Za-z0-9]", "-", name)
    text = svg[svg.index("<svg") :]
    view = _VIEW.search(text)
    head = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
        + (f' viewBox="{view.group(1)}"' if view else "")
        + ">"
    )
    text = _METADATA.sub("", _HEAD.sub(lambda _: head, text, count=1))
    text = _ID.sub(lambda m: _renamed(m, prefix), text)
    return _URL.sub(lambda m: f"url(#{prefix}-{m.group(1)})", text).strip()


def _renamed(match: re.Match[str], prefix: str) -> str:
    """Ids and references within the file; data: addresses of embedded pictures stay."""
    attribute, hash_, value = match.groups()
    if attribute != "id" and not hash_:
        return match.group(0)
    return f'{attribute}="{hash_}{prefix}-{value}"'


def _png(figure: Plot) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=PNG_DPI, metadata=METADATA["png"])
    return buffer.getvalue()
