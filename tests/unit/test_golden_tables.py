"""Every table that the terminal prints, word for word, from results with fixed numbers.

After a deliberate change: write the text to the golden file, and read it. Tables of `rig analyze`,
`rig list` and of a plan have theirs beside their other tests.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.gap.answer.notes import KINDS, Note, ordered
from identification.gap.explanations.explanation import GapPattern
from identification.gap.judging.heldout import HeldOut
from identification.gap.laws.interval import Parameter
from identification.gap.model.bench import Bench
from rig import cli
from rig.blind import text
from rig.blind.score import report
from rig.diagnosis import diagnose, diagnose_text
from tests.unit import shown_results as shown
from tests.unit.test_blind_judge import campaign

GOLDEN = Path(__file__).parents[1] / "golden"
TABLES: dict[str, Callable[[], Sequence[str]]] = {
    "identify": lambda: [shown.identified().to_text()],
    "diagnose": lambda: [
        d.to_text() for d in (shown.explained(), shown.without_gap(), shown.unexplained())
    ],
    "couple": lambda: [shown.coupled().to_text(), shown.placed().to_text()],
    "simulate": lambda: [shown.predicted().to_text()],
    "check": lambda: [shown.checked().to_text()],
    "blind": lambda: [text.terminal(report(campaign()))],
}


@pytest.mark.parametrize("command", TABLES)
def test_the_text_word_for_word(command: str) -> None:
    found = "\n\n\n".join(TABLES[command]()) + "\n"
    assert found == (GOLDEN / f"{command}_text.txt").read_text("utf-8")


def test_where_the_numbers_come_from_is_said_first() -> None:
    notes = ("Another note.", shown.EMULATED)
    for result in (shown.coupled(), shown.predicted()):
        text = replace(result, notes=notes).to_text()
        assert text.startswith(f"{shown.EMULATED}\n\n")
        assert text.count("EMULATED") == 1
        assert text.endswith("\nNote: Another note.")


IMPORTED = """session_s,time_s,repetition,branch,step,force_N,displacement_mm,temprature1_C
0,0,1,zero,0,0.0,0.0,7
1,1,1,loading,1,20.0,0.25,7
2,2,1,loading,2,40.0,0.5,7
0.5,0.5,2,zero,0,0.0,0.0,7
1.5,1.5,2,loading,1,20.0,0.251,7
2.5,2.5,2,loading,2,40.0,0.502,7
"""
META = """robot: none
directions: {x: [1, 0, 0]}
instruments: {force: {standard_uncertainty_N: 0.1}, displacement: {standard_uncertainty_mm: 0.002}}
"""


def test_what_import_says_word_for_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.csv").write_text(IMPORTED, "utf-8")
    (tmp_path / "meta.yaml").write_text(META, "utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["rig", "import", "run.csv", "meta.yaml", "-o", "run.h5"])
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)  # `main` sets its own
    with pytest.raises(SystemExit) as ending:
        cli.main()
    assert not ending.value.code
    out, said = capsys.readouterr()
    assert (out, said) == ("", (GOLDEN / "import_text.txt").read_text("utf-8"))


def test_what_was_added_is_compared_with_the_explanation_without_it() -> None:
    found = replace(shown.explained().result, without_added=4.6e-6)
    lines = diagnose_text._gap(found).splitlines()
    assert lines[3].split()[:4] == ["without", "what", "was", "added"]
    assert "no explanation" not in lines[4]
    worse = diagnose_text._gap(replace(found, after=5e-6)).splitlines()
    assert worse[4] == "  What was added is no explanation: more is left with it than without."


def test_an_interval_that_nothing_tells_is_not_shown() -> None:
    once = HeldOut("block", 1.72e-5, 1e-6, (17.2, 17.2))
    found = replace(shown.without_gap().result, held_out=(once,), after=0.0)
    lines = diagnose_text._gap(found).splitlines()
    assert lines[2].split()[-1] == "-"  # nothing is left
    assert lines[3].endswith("17.2")


def test_what_nothing_was_withheld_of_is_no_row() -> None:
    still = HeldOut("block", 0.0, 0.0, (1.0, 1.0))
    found = replace(shown.without_gap().result, held_out=(still,))
    assert "withheld" not in diagnose_text._gap(found)


def test_a_place_without_any_force_is_none() -> None:
    found = shown.explained().result
    still = dict.fromkeys(found.where.force, (0.0, 0.0))
    assert diagnose_text._where(replace(found, where=replace(found.where, force=still))) == ""


@pytest.mark.parametrize(
    ("low", "high", "value", "probability", "said"),
    [
        (-0.5, 2.0, 1.0, 0.99, ["surer that it is there"]),
        (-0.5, 2.0, 1.0, 0.9, []),
        (0.5, 2.0, 1.0, 0.99, []),
        (0.0, 2.0, 0.0, 0.99, ["at the limit of what is possible", "surer that it is there"]),
        (0.5, 2.0, 2.0, 0.99, ["at the limit of what is possible"]),
        (1.0, 1.0, 1.0, 0.99, []),  # known to the last digit
    ],
)
def test_what_an_interval_leaves_open_is_said(
    low: float, high: float, value: float, probability: float, said: list[str]
) -> None:
    effect = shown.explained().result.effects[1]
    found = replace(
        effect, probability=probability, parameters={"rate": Parameter(value, low, high, "N/s")}
    )
    text = "\n".join(diagnose_text._one_effect(found, found.name))
    sayings = ("at the limit of what is possible", "surer that it is there")
    assert [s for s in sayings if s in text] == said


def test_a_gap_of_force_is_told_in_newtons() -> None:
    rig = SimpleNamespace(arm=False, joints=1, compliance=np.array([1 / 3e7]))
    bench = cast(Bench, SimpleNamespace(imposed=True, data=rig))
    told = "the gap is one of force, over the simulated stiffness: 1 mm is 30000 N"
    assert diagnose_text.in_newtons(bench) == told
    rig.joints, rig.compliance, rig.spring_name = 2, np.array([1e-6, 1e-7]), "xy".__getitem__
    assert diagnose_text.in_newtons(bench).endswith("1 mm is 1000 N along x, 10000 N along y")
    assert shown.explained().result.bench.imposed is False
    assert diagnose_text.in_newtons(shown.explained().result.bench) == ""


def test_notes_stand_under_what_they_are_what_is_wrong_right_after_the_answer() -> None:
    assert tuple(diagnose_text.NOTED) == KINDS
    notes = ordered([Note(kind, f"Of {kind}.") for kind in reversed(KINDS)])
    text = diagnose_text.render(replace(shown.without_gap().result, said=notes))
    assert text.split("\n\n")[1] == "See to this first:\n  Of fault."
    assert text.endswith(
        "Set aside:\n  Of set aside.\n\n"
        "Not decidable from these data:\n  Of undecided.\n\n"
        "To be known:\n  Of remark."
    )


@pytest.mark.parametrize(
    ("p", "said"),
    [
        (1.0, "> 99 %"),
        (0.9951, "> 99 %"),
        (0.994, "99 %"),
        (0.5, "50 %"),
        (0.004, "< 1 %"),
    ],
)
def test_a_probability_is_never_said_to_be_one_or_none(p: float, said: str) -> None:
    assert diagnose_text.likely(p) == said


@pytest.mark.parametrize("kind", ["waves", "jumps"])
def test_a_rig_without_an_arm_is_told_of_no_laser(kind: str) -> None:
    found = shown.unexplained()
    found = replace(found, result=replace(found.result, looks_like=GapPattern(kind, 1e-3, -80.0)))
    assert "laser" in diagnose_text.render(found.result)
    assert "laser" not in diagnose_text.render(shown.without_arm(found).result)
    assert "sensor" in diagnose_text.render(shown.without_arm(found).result)


def test_what_each_of_many_runs_has_to_itself_is_one_line_with_its_range() -> None:
    found = {f"drift_x_run{i}": Parameter(i - 3.0, i - 3.1, i - 2.8, "N") for i in (1, 2, 3)}
    assert diagnose_text._parameters(found) == [
        "    drift_x = -2 to 0 N in 3 runs (95 %: each +- 0.2 N at most; one by one in the JSON)"
    ]
    two = {name: found[name] for name in list(found)[:2]}
    assert diagnose_text._parameters(two | {"lag": Parameter(1.0, 0.9, 1.1, "s")}) == [
        "    drift_x_run1 = -2 N (95 %: -2.1 to -1.8 N)",
        "    drift_x_run2 = -1 N (95 %: -1.1 to -0.8 N)",
        "    lag = 1 s (95 %: 0.9 to 1.1 s)",
    ]
    cut = Parameter(1.0, 0.5, 2.0, "N", most=1.5).possible(0.0)
    assert diagnose_text._value(cut).endswith(" N; the largest seen is 1.5 N)")
    assert diagnose._parameter(cut)["largest_seen"] == 1.5
    assert "largest_seen" not in diagnose._parameter(two["drift_x_run1"])


@pytest.mark.parametrize(
    ("places", "title"),
    [({"joint 4": 1.0}, "joint_yield, joint 4"), ({}, "joint_yield")],
)
def test_an_effect_is_told_with_its_joint_where_that_is_known(
    places: dict[str, float], title: str
) -> None:
    result = shown.explained().result
    first = replace(result.effects[0], places=places)
    text = diagnose_text.render(replace(result, effects=(first, *result.effects[1:])))
    assert f"  {title}: present with a probability of 99 %" in text


@pytest.mark.parametrize(("after", "met"), [(1e-6, True), (9e-6, False)])
def test_a_gap_that_nothing_may_explain_though_it_is_met_is_said_to_be_met(
    after: float, met: bool
) -> None:
    likely = {"unknown": 0.6, "none": 0.4}
    result = replace(shown.explained().result, verdict="unknown", effects=(), noise=1e-6)
    result = replace(result, probabilities=likely, after=after)
    text = diagnose_text.render(result)
    assert ("is met without any effect" in text) is met
    assert ("there is a gap" in text) is not met


def test_joints_of_a_smaller_effect_are_said_to_be_its() -> None:
    result = shown.explained().result
    assert "joints      1\n" in diagnose_text._where(result)
    drifts = replace(result, verdict="thermal_drift")
    assert "joints      1 (joint_yield)\n" in diagnose_text._where(drifts)
