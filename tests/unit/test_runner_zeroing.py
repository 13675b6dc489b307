"""The procedure on a rig in memory: a screw that still presses when force and datum are zeroed."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.errors import ReadTimeout
from drivers.interfaces import LiveView, Prompt
from tests.unit.runner_bench import ALL, Bench

SILENT = ReadTimeout("laser", "silent", "Check.")


class Careless:
    """Confirms the n-th questions about unloading with the screw left as it is."""

    def __init__(self, bench: Bench, *left: int) -> None:
        self._bench, self._ask, self._left = bench, bench.loader.ask, left
        self.unloads = 0
        bench.loader.ask = self.ask  # type: ignore[method-assign]

    def ask(self, prompt: Prompt) -> str:
        advance = self._bench.arm.u
        answer = self._ask(prompt)
        if prompt.key == "unload":
            self.unloads += 1
        if prompt.key in ("unload", "mount"):
            left = prompt.key == "mount" or self.unloads in self._left
            self._bench.arm.u = advance if left else 0.0
        return answer


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def asked(bench: Bench, key: str) -> list[Prompt]:
    return [p for p in bench.loader.asked if p.key == key]


def interrupted_under_load(bench: Bench) -> None:
    """A first attempt that the laser ends in the third step, at 60 N."""

    def script(view: LiveView) -> None:
        if (view.step, view.phase, view.samples) == (3, "sampling", 1):
            bench.arm.broken["laser"] = SILENT

    bench.loader.script = script
    with pytest.raises(ReadTimeout):
        bench.run()
    bench.loader.script = lambda _view: None
    bench.arm.broken.clear()
    bench.loader.asked.clear()


def test_an_arm_that_stands_where_it_stood_is_not_asked_about(bench: Bench) -> None:
    Careless(bench)
    bench.run()
    assert {p.key for p in bench.loader.asked} == {"mount", "unload"}


def test_a_screw_left_under_load_is_asked_about_when_resumed(bench: Bench) -> None:
    Careless(bench, 2)
    interrupted_under_load(bench)
    bench.loader.answers["screw_clear"] = ["touching"]
    bench.run()
    (question,) = asked(bench, "screw_clear")
    assert question.answers == ("clear", "touching", "abort")
    assert question.text.startswith(
        "The laser shows the arm 0.6 mm from where it last stood unloaded, as under about 60 N. "
    )
    assert len(bench.events("unloaded_elsewhere")) == 1
    assert not bench.events("tared_under_load")
    good = bench.good()
    assert bench.steps() == ALL
    assert all(abs(r["values"]["force_N"] - r["target_N"]) < 1 for r in good if r["step"])
    assert all(abs(r["values"]["displacement_mm"]) < 1e-9 for r in good if not r["step"])


def test_a_screw_that_nobody_turned_back_is_asked_about_at_the_next_tare(bench: Bench) -> None:
    Careless(bench, 2, 3)  # at the end of the first repetition, and ahead of the second
    bench.loader.answers["screw_clear"] = ["touching"]
    bench.run()
    assert len(asked(bench, "screw_clear")) == 1
    assert not bench.events("tared_under_load")
    zeros = [r["values"] for r in bench.good() if not r["step"] and r["repetition"] == 2]
    assert all(abs(v["force_N"]) < 1e-9 for v in zeros)


def test_a_tare_under_load_shows_once_unloaded_and_is_redone(bench: Bench) -> None:
    bench.arm.u = 0.1  # nothing is known before the first load: 10 N stay unseen
    Careless(bench, 1)
    bench.loader.answers["tared_under_load"] = ["redo_repetition"]
    bench.run()
    (question,) = asked(bench, "tared_under_load")
    assert question.text == (
        "Repetition 1 seems to have been tared while the screw still pressed: unloaded, the force "
        "stands 10 N and the displacement 0.1 mm below their zeros, in the ratio of the loading "
        "curve. Its levels are that much too low. Redo the repetition, with the screw clear of "
        "the arm when it is tared."
    )
    assert len(bench.events("tared_under_load")) == 1
    zeros = [r["values"] for r in bench.good() if not r["step"]]
    assert all(abs(v["displacement_mm"]) < 1e-9 for v in zeros), "the datum was set under load, too"
    assert bench.steps() == ALL


def test_a_repetition_tared_under_load_may_be_kept(bench: Bench) -> None:
    bench.arm.u = 0.1
    Careless(bench, 1)
    bench.run()
    assert len(asked(bench, "tared_under_load")) == 1
    assert not bench.events("discard")
    kept = "Repetition 1, which seems to have been tared under load, is kept."
    assert kept in bench.loader.said


def test_an_amplifier_that_drifts_is_not_taken_for_a_tare_under_load(bench: Bench) -> None:
    Careless(bench)

    def drifting(view: LiveView) -> None:
        if (view.step, view.phase, view.samples) == (3, "sampling", 1):
            bench.arm.offset_N = -4.0

    bench.loader.script = drifting
    bench.run()
    assert not bench.events("tared_under_load")
