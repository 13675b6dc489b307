"""A response of another order of size than simulated is said to be one, before any verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.answer.notes import FAULT, UNDECIDED, notes_of
from identification.gap.answer.scale import off_scale
from identification.gap.data import Curve, GapData
from identification.gap.model.bench import make_bench
from rig.diagnosis.diagnose import Diagnosis
from rig.diagnosis.diagnose_text import render
from tests.conformance.gap_designs import linear
from tests.explained import explained


def said(data: GapData) -> list[str]:
    bench = make_bench(data)
    simulated = bench.simulated
    predicted = bench.stated_slope * bench.load if simulated is None else simulated
    return [note.text for note in off_scale(bench, predicted)]


@pytest.mark.parametrize("name", ["paper", "bench"])
@pytest.mark.parametrize(
    ("displacement", "force", "moves"),
    [
        (1000.0, 1.0, "times as far as simulated"),  # micrometres for millimetres
        (1.0, 1e-3, "times as far as simulated"),  # kilonewtons for newtons
        (1e-3, 1.0, "of the way that was simulated"),
        (1.0, 1e3, "of the way that was simulated"),
        (20.0, 1.0, ""),  # of a spring that somebody guessed
        (0.05, 1.0, ""),
    ],
)
def test_a_wrong_unit_is_asked_for(
    name: str, displacement: float, force: float, moves: str
) -> None:
    data = linear(name)
    scaled = replace(data, displacement=displacement * data.displacement, force=force * data.force)
    texts = said(scaled)
    assert len(texts) == (1 if moves else 0)
    assert all(moves in text for text in texts)


@pytest.mark.parametrize(
    ("displacement", "force", "units"),
    [(1.0, 1 / 4.448, "forces in lbf"), (1 / 25.4, 1.0, "displacements in inches")],
)
def test_a_unit_of_an_arm_is_asked_for_by_its_name(
    displacement: float, force: float, units: str
) -> None:
    """Springs of an arm are known to a tenth; those of a bench are often guessed."""
    data = linear("paper")
    arm = replace(data, displacement=displacement * data.displacement, force=force * data.force)
    (text,) = said(arm)
    assert f"in every pose and direction. Are these {units}?" in text
    assert said(replace(arm, arm=False)) == []
    one = np.where(arm.setup == 0, arm.displacement, arm.displacement / 1.3)
    assert said(replace(arm, displacement=one)) == []  # no factor common to all
    unsure = np.full(arm.joints, 2.0)
    assert said(replace(arm, compliance_relative_sd=unsure)) == []


def test_simulated_curves_that_go_the_other_way_are_told() -> None:
    data = linear("bench")
    slope = float(data.setups[0].lever ** 2 @ data.compliance)
    ends = np.array([-100.0, 100.0])
    assert said(replace(data, curves=(Curve(ends, slope * ends),))) == []
    (text,) = said(replace(data, curves=(Curve(ends, -slope * ends),)))
    assert "go the other way" in text


def test_it_is_the_first_thing_said_and_nothing_is_likened() -> None:
    data = linear("bench")
    result = explained(replace(data, displacement=1000 * data.displacement))
    assert "see first whether forces are in N" in result.notes[0]
    assert result.looks_like is None


@pytest.mark.parametrize(("verdict", "kind"), [("none", FAULT), ("thermal_drift", UNDECIDED)])
@pytest.mark.parametrize("still", ["load", "signals"])
def test_where_nothing_moves_no_gap_is_no_finding(still: str, verdict: str, kind: str) -> None:
    data = linear("bench")
    if still == "load":
        data = replace(data, force=np.zeros(len(data.force)))
    else:
        data = replace(data, force=1e-9 * data.force, displacement=1e-9 * data.displacement)
    said = {n.text: n.kind for n in notes_of(make_bench(data), verdict)}
    (text,) = (t for t in said if "The load does not change" in t or "Nothing moves by more" in t)
    assert said[text] == kind


def test_where_nothing_moves_nothing_is_learned() -> None:
    data = linear("bench")
    still = replace(data, force=1e-9 * data.force, displacement=1e-9 * data.displacement)
    assert not explained(data).learned_nothing
    result = explained(still, withhold=["joint_yield"])
    p = result.probabilities
    assert p["none"] / p["unknown"] == pytest.approx(10.0)  # the priors
    assert p["none"] / p["time_lag"] == pytest.approx(0.5 / 0.37 * 18)
    assert p["joint_yield"] == p["base_compliance"] == 0.0  # taken away; needs an arm
    assert sum(p.values()) == pytest.approx(1.0)
    first, *_ = render(result).splitlines()
    assert first.startswith("none (")
    assert "nothing can be said of a gap, since nothing moved" in first
    assert "no gap to close" not in first
    told = Diagnosis("d", replace(result, before=0.0)).to_json()
    assert told["nothing_learned"] is True
    assert told["gap"]["shrink_factor"] == 1.0
