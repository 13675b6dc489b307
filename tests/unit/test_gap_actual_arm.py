"""Effects that meet: springs that are off with what goes through them, and mechanisms with what
turns the load. Both are products of two unknowns."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.forms import describe, realise
from identification.gap.answer.known import knowing
from identification.gap.data import GapData
from identification.gap.effects import EFFECTS, base_compliance, base_slip, library
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.explanations.several import family_of
from identification.gap.laws.actual_arm import bench_of_actual_arm
from identification.gap.laws.lags import ahead_of_reading
from identification.gap.laws.law import AS_IT_STANDS
from identification.gap.laws.springs_found import springs_found
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import TO_ACTUAL_BENCH, Variant
from identification.gap.search.mechanisms_refit import refit_mechanism_variants
from identification.gap.search.overshoot_paths import _Columns
from identification.gap.search.search import search
from identification.gap.search.springs_refit import relinearised_variants
from identification.gap.words import IN_JOINTS, UNMODELLED
from rig.diagnosis.gap_forms import from_entry, to_entry
from tests.unit.test_gap_forms import arm_data

ETAS = np.array([0.0, 1e-6, 4e-6, 2e-5])
WEAK = 1  # a joint that the load along x and y hardly turns, and one across does
SOFTER = np.array([1.0, 1.4, 1.0, 1.0, 1.0, 1.0])


def engine_of(data: GapData) -> Engine:
    bench = make_bench(data)
    return Engine(bench, base_columns(bench), bench.observed - prediction(bench), ETAS)


def measured(data: GapData, there: Bench, added: Array) -> GapData:
    """What would have been measured on a bench, of its simulation and more (size,), with noise."""
    assert data.q is not None
    assert data.tangential is not None
    total, rows, layout = prediction(there) + added, there.rows, there.layout
    count = rows.weight.astype(int)
    holds = np.add.reduceat(count, np.flatnonzero(rows.hold_starts))
    noise = data.displacement - 1.1e-5 * data.force
    q = total[layout.q].reshape(data.joints, -1).T
    across = total[layout.tangential].reshape(2, -1).T
    return replace(
        data,
        displacement=np.repeat(total[: rows.n], count) + noise,
        q=data.q + np.repeat(q, holds, axis=0),
        tangential=data.tangential + np.repeat(across, holds, axis=0),
    )


def labelled(bench: Bench, word: str, label: str) -> Variant:
    return next(v for v in library(bench, [word]) if v.label == label)


def test_a_spring_that_only_what_pulls_across_shows_is_found_with_it() -> None:
    """Its own column says next to nothing; taken from that alone it is off the wrong way."""
    data = arm_data()
    there = make_bench(data, compliance=data.compliance * SOFTER)
    across = labelled(there, "load_misalignment", "all directions")
    w = np.array([0.0, -0.25, 0.15, -0.2])
    seen = measured(data, there, sum(w[i] * there.columns[c] for i, c in enumerate(across.columns)))
    engine = engine_of(seen)
    found = labelled(engine.bench, across.word, across.label)
    laws = EFFECTS[across.word].laws
    best = score(engine, engine.levels, [found])[0]
    compliance = springs_found(laws, engine, Part(found, best.scale), (), 0.0)
    assert compliance[WEAK] / data.compliance[WEAK] == pytest.approx(SOFTER[WEAK], rel=0.03)
    assert compliance[2:] == pytest.approx(data.compliance[2:], rel=0.03)


def test_a_spring_beside_that_is_an_effect_itself_counts_as_well() -> None:
    """Stated to a percent, the joint's own spring can't be off by so much."""
    data = replace(arm_data(), compliance_relative_sd=np.full(6, 0.01))
    there = make_bench(data, compliance=data.compliance * SOFTER)
    across = labelled(there, "load_misalignment", "all directions")
    w = np.array([0.0, -0.25, 0.15, -0.2])
    seen = measured(data, there, sum(w[i] * there.columns[c] for i, c in enumerate(across.columns)))
    engine = engine_of(seen)
    springs = labelled(engine.bench, "joint_stiffness_error", f"joint {WEAK + 1}")
    found = labelled(engine.bench, across.word, across.label)
    pulls, off = (Part(v, v.scales[-1]) for v in (found, springs))
    compliance = springs_found(EFFECTS[across.word].laws, engine, pulls, (off,), 0.0)
    assert compliance[WEAK] / data.compliance[WEAK] == pytest.approx(SOFTER[WEAK], rel=0.03)


def test_springs_are_found_anew_beside_another_effect_where_more_than_noise_is_left() -> None:
    data = arm_data()
    there = make_bench(data, compliance=data.compliance * SOFTER)
    across = labelled(there, "load_misalignment", "all directions")
    w = np.array([0.0, -0.25, 0.15, -0.2])
    pulls = sum(w[i] * there.columns[c] for i, c in enumerate(across.columns))
    creep = next(v for v in library(there, ["joint_creep"]) if v.info["joint"] == 2)
    crept = there.columns[creep.columns[0]]
    crept = 4e-5 / np.abs(crept[: there.rows.n]).max() * crept
    engine = engine_of(measured(data, there, pulls + crept))
    shapes = [labelled(engine.bench, v.word, v.label) for v in (across, creep)]
    parts = tuple(Part(s.variant, s.scale) for s in score(engine, engine.levels, shapes))
    left = Explanation(parts, 0.0, float(ETAS[2]), (0.0, 0.0), 0.0)
    again = relinearised_variants(engine, left)
    assert [v.word for v in again] == ["load_misalignment"]
    compliance = again[0].info["compliance"]
    assert compliance[WEAK] / data.compliance[WEAK] == pytest.approx(SOFTER[WEAK], rel=0.03)
    assert relinearised_variants(engine, replace(left, eta=0.0)) == []
    # nor what no word names, which goes through nothing
    unmodelled = (replace(shapes[0], word=w) for w in UNMODELLED)
    strange = [(Part(v, parts[0].scale), parts[1]) for v in unmodelled]
    assert all(relinearised_variants(engine, replace(left, parts=p)) == [] for p in strange)
    # what is there already is not found once more
    parts = (Part(again[0], parts[0].scale), parts[1])
    assert relinearised_variants(engine, replace(left, parts=parts)) == []


OFFSET = np.array([0.05, 0.1, 0.08])
JOINT = 4


def off_and_rubbing() -> GapData:
    """An arm whose tool is elsewhere and whose wrist rubs, at the torques that there are then."""
    data = arm_data()
    plain = make_bench(data)
    tool = labelled(plain, "pose_error", "tool 150 mm")
    form = describe(plain, Part(tool, 1.0), OFFSET, np.eye(3))
    stands = bench_of_actual_arm(plain, [form.acts])
    rubs = next(
        v
        for v in EFFECTS["joint_hysteresis"].variants(stands)
        if v.info["joint"] == JOINT and v.label.endswith("spectrum that slips")
    )
    column = stands.columns[rubs.columns[len(rubs.columns) // 2]]
    moved = 1e-4 / np.abs(column[: plain.rows.n]).max() * column
    # the place itself, to second order as arms move
    shifts = EFFECTS["pose_error"].laws.rows(
        plain, replace(form.law, constants={**form.law.constants, "about_offset": tuple(OFFSET)})
    )
    return measured(data, plain, shifts @ OFFSET + moved)


def test_levers_and_torques_are_those_of_the_arm_as_it_stands() -> None:
    bench = make_bench(arm_data())
    tool = labelled(bench, "pose_error", "tool 150 mm")
    stands = bench_of_actual_arm(bench, [describe(bench, Part(tool, 1.0), OFFSET, np.eye(3)).acts])
    across = labelled(bench, "load_misalignment", "direction x")
    form = describe(bench, Part(across, 1.0), np.array([0.1, 0.0]), np.eye(2))
    pulled = bench_of_actual_arm(bench, [form.acts])
    for s, setup in enumerate(bench.data.setups):
        mine = np.flatnonzero(bench.rows.setup == s)[5]
        # what the same tool would have as simulated
        wanted = setup.lever + setup.offset_lever @ OFFSET
        assert stands.lever[mine] == pytest.approx(wanted)
        assert stands.true_torque[mine] == pytest.approx(wanted * bench.true_load[mine])
        aside = 0.1 * bench.load[mine] * setup.tangent_lever[0] * (setup.direction == "x")
        along = setup.lever * bench.true_load[mine]
        assert pulled.true_torque[mine] == pytest.approx(along + aside)
        assert pulled.lever[mine] == pytest.approx(setup.lever)
    late = labelled(bench, "time_lag", "force filter 5.2 s")
    form = describe(bench, Part(late, 1.0), np.array([0.8]), np.eye(1))
    behind = bench_of_actual_arm(bench, [form.acts])
    more = 0.8 * ahead_of_reading(bench, "filter", 5.2)
    assert np.abs(more).max() > 1
    assert behind.true_load == pytest.approx(bench.true_load + more)
    assert behind.true_torque == pytest.approx(bench.lever * behind.true_load[:, None])
    shown = labelled(bench, "time_lag", "displacement filter 5.2 s")
    acts = describe(bench, Part(shown, 1.0), np.ones(1), np.eye(1)).acts
    assert bench_of_actual_arm(bench, [acts]) is bench
    creep = library(bench, ["joint_creep"])[0]
    acts = describe(bench, Part(creep, 1.0), np.ones(len(creep.columns)), np.eye(1)).acts
    assert bench_of_actual_arm(bench, [acts]) is bench


def test_moments_about_the_base_are_those_of_the_arm_as_it_stands() -> None:
    """About the upright axis those of the first joint, which it is; about lying ones by hand."""
    data = arm_data(directions="xyz")
    bench = make_bench(data)
    tool = labelled(bench, "pose_error", "tool 150 mm")
    across = labelled(bench, "load_misalignment", "all directions")
    w = np.linspace(-0.2, 0.2, len(across.columns))
    forms = [
        describe(bench, Part(tool, 1.0), OFFSET, np.eye(3)),
        describe(bench, Part(across, 1.0), w, np.eye(len(w))),
    ]
    stands = bench_of_actual_arm(bench, [f.acts for f in forms])
    assert base_slip.lever_of(stands, "z", 0.0) == pytest.approx(stands.lever[:, 0])
    assert base_slip.moment_of(stands, "z", 0.0) == pytest.approx(stands.true_torque[:, 0])
    there, depth = stands.arm_state, 0.3
    assert there is not None
    for s, setup in enumerate(data.setups):
        mine = np.flatnonzero(bench.rows.setup == s)[5]
        load = bench.load[mine]
        point = setup.point + setup.shifted_point @ OFFSET + np.array([0.0, 0.0, depth])
        lever = np.cross(point, setup.unit_vector)
        assert base_compliance.moments(stands, depth)[mine] == pytest.approx(lever)
        # what pulls across acts where the tool was taken to be: its own change is of second order
        nominal = setup.point + np.array([0.0, 0.0, depth])
        moment = lever * load + np.cross(nominal, there.force[mine])
        carried = base_compliance.moments_of_load(stands, depth, bench.load)[mine]
        assert carried == pytest.approx(moment)
        assert np.abs(there.force[mine] @ setup.unit_vector) < 1e-9 * load


def test_a_mechanism_is_found_on_the_arm_as_it_stands() -> None:
    data = off_and_rubbing()
    engine = engine_of(data)
    variants = library(engine.bench, ["pose_error", "joint_hysteresis"])
    both = next(e for e in search(engine, variants).explanations if len(e.words) == 2)
    rubs = next(p for p in both.parts if p.word == "joint_hysteresis")
    assert TO_ACTUAL_BENCH in rubs.variant.info
    assert rubs.variant.joint == JOINT
    # in absolute units, beside the same pose, it is what was fitted; alone it is something else
    fitted = fit(engine, both)
    forms = [describe(engine.bench, p, *fitted.of(i)) for i, p in enumerate(both.parts)]
    mine = next(f for f in forms if f.word == "joint_hysteresis")
    own = fitted.contribution(engine, both.parts.index(rubs))
    assert mine.law.constants[AS_IT_STANDS]
    size = np.abs(own).max()
    assert np.abs(realise(engine.bench, mine, forms) - own).max() < 0.02 * size
    assert np.abs(realise(engine.bench, mine) - own).max() > 0.1 * size
    # and where a hand is looked for that went too far, it is the same
    rows = engine.bench.rows
    beyond = _Columns(engine.bench, rubs, np.where(rows.hold_starts, 1.0, 0.0))
    columns = beyond.along(rows.overshoot) @ fitted.of(both.parts.index(rubs))[0]
    assert np.abs(columns - own).max() < 1e-9 * size
    # a file says so
    entry = to_entry(mine, {"name": mine.word})
    assert entry["answers_to_the_other_effects"]
    again = from_entry(json.loads(json.dumps(entry)))
    assert realise(engine.bench, again, forms) == pytest.approx(
        realise(engine.bench, mine, forms), rel=1e-6, abs=1e-15
    )
    known = knowing(engine.bench, forms).known
    assert known is not None
    both_do = sum(realise(engine.bench, f, forms) for f in forms)
    n, setup = rows.n, rows.setup
    datum = np.array([both_do[np.argmax(setup == s)] for s in range(int(setup.max()) + 1)])
    assert known.does[:n] == pytest.approx(both_do[:n] - datum[setup], abs=1e-12)


def test_it_stands_beside_what_has_the_arm_so_alone() -> None:
    data = off_and_rubbing()
    engine = engine_of(data)
    words = ["pose_error", "joint_hysteresis", "thermal_drift", "joint_creep", "zero_shift"]
    found = search(engine, library(engine.bench, words))
    made = [v for v in found.variants if v.answers_to is not None]
    assert {(v.word, v.answers_to) for v in made} == {("joint_hysteresis", "pose_error")}
    for e in found.explanations:
        for part in e.parts:
            assert part.variant.answers_to in {None, *e.words}
    thermal = next(v for v in found.variants if v.word == "thermal_drift")
    tool = next(v for v in found.variants if v.word == "pose_error")
    for v, able in ((thermal, False), (tool, True)):
        family = family_of(found.variants, "joint_hysteresis", (Part(v, v.scales[0]),))
        assert (made[0] in family) is able


def test_caches_of_variants_are_of_one_bench() -> None:
    engine = engine_of(arm_data())
    v = labelled(engine.bench, "joint_stiffness_error", f"joint {JOINT + 1}")
    creep = next(v for v in library(engine.bench, ["joint_creep"]) if v.joint == JOINT)
    before = score(engine, engine.levels, [v, creep])
    there = bench_of_actual_arm(
        engine.bench,
        [
            describe(
                engine.bench,
                Part(labelled(engine.bench, "pose_error", "tool 150 mm"), 1.0),
                OFFSET,
                np.eye(3),
            ).acts
        ],
    )
    with engine.on(there):
        assert engine.bench is there
        inside = score(engine, engine.levels, [v, creep])
    assert [s.log_evidence for s in score(engine, engine.levels, [v, creep])] == [
        s.log_evidence for s in before
    ]
    assert inside[1].log_evidence != before[1].log_evidence  # likelier where it gives more


def test_a_lag_of_the_laser_goes_through_no_spring() -> None:
    engine = engine_of(arm_data())
    late = labelled(engine.bench, "time_lag", "displacement filter 1.25 s")
    creep = next(v for v in library(engine.bench, ["joint_creep"]) if v.joint == JOINT)
    parts = Part(late, 1.0), Part(creep, 0.1)
    left = Explanation(parts, 0.0, float(ETAS[2]), (0.0, 0.0), 0.0)
    assert relinearised_variants(engine, left) == []


@pytest.mark.parametrize("word", sorted(IN_JOINTS))
def test_the_law_of_a_mechanism_there_is_one_of_the_torques_there(word: str) -> None:
    """On every bench, beside the same pose; by no other is it what the variant is."""
    bench = make_bench(arm_data())
    tool = labelled(bench, "pose_error", "tool 150 mm")
    pose = describe(bench, Part(tool, 1.0), OFFSET, np.eye(3))
    stands = partial(bench_of_actual_arm, acts=[pose.acts])
    found = next(v for v in EFFECTS[word].variants(stands(bench)) if v.joint == JOINT)
    part = Part(found.known_by(", there", **{TO_ACTUAL_BENCH: stands}), 1.0)
    k = len(found.columns)
    form = describe(bench, part, np.ones(k), np.eye(k))
    own = sum(bench.columns[c] for c in found.columns)
    close = 0.01 * np.abs(own).max()
    assert np.abs(realise(bench, form, [pose, form]) - own).max() < close
    assert np.abs(realise(bench, form) - own).max() > close


def test_none_is_looked_for_where_nothing_turns_the_load_or_nothing_is_left() -> None:
    data = off_and_rubbing()
    engine = engine_of(data)
    shapes = [
        labelled(engine.bench, "pose_error", "tool 150 mm"),
        next(v for v in library(engine.bench, ["joint_hysteresis"]) if v.joint == JOINT),
        library(engine.bench, ["thermal_drift"])[0],
    ]
    tool, rubs, warms = (Part(v, v.scales[0]) for v in shapes)
    left = Explanation((tool, rubs), 0.0, float(ETAS[2]), (0.0, 0.0), 0.0)
    assert refit_mechanism_variants(engine, left)
    assert refit_mechanism_variants(engine, replace(left, eta=0.0)) == []
    assert refit_mechanism_variants(engine, replace(left, parts=(warms, rubs))) == []
    assert refit_mechanism_variants(engine, replace(left, parts=(tool, warms))) == []
