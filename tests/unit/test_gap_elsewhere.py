"""Knees at other joints and axes than those at which they were found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import EFFECTS, base_slip, library
from identification.gap.evidence.compare import Scored, score
from identification.gap.laws import flows, knees_closer
from identification.gap.laws.flows import Flow
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import CALLED, Variant, place_of
from identification.gap.search.refine import refine
from tests.conformance.gap_designs import linear
from tests.explained import explained
from tests.unit.test_gap_closer import assert_lawful, engine_with
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_running import SPRING, running


def elsewhere(bench: Bench, found: Variant, there: Variant) -> Variant | None:
    place = there.info[CALLED], there.info
    return next(iter(knees_closer.elsewhere(bench, [(found, place)])), None)


@pytest.mark.parametrize("word", ["joint_yield", "base_slip"])
@pytest.mark.parametrize("flow_s", [0.0, 5.0])
def test_a_knee_elsewhere_begins_at_the_same_load_of_the_rig(word: str, flow_s: float) -> None:
    bench = make_bench(arm_data())
    sharp = [v for v in library(bench, [word]) if v.info["knee"] == "sharp" and v.label[-1] == "k"]
    sharp = [v for v in sharp if "weight" not in v.info and v.info["memory"] == ""]
    found = next(
        v
        for v in knees_closer.refined(bench, sharp[0])
        if v.info["flow_s"] == flow_s and v.label.endswith("flows back")
    )
    others = {place_of(v): v for v in reversed(sharp)}
    moved = {k: elsewhere(bench, found, v) for k, v in others.items()}
    made = {k: v for k, v in moved.items() if v is not None}
    assert len(made) > 1
    most = int(np.abs(found.info["load"]).argmax())
    for k, v in made.items():
        there = others[k]
        assert place_of(v) == place_of(there)
        assert v.label.startswith(there.label.split(" at ")[0])
        assert f" at {v.info['centre']:.4g} fine" in v.label
        ratio = abs(there.info["load"][most]) / abs(found.info["load"][most])
        assert v.info["centre"] == pytest.approx(ratio * found.info["centre"])
        assert v.info["radius"] == pytest.approx(ratio * np.asarray(found.info["radius"]))
        assert len(v.columns) == len(found.columns)
    assert_lawful(bench, list(made.values()))


@pytest.mark.parametrize("word", ["joint_yield", "base_slip"])
def test_flows_of_many_laws_are_made_in_one_loop(
    word: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, laws = make_bench(arm_data()), EFFECTS[word].laws
    sharp = [v for v in library(bench, [word]) if v.info["knee"] == "sharp" and v.label[-1] == "k"]
    sharp = [v for v in sharp if "weight" not in v.info and v.info["memory"] == ""]
    found = [v for s in sharp[:2] for v in knees_closer.refined(bench, s) if v.info["flow_s"] > 0]
    every = [laws.of(bench, v)[0] for v in found]
    assert len(every) > 10
    fresh, loops = make_bench(arm_data()), []
    real = flows.flowing_play
    monkeypatch.setattr(flows, "flowing_play", lambda *a: loops.append(1) or real(*a))
    assert laws.flow is not None
    flows.make(fresh, [laws.flow(fresh, law) for law in every])
    for law in every:
        laws.rows(fresh, law)
    assert len(loops) == 1


def test_the_axis_of_a_slip_is_looked_for_between_the_depths_of_the_grid() -> None:
    bench = make_bench(arm_data())
    load, column, _ = base_slip._about(bench, "x", 0.35)
    assert 0.35 not in base_slip.DEPTHS_M
    slip = column(bench.plays(load, np.array([0.5 * np.abs(load).max()]), bench.moved)[:, 0])
    variants = library(bench, ["base_slip"])
    engine = engine_with(bench, bench.columns[slip])
    finer = refine(engine, score(engine, engine.levels, variants))
    best = max(score(engine, engine.levels, [*variants, *finer]), key=lambda s: s.log_evidence)
    assert (best.variant.info["axis"], best.variant.info["depth_m"]) == ("x", 0.35)
    assert_lawful(bench, [best.variant])


@pytest.mark.slow
def test_a_stand_that_slides_is_told_by_the_force_across() -> None:
    """Beyond 0.6 of the largest push along x, in both poses; until the arm goes to another one."""
    data = linear("rich")
    across = np.array([s.unit_vector[0] for s in data.setups])[data.setup]
    poses = [s.pose for s in data.setups]
    at, slid, state, pose = 0.6 * float(np.abs(across * data.force).max()), [], 0.0, ""
    for force, setup in zip(across * data.force, data.setup, strict=True):
        if poses[setup] != pose:
            state, pose = 0.0, poses[setup]
        state = min(max(state, force - at), force + at)
        slid.append(state)
    moved = 5e-7 * across * np.array(slid)
    found = explained(replace(data, displacement=data.displacement + moved))
    (effect,) = found.effects
    assert effect.name == "base_slip"
    assert effect.places["sliding along x"] > 0.9
    assert effect.parameters["threshold_of_force"].value == pytest.approx(at, rel=0.05)
    assert "threshold" not in effect.parameters


def test_what_is_far_worse_beside_the_best_is_not_looked_at_again() -> None:
    bench = make_bench(arm_data())
    variants = library(bench, ["joint_yield"])
    found = next(v for v in variants if v.label == "joint 4 at 0.68 sharp")
    engine = engine_with(bench, 10 * bench.columns[found.columns[0]])
    finer = refine(engine, score(engine, engine.levels, variants))
    there = [v for v in finer if v.info["joint"] == 3]
    logs = [s.log_evidence for s in score(engine, engine.levels, there)]
    assert 0 < len(there) < len(knees_closer.refined(bench, found))
    assert max(logs) - min(logs) < 61.0  # 60, and what priors do


def test_what_a_controller_takes_back_it_had_clamped() -> None:
    """It gives way at once, and no metal flows back."""
    bench = make_bench(arm_data())
    sharp = [v for v in library(bench, ["joint_yield"]) if v.info["knee"] == "sharp"]
    for taken in (False, True):
        mine = [v for v in sharp if ("taken back" in v.label) == taken]
        assert mine
        finer = knees_closer.refined(bench, mine[0])
        assert any("flows back" in v.label for v in (*mine, *finer)) != taken
        assert any(v.info["flow_s"] > 0 for v in finer) != taken


def test_a_place_without_load_has_no_knee() -> None:
    bench = make_bench(arm_data(directions="x"))
    sharp = [v for v in library(bench, ["joint_yield"]) if v.info["knee"] == "sharp"]
    idle = replace(sharp[-1], info={**sharp[-1].info, "load": np.zeros(bench.rows.n)})
    assert elsewhere(bench, sharp[0], idle) is None


def test_flows_made_in_one_go_are_those_made_one_by_one() -> None:
    data = arm_data()
    bench, torque = make_bench(data), make_bench(data).true_torque
    every = [
        Flow(torque[:, j], radius * np.abs(torque[:, j]).max(), time, fresh, square=square)
        for j, radius, time, fresh, square in (
            (0, np.array([0.3, 0.5]), 5.0, bench.moved, False),
            (1, np.array([0.4]), 1.2, bench.moved | bench.rest, False),
            (1, np.array([0.2, 0.3, 0.6]), 15.0, bench.moved, True),
            (2, np.array([0.4]), 0.0, bench.moved, False),
        )
    ]
    flows.make(bench, every)
    assert len(bench.flows) == 3  # one is there at once
    for one in every:
        alone = make_bench(data)
        assert np.array_equal(flows.states(bench, one), flows.states(alone, one))
        assert np.ptp(flows.states(alone, one)) > 0


@pytest.mark.slow
def test_without_readings_a_joint_is_not_named_for_having_been_looked_at_closely() -> None:
    """Flow that lies between the times of the grid: only one joint was looked at that closely."""
    data = replace(arm_data(), q=None)
    data = replace(data, setups=data.setups[:2], **_first_pose(data))
    bench = make_bench(data)
    found = next(v for v in library(bench, ["joint_yield"]) if v.label == "joint 4 at 0.68 sharp")
    slow = next(v for v in knees_closer.refined(bench, found) if v.info["flow_s"] == 10.0)
    truth = next(v for v in knees_closer.refined(bench, slow, 0.4) if v.info["flow_s"] > 11)
    effect = bench.columns[truth.columns[0]]
    engine = engine_with(bench, effect)
    singles = score(engine, engine.levels, library(bench, ["joint_yield"]))
    finer = refine(engine, singles)
    best: dict[tuple[str, ...], Scored] = {}
    for s in sorted(score(engine, engine.levels, finer), key=lambda s: s.log_evidence):
        best[place_of(s.variant)] = s
    names = {s.variant.label.split(" ")[1]: s.log_evidence for s in best.values()}
    assert min(names[j] for j in "234") > max(names.values()) - 5.0
    assert_lawful(bench, [s.variant for s in best.values()])

    size = 5e-5 / np.abs(effect[: bench.rows.n]).max()
    moved = bench.slope * bench.load + size * effect[: bench.rows.n]
    noise = np.random.default_rng(5).normal(0, 1e-6, len(data.force))
    moved = np.repeat(moved, bench.rows.weight.astype(int)) + noise
    told = explained(replace(data, displacement=moved), withhold=["base_slip"])
    assert told.verdict == "joint_yield"
    assert set(told.effects[0].places) == {"joint 2", "joint 3", "joint 4"}
    assert sum(told.effects[0].places.values()) == pytest.approx(1.0, abs=0.03)


def test_on_an_arm_what_gives_way_bit_by_bit_does_not_flow_back() -> None:
    """That is friction; a knee with a threshold may (Bauschinger), and so may any metal."""
    knees = library(make_bench(arm_data()), ["joint_yield", "base_slip"])
    back = {v.info["knee"] for v in knees if v.label.endswith("flows back")}
    assert back == {"sharp"}
    load = 100 * np.sin(np.arange(300) / 15)
    knees = library(make_bench(running(load, load / SPRING)), ["joint_yield"])
    back = {v.info["knee"] for v in knees if v.label.endswith("flows back")}
    assert back == {"sharp", "round"}


def _first_pose(data: object) -> dict[str, np.ndarray]:
    keep = np.asarray(data.setup) < 2  # type: ignore[attr-defined]
    names = (
        "time",
        "session",
        "run",
        "setup",
        "repetition",
        "branch",
        "step",
        "force",
        "displacement",
        "tangential",
        "temperature",
    )
    return {n: getattr(data, n)[keep] for n in names}
