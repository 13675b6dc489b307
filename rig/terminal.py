"""What only a terminal is given: progress of long work, and lines folded to its width."""

from __future__ import annotations

import os
import shutil
import stat
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

Progress = Callable[[str, float], None]  # what is being done, and how much of it is: 0 to 1


def silent(_: str, __: float) -> None:
    """Progress that nobody looks at."""


@contextmanager
def terminal_progress() -> Iterator[Progress]:
    """Yields a function that takes what is being done and the share done, 0 to 1."""
    if not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import Progress as Bars

    with Bars(console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=1.0)

        def show(what: str, fraction: float) -> None:
            bars.update(task, description=what, completed=fraction)

        yield show


def folded(text: str, width: int) -> str:
    """Lines that are too long go on below, deeper by two, and no word is torn that has a place."""
    return "\n".join(_fold(line, width) for line in text.split("\n"))


def width_of(stream: TextIO) -> int | None:
    """Columns of a terminal; None for files and pipes, whose lines stay whole."""
    return shutil.get_terminal_size().columns if stream.isatty() else None


def folded_for(stream: TextIO, text: str) -> str:
    """Folded where the stream is a terminal."""
    width = width_of(stream)
    return text if width is None else folded(text, width)


def leave_lost_terminal() -> None:
    """Standard streams on a terminal that was closed lead nowhere from here on: whatever is still
    written or read there would fail, in whichever thread does it."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        with suppress(OSError):
            if stat.S_ISCHR(os.fstat(number).st_mode) and not os.isatty(number):
                os.dup2(nowhere, number)
    os.close(nowhere)


def _fold(line: str, width: int) -> str:
    inside = line.lstrip(" ")
    indent = " " * (len(line) - len(inside))
    deeper = indent if not indent else indent + "  "
    if len(line) <= width or len(deeper) > width // 2:
        return line
    return textwrap.fill(
        inside,
        width,
        initial_indent=indent,
        subsequent_indent=deeper,
        replace_whitespace=False,
        expand_tabs=False,
        break_long_words=False,
        break_on_hyphens=False,
    )
