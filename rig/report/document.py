"""What a report is made of, before anybody decides how it looks: sections, tables, figures, words.

Text stands here as it was given, unescaped; whoever renders it (`rig.report.html`,
`rig.report.pdf`) sees to it that text stays text.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

Tone = Literal["plain", "answer", "note", "warning"]
Style = Literal["strong", "code", "good", "bad", "open"]


@dataclass(frozen=True)
class Number:
    """A number of the results: `text` is what is shown, `value` times `scale` in full.

    pointer: where it stands in the report's JSON (RFC 6901).
    """

    text: str
    value: float | None
    pointer: str
    scale: float = 1.0


@dataclass(frozen=True)
class Word:
    """Text that stands out. good, bad, open: a verdict, marked by more than its colour."""

    text: str
    style: Style


Inline = str | Number | Word
Rich = tuple[Inline, ...]
Cell = Inline | Rich
Row = tuple[Cell, ...]


@dataclass(frozen=True)
class Paragraph:
    """One paragraph; "answer" is the sentence to read first, "warning" must not be overlooked."""

    parts: Rich
    tone: Tone = "plain"


@dataclass(frozen=True)
class Bullets:
    """A list of short sentences."""

    items: tuple[Cell, ...]


@dataclass(frozen=True)
class Facts:
    """Names and what stands for them."""

    rows: tuple[tuple[str, Cell], ...]


@dataclass(frozen=True)
class Table:
    """words: how many columns hold words and stand to the left; the others hold numbers."""

    caption: str
    header: tuple[str, ...]
    rows: tuple[Row, ...]
    words: int = 1


@dataclass(frozen=True)
class Figure:
    """A drawing as SVG text, and the numbers behind it: header and rows of a CSV file.

    name: of the files it is written to. alt: what it shows, for those who cannot see it.
    """

    name: str
    caption: str
    alt: str
    svg: str
    header: tuple[str, ...] = ()
    rows: tuple[tuple[object, ...], ...] = ()
    png: bytes | None = field(default=None, repr=False)


@dataclass(frozen=True)
class Verbatim:
    """Text with its line breaks, as a protocol is."""

    title: str
    text: str


@dataclass(frozen=True)
class Section:
    """A chapter, or a part of one. ident: unique in the report; banners: what it must say first."""

    ident: str
    title: str
    blocks: tuple[Block, ...]
    banners: tuple[str, ...] = ()


Block = Paragraph | Bullets | Facts | Table | Figure | Verbatim | Section


@dataclass(frozen=True)
class Document:
    """A whole report. foot: one line for the foot of every page."""

    title: str
    subtitle: str
    banners: tuple[str, ...]
    sections: tuple[Section, ...]
    foot: str


def rich(cell: Cell) -> Rich:
    """A cell as a sequence of parts."""
    return cell if isinstance(cell, tuple) else (cell,)


def row(*cells: Cell) -> Row:
    """A row of a table."""
    return cells


def figures(blocks: Sequence[Block]) -> list[Figure]:
    """All figures, in the order of reading."""
    found: list[Figure] = []
    for block in blocks:
        if isinstance(block, Figure):
            found.append(block)
        elif isinstance(block, Section):
            found += figures(block.blocks)
    return found
