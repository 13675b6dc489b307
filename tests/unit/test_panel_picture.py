"""From the live view to what the page shows."""

from __future__ import annotations

import json
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import get_args

import pytest

from drivers.interfaces import LimitLevel, LiveView, Phase, Prompt
from drivers.operator.screen import HANDS_OFF
from rig.panel.picture import PHASES, Moment, Setting, state_of
from rig.panel.plan import plan_of, prediction_of
from rig.panel.state import Slots, State, to_json
from rig.protocol import load_protocol

HOME = Path(__file__).resolve().parents[2]
PROTOCOL = load_protocol(HOME / "protocols" / "paper_xy.yaml")
SETTING = Setting(PROTOCOL, emulated=True, speed=50.0, pitch_mm=0.5)
VIEW = LiveView(
    phase="approach",
    pose="P1",
    direction="y",
    repetition=2,
    repetitions=3,
    step=4,
    steps=12,
    force_N=40.0,
    target_N=60.0,
    band_N=0.6,
    displacement_mm=0.7,
    stiffness_N_per_mm=57.0,
    settle_remaining_s=2.5,
    samples=2,
    samples_wanted=5,
    branch="loading",
    force_age_s=0.1,
    displacement_age_s=0.2,
    limits=(LimitLevel("force", 60.0, 240.0, "N", "stop"),),
)


def moment(view: LiveView | None = VIEW, **changes: object) -> Moment:
    usual = Moment(view, 0.05, 4.0, None, "", (), Slots(3, 1.5))
    return replace(usual, **changes)  # type: ignore[arg-type]


def shown(**changes: object) -> State:
    return state_of(SETTING, moment(replace(VIEW, **changes)))  # type: ignore[arg-type]


def test_a_step_under_way() -> None:
    state = state_of(SETTING, moment())
    assert state.phase == "turning"
    assert state.run.unit_vector == (0.0, 1.0, 0.0)
    assert (state.run.step, state.run.steps, state.run.branch) == (4, 12, "loading")
    assert state.force.age_s == pytest.approx(0.15)
    assert state.displacement.age_s == pytest.approx(0.25)
    assert not state.force.stale
    assert state.turn is not None
    assert state.turn.sense == "in"
    assert state.turn.turns == pytest.approx(20 / 57 / 0.5)
    assert state.turn.degrees == pytest.approx(360 * 20 / 57 / 0.5)
    assert state.limits[0].left_fraction == pytest.approx(0.75)
    assert state.slots == Slots(3, 1.5)
    assert state.banner.startswith("EMULATED")
    assert state_of(replace(SETTING, emulated=False), moment()).banner == ""


@pytest.mark.parametrize(
    ("force_N", "sense"), [(59.0, "in"), (60.5, "hold"), (62.0, "out"), (59.5, "hold")]
)
def test_which_way_to_turn(force_N: float, sense: str) -> None:
    turn = shown(force_N=force_N).turn
    assert turn is not None
    assert turn.sense == sense


def test_hands_are_off_while_settling_and_while_values_are_old() -> None:
    assert shown(phase="settling").turn is None
    assert shown(stale=("laser",)).turn is None
    old = state_of(SETTING, moment(view_age_s=1.0))
    assert old.force.stale
    assert old.turn is None
    assert shown(stale=("dynamometer",)).force.stale
    assert not shown(stale=("dynamometer",)).displacement.stale
    assert shown(stale=("laser",)).displacement.stale


def test_every_phase_of_the_procedure_has_a_name_on_the_page() -> None:
    source = "".join(p.read_text("utf-8") for p in (HOME / "rig").rglob("*.py"))
    used = {part.split('"')[0] for part in source.split('show(phase="')[1:]} | {"idle"}
    assert used == set(get_args(Phase)) == set(PHASES)
    assert {*HANDS_OFF, "approach", "unloading"} == used, "what else stands on the console's screen"
    for phase in PHASES:
        assert shown(phase=phase).phase == PHASES[phase]


def test_a_question_takes_the_stage() -> None:
    prompt = Prompt("settle_deadline", "not settled", ("record", "redo_step", "abort"))
    state = state_of(SETTING, moment(prompt=prompt, prompt_id="q7"))
    assert state.phase == "prompt"
    assert state.turn is None
    assert state.prompt is not None
    assert state.prompt.id == "q7"
    assert [c.key for c in state.prompt.choices] == ["record", "redo_step", "abort"]
    assert state.prompt.choices[1].label == "Redo step"
    paused = moment(replace(VIEW, phase="paused"), prompt=prompt)
    assert state_of(SETTING, paused).phase == "paused"
    unload = state_of(SETTING, moment(prompt=Prompt("unload", "back")))
    assert unload.turn is not None
    assert unload.turn.sense == "out"


def test_countdowns() -> None:
    assert shown(phase="sampling").countdown_s == 3.0
    settling = shown(phase="settling")
    assert settling.countdown_s == 2.5
    assert settling.settle is not None
    assert (settling.settle.left_s, settling.settle.of_s) == (2.5, PROTOCOL.settle.window_s)
    full = shown(phase="settling", settle_remaining_s=0.0).settle
    assert full is not None
    assert full.reason == "force or displacement still moves"
    assert shown(phase="rest").countdown_s == PROTOCOL.rest_s - 4.0
    assert shown().settle is None


def test_before_the_first_value_nothing_looks_live() -> None:
    state = json.loads(to_json(state_of(SETTING, moment(None))))
    assert state["phase"] == "starting"
    assert state["force"] == {
        "N": None,
        "age_s": None,
        "target_N": None,
        "band_N": 0.0,
        "stale": True,
    }
    assert state["displacement"] == {"mm": None, "age_s": None, "stale": True}
    assert shown(force_N=nan).force.stale


def test_the_end_stands_over_everything() -> None:
    prompt = Prompt("unload", "back")
    state = state_of(SETTING, moment(prompt=prompt, ending="aborted", message="stopped"))
    assert (state.phase, state.prompt, state.turn, state.message) == (
        "aborted",
        None,
        None,
        "stopped",
    )


def test_the_prediction_is_that_of_rig_simulate(tmp_path: Path) -> None:
    from rig.models.simulate import simulate

    curves = prediction_of(PROTOCOL)
    model = tmp_path / "arm.yaml"
    model.write_text("robot: ur10e\npose: {q_rad: [0, -1, 1, 0, 1, 0]}\n", encoding="utf-8")
    simulated = simulate(model, PROTOCOL.path)
    for curve in simulated.curves:
        told = curves[f"{curve.pose}|{curve.direction}"]
        assert [force for force, _ in told] == pytest.approx(list(curve.force))
        assert [u for _, u in told] == pytest.approx(list(1e3 * curve.displacement), rel=1e-9)


def test_the_plan_holds_the_arm_from_base_to_load() -> None:
    plan = plan_of(PROTOCOL, 0.5)
    assert [run.direction for run in plan.runs] == ["x", "y"]
    outline = plan.arms["P1"]
    assert outline[0] == (0.0, 0.0, 0.0)
    assert outline[-1][:2] == pytest.approx((750, 0), abs=0.1)


def test_json_holds_no_nan() -> None:
    assert to_json({"a": nan, "b": [float("inf"), 1.23456789]}) == b'{"a":null,"b":[null,1.234568]}'
