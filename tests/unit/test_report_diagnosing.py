"""Diagnoses beside the report: who draws what, and what happens when a process is gone."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, cast

import pytest

from rig.report import diagnosing
from rig.report.diagnosing import FIGURES, Crew, Found, Job, Waiting
from rig.report.document import Figure

VIEW: Any = object()


class Beside:
    """A pool of one process; gone: which was killed."""

    def __init__(self, *, gone: bool = False) -> None:
        self.gone = gone
        self.done: list[str] = []

    def submit(self, work: Callable[..., Any], *words: Any) -> Future[Any]:
        if self.gone:
            raise BrokenProcessPool
        self.done.append(work.__name__)
        future: Future[Any] = Future()
        future.set_result(work(*words))
        return future


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """The names that each call of `draw` was asked for."""
    calls: list[tuple[str, ...]] = []

    def draw(_: object, names: tuple[str, ...]) -> tuple[Figure, ...]:
        calls.append(tuple(names))
        return tuple(Figure(name, "", "", "") for name in names)

    monkeypatch.setattr(diagnosing, "draw", draw)
    return calls


def found_with(artist: Beside, outcome: Found | Exception) -> Waiting:
    crew = Crew(cast("Any", Beside()), cast("Any", artist))
    future: Future[Found] = Future()
    if isinstance(outcome, Found):
        future.set_result(outcome)
    else:
        future.set_exception(outcome)
    crew.begun = [future]
    return Waiting(Job(Path("a.h5"), "a", png=False), crew, 0)


def test_the_figures_are_drawn_in_two_processes(
    drawn: list[tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    artist, loaded = Beside(), list[str]()

    def load_drawing() -> None:
        loaded.append("drawing")

    monkeypatch.setattr(diagnosing, "load_drawing", load_drawing)
    diagnosed = found_with(artist, Found({"verdict": "none"}, VIEW)).result()
    assert tuple(f.name for f in diagnosed.figures) == FIGURES
    assert sorted(sum(drawn, ())) == sorted(FIGURES)  # each of them once
    assert len(drawn) == 2
    assert artist.done == ["load_drawing", "draw"]  # it has loaded before there is work
    assert loaded == ["drawing", "drawing"]  # and so has this process


def test_what_is_done_meanwhile_loads_no_diagnosis() -> None:
    code = (
        "import sys, rig.report.compose, rig.report.gather, rig.report.pictures\n"
        "print([m for m in sys.modules if m.startswith('identification.gap')])"
    )
    command = [sys.executable, "-c", code]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said.strip() == "[]"


def test_without_the_process_that_draws_all_is_drawn_here(drawn: list[tuple[str, ...]]) -> None:
    diagnosed = found_with(Beside(gone=True), Found({"verdict": "none"}, VIEW)).result()
    assert diagnosed.json == {"verdict": "none"}
    assert tuple(f.name for f in diagnosed.figures) == FIGURES
    assert drawn == [FIGURES]


@pytest.mark.parametrize(
    ("ending", "words"),
    [
        (BrokenProcessPool(), "The diagnosis was ended from outside, or ran out of memory."),
        (TimeoutError(), "The diagnosis took longer than 900 s and was given up."),
    ],
)
def test_a_diagnosis_that_did_not_end_says_so(
    ending: Exception, words: str, drawn: list[tuple[str, ...]]
) -> None:
    diagnosed = found_with(Beside(), ending).result()
    assert (diagnosed.json, diagnosed.reason) == (None, words)
    assert not drawn
