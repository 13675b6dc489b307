"""Plays: where the net torque passes them, and how closely they are looked at."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.effects import joint_backlash, library
from identification.gap.effects.joint_backlash import TOOLS_KG
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.laws import lost_motion
from identification.gap.laws.lost_motion import Play
from identification.gap.laws.lost_motion_law import describe, net_of
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from identification.gap.search.refine import refine
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running
from tests.unit.test_gap_weights import UP, hanging


def closed_in(bench: Bench, x: Array, zone: float) -> Variant:
    """What the search finds of a play of 0.4 mrad, of that zone (Nm), passed where x (n,) is 0."""
    play = bench.joint_column(0, 4e-4 * Play(bench, x, zone).place("free"))
    variants = library(bench, ["joint_backlash"])
    base, target = base_columns(bench), bench.observed - prediction(bench)
    engine = Engine(bench, base, target + play, np.array([0.0, 1e-7, 2.5e-7]))
    finer = refine(engine, score(engine, engine.levels, variants))
    return max(score(engine, engine.levels, finer), key=lambda s: s.log_evidence).variant


def work_in_loops(bench: Bench, moved: Array) -> float:
    """J that the load does on what moves the laser (n,) m, in all runs."""
    same = np.diff(bench.rows.run) == 0
    mean = (bench.load[1:] + bench.load[:-1]) / 2
    return float(np.sum((mean * np.diff(moved))[same]))


@pytest.mark.parametrize("rub", [0.25, -0.05, -0.25])
def test_a_play_and_the_friction_beside_it_give_out_no_work(rub: float) -> None:
    """Though of some too much friction is assumed: every load is taken off again."""
    bench = make_bench(arm_data())
    kept, given_out = [], []
    for v in library(bench, ["joint_backlash"]):
        w = np.zeros(len(v.columns))
        w[:2] = 1e-4, rub * 1e-4
        columns = np.column_stack([bench.columns[c][: bench.rows.n] for c in v.columns])
        work = work_in_loops(bench, columns @ w)
        kept.append(bool(np.all(v.within @ w >= 0)))
        given_out.append(work < 0)
    assert not any(k and out for k, out in zip(kept, given_out, strict=True))
    assert any(kept)
    assert all(kept) or any(given_out)


def test_plays_cross_where_some_tool_balances_the_weights() -> None:
    bench = hanging(UP)
    found = [v for v in library(bench, ["joint_backlash"]) if v.info["crossing"] == "weight"]
    assert {v.info["tool_kg"] for v in found if not v.info["preload_Nm"]} == set(TOOLS_KG)
    too_heavy = library(hanging(UP, gravity=-300.0), ["joint_backlash"])
    assert all(v.info["preload_Nm"] for v in too_heavy if v.info["crossing"] == "weight")


def test_a_preload_puts_the_crossing_where_no_tool_does() -> None:
    bench = hanging(UP)
    x, per_kg = bench.true_torque[:, 0] + bench.weight(0), bench.weight_per_kg(0)
    preloads = {v.info["preload_Nm"] for v in library(bench, ["joint_backlash"])} - {0.0}
    assert preloads
    assert all(x.min() < -p < x.max() for p in preloads)  # a load overcomes it
    assert min(map(abs, preloads)) >= 1.5 * np.abs(per_kg).min()  # a tool is off by so much


def test_a_preload_is_found_to_a_percent() -> None:
    bench = hanging(
        np.concatenate([np.arange(0, 80.5, 0.5), np.arange(80, -0.5, -0.5)]), gravity=-5.0
    )
    x = bench.true_torque[:, 0] + bench.weight(0) - 26.3
    found = closed_in(bench, x, 1.0)
    assert found.info["preload_Nm"] == pytest.approx(-26.3, rel=0.01)
    law, _ = describe(bench, found)
    np.testing.assert_allclose(net_of(bench, law), x, atol=0.3)
    assert found.info["zone_Nm"] == pytest.approx(1.0, rel=0.1)


def test_a_joint_lies_in_its_play_where_the_push_before_left_it() -> None:
    """Whichever way it is pushed next, until the arm goes to another pose."""
    there = make_bench(arm_data())
    x = there.true_torque[:, 0]  # of the pushes along y
    zone = 0.02 * float(np.abs(x).max())
    play = Play(there, x, zone)
    turned = np.flatnonzero(there.rebuilt & ~there.moved)
    for k in np.flatnonzero(there.rebuilt):
        assert play.place("friction")[k] == pytest.approx(0.0, abs=0.01)
        left = 0.0 if there.moved[k] else play.place("kept")[k - 1]
        assert play.place("kept")[k] == pytest.approx(left, abs=0.01)  # noise of the force
    assert len(turned) == 2
    assert np.abs(play.place("kept")[turned]).max() > 0.4


def test_the_tool_is_found_to_a_few_grams_where_a_narrow_play_crosses() -> None:
    """A zone of 1 Nm, and 5 Nm for every kilogram: the mass decides where it is passed."""
    bench = hanging(
        np.concatenate([np.arange(0, 40.5, 0.5), np.arange(40, -0.5, -0.5)]), gravity=-20.0
    )
    x = bench.true_torque[:, 0] + bench.weight(0, 0.845)
    found = closed_in(bench, x, 1.0)
    assert found.info["tool_kg"] == pytest.approx(0.845, abs=0.005)
    assert found.info["zone_Nm"] == pytest.approx(1.0, rel=0.05)


def test_a_play_is_refined_to_no_more_than_the_widest() -> None:
    bench = hanging(UP)
    plays = [v for v in library(bench, ["joint_backlash"]) if not v.info["preload_Nm"]]
    wide = [v for v in plays if v.info["crossing"] == "weight"][-1]
    widest = max(v.info["zone_Nm"] for v in joint_backlash.refined(bench, wide))
    assert widest == pytest.approx(joint_backlash.ZONES[-1] * bench.reach_of(bench.load))


def test_zones_of_a_play_are_closed_in_on_where_no_tool_can_be_wrong() -> None:
    bench = hanging(np.concatenate([UP, -UP]), gravity=0.0)
    still = [replace(s, tool_gravity=np.zeros(1)) for s in bench.data.setups]
    bench = make_bench(replace(bench.data, setups=tuple(still)))
    found = next(
        v for v in library(bench, ["joint_backlash"]) if v.label.endswith("free zone 0.012")
    )
    spans = []
    for close in (1.0, *joint_backlash.CLOSE):
        finer = joint_backlash.refined(bench, found, close)
        zones = sorted({v.info["zone_Nm"] for v in finer if v.info["kind"] == "free"})
        assert len(zones) == 7
        assert zones[3] == pytest.approx(found.info["zone_Nm"])
        kinds = {v.info["kind"] for v in finer}
        beside = {"free", "soft", "slow", "arctan", *lost_motion.KEPT}
        assert kinds == (beside if close > 0.1 else {"free"})
        spans.append(zones[-1] / zones[0])
    assert spans[0] == pytest.approx(2.25)
    assert spans == sorted(spans, reverse=True)
    assert 1.03 < spans[-1] < 1.15  # not so near as masses
    # nobody looked for uneven ends before: from scratch
    first = joint_backlash.uneven(bench, found)
    assert {v.info["kind"] for v in first} == set(lost_motion.UNEVEN)
    zones = sorted({v.info["zone_Nm"] for v in first})
    assert zones[-1] / zones[0] == pytest.approx(0.07 / 0.004)
    closer = joint_backlash.uneven(bench, first[0], joint_backlash.CLOSE[-1])
    assert {v.info["kind"] for v in closer} == {first[0].info["kind"]}
    specimen = make_bench(replace(bench.data, arm=False))
    assert not any("kept" in v.label for v in library(specimen, ["joint_backlash"]))


def test_a_play_with_long_flanks_is_taken_up_slowly() -> None:
    bench = hanging(UP)
    x = np.resize([1.0, 10.0, -10.0], bench.rows.n)
    shape = Play(bench, x, 1.0).place("arctan")
    far = np.arctan(10) / np.pi
    assert shape[:3] == pytest.approx([0.25, far, -far])


def test_a_spring_in_the_play_gives_way_in_proportion() -> None:
    bench = hanging(UP)
    x = np.resize([0.5, 3.0, -3.0], bench.rows.n)
    shape = Play(bench, x, 1.0).place("sprung")
    assert shape[:3] == pytest.approx([0.125, 0.5, -0.5])


def test_no_tool_hangs_on_a_rig_without_an_arm() -> None:
    force = 60 * np.sin(np.arange(400) / 30)
    bench = make_bench(running(force, force / SPRING, imposed="force"))
    plays = [v for v in library(bench, ["joint_backlash"]) if not v.info["preload_Nm"]]
    closer = [v for p in plays for v in joint_backlash.refined(bench, p)]
    assert not any("tool" in v.label for v in (*plays, *closer))
    assert {v.info["kind"] for v in closer} >= {"soft", "slow", "sprung"}


def test_a_preload_puts_a_play_into_a_recording_from_one_side() -> None:
    """Of a force that runs; what is slack where a displacement begins is a seat."""
    force = np.concatenate([np.linspace(0, 60, 200), np.linspace(60, 0, 200)])
    u = force / SPRING + 2e-5 * np.tanh((force - 24.0) / 1.3)
    found = library(make_bench(running(force, u, imposed="force")), ["joint_backlash"])
    assert found
    assert all(v.info["preload_Nm"] for v in found)
    assert not library(make_bench(running(force, u, imposed="displacement")), ["joint_backlash"])


@pytest.mark.parametrize("runs_on", [True, False])
def test_a_play_within_a_load_from_one_side_is_seldom_and_sharp(runs_on: bool) -> None:
    """What is smooth there is a seat, or a curve."""
    force, step = np.concatenate([UP, UP[::-1]]), np.arange(2 * len(UP))
    coarse, fine = {}, {}
    for both in (False, True):
        load = np.where(step % 10 < 5, force, -force) if both else force
        changes = {} if runs_on else {"step": step, "branch": np.ones(len(step), dtype=int)}
        data = replace(running(load, load / SPRING, imposed="force"), **changes)
        bench = make_bench(data)
        assert bench.rows.continuous is runs_on
        assert bench.load_history.one_sided is not both
        plays = [v for v in library(bench, ["joint_backlash"]) if v.info["preload_Nm"]]
        closer = joint_backlash.refined(bench, plays[len(plays) // 2])  # both flanks seen
        beside = {"free", "soft", "slow"}  # no "sprung": straight and soft there is a curve
        assert {v.info["kind"] for v in closer} == (beside if both else {"free"})
        coarse[both] = max(v.prior for v in plays)
        fine[both] = sum(v.prior for v in closer)
    odds = np.exp(-20.0) if runs_on else 0.05
    assert coarse[False] == pytest.approx(odds * coarse[True])
    assert fine[False] == pytest.approx(odds * fine[True])


@pytest.mark.parametrize("pulled", [False, True])
def test_what_is_slack_and_smooth_under_a_load_from_one_side_is_a_seat(pulled: bool) -> None:
    step = np.repeat([*range(1, 9), *range(7, 0, -1)], 3)
    force = 8.0 * step - (32.0 if pulled else 0.0)
    bench = make_bench(bench_data(force, force * SPRING, step=step))
    assert not bench.rows.continuous
    kinds = {v.info["kind"] for v in library(bench, ["joint_backlash"])}
    assert {"free", "friction"} <= kinds
    assert ({"soft", "slow", "arctan"} <= kinds) == pulled


@pytest.mark.parametrize(
    ("softer", "verdict"),
    [
        (1.7, "joint_nonlinear_stiffness"),
        pytest.param(8.0, "joint_backlash", marks=pytest.mark.slow),
    ],
)
def test_a_stage_of_a_gear_is_no_play(softer: float, verdict: str) -> None:
    """Soft about no load, a fifth of the range wide: a play gives way there by far more."""
    load = 60 * np.sin(np.arange(1200) / 60)
    u = (load + (softer - 1) * np.clip(load, -12, 12)) / SPRING
    rng = np.random.default_rng(5)
    data = running(load + rng.normal(0, 0.1, 1200), u + rng.normal(0, 1e-6, 1200), imposed="force")
    assert explained(data).verdict == verdict


def test_a_play_is_soft_beside_the_spring_of_its_own_direction() -> None:
    soft, stiff = 3e-5, 1e-6
    there: Any = SimpleNamespace(
        data=SimpleNamespace(arm=False),
        imposed=False,
        lever=np.repeat(np.eye(2), 5, axis=0),
        line_slope=np.repeat([soft, stiff], 5),
    )
    for joint, slope in ((0, soft), (1, stiff)):
        assert joint_backlash._least(there, joint, 4.0) == pytest.approx(1.5 * 8.0 * slope)
