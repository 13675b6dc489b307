"""A k that rests on a part of the levels asked for is not shown like that of a whole curve."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rig.analysis.analyze import analyze
from tests.unit.runner_bench import PROTOCOL
from tests.unit.stiffness_tables import Table, run, table

LEVELS = (20.0, 60.0, 100.0, 140.0, 180.0)
SECANT = (
    "k in x rests on 1 of 5 levels, up to 20.0 of 180 N in the protocol: a secant through one "
    "level is no stiffness over a range. Where the curve bends, k of the whole range is another, "
    "and may lie outside of the interval. Measure the levels that are missing before you quote k."
)


def softening(force: float) -> float:
    return force / 110 + (force / 400) ** 2


def asked_for(levels: tuple[float, ...] = LEVELS) -> dict[str, str]:
    forces = ", ".join(f"{f:g}" for f in levels)
    text = PROTOCOL.replace("[20, 40, 60]", f"[{forces}]")
    return {"protocol": text.replace("force_N: {max: 100", "force_N: {max: 300")}


def measured(*levels: float, texts: dict[str, str] | None = None, **more: Any) -> Table:
    told = asked_for() if texts is None else texts
    return table(run(softening, levels), texts=told, **more)


def test_one_level_of_many_is_called_a_secant_wherever_k_stands() -> None:
    result = analyze(measured(20.0))
    assert result.notes == (SECANT,)
    lines = result.to_text().splitlines()
    assert lines[0].startswith(
        "run.h5: k in x (over 1 of 5 levels, up to 20.0 of 180 N) is 108.5 ["
    )
    assert lines[1] == f"Mind: {SECANT}"
    assert lines[5].startswith("k (over 1 of 5 levels, up to 20.0 of 180 N) = 108.5 N")
    assert result.to_json()["directions"]["x"]["levels"] == {
        "measured": 1,
        "asked": 5,
        "largest_force_N": pytest.approx(20.0),
        "asked_force_N": 180.0,
        "partial": True,
    }


@pytest.mark.parametrize("levels", [LEVELS, (*LEVELS[:3], 180.0), (*LEVELS[:4], 165.0)])
def test_a_curve_that_covers_the_range_is_whole(levels: tuple[float, ...]) -> None:
    result = analyze(measured(*levels))
    assert result.notes == ()
    assert "(over" not in result.to_text()


def test_three_levels_of_five_end_far_below_the_range() -> None:
    (note,) = analyze(measured(*LEVELS[:3])).notes
    assert note.startswith("k in x rests on 3 of 5 levels, up to 100 of 180 N in the protocol: an")


def test_few_levels_are_few_though_they_reach_the_top() -> None:
    data = measured(20.0, 180.0)
    data.columns["step"][data.columns["force_N"] == 180.0] = 5
    (note,) = analyze(data).notes
    assert note.startswith("k in x rests on 2 of 5 levels, up to 180 of 180 N in the protocol: an")


def test_a_table_with_one_level_has_no_protocol_to_compare_with() -> None:
    (note,) = analyze(measured(60.0, texts={})).notes
    assert note.startswith("k in x rests on 1 level, up to 60.0 N: a secant")
    assert note.endswith("Measure more levels before you quote k.")


def test_a_protocol_that_asks_for_one_level_lacks_none() -> None:
    (note,) = analyze(measured(60.0, texts=asked_for((60.0,)))).notes
    assert note.startswith("k in x rests on 1 of 1 level, up to 60.0 of 60.0 N in the protocol: a")
    assert note.endswith("Measure more levels before you quote k.")


def test_loading_that_the_displacement_ended_lacks_nothing_beyond() -> None:
    data = measured(*LEVELS[:3])
    at = int(np.flatnonzero(data.columns["step"] == 3)[0])
    top = {"kind": "top", "branch": "loading", "step": 3, "sample": at}
    assert analyze(measured(*LEVELS[:3], events=[top])).notes == ()


def skipped(why: str, *, sample: int = 4) -> dict[str, Any]:
    return {
        "kind": "step_done",
        "text": f"loading to 20 N: skipped: {why}",
        "outcome": f"skipped: {why}",
        "pose": "P1",
        "direction": "x",
        "repetition": 1,
        "step": 1,
        "sample": sample,
    }


@pytest.mark.parametrize(
    ("why", "said"), [("the laser's spot was off.", ": the laser's spot was off."), ("", ".")]
)
def test_a_skipped_level_is_mentioned_with_its_reason(why: str, said: str) -> None:
    (note,) = analyze(measured(*LEVELS, events=[skipped(why)])).directions["x"].result.notes
    reason = said if why else ", no reason given."
    assert note == f"Skipped by the operator: loading to 20 N (step 1, repetition 1){reason}"


def test_a_skip_in_a_repetition_that_was_measured_anew_is_past() -> None:
    anew = {"kind": "discard", "text": "", "reason": "", "first": 0, "last": 9, "sample": 10}
    notes = analyze(measured(*LEVELS, events=[skipped("late"), anew])).directions["x"].result.notes
    assert notes == ()
