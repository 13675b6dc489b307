"""Bench rigs of the blind check: every law draws, physics holds, answers fit the data."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.arrays import Array
from rig.blind.campaign import Campaign, Outcome, Plan
from rig.blind.case import generator, write_dataset
from rig.blind.diagnosers import Reply
from rig.blind.score import report
from rig.dataset import load
from rig.errors import InputError
from rig.meta import Meta
from rig.worlds.benches import channels, curves, loops, metals, strange, viscous
from rig.worlds.benches.draw import EFFECTS, FORMS, WORDS, BenchCase, draw_case
from rig.worlds.benches.imperfect import imperfect
from rig.worlds.benches.label import WITHIN_SD, accepted, structural
from rig.worlds.benches.memory import bouc_wen, chaboche, lowpass, maxwell, pursuit, stops
from rig.worlds.benches.paths import through, to_and_fro
from rig.worlds.benches.rig import Rig, Stated, make_rig
from rig.worlds.benches.sensors import Readings, columns_of, noise_rms_mm, read
from rig.worlds.benches.trial import Trial, bent
from rig.worlds.hidden.words import EFFECTS as OF_AN_ARM

LAWS = [(word, form.name) for word, forms in FORMS.items() for form in forms]


@pytest.fixture(scope="module")
def cases() -> list[BenchCase]:
    return [draw_case(31, k) for k in range(60)]


# ---------------------------------------------------------------------------------- every case


@pytest.mark.parametrize(("word", "form"), LAWS)
def test_every_law_draws_a_fair_question(word: str, form: str) -> None:
    for number in range(3):
        case = draw_case(32, number, word=word, form=form)
        label = case.label
        assert json.loads(json.dumps(label)) == label
        assert label["truth"] == [word] == [label["verdict"]]
        assert word in label["accept"]
        assert label["accept_each"] == [label["accept"]]
        assert label["noise_rms_mm"] > 0
        assert label["snr"] >= 3 if word != "none" else label["snr"] == 0
        meta = Meta.model_validate(case.meta)
        assert meta.robot == "none"
        assert {len(c) for c in case.columns.values()} == {label["samples"]}
        for name in ("force_N", "displacement_mm"):
            assert np.isfinite(case.columns[name]).all()


def test_the_same_seed_and_number_give_the_same_case(cases: list[BenchCase]) -> None:
    again = draw_case(31, 5)
    assert (again.name, again.meta, again.label) == (cases[5].name, cases[5].meta, cases[5].label)
    for name, column in again.columns.items():
        assert np.array_equal(column, cases[5].columns[name])
    assert draw_case(30, 5).meta != cases[5].meta


def test_cases_are_as_mixed_as_benches_are(cases: list[BenchCase]) -> None:
    tables = [set(c.columns) for c in cases]
    for name in ("time_s", "branch", "direction", "repetition"):
        assert {name in t for t in tables} == {True, False}, name
    assert {"imposed" in c.meta for c in cases} == {True, False}
    assert {c.label["imposed"] for c in cases} == {"force", "displacement"}
    assert max(c.label["snr"] for c in cases) > 1000
    forces = [float(np.abs(c.columns["force_N"]).max()) for c in cases]
    assert min(forces) < 0.1
    assert max(forces) > 1e4
    samples = [c.label["samples"] for c in cases]
    assert min(samples) < 300
    assert max(samples) > 10_000
    off = [
        c.meta["simulation"]["stiffness_N_per_mm"]["x"] / c.label["true_stiffness_N_per_mm"]
        for c in cases
    ]
    assert min(off) < 0.4
    assert max(off) > 2.5


def test_clocks_start_at_zero_and_never_go_back(cases: list[BenchCase]) -> None:
    for case in cases:
        runs = case.columns.get("repetition", np.ones(case.label["samples"], dtype=int))
        for clock in (case.columns.get("time_s"), case.columns.get("session_s")):
            if clock is None:
                continue
            inside = np.diff(runs) == 0
            assert clock[0] == 0
            assert (np.diff(clock)[inside] >= 0).all(), case.name
        if "session_s" in case.columns:
            first = np.flatnonzero(np.diff(runs, prepend=0))
            assert (case.columns["time_s"][first] == 0).all()
            assert (np.diff(case.columns["session_s"]) >= 0).all()


def test_tables_come_in_as_emulated_measurements(cases: list[BenchCase], tmp_path: Path) -> None:
    for k, case in enumerate(cases[:6]):
        write_dataset(case, tmp_path / f"{k}.h5")
        dataset = load(tmp_path / f"{k}.h5")
        assert dataset.origin == "emulated"
        assert np.array_equal(dataset.columns["force_N"], case.columns["force_N"])


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match=r'word: "joint_yeld" is not known.*joint_yield'):
        draw_case(1, 1, word="joint_yeld")
    with pytest.raises(InputError, match='form: "indents" is no law of joint_yield; allowed: coup'):
        draw_case(1, 1, word="joint_yield", form="indents")
    with pytest.raises(InputError, match='form: "indent" stands without its word'):
        draw_case(1, 1, form="indent")


def test_the_blind_check_scores_them(cases: list[BenchCase]) -> None:
    draw, words = generator("benches")
    assert words == EFFECTS == tuple(w for w in WORDS if w not in ("none", "unknown"))
    assert set(words) < set(OF_AN_ARM)
    assert draw(31, 3).label == cases[3].label
    plan = Plan(cases=60, seed=31, generator="benches")
    outcomes = [
        Outcome(k, c.name, c.label, None, Reply("answered", 1.0, _said(c)))
        for k, c in enumerate(cases)
    ]
    out = report(Campaign(plan, outcomes))
    assert out["summary"]["right_all_kinds"]["hits"] == len(cases)
    assert out["summary"]["where"]["main_direction"]["n"] > 0
    assert out["summary"]["where"]["joint"]["n"] == 0
    assert set(out["tables"]["by_laws"]) == {"foreign"}


def _said(case: BenchCase) -> dict[str, Any]:
    word = case.label["truth"][0]
    return {
        "verdict": word,
        "probabilities": {word: 1.0},
        "effects": [],
        "where": {"directions": ["x"], "joints": []},
    }


# ------------------------------------------------------------------------------------- answers


def _line(k: float, **extra: Any) -> Trial:
    path = through(to_and_fro(-1.0, 1.0, 3), 300)
    return Trial(path.time, k * path.value, path.value, stiffness=k, clean=True, **extra)


def _rig(trial: Trial, stated: Stated) -> Rig:
    return Rig(trial, trial.time, trial.force, trial.displacement, trial.stiffness, stated, {})


def test_a_line_within_three_sd_is_no_gap_and_beyond_is_what_is_left() -> None:
    trial = _line(1.0)
    inside = structural(_rig(trial, Stated(1 / 1.29, 0.1, 0.0, 0.0)))
    assert np.abs(inside).max() < 1e-12
    beyond = structural(_rig(trial, Stated(0.5, 0.1, 0.0, 0.0)))
    centred = trial.displacement - trial.displacement.mean()
    assert beyond == pytest.approx((2.0 - (1 + WITHIN_SD * 0.1)) * centred)


@pytest.mark.parametrize("imposed", ["force", "displacement"])
def test_a_spring_far_off_is_accepted_where_it_makes_much_of_the_gap(imposed: Any) -> None:
    path = through(to_and_fro(-1.0, 1.0, 3), 300)
    force = path.value + 0.3 * path.value**3
    trial = Trial(path.time, force, path.value, imposed)
    assert accepted("joint_nonlinear_stiffness", _rig(trial, Stated(0.95, 0.1, 0, 0))) == {
        "joint_nonlinear_stiffness"
    }
    assert accepted("joint_nonlinear_stiffness", _rig(trial, Stated(0.1, 0.1, 0, 0))) == {
        "joint_nonlinear_stiffness",
        "joint_stiffness_error",
    }


def test_of_scales_those_count_that_may_be_off_as_much() -> None:
    rig = _rig(_line(1.0), Stated(0.8, 0.02, 0.02, 0.001))
    assert accepted("joint_stiffness_error", rig) == {"joint_stiffness_error", "force_scale"}
    assert accepted("displacement_scale", rig) == {
        "joint_stiffness_error",
        "force_scale",
        "displacement_scale",
    }


def test_a_scale_is_off_beyond_all_that_is_stated_and_a_clean_spring_is_not() -> None:
    signs = set()
    for number in range(12):
        for word in ("force_scale", "displacement_scale", "joint_stiffness_error", "none"):
            case = draw_case(33, number, word=word)
            spring = case.meta["simulation"]
            sd = np.linalg.norm(
                [spring["stiffness_relative_sd"]]
                + [i["gain_relative_sd"] for i in case.meta["instruments"].values()]
            )
            k = np.polyfit(case.columns["displacement_mm"], case.columns["force_N"], 1)[0]
            off = abs(np.log(k / spring["stiffness_N_per_mm"]["x"]))
            assert off > 2.2 * sd if word != "none" else off < 2.2 * sd + 0.01, (word, number)
            if word != "none":
                signs.add(case.label["parameters"][0]["factor"] > 1)
    assert signs == {True, False}


def test_noise_is_what_departs_from_the_response_without_it() -> None:
    random = np.random.default_rng(4)
    trial = _line(5.0)
    for imposed in ("force", "displacement"):
        rig = _rig(
            Trial(trial.time, trial.force, trial.displacement, imposed, 5.0), Stated(5.0, 0.1, 0, 0)
        )
        readings = read(rig, 1e-3, random)
        assert 0.5e-3 < noise_rms_mm(rig, readings) < 2e-3
        off = readings.displacement - readings.force / 5.0
        assert noise_rms_mm(rig, readings) == pytest.approx(float(off.std()), rel=1e-9)


def test_a_pause_tells_the_drift_of_the_cell_and_cycles_alone_do_not() -> None:
    random = np.random.default_rng(5)
    paused = channels.drift_between_pauses(random)
    assert paused.accept == frozenset()
    assert paused.zero is not None
    assert np.ptp(paused.displacement[paused.zero]) < 1e-12
    assert np.ptp(paused.force[paused.zero]) > 0.01
    assert channels.drift_under_cycles(random).accept == {"thermal_drift"}


def test_a_late_displacement_is_a_dashpot_and_a_late_force_is_none() -> None:
    for k in range(8):
        trial = channels.late_channel(np.random.default_rng(k))
        done = float(
            np.sum(0.5 * (trial.force[1:] + trial.force[:-1]) * np.diff(trial.displacement))
        )
        lossy = trial.imposed == "force"
        assert (done > 0) == lossy == ("joint_creep" in trial.accept)


def test_samples_that_were_not_stored_leave_every_run_its_ends() -> None:
    path = through(to_and_fro(0.0, 1.0, 5), 1000)
    number = np.arange(1000.0)
    trial = Trial(path.time, path.value, path.value, repetition=path.repetition)
    rig, lost = _rig(trial, Stated(1.0, 0.1, 0, 0)), 0
    for k in range(20):
        readings = Readings(number, path.value, 1.0, 1.0)
        stored = columns_of(rig, readings, np.random.default_rng(k))["force_N"]
        runs = [number[path.repetition == r] for r in range(1, 6)]
        assert {float(x) for run in runs for x in run[[0, -1]]} <= set(stored.tolist())
        lost += len(stored) < 1000
    assert 0 < lost < 15


def test_a_bench_adds_little_of_its_own_and_nothing_to_a_clean_trial() -> None:
    clean = _line(1.0)
    path = through(to_and_fro(-1.0, 1.0, 3), 600)
    bent_one = Trial(path.time, path.value**3, path.value)
    effect, added = bent(bent_one.displacement, bent_one.force), []
    for k in range(20):
        assert imperfect(clean, np.random.default_rng(k)) is clean
        out = imperfect(bent_one, np.random.default_rng(k))
        change = out.force[-600:] - bent_one.force  # what it may record before the start aside
        added.append(float(change.std()) / effect)
    assert 0.01 < np.median(added) < 0.1
    assert max(added) < 0.25


def test_a_crank_comes_to_rest_at_its_turning_points() -> None:
    even, eased = (through([0, 1, -1], 3001, eased=e) for e in (False, True))
    assert np.abs(np.diff(even.value)) == pytest.approx(1e-3)
    turn = int(np.argmax(eased.value))
    steps = np.abs(np.diff(eased.value))
    assert max(steps[turn - 1], steps[turn]) < 0.01 * steps.max()
    assert eased.value[[0, turn, -1]] == pytest.approx([0, 1, -1], abs=1e-6)


# ---------------------------------------------------------------------------------------- laws


def _work(force: Array, moved: Array) -> float:
    return float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(moved)))


def test_sliders_follow_masing_and_take_work() -> None:
    path = through(to_and_fro(-1.0, 1.0, 3), 11_001)  # samples at the turning points
    limit, stiff = np.array([0.1, 0.2]), np.array([1.0, 0.5])
    force = stops(path.value, limit, stiff)
    assert force[path.value == path.value.max()] == pytest.approx(limit.sum())
    first = np.interp(0.15, path.value[path.leg == 0], force[path.leg == 0])
    back = path.leg == 1
    twice = np.interp(0.3, 1.0 - path.value[back], limit.sum() - force[back])
    assert twice == pytest.approx(2 * first, rel=1e-3)
    assert _work(force, path.value) > 0


def test_a_maxwell_element_relaxes_by_its_time_whatever_the_sampling() -> None:
    tau, weight = np.array([0.3]), np.array([2.0])
    for count in (5, 500):
        time = np.concatenate([[0.0, 1e-9], np.linspace(0.1, 1, count)])
        strain = np.minimum(time / 1e-9, 1.0)
        left = maxwell(time, strain, tau, weight)
        assert left[2:] == pytest.approx(2.0 * np.exp(-time[2:] / 0.3), rel=1e-6)
        ramp = np.linspace(0, 1, count)
        pulled = maxwell(ramp, 3.0 * ramp, tau, weight)
        assert pulled == pytest.approx(2.0 * 3.0 * 0.3 * (1 - np.exp(-ramp / 0.3)))


def test_a_filter_and_a_presliding_near_their_goal_exponentially() -> None:
    time = np.linspace(0, 1, 11)
    assert lowpass(time, time, 0.2) == pytest.approx(time - 0.2 * (1 - np.exp(-time / 0.2)))
    assert pursuit(2 * time, np.ones(11), 0.5) == pytest.approx(1 - np.exp(-4 * time))


def test_a_cycled_metal_is_elastic_first_then_saturates_on_a_closed_loop() -> None:
    path = through(to_and_fro(-6.0, 6.0, 12), 6000)
    force = chaboche(path.value, [(0.8, 3.0), (0.02, 0.0)], 0.3, 0.5)
    early = path.value[:20] < 1
    assert force[:20][early] == pytest.approx(path.value[:20][early])
    tops = [force[path.leg == leg][-1] for leg in range(0, 24, 2)]
    assert tops[-1] > tops[0]
    assert tops[-1] == pytest.approx(tops[-2], rel=1e-3)
    assert _work(force[path.leg >= 20], path.value[path.leg >= 20]) > 0


def test_the_loop_of_bouc_and_wen_starts_with_slope_one_and_wears() -> None:
    path = through(to_and_fro(-4.0, 4.0, 5), 4000)
    fresh = bouc_wen(path.value, 2.0, 0.6, 0.0, 0.0)
    worn = bouc_wen(path.value, 2.0, 0.6, 0.02, 0.0)
    assert fresh[5] == pytest.approx(path.value[5], rel=1e-2)
    assert fresh.max() == pytest.approx(1.0, abs=0.01)
    assert worn[path.leg == 8].max() < 0.9 * worn[path.leg == 0].max()


def test_a_pulled_coupon_keeps_what_flowed_and_comes_back_on_a_straight_line() -> None:
    trial = metals.coupon_with_unloadings(np.random.default_rng(3))
    u, force = trial.displacement, trial.force
    turn = int(np.argmax(np.diff(u) < 0))
    low = turn + int(np.argmax(np.diff(u[turn:]) > 0))
    slope = np.gradient(force[turn + 1 : low], u[turn + 1 : low])
    assert slope == pytest.approx(slope[0], rel=1e-6)
    assert 0.8 < slope[0] <= 1.0 + 1e-9
    stays = u[low] - force[low] / slope[0]
    assert stays > 0.3 * u[turn]


def test_only_a_gradual_pull_may_be_a_softening_spring() -> None:
    trials = [metals.coupon_pulled_once(np.random.default_rng(k)) for k in range(20)]
    seen = {(bool(t.parameters["sharp"]), "joint_nonlinear_stiffness" in t.accept) for t in trials}
    assert seen == {(True, False), (False, True)}


LOOPS = [f.draw for f in FORMS["joint_hysteresis"]]


@pytest.mark.parametrize("law", LOOPS)
def test_every_loop_takes_work(law: Callable[[np.random.Generator], Trial]) -> None:
    for seed in range(4):
        trial = law(np.random.default_rng(seed))
        assert _work(trial.force, trial.displacement) > 0


def test_curves_come_back_on_themselves_within_a_tenth_of_what_is_bent() -> None:
    for form in FORMS["joint_nonlinear_stiffness"]:
        trial = form.draw(np.random.default_rng(2))
        order = np.argsort(trial.displacement, kind="stable")
        u, force = trial.displacement[order], trial.force[order]
        edges = np.linspace(u[0], u[-1], 15)[1:-1]
        inside = np.digitize(u, edges)
        left = [bent(u[inside == b], force[inside == b]) for b in range(14)]
        assert np.sqrt(np.mean(np.square(left))) < 0.3 * bent(u, force), form.name


def test_friction_in_the_clearance_and_round_corners_are_said() -> None:
    accepts = {curves.bolted_joint(np.random.default_rng(k)).accept for k in range(20)}
    assert accepts == {frozenset(), frozenset({"joint_nonlinear_stiffness"})}
    accepts = {curves.geared_joint(np.random.default_rng(k)).accept for k in range(20)}
    assert accepts == {frozenset(), frozenset({"joint_hysteresis"})}


def test_a_curve_counts_as_a_cause_from_half_the_loop_on() -> None:
    x = np.linspace(-1, 1, 400)
    loop = np.sign(np.sin(40 * x))
    assert loops.curve_too(x, 0.1 * x**3 + 5 * x, loop) == frozenset()
    assert loops.curve_too(x, 9.0 * x**3, loop) == {"joint_nonlinear_stiffness"}


def test_creep_goes_on_while_held() -> None:
    for seed in range(5):
        held = viscous.held_stretch(np.random.default_rng(seed))
        half = held.displacement == held.displacement.max()
        assert (np.diff(held.force[half]) < 0).all()
        again = viscous.foam_let_go(np.random.default_rng(seed))
        assert np.diff(again.force[again.time > 0.6]).min() > -1e-12  # grows back


def test_a_snapping_beam_falls_where_it_is_led_and_jumps_where_it_is_pushed() -> None:
    kinds = set()
    for seed in range(8):
        trial = strange.beam_that_snaps(np.random.default_rng(seed))
        kinds.add(trial.imposed)
        if trial.imposed == "displacement":
            assert (np.gradient(trial.force, trial.displacement)[1:-1] < -0.1).any()
        else:
            assert np.abs(np.diff(trial.displacement)).max() > 0.3
    assert kinds == {"force", "displacement"}


def test_softened_rubber_follows_its_last_path_until_it_is_stretched_further() -> None:
    trial = strange.rubber_that_softens(np.random.default_rng(1))
    u, most = trial.displacement, np.maximum.accumulate(trial.displacement)
    assert trial.force[u < 1e-3 * u.max()] == pytest.approx(0.0, abs=2e-3)
    first = np.interp(0.5 * u[u == most][-1], u[u == most], trial.force[u == most])
    late = np.abs(u - 0.5 * u.max()) < 0.02 * u.max()
    assert trial.force[late].min() < 0.8 * first


def test_sizes_stay_within_the_bounds_of_the_rig() -> None:
    random = np.random.default_rng(8)
    for forms in FORMS.values():
        for form in forms:
            word = next(w for w, fs in FORMS.items() if form in fs)
            rig = make_rig(form, word, form.draw(random), random)
            top = float(np.abs(rig.force).max())
            assert top == 0 or 0.35 * form.force_N[0] < top < 1.65 * form.force_N[1]
            assert len(columns_of(rig, read(rig, 1e-9, random), random)["force_N"]) > 50


def test_a_foam_is_finite_wherever_its_drive_swings() -> None:
    """An eased drive swings back beyond its start by rounding: no power of a negative number."""
    for seed in range(200):
        trial = curves.foam(np.random.default_rng(seed))
        assert np.isfinite(trial.force).all(), seed
