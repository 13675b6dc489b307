"""A report as PDF, set by typst (https://typst.app), which comes as a wheel without dependencies.

The words of the report go to the template as JSON, the figures as SVG files in memory: no text of a
data set is ever read as markup.
"""

from __future__ import annotations

import json
import re
from importlib.resources import files
from pathlib import Path
from types import ModuleType
from typing import Any

from rig.banners import marks
from rig.errors import InputError
from rig.report.document import (
    Block,
    Bullets,
    Cell,
    Document,
    Facts,
    Figure,
    Inline,
    Number,
    Paragraph,
    Section,
    Table,
    Verbatim,
    figures,
    rich,
)

_LONG = 18  # characters of a cell beyond which its column wraps
_SIZE = re.compile(r'viewBox="[\d.+-]+ [\d.+-]+ ([\d.]+) ([\d.]+)"')
_PAGE_HEIGHT_SHARE = 1.15  # of the width, above which a figure would not leave room for its caption


def typesetter() -> ModuleType:
    """typst; InputError where it is not installed."""
    try:
        import typst
    except ImportError as error:
        raise InputError(
            "--pdf needs the package typst, which is not installed. Install it with "
            "`pip install typst`, or print the HTML page from a browser."
        ) from error
    return typst


def pdf(document: Document) -> bytes:
    """The report as A4 pages. InputError where typst is not installed."""
    typst = typesetter()
    content = json.dumps(_document(document)).encode()
    sources = {
        "main.typ": files("rig.report").joinpath("report.typ").read_bytes(),
        "report.json": content,
    }
    sources |= {_file(f): f.svg.encode() for f in figures(document.sections)}
    compile_: Any = typst.compile  # its stub does not know that sources may be a dict
    return bytes(compile_(sources, font_paths=[_fonts()], format="pdf"))


def _fonts() -> str:
    """DejaVu, which matplotlib brings along: the figures are set in it too."""
    import matplotlib as mpl

    return str(Path(mpl.get_data_path()) / "fonts" / "ttf")


def _file(figure: Figure) -> str:
    return f"{figure.name}.svg"


def _document(document: Document) -> dict[str, Any]:
    return {
        "title": _clean(document.title),
        "subtitle": _clean(document.subtitle),
        "foot": _clean(document.foot),
        "banners": [_clean(b) for b in document.banners],
        "marks": " · ".join(marks(document.banners)),
        "sections": [_block(s) for s in document.sections],
    }


def _block(block: Block) -> dict[str, Any]:
    match block:
        case Paragraph():
            return {"kind": "paragraph", "tone": block.tone, "parts": _parts(block.parts)}
        case Bullets():
            return {"kind": "bullets", "items": [_parts(i) for i in block.items]}
        case Facts():
            return {"kind": "facts", "rows": [[_clean(n), _parts(c)] for n, c in block.rows]}
        case Table():
            return _table(block)
        case Figure():
            return {
                "kind": "figure",
                "file": _file(block),
                "caption": _clean(block.caption),
                "alt": _clean(block.alt),
                "width": _width(block.svg),
            }
        case Verbatim():
            return {"kind": "verbatim", "title": _clean(block.title), "text": _clean(block.text)}
        case Section():
            return {
                "kind": "section",
                "title": _clean(block.title),
                "banners": [_clean(b) for b in block.banners],
                "blocks": [_block(b) for b in block.blocks],
            }


def _table(table: Table) -> dict[str, Any]:
    width = range(len(table.header))
    longest = [max((_length(row[i]) for row in table.rows), default=0) for i in width]
    return {
        "kind": "table",
        "caption": _clean(table.caption),
        "header": [_clean(h) for h in table.header],
        "rows": [[{"parts": _parts(c)} for c in row] for row in table.rows],
        "words": table.words,
        "long": [n if n > _LONG else 0 for n in longest],  # their shares of the room; 0: as needed
    }


def _width(svg: str) -> float:
    """Share of the text's width: tall figures are made narrower, to stay on a page."""
    size = _SIZE.search(svg)
    if size is None:
        return 0.92
    ratio = float(size.group(2)) / float(size.group(1))
    return min(0.92, _PAGE_HEIGHT_SHARE / ratio)


def _length(cell: Cell) -> int:
    return sum(len(p if isinstance(p, str) else p.text) for p in rich(cell))


def _parts(cell: Cell) -> list[dict[str, str]]:
    return [_part(p) for p in rich(cell)]


def _part(part: Inline) -> dict[str, str]:
    if isinstance(part, str):
        return {"text": _clean(part), "style": ""}
    if isinstance(part, Number):
        return {"text": part.text, "style": ""}
    return {"text": _clean(part.text), "style": part.style}


def _clean(text: str) -> str:
    """Without lone halves of surrogate pairs, which JSON carries and UTF-8 does not."""
    return text.encode("utf-8", "replace").decode()
