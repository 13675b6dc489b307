"""Diagnoses beside the rest of the report: in processes of their own, because they take longer than
everything else together. Loads nothing heavy here: they begin before anything else does."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.errors import InputError
from rig.report.document import Figure

if TYPE_CHECKING:
    from rig.report.gap_view import GapView

# Of one data set; a million samples take half a minute.
DEADLINE_S = 900.0
FIGURES = ("curve", "map", "withheld", "remainder")
TURNED_OFF = "Left out, as asked for (--no-gap)."


@dataclass(frozen=True)
class Diagnosed:
    """What `rig diagnose` says (rig.diagnosis/1) and its figures; or why there is nothing."""

    json: dict[str, Any] | None
    figures: tuple[Figure, ...] = ()
    reason: str = ""


@dataclass(frozen=True)
class Job:
    """One data set to diagnose. stem: what its figures' names begin with."""

    path: Path
    stem: str
    png: bool


@dataclass(frozen=True)
class Found:
    """What the figures of a diagnosis are drawn from; or why there is nothing."""

    view: GapView | None
    reason: str = ""


Whole = Callable[[], "dict[str, Any] | None"]


def look(job: Job) -> tuple[Found, Whole]:
    """Diagnoses one data set but for what to measure next, which no figure shows, and what makes it
    whole; a data set that can't be diagnosed says why."""
    from rig.dataset import load
    from rig.diagnosis.diagnose import explain
    from rig.report.gap_view import view_of

    try:
        diagnosis, whole = explain(load(job.path))
    except InputError as error:
        return Found(None, without_name(str(error), job.path)), lambda: None
    return Found(view_of(diagnosis, job.stem, png=job.png)), lambda: whole().to_json()


# Of the last job of this process: too large to be handed from one process to another.
_unfinished: list[Whole] = []


def begin(job: Job) -> Found:
    """`look` in a process of a crew, which keeps what is left to do."""
    _unfinished.clear()  # an earlier job's memory, before this one takes its own
    found, whole = look(job)
    _unfinished.append(whole)
    return found


def finish() -> dict[str, Any] | None:
    """The whole of what this process began last (rig.diagnosis/1)."""
    return _unfinished.pop()()


def draw(view: GapView, names: Sequence[str]) -> tuple[Figure, ...]:
    """The figures of these names."""
    from rig.report.gap_pictures import gap_figures

    return tuple(gap_figures(view, names))


def without_name(message: str, path: Path) -> str:
    """A message without the file's name in front: the report names its file already."""
    text = message.removeprefix(f"{path}: ")
    return text[:1].upper() + text[1:]


def load_drawing() -> None:
    """What `draw` needs in a new process: a first figure takes twice as long as the next one."""
    import rig.report.gap_pictures  # noqa: F401
    from rig.canvas import blank
    from rig.report.drawing import style, svg_of

    with style():
        figure = blank(2.0, 2.0)
        figure.add_subplot().set_xlabel("x")
        svg_of(figure, "first")


class Crew:
    """The processes that diagnose, and one that draws half of the figures of what they find."""

    def __init__(self, pools: Sequence[ProcessPoolExecutor], artist: ProcessPoolExecutor) -> None:
        """pools: of one process each, so that a diagnosis is finished where it was begun."""
        self.pools = pools
        self.artist = artist
        self.begun: list[Future[Found]] = []
        self.finished: list[Future[dict[str, Any] | None]] = []

    def begin(self, jobs: Sequence[Job]) -> None:
        """Begins every diagnosis for which there is a process; the others follow."""
        with _ctrl_c_ignored():  # which the children inherit, from their first moment on
            for job, pool in zip(jobs, cycle(self.pools), strict=False):
                self.begun.append(pool.submit(begin, job))
                self.finished.append(pool.submit(finish))

    def wait_for(self, number: int) -> Found:
        """What a diagnosis found. The artist starts only now: while this process waits, nobody
        else wants its core."""
        with _ctrl_c_ignored(), suppress(BrokenProcessPool):  # `_drawn` does without it
            self.artist.submit(load_drawing)
        load_drawing()  # half of the figures are drawn here
        return self.begun[number].result(DEADLINE_S)


class Waiting:
    """A diagnosis on its way, or one that runs when it is asked for."""

    def __init__(self, job: Job, crew: Crew | None = None, number: int = 0) -> None:
        """number: among the crew's jobs; crew None: run here."""
        self._job = job
        self._crew = crew
        self._number = number

    def result(self) -> Diagnosed:
        """Waits for it, `DEADLINE_S` at most, and draws while it is finished."""
        try:
            found, whole = self._found()
            figures = () if found.view is None else self._drawn(found.view)
            return Diagnosed(whole(), figures, found.reason)
        except TimeoutError:
            return Diagnosed(
                None, reason=f"The diagnosis took longer than {DEADLINE_S:g} s and was given up."
            )
        except BrokenProcessPool:
            return Diagnosed(
                None, reason="The diagnosis was ended from outside, or ran out of memory."
            )

    def _found(self) -> tuple[Found, Whole]:
        if self._crew is None:
            return look(self._job)
        finished = self._crew.finished[self._number]
        return self._crew.wait_for(self._number), lambda: finished.result(DEADLINE_S)

    def _drawn(self, view: GapView) -> tuple[Figure, ...]:
        """Every other figure here, the rest beside: both take about as long."""
        if self._crew is None:
            return draw(view, FIGURES)
        try:
            others = self._crew.artist.submit(draw, view, FIGURES[1::2])
            mine, beside = draw(view, FIGURES[::2]), others.result(DEADLINE_S)
        except (TimeoutError, BrokenProcessPool):
            return draw(view, FIGURES)
        figures = [*mine, *beside]
        figures[::2], figures[1::2] = mine, beside
        return tuple(figures)


def usable_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def diagnosing(jobs: Sequence[Job], processes: int) -> Iterator[list[Waiting]]:
    """All jobs begun in up to so many processes; 0: none, each then runs here when asked for.

    What is still running when the block is left is ended.
    """
    if processes < 1 or not jobs:
        yield [Waiting(job) for job in jobs]
        return
    others = set(multiprocessing.active_children())
    crew = Crew([_pool() for _ in range(min(processes, len(jobs)))], _pool())
    try:
        crew.begin(jobs)
        yield [Waiting(job, crew, number) for number, job in enumerate(jobs)]
    finally:
        for pool in (*crew.pools, crew.artist):
            pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - others:
            child.terminate()


def _pool() -> ProcessPoolExecutor:
    """Starts its process when there is work."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _deaf_to_ctrl_c)


@contextmanager
def _ctrl_c_ignored() -> Iterator[None]:
    """Only the main thread may say so; elsewhere, or under a handler that is not Python's, nothing
    changes."""
    earlier = signal.getsignal(signal.SIGINT)
    if earlier is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, earlier)


def _deaf_to_ctrl_c() -> None:
    """The parent hears it, and ends the children. Needed where nothing is inherited."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
