"""Progress of long work: on standard error while that is a terminal, otherwise silence."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

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
