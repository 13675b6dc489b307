"""The procedure on a rig in memory: what a resumed run measures anew, and what it does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.errors import ReadTimeout
from drivers.interfaces import LiveView
from rig.journal import replay
from rig.procedure.progress import Progress, read_progress
from tests.unit.runner_bench import ALL, PROTOCOL, Bench, resumed

SILENT = ReadTimeout("laser", "silent", "Check.")
UNLOADING = PROTOCOL.replace("branches: loading\n", "branches: loading-unloading\n")


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def break_at(bench: Bench, repetition: int, step: int, phase: str = "sampling") -> None:
    """Runs until the laser falls silent there."""

    def script(view: LiveView) -> None:
        if (view.repetition, view.step, view.phase) == (repetition, step, phase):
            bench.arm.broken["laser"] = SILENT

    bench.loader.script = script
    with pytest.raises(ReadTimeout):
        bench.run()


def progress(bench: Bench) -> Progress:
    return read_progress(replay(bench.path))


@pytest.mark.parametrize("step", [1, 2, 3])
def test_resume_measures_an_interrupted_repetition_anew(bench: Bench, step: int) -> None:
    break_at(bench, 1, step)
    begun = len(bench.records("sample"))
    assert progress(bench).interrupted == (0, 1, begun)
    assert progress(bench).done_steps == 0
    before = resumed(bench)
    assert before == begun
    assert bench.steps() == ALL
    assert {r["segment"] for r in bench.good()} == {2, 3}, "a repetition has one tare"
    settled = [r for r in bench.good() if r["step"] == step and r["values"]["settled"]]
    assert len(settled) == 6, "rows of the broken step must not count twice"
    clock = [r["session_s"] for r in bench.records("sample")]
    assert clock == sorted(clock)
    (discard,) = bench.events("discard")
    assert (discard["first"], discard["last"]) == (0, before - 1)
    assert discard["reason"] == "repetition interrupted before its end"
    assert progress(bench).interrupted is None


def test_resume_does_not_repeat_what_is_done(bench: Bench) -> None:
    break_at(bench, 2, 2)
    assert progress(bench).done_steps == 3
    before = resumed(bench)
    assert bench.steps() == ALL
    assert {r["repetition"] for r in bench.records("sample")[before:]} == {2}
    assert {r["step"] for r in bench.records("sample")[before:]} == {0, 1, 2, 3}


def test_unloading_is_never_taken_up_from_no_load(tmp_path: Path) -> None:
    bench = Bench(tmp_path, UNLOADING)
    break_at(bench, 2, 5)  # the last of the unloading levels
    before = resumed(bench)
    rows = bench.records("sample")[before:]
    branches = dict.fromkeys((r["branch"], r["step"]) for r in rows if r["step"])
    up = [("loading", 1), ("loading", 2), ("loading", 3)]
    assert list(branches) == [*up, ("unloading", 2), ("unloading", 1)]


def test_a_second_interruption_discards_what_was_measured_since_the_first(bench: Bench) -> None:
    break_at(bench, 1, 3)
    first = len(bench.records("sample"))
    bench.arm.broken.clear()
    break_at(bench, 1, 2)
    second = len(bench.records("sample"))
    resumed(bench)
    ranges = [(e["first"], e["last"]) for e in bench.events("discard")]
    assert ranges == [(0, first - 1), (first, second - 1)]
    assert bench.steps() == ALL


def test_a_repetition_that_only_lacks_its_rest_is_kept(tmp_path: Path) -> None:
    bench = Bench(tmp_path, PROTOCOL.replace("rest_s: 1\n", "rest_s: 50\n"))
    break_at(bench, 1, 0, phase="rest")
    assert progress(bench).interrupted is None
    before = resumed(bench)
    assert not bench.events("discard")
    assert {r["repetition"] for r in bench.records("sample")[before:]} == {2}
    rests = [v for v in bench.loader.views if v.phase == "rest"]
    assert len(rests) >= 2 * 450, (
        "ten looks a second: the rest that was cut short, and the last one"
    )


def test_a_repetition_may_be_redone_in_its_rest(bench: Bench) -> None:
    redone: list[bool] = []

    def script(view: LiveView) -> None:
        if (view.phase, view.repetition) == ("rest", 1) and not redone:
            redone.append(True)
            bench.loader.commands.append("redo_repetition")
        elif redone and (view.step, view.phase) == (3, "sampling"):
            bench.arm.broken["laser"] = SILENT

    bench.loader.script = script
    with pytest.raises(ReadTimeout):
        bench.run()
    assert progress(bench).repetitions == set()
    resumed(bench)
    assert bench.steps() == ALL
    assert {r["segment"] for r in bench.good()} == {3, 4}


def test_what_was_discarded_once_is_not_discarded_again(bench: Bench) -> None:
    redone: list[bool] = []

    def script(view: LiveView) -> None:
        if (view.step, view.phase) == (2, "sampling") and not redone:
            redone.append(True)
            bench.loader.commands.append("redo_repetition")
        elif (view.step, view.phase) == (3, "sampling"):
            bench.arm.broken["laser"] = SILENT

    bench.loader.script = script
    with pytest.raises(ReadTimeout):
        bench.run()
    before = resumed(bench)
    (a, b), (c, d) = [(e["first"], e["last"]) for e in bench.events("discard")]
    assert (a, b, d) == (0, c - 1, before - 1)
    assert bench.steps() == ALL
