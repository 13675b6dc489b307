"""A bar on standard error for runs without a person at the screw."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Literal

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from drivers.interfaces import Command, LiveView, Loader, Prompt
from rig.protocol import MeasurementProtocol


class _Narrower:
    """Leaves room for the ^C that a terminal shows: else that begins a line, and the bar stays."""

    def __init__(self, inner: RenderableType) -> None:
        self._inner = inner

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """A little narrower than the terminal."""
        width = max(1, options.max_width - len("^C") - 1)
        yield from console.render(self._inner, options.update_width(width))


class Bar(Progress):
    """A progress bar that Ctrl-C leaves in its line."""

    def get_renderable(self) -> RenderableType:
        """The bar."""
        return _Narrower(super().get_renderable())


class LoaderWithBar:
    """Passes everything on to the loader, and shows where the procedure is.

    Quiet when standard error is no terminal.
    """

    def __init__(self, loader: Loader, protocol: MeasurementProtocol, done_steps: int) -> None:
        self.name = loader.name
        self._loader = loader
        console = Console(stderr=True)
        self._bar = Bar(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:.0f} of {task.total:.0f} steps"),
            TimeRemainingColumn(),
            TextColumn("left"),
            console=console,
            disable=not console.is_terminal,
        )
        total = protocol.repetitions * sum(len(protocol.steps(run)) for run in protocol.runs)
        self._task = self._bar.add_task("setting up", total=total, completed=done_steps)
        self._sampled: tuple[str, str, int, int] | None = None

    def open(self) -> None:
        """Starts loader and bar."""
        self._loader.open()
        self._bar.start()

    def close(self) -> None:
        """Ends both; what the bar shows last stays."""
        with suppress(OSError):  # the terminal itself may be gone
            self._bar.stop()
        self._loader.close()

    def identity(self) -> Mapping[str, str]:
        """The loader's."""
        return self._loader.identity()

    def ask(self, prompt: Prompt) -> str:
        """The loader answers."""
        return self._loader.ask(prompt)

    def withdraw(self) -> None:
        """The loader does."""
        self._loader.withdraw()

    def guide(self, view: LiveView) -> None:
        """Moves the bar on when the sampling of another step has ended."""
        self._loader.guide(view)
        where = f"{view.pose} {view.direction} {view.repetition}/{view.repetitions}"
        force = f"{view.force_N:7.2f} N" if view.force_N == view.force_N else "   --   "
        self._bar.update(self._task, description=f"{where} {view.phase:9} {force}")
        if view.phase == "sampling":
            self._sampled = (view.pose, view.direction, view.repetition, view.step)
        elif self._sampled is not None:
            self._sampled = None
            self._bar.advance(self._task)

    def notify(self, text: str, level: Literal["info", "warning", "error"] = "info") -> None:
        """One line above the bar, or on a standard error that is no terminal."""
        self._loader.notify(text, level)
        if self._bar.disable:
            self._bar.console.print(text, highlight=False, markup=False, soft_wrap=True)
        else:
            self._bar.console.print(text, highlight=False, markup=False)

    def command(self) -> Command | None:
        """The loader's."""
        return self._loader.command()
