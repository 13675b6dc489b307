"""Withheld repetitions: what is withheld, whose datum goes with it, and who loses weight by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import Instruments
from identification.gap.diagnose import diagnose_gap
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, Sizes
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.fit import fit
from identification.gap.explanations.penalties import below_noise, cancelling, minor_parts
from identification.gap.explanations.verdict import with_posterior
from identification.gap.judging import cross_validation, residuals
from identification.gap.judging.choice import chosen_of
from identification.gap.judging.cross_validation import _foretold, reweighted_by_validation
from identification.gap.judging.heldout import (
    ALWAYS_IN,
    GROUPS,
    HeldOut,
    _later,
    _stacked_keep,
    folds,
    held_out,
    stated_prediction,
)
from identification.gap.judging.residual_checks import reweighted_by_residuals
from identification.gap.judging.residuals import excess_response_rms
from identification.gap.laws.drift import FreePath, free_path, free_variant
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from identification.gap.model.variants import Variant, variant
from identification.gap.recording.faults import bursts
from identification.gap.search import unmodelled_shapes
from identification.gap.words import DRIFTS
from tests.conformance.effect_benches import of, quick_engine
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data

STEPS, REPETITIONS, SAMPLES = 8, 3, 4
BUMP = 2e-5  # m


def engine(extra: Array, datum: str = "setup", zeros: bool = True) -> Engine:
    """Steps up from zero load, over and over; extra (repetitions,): size of a bump in each, m."""
    rng = np.random.default_rng(8)
    step = np.tile(np.repeat(np.arange(STEPS), SAMPLES), len(extra))
    run = np.repeat(np.arange(len(extra)), STEPS * SAMPLES)
    force = 20.0 * step
    shape = np.exp(-(((force - 80) / 25) ** 2))
    u = 1e-5 * force + extra[run] * shape + rng.normal(0, 5e-7, len(step))
    branch = np.where((step == 0) & zeros, 0, 1)
    data = bench_data(force, u, step=step, run=run, repetition=run + 1, branch=branch)
    bench = make_bench(replace(data, datum=datum))
    target = bench.observed - prediction(bench)
    mine = [
        (bench.rows.repetition == r + 1) * np.exp(-(((bench.load - 80) / 25) ** 2))
        for r in range(len(extra))
    ]
    bench.add(bench.stacked(np.sum(mine, axis=0)))
    for m in mine:
        bench.add(bench.stacked(m))
    return Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6]))


def explained(columns: list[int], word: str, weight: float) -> Explanation:
    v = variant(word, word, columns, (BUMP,), positive=False)
    return Explanation((Part(v, BUMP),), weight, 0.0, (BUMP / 3,), weight)


def found(e: Engine, *explanations: Explanation) -> SearchResult:
    none = Explanation((), -500.0, 0.0, (), -500.0)
    words = {w: 0.0 for x in explanations for w in x.words}
    ranked = (*sorted(explanations, key=lambda x: -x.log_weight), none)
    return with_posterior(SearchResult(e, ranked, words, {}, -400.0, 1e-6), {})


def test_the_first_repetition_is_never_withheld() -> None:
    e = engine(np.full(REPETITIONS, BUMP))
    fold = folds(e)["repetition"]
    assert set(fold[e.bench.rows.repetition == 1]) == {ALWAYS_IN}
    assert len(set(fold[e.bench.rows.repetition > 1])) == REPETITIONS - 1


@pytest.mark.parametrize("each", [1, 3])
def test_many_repetitions_are_withheld_in_groups_from_all_over(each: int) -> None:
    e = engine(np.full(1 + each * GROUPS, BUMP))
    fold, repetition = folds(e)["repetition"], e.bench.rows.repetition
    groups = [set(repetition[fold == f]) for f in np.unique(fold[fold != ALWAYS_IN])]
    assert [len(g) for g in groups] == [each] * GROUPS
    assert set().union(*groups) == set(range(2, 2 + each * GROUPS))
    assert all(np.ptp(list(g)) >= (each - 1) * GROUPS for g in groups)


def test_of_setups_in_turn_each_keeps_repetitions_to_foretell_by() -> None:
    """Numbered through all of them."""
    setup = np.tile(np.repeat(np.arange(10), 4), 4)
    repetition = np.repeat(np.arange(1, 41), 4)
    fold = _later(setup.astype(np.int64), repetition.astype(np.int64))
    for s in range(10):
        mine = fold[setup == s]
        assert len(set(mine.tolist()) - {ALWAYS_IN}) == 3
    few = _later(np.zeros(12, dtype=np.int64), np.arange(12) // 2 + 5)
    assert few.tolist() == [ALWAYS_IN] * 2 + [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]


def test_what_repeats_is_foreseen_and_what_is_fitted_run_by_run_is_not() -> None:
    e = engine(np.full(REPETITIONS, BUMP))
    fold = folds(e)["repetition"]
    alike = held_out(e, explained([0], "joint_nonlinear_stiffness", 0.0), "repetition", fold)
    each = held_out(e, explained([1, 2, 3], "zero_shift", 0.0), "repetition", fold)
    assert alike.after < 1e-6
    assert each.after > 5e-6


@pytest.mark.parametrize(
    ("left", "after", "foreseen"),
    [(1.0, 2.5, False), (1.5, 2.5, True), (1.5, 3.5, False), (3.0, 3.5, False)],
)
def test_what_a_fit_to_all_repetitions_leaves_too_is_not_unforeseen(
    monkeypatch: pytest.MonkeyPatch, left: float, after: float, foreseen: bool
) -> None:
    """Times the noise; of a fit that leaves more, laws are to blame."""
    e = engine(np.zeros(3))
    noise, law = residuals.noise_rms(e.bench), explained([0], "joint_nonlinear_stiffness", 0.0)
    e.structural = 1e-9
    judged = cross_validation.__name__
    monkeypatch.setattr(f"{judged}.residual_rms", lambda *_: left * noise)
    held = replace(held_out(e, law, "repetition", folds(e)["repetition"]), after=after * noise)
    monkeypatch.setattr(f"{judged}.held_out", lambda *_: held)
    kept = reweighted_by_validation(found(e, law)).kept
    assert (kept[law.words] > cross_validation.PASSES_ABOVE) is foreseen


def test_a_fit_of_the_session_loses_its_weight_to_what_foresees() -> None:
    e = engine(np.full(REPETITIONS, BUMP))
    alike = explained([0], "joint_nonlinear_stiffness", -3.0)
    each = explained([1, 2, 3], "zero_shift", 0.0)
    before = found(e, alike, each)
    after = reweighted_by_validation(before)
    assert before.probabilities["zero_shift"] > 0.8
    assert after.kept[frozenset(["zero_shift"])] < 0.01
    assert after.kept[frozenset(["joint_nonlinear_stiffness"])] > 0.99
    assert after.probabilities["zero_shift"] < 0.05
    # what it loses goes to no other word: nothing says that that one explains what it explained
    assert after.probabilities["unknown"] > after.probabilities["joint_nonlinear_stiffness"]


def test_what_a_drift_does_in_a_repetition_that_repetition_tells() -> None:
    """What stands beside the drift is judged all the same."""
    e = engine(np.array([1.0, -1.0, 2.0, 0.5])[:REPETITIONS] * BUMP)
    drift = explained([1, 2, 3], "thermal_drift", 0.0).parts
    law = explained([0], "joint_nonlinear_stiffness", 0.0).parts
    fold = folds(e)["repetition"]
    both = Explanation((*drift, *law), 0.0, 0.0, (BUMP, BUMP / 9), 0.0)
    assert held_out(e, both, "repetition", fold).after > 5e-6
    assert held_out(e, both, "repetition", fold, DRIFTS).after < 1e-6
    assert held_out(e, both, "repetition", fold, frozenset({"zero_shift"})).after > 5e-6
    assert reweighted_by_validation(found(e, both)).kept[both.words] > 0.99
    more = explained([0], "contact_seating", 0.0).parts
    three = replace(both, parts=(*both.parts, *more), sizes=(BUMP, BUMP / 9, BUMP / 9))
    assert reweighted_by_validation(found(e, three)).kept[three.words] < 0.01
    alone = replace(both, parts=law, sizes=(BUMP / 9,))
    assert reweighted_by_validation(found(e, alone)).kept[alone.words] < 0.01


def test_beyond_the_loads_of_other_repetitions_nobody_is_judged() -> None:
    """The last repetition goes twice as far, and bends there."""
    step = np.concatenate([np.repeat(np.arange(8), 4), *2 * [np.repeat(np.arange(8), 4)]])
    run = np.repeat(np.arange(3), 32)
    force = 20.0 * step * np.where(run == 2, 2.0, 1.0)
    u = 1e-5 * force + np.where(force > 145, 1e-4, 0.0)
    data = bench_data(force, u, step=step, run=run, repetition=run + 1)
    bench = make_bench(data)
    bench.add(bench.stacked(np.ones(bench.rows.n)))
    e = Engine(
        bench, base_columns(bench), bench.observed - prediction(bench), np.array([0.0, 1e-6])
    )
    held = held_out(e, Explanation((), 0.0, 0.0, (), 0.0), "repetition", folds(e)["repetition"])
    assert held.before < 1e-9


def test_effects_that_take_each_other_back_are_charged_and_springs_are_not() -> None:
    e = engine(np.full(REPETITIONS, BUMP))
    big = 10 * e.structural
    mine = explained([0], "joint_nonlinear_stiffness", 0.0).parts
    spring = explained([1], "joint_stiffness_error", 0.0).parts
    other = explained([0], "joint_yield", 0.0).parts

    def charged(parts: tuple[Part, ...], *sizes: float, linear: float = 0.0) -> float:
        each = np.array(sizes)
        return cancelling(e, parts, Sizes(each, each, 0.0, linear), each)

    assert charged(mine + other, e.structural, e.structural) == 0.0
    assert charged(mine + other, big, e.structural) > 50
    assert charged(mine + other + spring, e.structural, big, big) > 50
    # a bench's one spring hides little; an arm's may hide most of a single effect
    assert charged(mine + spring, big, big) > 50
    e.bench = replace(e.bench, data=replace(e.bench.data, arm=True))
    assert charged(mine + spring, big, big) == 0.0
    assert charged(mine + other, big, big) > 50
    # of two that are linear something must be left
    gain = explained([0], "force_scale", 0.0).parts
    assert charged(gain + spring, big, big, linear=0.4 * big) == 0.0
    assert charged(gain + spring, big, big, linear=0.1 * big) > 50


def test_a_drift_alone_need_not_foresee_what_another_run_brings() -> None:
    e = engine(np.full(REPETITIONS, BUMP))
    after = reweighted_by_validation(found(e, explained([1, 2, 3], "thermal_drift", 0.0)))
    assert after.kept[frozenset(["thermal_drift"])] == 1.0
    assert after.probabilities["thermal_drift"] > 0.8


def test_repetitions_that_no_setup_has_twice_are_no_fold() -> None:
    setup = bench_data(np.zeros(4), np.zeros(4)).setups[0]
    force = np.tile(np.repeat(20.0 * np.arange(8), 4), 2)
    run = np.repeat([0, 1], 32)
    data = bench_data(
        force,
        1e-5 * force,
        step=np.tile(np.repeat(np.arange(8), 4), 2),
        run=run,
        setup=run,
        repetition=run + 1,
        setups=(setup, replace(setup, direction="y")),
    )
    bench = make_bench(data)
    bench.add(bench.stacked(np.ones(bench.rows.n)))
    e = Engine(
        bench, base_columns(bench), bench.observed - prediction(bench), np.array([0.0, 1e-6])
    )
    assert "repetition" not in folds(e)
    assert "direction" in folds(e)


def test_one_repetition_is_judged_by_nothing() -> None:
    force = np.repeat(20.0 * np.arange(8), 4)
    data = bench_data(force, 1e-5 * force, step=np.repeat(np.arange(8), 4))
    bench = make_bench(data)
    bench.add(bench.stacked(np.ones(bench.rows.n)))
    e = Engine(
        bench, base_columns(bench), bench.observed - prediction(bench), np.array([0.0, 1e-6])
    )
    before = found(e, explained([0], "zero_shift", 0.0))
    assert reweighted_by_validation(before) is before


@pytest.mark.parametrize(("datum", "zeros"), [("repetition", True), ("setup", False)])
def test_a_datum_that_nobody_can_know_is_not_held_against_a_law(datum: str, zeros: bool) -> None:
    """The last run stands 50 um off: its own laser datum, or a run that was never read unloaded."""
    e = engine(np.zeros(REPETITIONS), datum, zeros)
    n = e.bench.rows.n
    e.target[:n] += np.where(e.bench.rows.repetition == 3, 5e-5, 0.0)
    nothing = Explanation((), 0.0, 0.0, (), 0.0)
    held = held_out(e, nothing, "repetition", folds(e)["repetition"])
    assert held.after < 2e-6


def test_before_is_the_simulation_as_given_whatever_datum_nobody_can_know() -> None:
    e = engine(np.full(REPETITIONS, BUMP), "repetition")
    law = explained([0], "joint_nonlinear_stiffness", 0.0)
    held, rows = held_out(e, law, "repetition", folds(e)["repetition"]), e.bench.rows
    judged = ~rows.zero & (rows.repetition > 1)
    gap, weight = (e.bench.response - stated_prediction(e))[judged], rows.weight[judged]
    given = np.sqrt(weight @ gap**2 / weight.sum())
    assert given > 1.2 * gap.std()
    assert held.before == pytest.approx(given, rel=0.01)
    assert held.own_datum
    assert not held_out(e, law, "block", np.arange(rows.n) // 4).own_datum


def test_a_drift_and_a_jump_of_the_datum_foresee_nothing_either() -> None:
    e = engine(np.full(REPETITIONS, BUMP))
    drift = explained([1, 2], "thermal_drift", 0.0)
    jump = explained([3], "zero_shift", 0.0)
    both = replace(drift, parts=drift.parts + jump.parts, sizes=(BUMP / 3, BUMP / 3))
    after = reweighted_by_validation(found(e, both))
    assert after.kept[both.words] == 1.0


@pytest.mark.parametrize(
    ("second", "needed"), [("joint_creep", False), ("joint_creep", True), ("thermal_drift", False)]
)
def test_one_of_two_that_foretells_better_speaks_for_both(second: str, needed: bool) -> None:
    """The larger effect of two is either half of what repeats, or goes one way in one run and back
    in the next. Of a drift, which nothing foretells, that is no reason to leave it out."""
    e = engine(np.full(REPETITIONS, BUMP))
    n = e.bench.rows.n
    other = e.bench.stacked(np.exp(-(((e.bench.load - 120) / 15) ** 2)))
    way = np.array([0, 1.0, 1, 1 if needed else -1])[e.bench.rows.repetition]
    e.bench.add(other)
    e.target[:n] += 2 * BUMP * way * other[:n]
    bump = explained([0], "joint_nonlinear_stiffness", -40.0)
    more = explained([4], second, -60.0)
    both = Explanation(more.parts + bump.parts, 0.0, 0.0, (2 * BUMP / 3, BUMP / 3), 0.0)
    after = reweighted_by_validation(found(e, both, bump, more))
    spoken = after.representatives.get(both.words)
    assert spoken is (None if needed or second == "thermal_drift" else bump)
    choice = chosen_of(after, "joint_nonlinear_stiffness" if spoken else second)
    assert choice.shown is (spoken or both)
    spoken_for = with_posterior(replace(after, representatives={both.words: bump}), {})
    for result, word in (
        (with_posterior(replace(after, representatives={}), {}), second),
        (spoken_for, "joint_nonlinear_stiffness"),
    ):
        assert result.probabilities[word] > 0.7


def test_what_another_one_speaks_for_speaks_for_none() -> None:
    e = engine(np.full(REPETITIONS, BUMP))
    bump = explained([0], "joint_nonlinear_stiffness", -40.0)
    drift = explained([1, 2], "thermal_drift", -40.0)
    both = Explanation(bump.parts + drift.parts, 0.0, 0.0, (BUMP / 3, BUMP / 9), 0.0)
    alone = found(e, both, bump, drift)
    spoken = replace(alone, representatives={bump.words: drift})
    assert reweighted_by_validation(alone).representatives.get(both.words) is bump
    assert both.words not in reweighted_by_validation(spoken).representatives


def test_a_drift_alone_speaks_for_nobody() -> None:
    """It foretells nothing, also where another effect foretells less than nothing."""
    e = engine(np.array([0.0, 3.0, -3.0]) * BUMP)
    drift = explained([1, 2], "thermal_drift", -40.0)
    bump = explained([0], "joint_nonlinear_stiffness", -60.0)
    both = Explanation(bump.parts + drift.parts, 0.0, 0.0, (BUMP / 3, BUMP / 9), 0.0)
    assert reweighted_by_validation(found(e, both, drift, bump)).representatives[both.words] is bump


@pytest.mark.parametrize(("bump_after", "speaks"), [(1.05, "bump"), (1.3, "creep"), (2.5, "creep")])
def test_of_two_that_foretell_alike_the_one_that_explains_more_speaks(
    monkeypatch: pytest.MonkeyPatch, bump_after: float, speaks: str
) -> None:
    e = engine(np.full(REPETITIONS, BUMP))
    one = {
        "bump": explained([0], "joint_nonlinear_stiffness", -40.0),
        "creep": explained([1], "joint_creep", -60.0),
    }
    parts = one["creep"].parts + one["bump"].parts
    both = Explanation(parts, 0.0, 0.0, (BUMP / 3, BUMP / 3), 0.0)
    after = {both.words: 2.0, one["bump"].words: bump_after, one["creep"].words: 1.0}
    monkeypatch.setattr(
        "identification.gap.judging.cross_validation.held_out",
        lambda _, x, *__: HeldOut("repetition", 3.0, after[x.words], (1.0, 1.0)),
    )
    told = _foretold(found(e, both, *one.values()), "repetition", np.zeros(e.bench.rows.n, int))
    assert told[both.words] is one[speaks]


@pytest.mark.parametrize(("height", "spells"), [(0.0, False), (3e-6, True)])
def test_readings_that_scatter_in_spells_are_explained_by_no_law(
    height: float, spells: bool
) -> None:
    """A sixth of the holds rings at twenty times the noise of the others."""
    rng = np.random.default_rng(12)
    step = np.tile(np.repeat(np.arange(12), 8), 3)
    run = np.repeat([0, 1, 2], 96)
    ringing = np.isin(step, [6, 7])
    u = 1e-5 * 20.0 * step + rng.normal(0, 1.5e-7, len(step))
    u += height * ringing * rng.standard_normal(len(step))
    data = bench_data(
        20.0 * step,
        u,
        step=step,
        run=run,
        repetition=run + 1,
        instruments=Instruments(0.1, 2e-7, 0.005, 0.003),
    )
    assert bursts(data) is spells
    result = diagnose_gap(data)
    p = result.probabilities
    assert any("scatter in spells" in note for note in result.notes) is spells
    assert (p["unknown"] > 0.5) is spells
    assert (p["none"] > 0.5) is not spells


def test_what_is_linear_counts_as_it_moves_and_not_by_what_springs_leave_of_it() -> None:
    """A slant of the load: the springs take all of it back, the joint readings show it."""
    e = engine(np.full(REPETITIONS, BUMP))
    lag = explained([0], "time_lag", 0.0).parts
    slant = explained([1], "load_misalignment", 0.0).parts
    drift = explained([1], "thermal_drift", 0.0).parts
    hidden = Sizes(np.array([1e-5, 0.0]), np.array([1e-5, 8e-6]), 0.0)
    assert minor_parts(e, lag + slant, hidden) == 0.0
    assert minor_parts(e, lag + drift, hidden) > 100
    # nor is a spring that is off below the noise where the rig runs on
    force = 20.0 * np.arange(200.0)
    data = bench_data(force, 1e-5 * force, step=np.full(200, -1))
    bench = make_bench(data)
    bench.add(bench.stacked(np.ones(bench.rows.n)))
    running = Engine(
        bench, base_columns(bench), bench.observed - prediction(bench), np.array([0.0, 1e-6])
    )
    spring = explained([0], "joint_stiffness_error", 0.0).parts
    assert below_noise(running, spring, Sizes(np.zeros(1), np.array([1e-4]), 0.0)) == 0.0
    assert below_noise(running, spring, Sizes(np.zeros(1), np.array([1e-9]), 0.0)) > 20
    beside = spring + drift  # a large one does not hide a small one
    assert (
        below_noise(running, beside, Sizes(np.array([0.0, 1e-9]), np.array([1e-4, 1e-9]), 0.0)) > 20
    )


@pytest.mark.parametrize(("cycles", "swings"), [(1.0, False), (4.0, True)])
def test_a_drift_that_comes_and_goes_is_no_drift(cycles: float, swings: bool) -> None:
    wave = 1e-5 * np.sin(2 * np.pi * cycles * np.arange(640) / 640)
    assert believed(wave, "thermal_drift") is not swings


@pytest.mark.parametrize(
    ("word", "size", "clock", "kept"),
    [
        ("thermal_drift", 5e-4, True, True),
        ("thermal_drift", 1e-3, True, False),
        ("thermal_drift", 1e-3, False, True),
        ("force_drift", 1e-3, True, True),
    ],
)
def test_nothing_warms_up_in_a_moment(word: str, size: float, clock: bool, kept: bool) -> None:
    """By 0.3 and 0.6 mm a minute; without a clock nobody knows; an amplifier may."""
    wave = size * np.sin(2 * np.pi * np.arange(640) / 640)
    assert believed(wave, word, clock) is kept


def believed(wave: Array, word: str, clock: bool = True) -> bool:
    """Whether a drift of such a wave (n,) m over 640 s keeps its weight, alone and beside a jump:
    where it only fills up what others leave as well."""
    n, pieces = 640, 32
    force = np.tile(np.repeat([0.0, 40.0, 80.0, 40.0], 4), 40)
    step, run = np.arange(n) // 4, np.arange(n) // 16
    data = bench_data(
        force,
        1e-5 * force + wave,
        step=step,
        run=run,
        repetition=run + 1,
        branch=np.where(force > 0, 1, 0),
        session=np.arange(float(n)),
    )
    bench = make_bench(replace(data, arm=True))
    bench = replace(bench, rows=replace(bench.rows, clock=clock))
    hats = free_path(bench, pieces)
    columns = [bench.add(bench.stacked(hats[:, k])) for k in range(pieces)]
    target = bench.observed - prediction(bench)
    e = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6]))
    size = float(np.ptp(wave))
    v = free_variant(word, "path", FreePath(pieces), columns, (size,), ("",))
    law = Explanation((Part(v, size),), 0.0, 0.0, (0.7 * size,), 0.0)
    jump = explained(columns[:1], "zero_shift", 0.0).parts
    beside = Explanation((*jump, *law.parts), 0.0, 0.0, (0.9 * size, 0.7 * size), 0.0)
    whole = replace(found(e, law, beside), unknown=-800.0)
    kept = {x.words: x.adequate for x in reweighted_by_residuals(whole).explanations if x.parts}
    assert kept[law.words] is kept[beside.words]
    return bool(kept[law.words])


def test_what_moves_the_target_by_nothing_is_a_trifle_whoever_shows_it() -> None:
    """Of levels at rest: a load askew that only the dynamometer feels; springs that hide it."""
    bench, variants, _ = of("load_misalignment", "rich")
    engine, noise = quick_engine(bench), bench.noise.stated
    part = (Part(variants[0], 1.0),)
    assert below_noise(engine, part, Sizes(np.zeros(1), np.array([0.05 * noise]), 0.0)) > 20
    assert below_noise(engine, part, Sizes(np.zeros(1), np.array([0.5 * noise]), 0.0)) == 0.0


def test_a_path_that_may_take_any_way_is_no_effect_below_the_noise_of_a_sample() -> None:
    """Of a running recording; a law may be, down to half of it, at 20 nats a factor e."""
    bench, variants, _ = of("thermal_drift", "bench imposed")
    engine, noise = quick_engine(bench), bench.noise.stated
    free = next(v for v in variants if v.info["path"] == "free")
    line = next(v for v in variants if v.info["path"] != "free")

    def charged(v: Variant, size: float) -> float:
        one = np.array([size * noise])
        return below_noise(engine, (Part(v, 1.0),), Sizes(one, one, 0.0))

    assert charged(line, 0.8) == pytest.approx(20 * np.log(1 / 0.8))
    assert charged(free, 0.8) == pytest.approx((20 + 60) * np.log(1 / 0.8))
    assert charged(line, 0.25) == pytest.approx(20 * np.log(4) + 60 * np.log(2))
    assert charged(free, 1.1) == charged(line, 1.1) == 0.0


def test_of_a_withheld_run_the_datum_and_the_forces_across_stay_in() -> None:
    """Its motion and its joint readings are withheld, but for the rows without load."""
    data = arm_data()
    assert data.q is not None
    bench = make_bench(replace(data, tangential=np.zeros((len(data.force), 2))))
    e = Engine(bench, base_columns(bench), bench.observed, np.array([0.0, 1e-6]))
    out = bench.rows.run == bench.rows.run.max()
    keep = _stacked_keep(e, out)
    layout, first = bench.layout, np.flatnonzero(bench.rows.hold_starts)
    np.testing.assert_array_equal(keep[: bench.rows.n], ~out | bench.rows.zero)
    q = keep[layout.q].reshape(-1, len(first))
    np.testing.assert_array_equal(q, np.tile((~out | bench.rows.zero)[first], (len(q), 1)))
    assert not q.all()
    assert keep[layout.tangential].all()
    assert layout.tangential.stop > layout.tangential.start


@pytest.mark.parametrize(
    ("eta", "weight", "creeps"),
    [
        (0.0, -10.0, True),
        (1e-4, -10.0, False),
    ],
)
def test_creep_that_leaves_nothing_is_not_something_that_settles(
    eta: float, weight: float, creeps: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever a shape of its own in every direction brings more."""
    e = engine(np.zeros(REPETITIONS))
    settles = unmodelled_shapes.GapPattern(unmodelled_shapes.SETTLES, None, 0.0)
    monkeypatch.setattr(unmodelled_shapes, "unmodelled_variants", lambda *_: [None])
    monkeypatch.setattr(unmodelled_shapes, "likenesses", lambda *_: (settles,))
    creep = replace(explained([0], "joint_creep", weight), eta=eta)
    said = unmodelled_shapes.with_unmodelled_evidence(found(e, creep))
    assert (said.looks_like is None) is creeps
    assert (said.unknown < -100) is creeps


def test_what_is_left_beyond_the_noise_is_what_stands_off_in_every_run() -> None:
    """As much as is stated, here and there from hold to hold, under noise of rows, of holds and,
    as large, of runs, whose datum is fitted."""
    bench = engine(np.zeros(REPETITIONS)).bench
    bench = replace(bench, noise=replace(bench.noise, run=bench.noise.stated))
    start, rows, noise = quick_engine(bench), bench.rows, bench.noise
    stands_off = noise.stated * np.where(rows.hold % 2 == 0, 1.0, -1.0)
    rng, squares = np.random.default_rng(5), []
    for _ in range(200):
        row, hold, run = rng.standard_normal((3, rows.n))
        off = noise.response * row + (noise.hold * hold)[rows.edges][rows.hold]
        start.target = np.zeros(bench.layout.size)
        start.target[: rows.n] = stands_off + off + noise.run * run[rows.run]
        squares.append(
            excess_response_rms(start, fit(start, Explanation((), 0.0, 0.0, (), 0.0))) ** 2
        )
    assert np.mean(squares) ** 0.5 == pytest.approx(noise.stated, rel=0.15)
