"""A box that fits the terminal: where that is small, what is needed least gives way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.segment import Segment
from rich.text import Text

_BORDERS, _SIDES = 2, 4  # lines, and columns with their padding, that the box itself takes


class Rank(IntEnum):
    """What gives way to what: the first before all others, the last never."""

    BLANK = 0
    DIGITS = 1
    LIMITS = 2
    OLDER_NOTICE = 3
    FRAME = 4
    FACTS = 5
    BAR = 6
    TARGET = 7
    KEYS = 8
    NEWEST_NOTICE = 9
    STAYS = 10


@dataclass(frozen=True, slots=True)
class Part:
    """One of the parts of the box, top to bottom; `instead` stands there once it gave way."""

    content: RenderableType
    rank: Rank = Rank.STAYS
    instead: RenderableType | None = None


class Fitted:
    """The box. parts: from the columns that there are for them. A terminal too small even for what
    stays shows the last lines, where the answer is typed."""

    def __init__(
        self, parts: Callable[[int], Sequence[Part]], title: str, subtitle: Text | None
    ) -> None:
        self._parts = parts
        self._title = title
        self._subtitle = subtitle

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """As many parts as there are lines for."""
        height = options.size.height
        inner = options.update_width(max(1, options.max_width - _SIDES))
        parts = _fitting(self._parts(inner.max_width), height - _BORDERS, console, inner)
        box = Panel(
            Group(*parts), title=self._title, subtitle=self._subtitle, border_style="grey50"
        )
        for line in console.render_lines(box, options)[-height:]:
            yield from line
            yield Segment.line()


def _fitting(
    parts: Sequence[Part], lines: int, console: Console, options: ConsoleOptions
) -> list[RenderableType]:
    """What is shown of the parts in so many lines, the oldest of a rank giving way first."""

    def height(content: RenderableType | None) -> int:
        return 0 if content is None else len(console.render_lines(content, options))

    shown: list[RenderableType | None] = [part.content for part in parts]
    left = lines - sum(map(height, shown))
    for i in sorted(range(len(parts)), key=lambda i: parts[i].rank):
        if left >= 0 or parts[i].rank is Rank.STAYS:
            break
        left += height(shown[i]) - height(parts[i].instead)
        shown[i] = parts[i].instead
    return [content for content in shown if content is not None]
