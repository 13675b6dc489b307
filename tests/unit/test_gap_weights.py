"""Joints carry the weights of arm and tool: friction, knees and plays act on the net torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.forms import law_of, rows_of
from identification.gap.answer.parameters import parameters
from identification.gap.data import Setup
from identification.gap.effects import joint_hysteresis, joint_nonlinear_stiffness, library
from identification.gap.evidence.compare import Scored, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.several import family_of
from identification.gap.laws import knees_closer
from identification.gap.laws.closer import places
from identification.gap.laws.curves import above, beyond, hinge
from identification.gap.laws.interval import TWO_SIDED, ComplianceChange
from identification.gap.laws.knees import is_sharp
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import TOOL_KG, TOOL_SD_KG, Bench, make_bench
from identification.gap.model.flowing import flowing_play
from identification.gap.model.history import bristles, play
from identification.gap.model.variants import variant
from identification.gap.recording.rows import reduce_rows
from identification.gap.search.refine import refine
from rig.diagnosis.gap_data import _joint_to_joint, arm_setup
from rig.models.robot import load_robot
from tests.conformance.gap_designs import linear
from tests.unit.test_gap_closer import assert_lawful
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data, fresh

PATH = np.array([0.0, 4.0, 9.0, 15.0, 8.0, 0.0, -6.0, 3.0])


def after_weight(path: Array, weight: float) -> Array:
    """The path with the weight coming on before it, as its own first row."""
    return np.concatenate([[weight], path + weight])


@pytest.mark.parametrize("weight", [-7.0, 0.0, 2.0, 12.0])
def test_a_play_under_weight_is_one_whose_load_began_with_it(weight: float) -> None:
    radius, n = np.array([3.0, 5.0]), len(PATH)
    none = np.zeros(n + 1, dtype=bool)
    whole = play(np.tile(after_weight(PATH, weight)[:, None], 2), radius, none, fresh(n + 1))
    found = play(np.tile(PATH[:, None], 2), radius, none[1:], fresh(n), np.full((n, 1), weight))
    assert found == pytest.approx(whole[1:] - whole[0])


@pytest.mark.parametrize("weight", [-9.0, 9.0])
def test_a_rest_takes_the_push_off_and_leaves_the_weight(weight: float) -> None:
    path = np.sign(-weight) * PATH  # against it first
    rest, longer = np.arange(len(path)) == 4, np.insert(path, 4, 0.0)
    n = len(longer) + 1
    load = after_weight(longer, weight)[:, None]
    whole = play(load, np.array([5.0]), np.zeros(n, dtype=bool), fresh(n))[:, 0]
    hung = np.full((len(path), 1), weight)
    found = play(path[:, None], np.array([5.0]), rest, fresh(len(path)), hung)[:, 0]
    assert found == pytest.approx(np.delete(whole[1:], 4) - whole[0])


@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("weight", [-7.0, 2.0])
def test_bristles_under_weight_are_bent_by_it_first(weight: float, elastic: bool) -> None:
    reach, n = np.array([4.0]), len(PATH)
    whole = bristles(after_weight(PATH, weight), reach, fresh(n + 1), elastic)
    found = bristles(PATH, reach, fresh(n), elastic, np.full(n, weight))
    assert found == pytest.approx(whole[1:] - whole[0])


def test_flow_under_weight_comes_to_the_same_state_in_the_end() -> None:
    rows = reduce_rows(bench_data(PATH, 1e-5 * PATH, time=1e4 * np.arange(len(PATH))))
    weight, radius = np.full(len(PATH), -9.0), np.array([5.0])
    found = flowing_play(PATH, radius, np.array([0.01]), rows, fresh(len(PATH)), weight)
    none = np.zeros(len(PATH), dtype=bool)
    still = play(PATH[:, None], radius, none, fresh(len(PATH)), weight[:, None])
    assert found == pytest.approx(still)


def test_curves_of_the_net_torque_start_where_the_weight_left_them() -> None:
    torque, weight = np.linspace(-20, 60, 81), np.full(81, -30.0)
    net = torque + weight
    for shape, law in (
        (beyond, lambda x: np.sign(x) * np.maximum(np.abs(x) - 10, 0)),
        (above, lambda x: np.maximum(x - 10, 0)),
    ):
        assert shape(torque, weight, 10.0) == pytest.approx(law(net) - law(weight))
        assert shape(np.zeros(1), weight[:1], 10.0) == 0.0


def hanging(levels: Array, gravity: float = -30.0, poses: tuple[float, ...] = (1.0,)) -> Bench:
    """One joint of an arm with a lever of 1 m, pushed to levels, 4 samples each, once per pose, in
    which the weight is so many times what it is in the first."""
    one = bench_data(PATH, PATH).setups[0]
    setups: tuple[Setup, ...] = tuple(
        replace(one, pose=f"P{i}", gravity=np.array([gravity * p]), tool_gravity=np.array([-5.0]))
        for i, p in enumerate(poses)
    )
    n = 4 * len(levels)
    number = np.repeat(np.arange(len(poses)), n)
    force = np.tile(np.repeat(levels, 4), len(poses))
    step = np.tile(np.repeat(np.arange(len(levels)), 4), len(poses))
    data = bench_data(
        force,
        1e-5 * force,
        setups=setups,
        arm=True,
        setup=number,
        run=number,
        step=step,
        time=np.tile(np.arange(float(n)), len(poses)),
    )
    return make_bench(data)


UP = np.array([0, 20, 40, 60, 80, 60, 40, 20, 0.0])


def labels(bench: Bench, word: str) -> list[str]:
    return [v.label for v in library(bench, [word])]


def test_weights_count_where_the_joint_feels_them() -> None:
    heavy, light = hanging(UP), hanging(UP, gravity=7.5)  # with the tool: -37.5 and 0 Nm
    assert heavy.weight(0)[0] == pytest.approx(-30.0 - 5.0 * TOOL_KG)
    assert heavy.feels_weight(0)
    assert not light.feels_weight(0)
    for word in ("joint_hysteresis", "joint_nonlinear_stiffness"):
        new = set(labels(heavy, word)) - set(labels(light, word))
        assert any("under weight" in v or "tool" in v for v in new)


def test_thresholds_on_the_net_torque_are_others_between_poses_and_senses() -> None:
    def under(bench: Bench) -> int:
        return sum("under weight" in v for v in labels(bench, "joint_yield"))

    along = hanging(UP, gravity=30.0)  # the push adds to the weight
    assert not under(along)
    assert under(hanging(UP, gravity=30.0, poses=(1.0, 1.3)))
    assert under(hanging(np.concatenate([UP, -UP]), gravity=30.0))
    relieved = hanging(UP, gravity=-300.0, poses=(1.0, 1.3))  # every push takes load off
    assert not under(relieved)


def test_a_controller_may_take_a_joint_back_that_carries_weight() -> None:
    """Then every run begins anew, and still it yields at the net torque."""
    bench = make_bench(arm_data())
    knees = [v for v in library(bench, ["joint_yield"]) if " under weight" in v.label]
    taken = [v for v in knees if v.label.startswith("joint 2 under weight, taken back at")]
    kept = {v.label.replace(", taken back", ""): v for v in taken}
    assert taken
    assert {v.label for v in knees} >= set(kept)
    sharp = next(v for v in taken if v.label.endswith("at 0.75 sharp"))
    finer = knees_closer.refined(bench, sharp)
    assert_lawful(bench, [*taken[:8], *finer[::25]])
    lasting = next(v for v in knees if v.label == "joint 2 under weight at 0.75 sharp")
    state, other = (bench.columns[v.columns[0]][: bench.rows.n] for v in (sharp, lasting))
    first = {r: state[bench.rows.run == r][0] for r in np.unique(bench.rows.run)}
    assert np.abs(state).max() > 0
    assert not any(first.values())
    assert any(other[bench.rows.run == r][0] for r in first)
    assert not any("taken back" in v for v in labels(hanging(UP, poses=(1.0, 1.3)), "joint_yield"))


def test_a_threshold_is_the_net_torque_and_knows_no_more_of_it_than_of_the_tool() -> None:
    bench = hanging(UP, gravity=30.0)  # the tool takes 7.5 Nm off: the joint carries 22.5
    sharp = next(v for v in library(bench, ["joint_yield"]) if "at 0.5 sharp" in v.label)
    info = {**sharp.info, "radius": np.array([40.0])}
    knee = replace(sharp, columns=sharp.columns[:1], root=np.eye(1), info=info)
    found = parameters(bench, Part(knee, 1.0), np.array([1.0]), np.zeros((1, 1)))
    push, net = found["threshold_of_load"], found["threshold"]
    assert push.value == pytest.approx(40.0, rel=0.01)
    assert net.value == pytest.approx(push.value + 22.5)
    wide = np.hypot(push.high - push.value, TWO_SIDED * TOOL_SD_KG * 5.0)
    assert net.high - net.value == pytest.approx(wide, rel=1e-6)


def test_weights_that_bear_more_than_the_push_cut_no_threshold() -> None:
    """The net torque falls while the push grows, and is the largest without it."""
    bench = hanging(UP, gravity=-75.0)  # the tool takes 7.5 Nm more: 82.5 the other way
    sharp = next(v for v in library(bench, ["joint_yield"]) if "at 0.5 sharp" in v.label)
    info = {**sharp.info, "radius": np.array([38.0, 42.0])}
    knee = replace(sharp, columns=sharp.columns[:1] * 2, root=np.eye(2), info=info)
    found = parameters(bench, Part(knee, 1.0), np.array([0.9, 0.1]), 1e-4 * np.eye(2))
    push, net = found["threshold_of_load"], found["threshold"]
    assert net.value == pytest.approx(82.5 - push.value)
    assert net.possible(0.0).value == net.value
    assert net.most > 82.5


def test_thresholds_answer_to_the_load_without_the_drift_of_its_reading() -> None:
    """3 N of drift over the run, plain at zero load before and after."""
    levels = np.array([0, 20, 40, 60, 80, 60, 40, 20, 0.0])
    force = np.repeat(levels, 4)
    drift = np.linspace(0.0, 3.0, len(force))
    branch = np.where(force == 0, 0, 1)
    step = np.where(force == 0, 0, np.repeat(np.arange(9), 4))
    data = bench_data(force + drift, 1e-5 * force, branch=branch, step=step)
    bench = make_bench(data)
    rows = bench.rows
    expected = np.array([levels[s] for s in rows.step])
    assert bench.true_torque[:, 0] == pytest.approx(expected, abs=0.15)
    assert np.abs(bench.torque[:, 0] - expected).max() > 2.0


def test_a_tool_pulls_at_the_point_of_load() -> None:
    """Against an arm that carries it as its payload there."""
    arm = load_robot("ur10e")
    q, tcp = np.array([0.2, -1.66, -1.78, -1.27, 1.57, -1.34]), np.array([0.0, 0.0, 0.07])
    setup = arm_setup(arm, "P1", q, tcp, "x", np.array([1.0, 0, 0]))
    laden = replace(arm, payload=1.0, payload_centre=tcp)
    more = arm.gravity_torques(q) - laden.gravity_torques(q)
    assert setup.tool_gravity == pytest.approx(more, abs=1e-9)
    assert np.abs(more).max() > 5.0


def test_segments_run_where_the_model_has_them_or_from_joint_to_joint() -> None:
    """A cantilever of the upper arm's length, loaded across at the elbow: F L^3 / 3 EI, and what
    turns it beyond; nothing of it lies beside the plane of the joints."""
    arm, q = load_robot("ur10e"), np.array([0.0, -1.2, 1.9, -0.7, 1.57, 0.0])
    upper, fore = (_joint_to_joint(arm, link) for link in arm.links)
    assert (upper.length, fore.length) == pytest.approx(tuple(np.abs(arm.a[1:3])))
    frames = arm.frames(q)
    for link in (upper, fore):
        own, before = frames[link.frame], frames[link.frame - 1]
        assert (own @ [*link.start, 1.0])[:3] == pytest.approx(before[:3, 3])
        assert (own @ [*link.end, 1.0])[:3] == pytest.approx(own[:3, 3])
        assert link.section == next(b.section for b in arm.links if b.frame == link.frame)
    flat = replace(arm, links=(upper, fore))
    tool, across = np.eye(4), np.array([0.3, 0.4, 0.866])
    tool[:3, 3] = [0.05, 0.0, 0.2]
    parts = arm_setup(arm, "P1", q, tool[:3, 3], "y", across).links
    for k, link in enumerate(arm.links):  # the four of them are the beam, but for its stretch
        beam = arm.compliance(q, tool, links=[link]) - arm.compliance(q, tool)
        assert parts[0, k].sum() == pytest.approx(across @ beam[:3, :3] @ across, rel=5e-3)
    for tcp, n in (([0.0, 0.0, 0.1], [0.0, 1.0, 0.0]), ([0.05, 0.0, 0.2], [1.0, 0.0, 0.0])):
        as_modelled, straight = arm_setup(arm, "P1", q, np.array(tcp), "y", np.array(n)).links
        again = arm_setup(flat, "P1", q, np.array(tcp), "y", np.array(n)).links
        assert straight == pytest.approx(again[0])
        assert straight == pytest.approx(again[1])
        # beside the plane of the joints counts for pushes in that plane
        assert np.allclose(as_modelled, straight, rtol=1e-6, atol=0) == (n[0] == 0)


def test_bending_of_a_segment_is_its_mean_along_it() -> None:
    """Of an even tube all three are alike; of a hinge in the middle two thirds count."""
    bench = make_bench(arm_data())
    both = next(v for v in library(bench, ["link_flexibility"]) if v.label == "both arms")
    w = np.array([0.0, 1.5, 0.0, 0.2, 2.0, 2.0, 2.0, 0.7])
    found = parameters(bench, Part(both, 1.0), w, np.zeros((8, 8)))
    values = {k.replace("compliance_over_nominal_segment", ""): p.value for k, p in found.items()}
    wanted = {"bending_1": 1.0, "twist_1": 0.2, "bending_2": 2.0, "twist_2": 0.7}
    assert values == pytest.approx(wanted)


def test_a_factor_of_a_spring_knows_the_spring_no_better_than_stated() -> None:
    bench = hanging(UP)
    wrong = next(v for v in library(bench, ["joint_stiffness_error"]))
    softer = ComplianceChange({0: 0.1}, {0: 0.0}, {0: np.zeros(1)})
    found = parameters(bench, Part(wrong, 1.0), np.array([0.5]), np.zeros((1, 1)), softer)
    factor = found["factor_joint1"]
    assert factor.value == pytest.approx(1 / 1.6)
    stated = float(bench.data.compliance_relative_sd[0])
    assert np.log(factor.high / factor.low) == pytest.approx(2 * TWO_SIDED * stated)


def test_creep_with_the_square_counts_as_its_straight_line() -> None:
    bench = hanging(UP)
    bent = next(v for v in library(bench, ["joint_creep"]) if v.info.get("bent"))
    k = len(bent.columns)
    found = parameters(bench, Part(bent, 1.0), np.full(k, 0.1), np.zeros((k, k)))
    assert found["creep_fraction"].value == pytest.approx(0.75 * 0.1 * k)


def test_curves_are_refined_for_tools_in_between() -> None:
    bench = hanging(UP)
    odd = next(v for v in library(bench, ["joint_nonlinear_stiffness"]) if "odd" in v.label)
    finer = joint_nonlinear_stiffness.refined(bench, odd)
    masses = [v.info["tool_kg"] - odd.info["tool_kg"] for v in finer]
    assert max(np.abs(masses)) == pytest.approx(0.4)
    assert min(np.abs(masses)) == pytest.approx(0.1)
    assert sum(v.prior for v in finer) == pytest.approx(0.3)
    bent = [bench.columns[v.columns[1]][: bench.rows.n] for v in (odd, finer[0])]
    assert not np.allclose(*bent)
    weightless = [replace(s, tool_gravity=np.zeros(1)) for s in bench.data.setups]
    assert not joint_nonlinear_stiffness.refined(
        make_bench(replace(bench.data, setups=tuple(weightless))), odd
    )


def test_friction_under_weight_is_refined_for_other_tools() -> None:
    bench = hanging(np.concatenate([UP, UP[::-1]]))
    found = library(bench, ["joint_hysteresis"])
    hung = next(v for v in found if v.label.endswith("under weight spectrum that slips"))
    finer = joint_hysteresis.refined(bench, hung)
    assert sorted({v.info["tool_kg"] for v in finer}) == [0.0, 0.5, 1.0, 2.0, 2.5, 3.0]
    slipping = [hung, *(v for v in finer if v.info["law"] == "Prandtl")]
    states = [np.sum([bench.columns[c] for c in v.columns], axis=0) for v in slipping]
    assert min(np.ptp(s - states[0]) for s in states[1:]) > 1e-3 * np.ptp(states[0])
    for v in finer:
        law, scale = law_of(bench, v)
        assert rows_of(bench, v.word, law) * scale == pytest.approx(
            np.column_stack([bench.columns[c] for c in v.columns])
        ), v.label
    free = next(v for v in found if v.info["memory"] == "")
    assert not joint_hysteresis.refined(bench, free)
    weightless = [replace(s, tool_gravity=np.zeros(1)) for s in bench.data.setups]
    assert not joint_hysteresis.refined(
        make_bench(replace(bench.data, setups=tuple(weightless))), hung
    )


def test_the_search_refines_the_tool_of_friction() -> None:
    bench = hanging(np.concatenate([UP, UP[::-1]]))
    variants = library(bench, ["joint_hysteresis"])
    hung = next(v for v in variants if v.label.endswith("under weight spectrum that slips"))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    loop = np.sum([bench.columns[c] for c in joint_hysteresis.refined(bench, hung)[-1].columns], 0)
    engine = Engine(bench, base, target + 0.05 * loop, np.array([0.0, 2e-6, 5e-6]))
    finer = refine(engine, score(engine, engine.levels, variants))
    kg = {v.info["tool_kg"] for v in finer if "tool_kg" in v.info}
    assert kg == set(joint_hysteresis.TOOLS_KG)


def test_an_arm_s_stated_springs_may_be_those_of_small_loads_which_make_nothing_slip() -> None:
    """Elements that slip add their plays then; what a specimen's spring is, its curve says."""
    bench = hanging(np.concatenate([UP, UP[::-1]]), gravity=0.0)
    found = {v.label: v for v in library(bench, ["joint_hysteresis"])}
    held, slips = found["joint 1 spectrum"], found["joint 1 spectrum that slips"]
    n, line = bench.rows.n, bench.columns[held.columns[-1]]
    for k, c in enumerate(slips.columns):  # strength by strength: stop and play make the line
        pair = bench.columns[c] - bench.columns[held.columns[k]]
        assert pair[:n] == pytest.approx(-line[:n])
    assert len(held.columns) == len(slips.columns) + 1
    specimen = make_bench(replace(bench.data, arm=False))
    assert not any("slips" in v.label for v in library(specimen, ["joint_hysteresis"]))


def test_a_second_spring_comes_to_bear_between_the_places_of_the_grid() -> None:
    """At 0.337 of the range, all at once: found to a percent of the range, and as exact as that."""
    bench = hanging(np.concatenate([UP, -UP]), gravity=0.0)
    variants = library(bench, ["joint_nonlinear_stiffness"])
    x, c = bench.load / 80.0, float(bench.compliance[0]) * 80.0
    second = bench.joint_column(0, -0.5 * c * hinge(x, 0.337))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    engine = Engine(bench, base, target + second, np.array([0.0, 2e-6, 5e-6]))
    singles = score(engine, engine.levels, variants)
    finer = refine(engine, singles)
    best = max([*singles, *score(engine, engine.levels, finer)], key=lambda s: s.log_evidence)
    assert best.variant.label.startswith("joint 1 corner")
    assert best.variant.info["kinds"][1] == pytest.approx(0.337, abs=0.01)
    law, scale = law_of(bench, best.variant)
    assert rows_of(bench, "joint_nonlinear_stiffness", law) * scale == pytest.approx(
        np.column_stack([bench.columns[k] for k in best.variant.columns])
    )
    curve = next(v for v in variants if v.label.endswith("curve"))
    bend = next(v for v in variants if " bend " in v.label)
    assert not joint_nonlinear_stiffness.corners(bench, curve)
    specimen = make_bench(replace(bench.data, arm=False))
    assert not joint_nonlinear_stiffness.corners(specimen, bend)


def test_the_search_refines_the_tool_of_a_curve_and_looks_alone_and_beside() -> None:
    bench = hanging(np.concatenate([UP, -UP]))
    variants = library(bench, ["joint_nonlinear_stiffness", "joint_creep"])
    odd = next(v for v in variants if "odd curve, tool 1.5 kg" in v.label)
    base, target = base_columns(bench), bench.observed - prediction(bench)
    bent = bench.columns[odd.columns[1]] + bench.columns[odd.columns[4]]
    engine = Engine(bench, base, target + 0.3 * bent, np.array([0.0, 2e-6, 5e-6]))
    finer = refine(engine, score(engine, engine.levels, variants))
    assert any("odd curve" in v.label and v.info["tool_kg"] == 1.6 for v in finer)

    def scored(joint: int, knee: str) -> Scored:
        return Scored(
            variant(
                "joint_yield", f"{joint} {knee}", [0], (1.0,), joint=joint, axis=None, knee=knee
            ),
            0.0,
            1.0,
            0,
        )

    alone = [scored(1, "round"), scored(1, "sharp"), scored(2, "sharp")]
    beside = [scored(3, "sharp"), scored(3, "sharp"), scored(4, "sharp"), scored(5, "sharp")]
    found = places(alone, beside, is_sharp)
    assert [s.variant.info["joint"] for s in found] == [1, 3, 4]
    assert places(alone, [], is_sharp) == alone[1:]


def test_a_joint_shows_strong_friction_in_a_single_loading_a_specimen_none() -> None:
    """One strength alone stays small: what bends all at once is a knee."""
    bench = hanging(UP[:5], gravity=0.0)
    assert bench.load_history.monotonic
    found = library(bench, ["joint_hysteresis"])
    whole = next(v for v in found if v.label.endswith("spectrum"))
    span = bench.reach_of(bench.true_torque[:, 0])
    assert whole.info["radius"][-2] == pytest.approx(span)
    assert max(v.info["radius"][0] for v in found if " r " in v.label) <= 0.15 * span
    specimen = make_bench(replace(bench.data, arm=False))
    assert not library(specimen, ["joint_hysteresis"])


def test_friction_that_leaves_nothing_and_never_turned_is_a_curve() -> None:
    """Loaded three times, let go in between: what forgets in every rest shows no loop."""
    loads = {"up": np.tile(UP[:5], 3), "up and down": np.tile(UP, 3)}
    for name, levels in loads.items():
        bench = hanging(levels)
        n = len(levels) // 3 * 4
        run = np.repeat([0, 1, 2], n)
        bench = make_bench(replace(bench.data, run=run, repetition=run + 1))
        memories = {v.info["memory"] for v in library(bench, ["joint_hysteresis"])}
        assert ("rested" in memories) is (name == "up and down")
        assert "under weight" in memories


def test_what_bends_before_the_first_load_that_was_read_is_lost_motion() -> None:
    bench = hanging(UP)  # in steps of a quarter
    found = library(bench, ["joint_nonlinear_stiffness"])
    bends = {v.label.split()[-1]: v for v in found if " bend " in v.label}
    assert "0.2" not in bends
    assert "0.3" in bends
    places = [v.info["kinds"][1] for v in joint_nonlinear_stiffness.corners(bench, bends["0.3"])]
    assert len(places) > 3
    assert min(places) >= 1.3 * 0.25
    close = hanging(np.linspace(0.0, 80.0, 17))
    assert any(v.label.endswith("bend 0.1") for v in library(close, ["joint_nonlinear_stiffness"]))


def test_a_direction_that_hardly_turns_a_joint_does_not_show_where_it_bends() -> None:
    """Pushed along x joint 1 bears a twentieth of what it bears along y, in steps of an eighth."""
    found = library(make_bench(linear("medium")), ["joint_nonlinear_stiffness"])
    bends = {v.label for v in found}
    assert "joint 1 bend 0.2" in bends
    assert "joint 1 bend 0.1" not in bends
    assert "joint 5 bend 0.1" in bends  # which both directions turn, x by smaller steps


def test_between_no_load_and_the_second_a_bench_shows_a_step() -> None:
    """Any line goes through zero and the first level; pushed to one side only, a bend is a bend."""
    levels = np.arange(-4.0, 5.0) * 20
    runs = {"run": np.repeat([0, 1], 9), "repetition": np.repeat([1, 2], 9)}
    for load, first in ((np.tile(levels, 2), "0.5"), (np.tile(np.abs(levels), 2), "0.1")):
        bench = make_bench(bench_data(load, 1e-5 * load, **runs))
        found = library(bench, ["joint_nonlinear_stiffness"])
        bends = [v.label.split()[-1] for v in found if " bend " in v.label]
        assert bends[0] == first


def test_a_joint_without_weight_may_bend_otherwise_to_either_side() -> None:
    """Where it was pushed both ways; with a weight the curve is one of the net torque."""
    both = np.concatenate([UP, -UP])
    none = -TOOL_KG * -5.0  # of arm and tool together
    for push, gravity, uneven in ((both, none, True), (UP, none, False), (both, 30.0, False)):
        found = library(hanging(push, gravity=gravity), ["joint_nonlinear_stiffness"])
        assert any(v.label.endswith("uneven curve") for v in found) is uneven


def test_joints_that_creep_do_so_alike() -> None:
    bench = make_bench(arm_data())
    variants = library(bench, ["joint_creep"])
    for bent in (True, False):
        one = next(v for v in variants if bool(v.info.get("bent")) == bent)
        rest = family_of(variants, "joint_creep", (Part(one, 1.0),))
        assert rest
        assert {bool(v.info.get("bent")) for v in rest} == {bent}
        assert one.info["joint"] not in {v.info["joint"] for v in rest}
    assert len(family_of(variants, "joint_creep", ())) == len(variants)
