"""A report as one HTML file: style and figures inside, no script, nothing fetched from anywhere.

Everything that comes from data goes through `escape`; the only markup is what stands here, the
style sheet beside, and the figures, which matplotlib draws as shapes. A content security policy
forbids scripts and requests, should that ever fail.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape as _escape
from importlib.resources import files

from rig.banners import marks
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
    rich,
)

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; form-action 'none'"
# Characters that XML and HTML do not know, and lone halves of surrogate pairs (file names).
_FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
_LONG = 8  # rows beyond which a table may be split between pages
# Wider or higher than that, in points, figures have panels that nobody could read in small print.
_LARGE = (700.0, 450.0)
_VIEW = re.compile(r'viewBox="\S+ \S+ ([\d.]+) ([\d.]+)"')
_MARKS = {"good": "✓ ", "bad": "✗ ", "open": "○ "}


def escape(text: str) -> str:
    """Text as text, in elements and in attributes."""
    return _escape(_FORBIDDEN.sub("\ufffd", text), quote=True)


def render(document: Document) -> str:
    """The whole file."""
    body = "\n".join(
        [
            _banners(document.banners, "banner"),
            f"<header><h1>{escape(document.title)}</h1>"
            f'<p class="subtitle">{escape(document.subtitle)}</p></header>',
            _contents(document.sections),
            "<main>",
            *(_section(s, 2) for s in document.sections),
            "</main>",
            f"<footer>{escape(document.foot)}</footer>",
        ]
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{escape(_POLICY)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(document.title)}</title>\n<style>\n{_style(document)}</style>\n"
        f"</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _style(document: Document) -> str:
    """The style sheet; on paper the marks stand at the head of every page."""
    sheet = files("rig.report").joinpath("report.css").read_text("utf-8")
    words = " · ".join(m for m in marks(document.banners) if m.isalpha())
    return sheet.replace('"MARKS"', f'"{words}"')


def _contents(sections: Iterable[Section]) -> str:
    links = "".join(
        f'<li><a href="#{escape(s.ident)}">{escape(s.title)}</a></li>' for s in sections
    )
    return f'<nav aria-label="Contents"><ol>{links}</ol></nav>'


def _banners(banners: Iterable[str], kind: str) -> str:
    return "".join(f'<p class="{kind}" role="note">{escape(b)}</p>' for b in banners)


def _section(section: Section, level: int) -> str:
    tag = f"h{min(level, 6)}"
    inner = "\n".join(_block(b, level) for b in section.blocks)
    return (
        f'<section id="{escape(section.ident)}">'
        f"<{tag}>{escape(section.title)}</{tag}>"
        f"{_banners(section.banners, 'mark')}\n{inner}\n</section>"
    )


def _block(block: Block, level: int) -> str:
    match block:
        case Paragraph():
            return f'<p class="{block.tone}">{_cell(block.parts)}</p>'
        case Bullets():
            return f"<ul>{''.join(f'<li>{_cell(item)}</li>' for item in block.items)}</ul>"
        case Facts():
            rows = "".join(f"<dt>{escape(n)}</dt><dd>{_cell(c)}</dd>" for n, c in block.rows)
            return f"<dl>{rows}</dl>"
        case Table():
            return _table(block)
        case Figure():
            return _figure(block)
        case Verbatim():
            return (
                f'<h{level + 1} class="text">{escape(block.title)}</h{level + 1}>'
                f"<pre>{escape(block.text)}</pre>"
            )
        case Section():
            return _section(block, level + 1)


def _figure(figure: Figure) -> str:
    view = _VIEW.search(figure.svg)
    large = view is not None and any(float(view[i]) > most for i, most in enumerate(_LARGE, 1))
    drawing = f'<div role="img" aria-label="{escape(figure.alt)}">{figure.svg}</div>'
    return (
        f'<figure id="{escape(figure.name)}" class="{"large" if large else "small"}">'
        f"{drawing}<figcaption>{escape(figure.caption)}</figcaption></figure>"
    )


def _table(table: Table) -> str:
    head = "".join(
        f'<th scope="col"{_side(i, table)}>{escape(h)}</th>' for i, h in enumerate(table.header)
    )
    rows = "".join(f"<tr>{_row(row, table)}</tr>" for row in table.rows)
    kind = "long" if len(table.rows) > _LONG else "short"
    return (
        f'<div class="scroll"><table class="{kind}"><caption>{escape(table.caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _row(row: tuple[Cell, ...], table: Table) -> str:
    return "".join(f"<td{_side(i, table)}>{_cell(cell)}</td>" for i, cell in enumerate(row))


def _side(column: int, table: Table) -> str:
    return "" if column < table.words else ' class="n"'


def _cell(cell: Cell) -> str:
    return "".join(_inline(part) for part in rich(cell))


def _inline(part: Inline) -> str:
    """`data` elements carry the number in full and where it stands in the report's JSON."""
    if isinstance(part, str):
        return escape(part)
    if isinstance(part, Number):
        scale = "" if part.scale == 1.0 else f' data-scale="{part.scale!r}"'
        return (
            f'<data value="{part.value!r}" data-pointer="{escape(part.pointer)}"{scale}>'
            f"{escape(part.text)}</data>"
        )
    tag = {"strong": "strong", "code": "code"}.get(part.style)
    if tag is not None:
        return f"<{tag}>{escape(part.text)}</{tag}>"
    return f'<span class="{part.style}">{_MARKS[part.style]}{escape(part.text)}</span>'
