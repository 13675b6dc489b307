"""What makes the numbers of a recording doubtful is said beside them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rig.analysis.analyze import analyze
from tests.unit.stiffness_tables import Row, Table, run, table

LEVELS = (20.0, 40.0, 60.0, 80.0)


def spring(force: float) -> float:
    return force / 100.0


def recorded(rows: list[Row] | None = None, **columns: Any) -> Table:
    """Three runs that went as they should, with more columns."""
    if rows is None:
        rows = [row for r in (1, 2, 3) for row in run(spring, LEVELS, repetition=r)]
    found = table(rows)
    found.columns |= {name: np.full(len(rows), value) for name, value in columns.items()}
    return found


def test_a_recording_that_went_well_has_no_doubts() -> None:
    result = analyze(recorded(slots_missed=0.0, settled=1.0))
    assert result.notes == ()
    assert result.to_json()["notes"] == []
    assert "Mind" not in result.to_text()


def test_a_table_that_says_nothing_of_all_that_has_none_either() -> None:
    assert analyze(recorded()).notes == ()


def test_missed_slots() -> None:
    data = recorded(slots_missed=5.0)
    assert data.columns["force_N"].size == 72
    note = (
        "83 % of the sampling slots were missed (360 of 432): the program was held up. Force and "
        "limits were seen late, and levels may be overshot. Measure again on a machine that keeps "
        "up (an emulated station: with a lower --speed)."
    )
    result = analyze(data)
    assert result.to_json()["notes"] == [note]
    assert result.to_text().splitlines()[1] == f"Mind: {note}"
    data.columns["slots_missed"][7:] = 0  # 35 of 107 become 8 of 80
    data.columns["slots_missed"][:7] = [2, 1, 1, 1, 1, 1, 1]
    assert analyze(data).notes == ()


def test_levels_that_had_not_settled() -> None:
    data = recorded(settled=1.0)
    late = (data.columns["step"] == 2) & (data.columns["repetition"] != 3)
    data.columns["settled"][late] = 0
    (note,) = analyze(data).notes
    assert note == (
        "2 of 12 levels had not settled when they were sampled: force or displacement still "
        "moved, and k depends on how long was waited. Give `settle` of the protocol a longer "
        "deadline_s, or wider bands if that motion is of no concern."
    )


def deadline(data: Table, step: int) -> int:
    """Marks the first two samples of a step as its settling, which ends at its deadline."""
    at = int(np.flatnonzero(data.columns["step"] == step)[0])
    data.columns["settled"][at : at + 2] = 0
    data.events = [{"kind": "not_settled", "text": "", "sample": at + 2, "step": step}]
    return at


def test_files_that_mark_what_followed_a_deadline_as_settled() -> None:
    data = recorded(settled=1.0)
    deadline(data, 3)
    assert analyze(data).notes[0].startswith("1 of 12 levels had not settled")


def test_a_step_that_was_measured_anew_after_its_deadline() -> None:
    data = recorded(settled=1.0)
    at = deadline(data, 3)
    data.columns["discarded"][at : at + 2] = True
    assert analyze(data).notes == ()


@pytest.mark.parametrize(("slope", "told"), [(0.1, False), (0.3, True)])
def test_a_force_at_zero_load_that_moved(slope: float, *, told: bool) -> None:
    rows = run(spring, LEVELS, zero_N=lambda t: slope * t)
    notes = analyze(recorded([*rows, *run(spring, LEVELS, repetition=2)])).notes
    assert bool(notes) == told
    if told:
        assert notes == (
            "The force at zero load moved by 6.00 N within a run (P1 x, repetition 1), 7 % of the "
            "range of force there. A straight line over time is taken off; what did not drift "
            "evenly stays in the levels. Reset the amplifier before each run, and look for what "
            "makes it drift.",
        )


def test_the_way_down_to_zero_is_no_drift() -> None:
    rows = run(spring, LEVELS, zeros=(4, 8))
    zero = len(rows) - 8
    rows[zero : zero + 2] = [(*row[:-2], 40.0, 0.4) for row in rows[zero : zero + 2]]
    assert analyze(recorded(rows)).notes == ()


def test_a_recording_without_load_has_no_range_to_compare_with() -> None:
    assert analyze(recorded(run(spring, (), zero_N=lambda t: t))).notes == ()


def pressed(tared_at_N: float, law: Callable[[float], float] = spring) -> list[Row]:
    """A run that was zeroed while the screw pressed so hard, and unloaded at its end."""
    above = [f for f in LEVELS if f > tared_at_N]
    rows = run(law, above)
    end = len(rows) - 4
    at_mm = law(tared_at_N)
    loads = [(*row[:-2], row[-2] - tared_at_N, row[-1] - at_mm) for row in rows[4:end]]
    return [*rows[:4], *loads, *((*row[:-2], -tared_at_N, -at_mm) for row in rows[end:])]


def softening(force: float) -> float:
    return force / 100.0 + (force / 100.0) ** 3


@pytest.mark.parametrize("law", [spring, softening])
def test_a_repetition_that_was_tared_under_load(law: Callable[[float], float]) -> None:
    rows = pressed(30.0, law)
    notes = analyze(recorded([*rows, *run(law, LEVELS, repetition=2)])).notes
    assert notes == (
        "Repetition 1 (P1 x) seems to have been tared while the screw still pressed: unloaded, "
        f"force and displacement stood 30.0 N and {law(30.0):.3f} mm below their zeros, in the "
        "ratio of the loading curve. A straight line over time is taken off the force, but this "
        "was no drift: its levels and k are wrong. Measure it again, with the screw clear of the "
        "arm when it is tared.",
    )


def test_an_amplifier_that_drifts_and_an_arm_that_gives_way_were_not_tared_under_load() -> None:
    rows = run(spring, LEVELS)
    end = len(rows) - 4
    for at_mm in (0.0, 0.05, 0.4, -0.1):
        moved = [(*row[:-2], -30.0, at_mm) for row in rows[end:]]
        (note,) = analyze(recorded([*rows[:end], *moved])).notes
        assert note.startswith("The force at zero load moved by 30.0 N")
