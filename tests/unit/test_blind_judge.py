"""What counts as right, and what follows from it."""

from __future__ import annotations

from typing import Any

import pytest

from rig.blind import targets, text
from rig.blind.campaign import Campaign, Outcome, Plan
from rig.blind.diagnosers import Reply
from rig.blind.judge import direction_right, encoders_right, intervals, joint_right, judge, matched
from rig.blind.score import report


def label(*truth: str, **more: Any) -> dict[str, Any]:
    n = len(truth)
    return {
        "truth": list(truth),
        "accept": list(truth),
        "accept_each": [[w] for w in truth],
        "forms": ["sharp"] * n,
        "laws": ["fitted"] * n,
        "parameters": [{} for _ in truth],
        "snr": 0.0 if truth == ("none",) else 10.0,
        "snr_each": [10.0 - i for i in range(n)],
        "noise_rms_mm": 0.002,
        "design": "rich",
        "where": {
            "directions": ["x", "y"],
            "main_direction": "y",
            "joints": [1],
            "seen_by_encoders": True,
        },
        **more,
    }


def said(verdict: str, *found: str, p: float = 0.8, **more: Any) -> dict[str, Any]:
    words = found or ((verdict,) if verdict not in ("none", "unknown") else ())
    effects = [
        {
            "name": w,
            "probability": 0.9,
            "parameters": {},
            "indistinguishable_from": [],
            "share_of_gap": 1.0,
        }
        for w in words
    ]
    other = "unknown" if verdict != "unknown" else "none"
    return {
        "verdict": verdict,
        "probabilities": {verdict: p, other: 1 - p},
        "effects": effects,
        "where": {"directions": ["y"], "joints": [1], "seen_by_encoders": True},
        "gap": {"after_rms_mm": 0.002, "held_out": {"after_rms_mm": 0.003, "shrink_factor": 5.0}},
        "runners_up": {"base_slip": {"held_out_after_rms_mm": 0.004}},
        **more,
    }


def outcome(
    answers: dict[str, Any], diagnosis: dict[str, Any] | None, withheld: str | None = None
) -> Outcome:
    reply = Reply("answered", 1.5, diagnosis) if diagnosis else Reply("crashed", 1.0, reason="oh")
    return Outcome(0, "case", answers, withheld, reply)


def test_an_accepted_word_is_right_and_only_the_true_one_exact() -> None:
    answers = label("joint_yield", accept=["joint_yield", "base_slip"])
    true, other = (judge(outcome(answers, said(w))) for w in ("joint_yield", "base_slip"))
    assert (true.right, true.exact) == (True, True)
    assert (other.right, other.exact) == (True, False)
    assert not judge(outcome(answers, said("unknown"))).right


def test_the_set_counts_only_the_verdicts_own_words() -> None:
    answers, found = label("joint_yield"), said("base_slip")
    assert not judge(outcome(answers, found)).in_set
    found["effects"][0]["indistinguishable_from"] = ["joint_yield"]
    assert judge(outcome(answers, found)).in_set
    assert not judge(outcome(answers, found)).right
    beside = said("base_slip", "base_slip", "zero_shift")
    beside["effects"][1]["indistinguishable_from"] = ["joint_yield"]
    assert not judge(outcome(answers, beside)).in_set


def test_recall_of_unknown_counts_only_cases_without_a_stand_in() -> None:
    alone = label("joint_yield")
    replaced = label("joint_yield", accept=["joint_yield", "base_slip"])
    outcomes = [outcome(answers, said("base_slip"), "joint_yield") for answers in (alone, replaced)]
    out = report(Campaign(Plan(cases=2, seed=1, withhold="joint_yield"), outcomes))
    recall, marks = out["summary"]["unknown_recall"], out["tables"]["by_withheld"]["joint_yield"]
    assert (recall["hits"], recall["n"]) == (0, 1)
    assert (marks["right"]["hits"], marks["right"]["n"]) == (1, 2)


def test_a_withheld_word_is_unknown_or_what_stands_in() -> None:
    answers = label("joint_yield", accept=["joint_yield", "base_slip"])
    unknown = judge(outcome(answers, said("unknown"), "joint_yield"))
    assert (unknown.kind, unknown.main, unknown.right, unknown.exact) == (
        "unknown",
        "unknown",
        True,
        True,
    )
    assert judge(outcome(answers, said("base_slip"), "joint_yield")).right
    assert not judge(outcome(answers, said("joint_creep"), "joint_yield")).right
    # withheld from a case that does not hold it: nothing changes but what may stand in
    kept = judge(outcome(answers, said("unknown"), "base_slip"))
    assert (kept.kind, kept.right) == ("single", False)


def test_a_case_without_answer_is_wrong_in_every_respect() -> None:
    lost = judge(outcome(label("none"), None))
    assert not lost.right
    assert not lost.exact
    assert not lost.in_set


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (("joint_creep", "zero_shift"), (2, 0, 0)),
        (("zero_shift",), (1, 0, 1)),
        (("thermal_drift", "joint_creep"), (2, 0, 0)),
        (("thermal_drift", "zero_shift"), (1, 1, 1)),  # one effect is hit once
        (("joint_yield", "zero_shift", "joint_creep"), (2, 1, 0)),
        ((), (0, 0, 2)),
    ],
)
def test_mixtures_match_one_word_to_one_effect(
    found: tuple[str, ...], expected: tuple[int, int, int]
) -> None:
    answers = label(
        "joint_creep", "zero_shift", accept_each=[["joint_creep"], ["zero_shift", "thermal_drift"]]
    )
    said_so = said(found[0] if found else "none", *found)
    assert matched(judge(outcome(answers, said_so))) == expected


def test_the_main_cause_of_a_mixture_is_the_larger_effect() -> None:
    answers = label("joint_creep", "zero_shift", snr_each=[3.0, 8.0])
    judged = judge(outcome(answers, said("joint_creep")))
    assert judged.main == "zero_shift"
    assert (judged.right, judged.exact) == (True, False)
    assert judge(outcome(answers, said("joint_creep"), "zero_shift")).kind == "partial"


def test_where() -> None:
    judged = judge(outcome(label("joint_yield"), said("joint_yield")))
    assert (joint_right(judged), direction_right(judged), encoders_right(judged)) == (
        True,
        True,
        True,
    )
    where = {"directions": ["x"], "joints": [1, 2], "seen_by_encoders": None}
    wrong = judge(outcome(label("joint_yield"), said("joint_yield", where=where)))
    assert (joint_right(wrong), direction_right(wrong), encoders_right(wrong)) == (
        False,
        False,
        False,
    )
    assert joint_right(judge(outcome(label("zero_shift"), said("zero_shift")))) is None


def test_intervals_of_shared_parameters() -> None:
    answers = label("force_scale", parameters=[{"factor": 1.10}])
    found = said("force_scale")
    factor = {"value": 1.0, "ci95": [0.9, 1.11], "ci90": [0.92, 1.092], "unit": "1"}
    found["effects"][0]["parameters"]["factor"] = factor
    (one,) = intervals(judge(outcome(answers, found)))
    assert one["in_95"]
    assert not one["in_90"]


@pytest.mark.parametrize("hung", [True, False])
def test_a_threshold_of_the_load_is_asked_for_as_such(hung: bool) -> None:
    """Where no weight hangs on the joint, it is all there is of the threshold."""
    answers = label("joint_yield", parameters=[{"threshold_of_load_Nm": 50.0}])
    found = said("joint_yield")
    read = found["effects"][0]["parameters"]
    load = {"value": 51.0, "ci95": [49.0, 53.0], "ci90": [49.3, 52.7], "unit": "Nm"}
    net = {"value": 80.0, "ci95": [75.0, 85.0], "ci90": [76.0, 84.0], "unit": "Nm"}
    read["threshold"] = net if hung else load
    if hung:
        read["threshold_of_load"] = load
    (one,) = intervals(judge(outcome(answers, found)))
    assert (one["value"], one["in_90"]) == (51.0, True)


def campaign() -> Campaign:
    """Nine cases whose figures are counted by hand below."""
    cases = [
        (label("none"), said("none")),
        (label("none"), said("joint_yield")),
        (label("unknown"), said("unknown", p=0.6)),
        (label("joint_yield"), said("joint_yield")),
        (label("joint_yield", laws=["foreign"]), said("joint_hysteresis", p=0.95)),
        (label("joint_yield", snr=2.0), said("none")),
        (label("base_slip"), said("unknown", p=0.7)),
        (label("base_slip"), None),
        (label("joint_creep", "zero_shift"), said("joint_creep", "joint_creep", "zero_shift")),
    ]
    outcomes = [Outcome(i, f"c{i}", a, None, outcome(a, d).reply) for i, (a, d) in enumerate(cases)]
    return Campaign(Plan(cases=9, seed=3), outcomes)


def test_summary_by_hand() -> None:
    s = report(campaign())["summary"]
    counted = {
        k: (s[k]["hits"], s[k]["n"])
        for k in (
            "right",
            "exact",
            "right_all_kinds",
            "confident_errors",
            "false_alarms",
            "unknown_recall",
            "known_called_unknown",
            "crashed_or_late",
        )
    }
    assert counted == {
        "right": (1, 4),  # the one with 2 times the noise is not counted
        "exact": (1, 4),
        "right_all_kinds": (4, 8),
        "confident_errors": (1, 8),
        "false_alarms": (1, 2),
        "unknown_recall": (1, 1),
        "known_called_unknown": (1, 5),
        "crashed_or_late": (1, 9),
    }
    assert s["unknown_auroc"] == pytest.approx(4 / 5)  # 0.6 against 0.2, 0.05, 0.7, 0, 0.2
    assert s["mixtures"]["f1"] == 1.0
    assert s["gap"]["withheld_over_noise"]["median"] == pytest.approx(1.5)
    assert s["gap"]["beats_wrong_runners_up"]["hits"] == 2
    assert s["calibration"]["n"] == 7


def test_tables_by_hand() -> None:
    t = report(campaign())["tables"]
    assert t["by_snr"]["1.5 to 3"]["wrong_verdicts"] == {"none": 1}
    assert t["by_laws"]["fitted"]["right"]["n"] == 3
    assert t["by_laws"]["foreign"]["wrong_verdicts"] == {"joint_hysteresis": 1}
    assert t["by_effect"]["base_slip"]["wrong_verdicts"] == {"unknown": 1, "crashed": 1}
    assert t["confusion"]["none"] == {"none": 1, "joint_yield": 1}


def test_text_says_that_it_is_simulated_and_how_to_repeat_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = text.terminal(report(campaign()))
    assert out.startswith("SIMULATED: every measurement below was drawn by a computer")
    assert "rig blind --cases 9 --seed 3" in out
    assert "4 of 8 verdicts are right" in out
    assert "c7: crashed, oh" in out
    (line,) = [x for x in out.splitlines() if x.strip().startswith("one effect: right  ")]
    assert " ".join(line.split()) == "one effect: right 0.25 0.05 to 0.70 1 of 4 >= 0.95"
    monkeypatch.setattr(targets, "_FEW", 4)  # of fewer cases nobody can say
    out = text.terminal(report(campaign()))
    (line,) = [x for x in out.splitlines() if x.strip().startswith("one effect: right  ")]
    assert line.endswith(" no")


def test_markdown_tables_are_rectangular() -> None:
    rows = [x for x in text.markdown(report(campaign())).splitlines() if x.startswith("|")]
    assert len(rows) > 30
    by_table: list[int] = [r.count("|") for r in rows]
    assert set(by_table) == {3, 6, 7, 8}
