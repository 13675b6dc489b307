"""Diagnoses and their figures, beside the rest of the report: in processes of their own, because
they take longer than everything else together."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.errors import InputError
from rig.report.document import Figure

# Of one data set; a million samples take half a minute.
DEADLINE_S = 900.0
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


def run(job: Job) -> Diagnosed:
    """Diagnoses one data set and draws; a data set that can't be diagnosed says why."""
    from rig.dataset import load
    from rig.diagnose import diagnose
    from rig.report.gap_pictures import gap_figures

    try:
        diagnosis = diagnose(load(job.path))
    except InputError as error:
        return Diagnosed(None, reason=without_name(str(error), job.path))
    return Diagnosed(diagnosis.to_json(), tuple(gap_figures(diagnosis, job.stem, png=job.png)))


def without_name(message: str, path: Path) -> str:
    """A message without the file's name in front: the report names its file already."""
    text = message.removeprefix(f"{path}: ")
    return text[:1].upper() + text[1:]


class Waiting:
    """A diagnosis on its way, or one that runs when it is asked for."""

    def __init__(self, job: Job, future: Future[Diagnosed] | None) -> None:
        """future None: run here."""
        self._job = job
        self._future = future

    def result(self) -> Diagnosed:
        """Waits for it, `DEADLINE_S` at most."""
        if self._future is None:
            return run(self._job)
        try:
            return self._future.result(DEADLINE_S)
        except TimeoutError:
            return Diagnosed(
                None, reason=f"The diagnosis took longer than {DEADLINE_S:g} s and was given up."
            )
        except BrokenProcessPool:
            return Diagnosed(
                None, reason="The diagnosis was ended from outside, or ran out of memory."
            )


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
        yield [Waiting(job, None) for job in jobs]
        return
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        min(processes, len(jobs)), multiprocessing.get_context("spawn"), _deaf_to_ctrl_c
    )
    try:
        with _ctrl_c_ignored():  # which the children inherit, from their first moment on
            begun = [Waiting(job, pool.submit(run, job)) for job in jobs]
        yield begun
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - others:
            child.terminate()


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
