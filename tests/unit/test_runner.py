"""The procedure on a rig in memory: order, redo, skip, pause, holds."""

from __future__ import annotations

from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

import pytest

from drivers.errors import NotDischarged
from drivers.interfaces import Command, LiveView, Prompt
from rig.errors import MeasurementStopped
from rig.journal import Record, replay
from rig.protocol import parse_protocol
from tests.unit.runner_bench import ALL, PROTOCOL, Bench, at, resumed


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_an_undisturbed_run_measures_every_step_and_zero_plateau(bench: Bench) -> None:
    bench.run()
    assert bench.steps() == ALL
    for number, force in ((1, 20.0), (2, 40.0), (3, 60.0)):
        rows = [r for r in bench.good() if r["step"] == number and r["values"]["settled"]]
        assert len(rows) == 2 * 3
        for row in rows:
            assert row["values"]["force_N"] == pytest.approx(force, abs=0.9)
            assert row["values"]["displacement_mm"] == pytest.approx(force / 100 + 0.5, abs=0.01)
    zeros = [r for r in bench.good() if r["branch"] == "zero" and r["values"]["settled"]]
    assert len(zeros) == 2 * (2 + 2)
    assert all(r["values"]["force_N"] == pytest.approx(0.0, abs=1e-9) for r in zeros)
    assert bench.checkpoints == 2


def test_settling_rows_are_kept_and_marked(bench: Bench) -> None:
    bench.run()
    unsettled = [r for r in bench.good() if not r["values"]["settled"]]
    assert unsettled
    assert {r["step"] for r in unsettled} == {0, 1, 2, 3}


def test_the_operator_is_asked_in_the_order_of_the_procedure(bench: Bench) -> None:
    bench.run()
    keys = [p.key for p in bench.loader.asked]
    assert keys == ["mount", "unload", "unload", "unload", "unload"]


def test_where_the_rig_is_set_up_is_told_before_the_question(tmp_path: Path) -> None:
    text = PROTOCOL.replace("{x: [1, 0, 0]}", "{x: [1, 0, 0], y: [0, 1, 0]}")
    run = "  - {pose: P1, direction: x, steps_N: [20, 40, 60]}\n"
    bench = Bench(tmp_path, text.replace(run, run + run.replace("x,", "y,")))
    newest: list[LiveView] = []
    ask = bench.loader.ask

    def ask_and_note(prompt: Prompt) -> str:
        if prompt.key == "mount":
            newest.append(bench.loader.views[-1])
        return ask(prompt)

    bench.loader.ask = ask_and_note  # type: ignore[method-assign]
    bench.run()
    told = [(view.phase, view.pose, view.direction, view.repetition) for view in newest]
    assert told == [("mounting", "P1", "x", 1), ("mounting", "P1", "y", 1)]
    assert all(isnan(view.force_N) and isnan(view.displacement_mm) for view in newest)


def test_an_amplifier_without_a_line_is_switched_by_the_operator(bench: Bench) -> None:
    bench.dynamometer.reset_by_hand = True
    bench.run()
    keys = [p.key for p in bench.loader.asked]
    tare = ["unload", "reset", "operate"]
    assert keys == ["reset", "mount", *tare, "unload", *tare, "unload"]
    texts = {p.key: p.text for p in bench.loader.asked}
    assert texts["reset"] == "Turn the charge amplifier to Reset, then confirm."
    assert texts["operate"] == "Turn the charge amplifier to Operate, then confirm."


def test_a_switch_that_was_not_turned_is_asked_for_again(bench: Bench) -> None:
    bench.dynamometer.reset_by_hand, bench.dynamometer.charged = True, 2
    bench.run()
    asked = [p for p in bench.loader.asked if p.key == "reset"]
    assert len(asked) == 2 + 3
    assert asked[1].text == (
        "Not discharged: in Reset channel 1 still shows 2.00 V. "
        "Turn the charge amplifier to Reset, then confirm."
    )
    assert asked[1].answers == ("ok", "abort")
    assert bench.steps() == ALL


def test_a_switch_that_cannot_be_turned_ends_the_measurement(bench: Bench) -> None:
    bench.dynamometer.reset_by_hand, bench.dynamometer.charged = True, 2
    bench.loader.answers["reset"] = ["ok", "abort"]
    with pytest.raises(MeasurementStopped, match="the operator ended the measurement"):
        bench.run()


def test_a_line_without_effect_is_a_failed_device(bench: Bench) -> None:
    bench.dynamometer.charged = 1
    with pytest.raises(NotDischarged):
        bench.run()
    assert not bench.loader.asked


def test_redo_step_discards_its_rows_and_measures_it_again(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("redo_step"))
    bench.run()
    assert bench.steps() == ALL
    discards = bench.events("discard")
    assert len(discards) == 1
    rows = bench.records("sample")[discards[0]["first"] : discards[0]["last"] + 1]
    assert {r["step"] for r in rows} == {2}
    assert len([r for r in bench.good() if r["step"] == 2 and r["values"]["settled"]]) == 6


def test_redo_repetition_starts_it_again(bench: Bench) -> None:
    at(bench, 3, lambda: bench.loader.commands.append("redo_repetition"))
    bench.run()
    assert bench.steps() == ALL
    assert {r["segment"] for r in bench.good()} == {2, 3}


def test_skip_asks_for_the_reason_and_goes_on(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("skip"))
    bench.loader.answers["skip_reason"] = ["screw slipped"]
    bench.run()
    assert bench.steps() == [s for s in ALL if s != (1, "loading", 2)]
    outcomes = [e["outcome"] for e in bench.events("step_done")]
    assert outcomes.count("skipped: screw slipped") == 1


def outside(bench: Bench, phase: str, command: Command) -> None:
    """Gives the command once, late in the first repetition, with no step under way."""
    done: list[bool] = []

    def script(view: LiveView) -> None:
        measured = bool(bench.events("unloaded"))
        if measured and (view.phase, view.repetition) == (phase, 1) and not done:
            done.append(True)
            bench.loader.commands.append(command)

    bench.loader.script = script


@pytest.mark.parametrize("phase", ["zero", "rest"])
@pytest.mark.parametrize("command", ["redo_step", "skip"])
def test_without_a_step_there_is_none_to_redo_or_skip(
    bench: Bench, phase: str, command: Command
) -> None:
    outside(bench, phase, command)
    bench.run()
    done = {"redo_step": "redone", "skip": "skipped"}[command]
    assert bench.loader.said[0] == f"No step is under way that could be {done}."
    assert not bench.events("discard")
    assert [e["outcome"] for e in bench.events("repetition_done")] == ["measured"] * 2
    assert bench.steps() == ALL


@pytest.mark.parametrize("phase", ["zero", "rest"])
def test_a_pause_without_a_step_offers_what_is_left_and_goes_on(bench: Bench, phase: str) -> None:
    outside(bench, phase, "pause")
    bench.run()
    paused = next(p for p in bench.loader.asked if p.key == "paused")
    assert paused.answers == ("continue", "redo_repetition", "abort")
    assert not bench.events("discard")
    assert bench.steps() == ALL


def test_a_pause_in_a_step_offers_to_redo_and_to_skip_it(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("pause"))
    bench.run()
    paused = next(p for p in bench.loader.asked if p.key == "paused")
    assert {"redo_step", "skip"} <= set(paused.answers)


def test_a_zero_plateau_that_does_not_settle_is_no_step(bench: Bench) -> None:
    text = PROTOCOL.replace("at_deadline: record", "at_deadline: ask")
    bench.protocol = parse_protocol(text, bench.path)

    def creep(view: LiveView) -> None:
        if view.phase == "settling" and view.branch == "zero":
            bench.arm.u -= 0.0005

    bench.loader.script = creep
    bench.run()
    asked = [p for p in bench.loader.asked if p.key == "settle_deadline"]
    assert [p.answers for p in asked] == [("record", "abort")] * 4


def test_a_pause_in_a_step_measures_the_step_again(bench: Bench) -> None:
    at(bench, 2, lambda: bench.loader.commands.append("pause"))
    bench.run()
    assert bench.steps() == ALL
    assert len(bench.events("discard")) == 1
    assert bench.checkpoints == 3


def test_a_force_that_is_not_reached_is_recorded_as_such(bench: Bench) -> None:
    bench.arm.yield_N = 50.0
    text = PROTOCOL.replace("{max: 5, at: pause}", "{max: 500, at: pause}")
    bench.protocol = parse_protocol(text, bench.path)
    bench.run()
    assert (1, "loading", 3) in bench.steps()
    outcomes = [e["outcome"] for e in bench.events("step_done")]
    assert "band not reached" in outcomes


def test_records_are_numbered_rows(bench: Bench) -> None:
    bench.run()
    records: list[Record] = replay(bench.path)
    assert [r.number for r in records] == list(range(len(records)))


def test_a_force_that_relaxes_out_of_its_band_is_approached_again(bench: Bench) -> None:
    def relax() -> None:
        bench.arm.u -= 0.05  # 5 N at 100 N/mm, while hands are off

    done: list[bool] = []

    def script(view: LiveView) -> None:
        if view.step == 2 and view.phase == "settling" and not done:
            done.append(True)
            relax()

    bench.loader.script = script
    bench.run()
    forces = [r["values"]["force_N"] for r in bench.good() if r["step"] == 2]
    assert forces == pytest.approx([40.0] * len(forces), abs=0.5)


@pytest.mark.parametrize(("hold_s", "samples"), [(7, 7), (4.4, 5)])
def test_a_hold_is_sampled_for_at_least_as_long_as_it_lasts(
    bench: Bench, hold_s: float, samples: int
) -> None:
    bench.protocol = parse_protocol(PROTOCOL.replace("hold_s: 0", f"hold_s: {hold_s}"), bench.path)
    bench.run()
    settled = [r for r in bench.good() if r["step"] == 1 and r["values"]["settled"]]
    assert len(settled) == 2 * samples


def stopped_at_3_mm(bench: Bench) -> None:
    """An arm that gives way at 50 N, on the way to the last level but one."""
    run = "steps_N: [20, 40, 60]"
    text = PROTOCOL.replace(run, "steps_N: [20, 40, 60, 80], stop_at_displacement_mm: 3")
    bench.protocol = parse_protocol(text, bench.path)
    bench.arm.yield_N = 50.0


def test_loading_ends_at_the_displacement_of_the_run_and_that_is_recorded(bench: Bench) -> None:
    stopped_at_3_mm(bench)
    bench.run()
    assert bench.steps() == ALL  # the level at 80 N is not gone to
    reached = [r["values"] for r in bench.good() if r["step"] == 3]
    assert {v["force_N"] for v in reached} == {50.0}
    furthest = max(v.displacement_mm for v in bench.loader.views if v.step)
    assert {v["displacement_mm"] for v in reached} == {furthest}
    assert sum(v["settled"] for v in reached) == 2 * 3  # samples of a step, twice
    assert [e["text"] for e in bench.events("top")] == ["displacement is above 3 mm"] * 2
    assert not bench.events("band_not_reached")


def test_an_end_of_loading_that_never_settles_is_marked(bench: Bench) -> None:
    stopped_at_3_mm(bench)

    def creep(view: LiveView) -> None:
        if view.phase == "settling" and view.step == 3:
            bench.arm.u += 0.001

    bench.loader.script = creep
    bench.run()
    reached = [r["values"]["settled"] for r in bench.good() if r["step"] == 3]
    assert reached
    assert not any(reached)
    assert len(bench.events("not_settled")) == 2


def test_an_end_of_loading_can_be_redone(bench: Bench) -> None:
    stopped_at_3_mm(bench)
    at(bench, 3, lambda: bench.loader.commands.append("redo_step"))
    bench.run()
    assert bench.steps() == ALL
    assert len(bench.events("top")) == 3
    assert len([r for r in bench.good() if r["step"] == 3 and r["values"]["settled"]]) == 2 * 3


def test_a_resumed_run_goes_on_behind_an_end_of_loading(bench: Bench) -> None:
    """What was interrupted at its top is measured anew; what was done before stays done."""
    stopped_at_3_mm(bench)

    def abort(view: LiveView) -> None:
        if view.repetition == 2 and view.step == 3 and view.samples == 1:
            bench.loader.commands.append("abort")

    bench.loader.script = abort
    with pytest.raises(MeasurementStopped):
        bench.run()
    resumed(bench)
    assert bench.steps() == ALL
    assert len(bench.events("repetition_done")) == 2


def test_a_slot_without_a_valid_value_is_no_row_but_an_event(bench: Bench) -> None:
    laser = bench.devices.laser
    collect = laser.collect
    empty = iter([True, False] * 500)

    def sometimes(_since: float = 0.0) -> Any:
        reading = collect()
        return replace(reading, count=0) if next(empty) else reading

    laser.collect = sometimes  # type: ignore[method-assign]
    bench.run()
    assert all(r["count"]["laser"] > 0 for r in bench.records("sample"))
    assert "no valid value from laser" in bench.events("no_value")[0]["text"]
    assert bench.steps() == ALL


def test_values_that_were_lost_are_an_event_and_a_warning(bench: Bench) -> None:
    laser = bench.devices.laser
    collect = laser.collect

    def overrun(_since: float = 0.0) -> Any:
        reading = collect()
        here = [v for v in bench.loader.views[-1:] if v.phase == "sampling" and v.step == 2]
        return replace(reading, lost=300) if here and not bench.events("values_lost") else reading

    laser.collect = overrun  # type: ignore[method-assign]
    bench.run()
    (event,) = bench.events("values_lost")
    text = f"300 values of laser before slot {event['text'].split()[6]} were lost"
    assert event["text"] == f"{text}: the program was held up"
    assert event["lost"] == {"laser": 300}
    assert event["text"] in bench.loader.said
    assert bench.steps() == ALL  # what did arrive counts


def test_taring_is_no_missed_slot(bench: Bench) -> None:
    bench.run()
    assert all(r["values"]["slots_missed"] == 0 for r in bench.records("sample"))
    assert all(r["lateness_s"] < 1e-6 for r in bench.records("sample"))
