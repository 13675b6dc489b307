"""The procedure on a rig in memory: pauses for a limit last as long as that is passed."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from drivers.interfaces import LiveView, Prompt
from rig.errors import MeasurementStopped
from rig.procedure.recorder import Recorder
from rig.procedure.supervision import ONLY_ABORT
from tests.unit.runner_bench import ALL, PROTOCOL, Bench, at

WARM = PROTOCOL.replace("limits:\n", "limits:\n  joint_temperature_C: {max: 40, at: pause}\n")


def heated(bench: Bench, paused_views: int, act: object = None) -> list[LiveView]:
    """The arm gets too hot in the second step, and cools down (or `act` is called) after so many
    views of the pause; those views."""
    paused: list[LiveView] = []

    def script(view: LiveView) -> None:
        if view.step == 2 and view.phase == "sampling" and not paused:
            bench.arm.temperature_C = 45.0
        if view.phase == "paused":
            paused.append(view)
            if len(paused) == paused_views:
                if callable(act):
                    act()
                else:
                    bench.arm.temperature_C = 35.0

    bench.loader.script = script
    return paused


def test_a_pause_for_a_limit_lasts_until_it_is_kept_again(tmp_path: Path) -> None:
    bench = Bench(tmp_path, WARM)
    paused = heated(bench, 50)
    bench.run()
    assert len(paused) >= 50
    assert bench.steps() == ALL
    assert len(bench.events("pause")) == 1
    assert [p.key for p in bench.loader.asked].count("paused") == 1
    assert bench.checkpoints == 2 + 1
    told = "Still paused: joint temperature 45 deg C is above the limit of 40 deg C. It goes on "
    assert [text for text in bench.loader.said if text.startswith(told)]


def test_ctrl_c_ends_a_pause_whose_limit_stands(tmp_path: Path) -> None:
    bench = Bench(tmp_path, WARM)
    heated(bench, 20, lambda: bench.runner and bench.runner.interrupt())
    with pytest.raises(MeasurementStopped, match="the operator ended the measurement"):
        bench.run()
    assert [p.key for p in bench.loader.asked][-1] == "interrupt"
    assert len(bench.events("pause")) == 1


def test_an_abort_ends_a_pause_whose_limit_stands_and_nothing_else_does(tmp_path: Path) -> None:
    bench = Bench(tmp_path, WARM)
    heated(bench, 20, lambda: bench.loader.commands.extend(["pause", "redo_step", "abort"]))
    with pytest.raises(MeasurementStopped, match="the operator ended the measurement"):
        bench.run()
    assert bench.loader.said.count(f"{ONLY_ABORT}.") == 2


def test_ctrl_c_comes_ahead_of_a_pause_that_comes_again_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A limit that is passed at the first look of every step, and kept while the question stands,
    leaves no other moment in which Ctrl-C could be heard."""
    bench = Bench(tmp_path, WARM)
    event, ask = Recorder.event, bench.loader.ask

    def flicker(self: Recorder, kind: str, text: str, **data: object) -> None:
        event(self, kind, text, **data)
        if kind in ("step_start", "pause"):
            bench.arm.temperature_C = 45.0 if kind == "step_start" else 35.0

    def interrupted(prompt: Prompt) -> str:
        if prompt.key == "paused":
            assert bench.runner
            if len(bench.events("pause")) == 3:
                bench.runner.interrupt()
            looks = len(bench.loader.views)
            while len(bench.loader.views) < looks + 2:
                time.sleep(0.001)
        return ask(prompt)

    monkeypatch.setattr(Recorder, "event", flicker)
    monkeypatch.setattr(bench.loader, "ask", interrupted)
    with pytest.raises(MeasurementStopped, match="the operator ended the measurement"):
        bench.run()
    assert len(bench.events("pause")) == 3


def test_slots_that_pass_while_a_pause_writes_the_file_are_not_missed(tmp_path: Path) -> None:
    bench = Bench(tmp_path, WARM)
    check = bench.check

    def slow() -> None:
        check()
        bench.clock.sleep(30.0)

    bench.check = slow  # type: ignore[method-assign]
    at(bench, 0, lambda: bench.loader.commands.append("pause"), phase="zero")
    bench.run()
    assert len(bench.events("pause")) == 1
    assert all(r["values"]["slots_missed"] == 0 for r in bench.records("sample"))
