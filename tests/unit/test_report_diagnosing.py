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
JSON = {"verdict": "none"}


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


class Finishes(Future[Any]):
    """The end of a diagnosis, which notes how often something had been drawn by then."""

    def __init__(self, drawn: list[tuple[str, ...]]) -> None:
        super().__init__()
        self.drawn = drawn
        self.drawn_before = -1

    def result(self, timeout: float | None = None) -> Any:
        self.drawn_before = len(self.drawn)
        return JSON


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """The names that each call of `draw` was asked for."""
    calls: list[tuple[str, ...]] = []

    def draw(_: object, names: tuple[str, ...]) -> tuple[Figure, ...]:
        calls.append(tuple(names))
        return tuple(Figure(name, "", "", "") for name in names)

    monkeypatch.setattr(diagnosing, "draw", draw)
    return calls


def found_with(
    artist: Beside, begun: Found | Exception, finished: dict[str, Any] | Exception = JSON
) -> Waiting:
    crew = Crew([cast("Any", Beside())], cast("Any", artist))
    crew.begun, crew.finished = [future_of(begun)], [future_of(finished)]
    return Waiting(Job(Path("a.h5"), "a", png=False), crew, 0)


def future_of(outcome: Any) -> Future[Any]:
    future: Future[Any] = Future()
    if isinstance(outcome, Exception):
        future.set_exception(outcome)
    else:
        future.set_result(outcome)
    return future


def test_the_figures_are_drawn_in_two_processes(
    drawn: list[tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    artist, loaded = Beside(), list[str]()

    def load_drawing() -> None:
        loaded.append("drawing")

    monkeypatch.setattr(diagnosing, "load_drawing", load_drawing)
    diagnosed = found_with(artist, Found(VIEW)).result()
    assert tuple(f.name for f in diagnosed.figures) == FIGURES
    assert sorted(sum(drawn, ())) == sorted(FIGURES)  # each of them once
    assert len(drawn) == 2
    assert artist.done == ["load_drawing", "draw"]  # it has loaded before there is work
    assert loaded == ["drawing", "drawing"]  # and so has this process


@pytest.mark.parametrize("number", [1, 3, 4])
def test_figures_keep_their_order_however_many_there_are(
    number: int, drawn: list[tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(diagnosing, "FIGURES", FIGURES[:number])
    diagnosed = found_with(Beside(), Found(VIEW)).result()
    assert tuple(f.name for f in diagnosed.figures) == FIGURES[:number]
    assert len(drawn) == 2


@pytest.mark.parametrize(
    ("work", "other"),
    [
        ("rig.report.compose, rig.report.gather, rig.report.pictures", "identification.gap"),
        ("rig.dataset, rig.diagnosis.diagnose, rig.report.gap_view", "rig.report.figures"),
        ("rig.dataset, rig.diagnosis.diagnose, rig.report.gap_view", "matplotlib"),
    ],
    ids=["who composes", "who diagnoses", "nothing that draws"],
)
def test_what_goes_on_side_by_side_loads_only_its_own(work: str, other: str) -> None:
    code = f"import sys, {work}\nprint([m for m in sys.modules if m.startswith({other!r})])"
    command = [sys.executable, "-c", code]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said.strip() == "[]"


def test_without_the_process_that_draws_all_is_drawn_here(drawn: list[tuple[str, ...]]) -> None:
    diagnosed = found_with(Beside(gone=True), Found(VIEW)).result()
    assert diagnosed.json == JSON
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


def test_the_figures_are_drawn_while_the_diagnosis_is_finished(
    drawn: list[tuple[str, ...]],
) -> None:
    waiting = found_with(Beside(), Found(VIEW))
    finishes = Finishes(drawn)
    cast("Any", waiting)._crew.finished = [finishes]
    assert waiting.result().json == JSON
    assert finishes.drawn_before == 2


def test_a_process_that_is_gone_before_it_has_finished_leaves_no_half_diagnosis(
    drawn: list[tuple[str, ...]],
) -> None:
    diagnosed = found_with(Beside(), Found(VIEW), BrokenProcessPool()).result()
    assert (diagnosed.json, diagnosed.figures) == (None, ())
    assert diagnosed.reason == "The diagnosis was ended from outside, or ran out of memory."


def test_a_diagnosis_is_finished_by_the_process_that_began_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def begin(job: Job) -> Found:
        return Found(None, job.stem)

    def finish() -> None: ...

    monkeypatch.setattr(diagnosing, "begin", begin)
    monkeypatch.setattr(diagnosing, "finish", finish)
    pools = [Beside(), Beside()]
    crew = Crew(cast("Any", pools), cast("Any", Beside()))
    crew.begin([Job(Path(f"{n}.h5"), n, png=False) for n in "abc"])
    assert [f.result().reason for f in crew.begun] == ["a", "b", "c"]
    assert [p.done for p in pools] == [["begin", "finish"] * 2, ["begin", "finish"]]


def test_a_process_keeps_one_unfinished_diagnosis(monkeypatch: pytest.MonkeyPatch) -> None:
    def look(job: Job) -> tuple[Found, Callable[[], Any]]:
        return Found(None, job.stem), lambda: {"verdict": job.stem}

    monkeypatch.setattr(diagnosing, "look", look)
    for stem in ("a", "b", "c"):
        assert diagnosing.begin(Job(Path("a.h5"), stem, png=False)).reason == stem
        if stem != "a":  # whoever asked for the first one may be gone
            assert diagnosing.finish() == {"verdict": stem}
