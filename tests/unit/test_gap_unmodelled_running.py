"""Troubles of running recordings that no word names: jerks, damage, softening."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf

from identification.arrays import Array
from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.explanations.priors import LOG_UNKNOWN, prior_of
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.search.unmodelled_running import _just_turned, jump_rows, troubles_of
from identification.gap.words import DAMAGE, JERKS, SOFTENING, UNMODELLED, WANDERS, WORDS
from rig.diagnosis.diagnose_text import LOOKS_LIKE, looks_like
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running, triangle

N = 900
NOISE_N = 0.1
# Strokes from one side, three of each height: what lasts shows against what comes again.
STROKE = 1e-3 * np.repeat([0.4, 0.7, 1.0], N // 3) * triangle(N, 9)
LARGEST = np.maximum.accumulate(STROKE)


def pulled(force: Array, seed: int = 1) -> GapData:
    """A specimen whose stroke is driven; N of force answer."""
    noise = np.random.default_rng(seed).normal(0, NOISE_N, N)
    return running(force + noise, STROKE, imposed="displacement")


def slips() -> Array:
    """A grip lets go of the specimen at three moments, wherever the stroke is."""
    at = np.arange(N)
    return SPRING * (STROKE - 4e-5 * (at > 210) - 7e-5 * (at > 455) - 3e-5 * (at > 770))


def breaking_fibres() -> Array:
    """Fibres of Weibull strength, of which those that have broken no longer carry (Daniels)."""
    return SPRING * STROKE * np.exp(-((LARGEST / 1.6e-3) ** 3))


def rubber() -> Array:
    """Ogden and Roxburgh 1999: softer by an error function of the work below the largest so far."""
    below = LARGEST**2 - STROKE**2
    return SPRING * STROKE * (1 - 0.35 * erf(below / (0.3e-3 * (1e-3 + LARGEST))))


def looked_for(data: GapData) -> tuple[Bench, list[int]]:
    bench = make_bench(data)
    return bench, jump_rows(bench, base_columns(bench), bench.observed - prediction(bench), 3)


def test_rows_of_jumps_are_found_one_after_the_other() -> None:
    bench, rows = looked_for(pulled(slips()))
    first = np.searchsorted(bench.rows.time, np.array([211, 456, 771]) - 0.5)
    assert sorted(rows) == pytest.approx(first.tolist(), abs=1)
    assert abs(rows[0] - first[1]) <= 1  # the largest


def test_columns_that_say_the_same_twice_move_no_jump() -> None:
    """What rounding leaves of the second is no direction, or the processor would choose it."""
    bench = make_bench(running(breaking_fibres(), STROKE, imposed="displacement"))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    smooth = base.columns * np.linspace(0.3, 3.0, base.columns.shape[1])
    twice = replace(base, columns=np.column_stack([base.columns, smooth]))
    assert jump_rows(bench, twice, target, 12) == jump_rows(bench, base, target, 12)


def test_where_a_stroke_turns_the_force_of_friction_jumps_and_nothing_jerked() -> None:
    sense = np.where(np.arange(N) % 100 < 50, 1.0, -1.0)  # of each stroke of 50 readings
    bench, rows = looked_for(pulled(SPRING * (STROKE + 4e-5 * sense)))
    since = bench.rows.time[rows] % 50
    assert since.min() > 2
    assert since.max() < 48
    assert not _just_turned(make_bench(replace(bench.data, imposed="force"))).any()


def test_no_jump_is_looked_for_where_a_run_begins() -> None:
    data = replace(pulled(slips()), run=(np.arange(N) > 455).astype(int))
    bench, rows = looked_for(data)
    assert not np.any(bench.rows.starts[rows])


@pytest.mark.parametrize(
    ("force", "kind"), [(slips, "jerks"), (breaking_fibres, "damage"), (rubber, "softening")]
)
def test_what_no_word_names_is_unknown_and_told(force: object, kind: str) -> None:
    assert callable(force)
    found = explained(pulled(force()))
    assert found.verdict == "unknown"
    assert found.probabilities["unknown"] > 0.7
    assert found.looks_like is not None
    assert found.looks_like.kind == kind
    assert kind in LOOKS_LIKE
    assert found.effects == ()


@pytest.mark.parametrize(("loose", "until"), [(5e-4, 0.01), (1e-3, 0.004)])
def test_what_hangs_loose_bears_at_the_same_load_in_every_pass_and_is_no_jerk(
    loose: float, until: float
) -> None:
    """Within a few readings at every beginning and end, pulled by a weak spring."""
    stroke = 1e-3 * triangle(N, 3)
    force, noise = SPRING * stroke, np.random.default_rng(2)
    way = stroke + loose * np.minimum(force / (until * force.max()), 1.0)
    read = force + noise.normal(0, NOISE_N, N)
    data = running(read, way + noise.normal(0, 1e-7, N), imposed="force")
    assert explained(data).verdict == "contact_seating"


def sticking(stiffness: float, limit: float) -> Array:
    """Spring and Coulomb slider in series."""
    out, held = np.empty(N), 0.0
    for i, step in enumerate(np.diff(STROKE, prepend=0.0)):
        held = float(np.clip(held + stiffness * step, -limit, limit))
        out[i] = held
    return out


@pytest.mark.parametrize(
    ("force", "word"),
    [
        (0.6 * SPRING * STROKE + sticking(0.4 * SPRING, 6.0), "joint_hysteresis"),
        pytest.param(
            sticking(SPRING, 45.0) + 0.1 * SPRING * STROKE, "joint_yield", marks=pytest.mark.slow
        ),
        (SPRING * STROKE * (1 + 400 * STROKE), "joint_nonlinear_stiffness"),
    ],
)
def test_what_a_word_names_is_not_taken_for_them(force: Array, word: str) -> None:
    found = explained(pulled(force))
    assert found.verdict == word
    assert found.looks_like is None
    assert {e.name for e in found.effects} <= set(WORDS)


def named(found: GapResult) -> set[str]:
    return set().union(*(e.words for e in found.found.explanations))


def test_a_word_beside_which_a_smaller_one_stands_stays_the_main_cause() -> None:
    """A curved spring whose grip slipped once, by less."""
    curve = SPRING * STROKE * (1 + 400 * STROKE) - 2.0 * (np.arange(N) > 600)
    found = explained(pulled(curve))
    assert found.verdict == "joint_nonlinear_stiffness"
    assert {JERKS, "joint_nonlinear_stiffness"} in [e.words for e in found.found.unmodelled]
    assert not named(found) & set(UNMODELLED)
    assert {e.name for e in found.effects} <= set(WORDS)


def test_only_recordings_that_run_on_without_an_arm_are_looked_at() -> None:
    def of(data: GapData) -> list[str]:
        bench = make_bench(data)
        target = bench.observed - prediction(bench)
        return sorted({v.word for v in troubles_of(bench, base_columns(bench), target)})

    assert of(pulled(slips())) == sorted(UNMODELLED)
    assert of(arm_data()) == []
    levels = np.repeat(np.arange(10.0), 5)
    assert of(bench_data(levels, levels / SPRING, step=np.repeat(np.arange(10), 5))) == []
    still = np.random.default_rng(2).normal(0, 0.1, N)
    assert of(running(still, np.zeros(N), imposed="force")) == []


@pytest.mark.parametrize(("strokes", "told"), [(9, True), (2, False)])
def test_a_stiffness_that_goes_its_own_way_in_time_is_nobody_s_word(
    strokes: int, told: bool
) -> None:
    """A pressure that nobody holds; of few strokes nobody knows whether it is load or time."""
    stroke = 1e-3 * triangle(N, strokes)
    force = SPRING * stroke * (1 + 0.2 * np.sin(np.linspace(0, 7, N)))
    noise = np.random.default_rng(8).normal(0, NOISE_N, N)
    data = running(force + noise, stroke, imposed="displacement")
    bench = make_bench(data)
    target = bench.observed - prediction(bench)
    assert (WANDERS in {v.word for v in troubles_of(bench, base_columns(bench), target)}) is told
    if told:
        found = explained(data)
        assert found.verdict == "unknown"
        assert found.looks_like is not None
        assert "its own way in time" in looks_like(found.looks_like, arm=False)


def test_another_stiffness_in_every_run_is_nobody_s_word() -> None:
    """A clamp that is set anew: every run is a straight line, and no path of a drift is needed."""
    run = np.arange(N) // (N // 9)
    stroke = 1e-3 * triangle(N, 9)
    softer = np.array([0.0, 0.2, -0.1, 0.3, -0.2, 0.1, -0.25, 0.15, 0.05])
    force = SPRING * stroke * (1 + softer[run])
    noise = np.random.default_rng(8).normal(0, NOISE_N, N)
    data = running(force + noise, stroke, imposed="displacement", run=run, repetition=run + 1)
    found = explained(data)
    assert found.verdict == "unknown"
    assert found.probabilities["unknown"] > 0.7
    assert found.looks_like is not None
    assert "a stiffness of its own" in looks_like(found.looks_like, arm=False)


@pytest.mark.parametrize(("runs", "tops", "told"), [(3, 1, True), (2, 1, False), (3, 3, False)])
def test_a_stiffness_of_every_run_takes_three_runs_through_the_same_loads(
    runs: int, tops: int, told: bool
) -> None:
    """Of runs that follow each other from load to load, what differs may as well be a curve."""
    run = np.minimum(np.arange(N) // (N // runs), runs - 1)
    within = np.linspace(0, runs, N, endpoint=False) % 1.0
    stroke = 1e-3 * (run + within) if tops > 1 else 1e-3 * triangle(N, runs)
    data = running(SPRING * stroke, stroke, imposed="displacement", run=run, repetition=run + 1)
    bench = make_bench(data)
    target = bench.observed - prediction(bench)
    found = {v.label for v in troubles_of(bench, base_columns(bench), target)}
    assert ("each run" in found) is told


@pytest.mark.parametrize("stays", [0.0, 0.6])
def test_what_stays_when_the_load_is_gone_does_not_only_soften(stays: float) -> None:
    """Rubber comes back; under a tip most of the way is left."""
    left = stays * np.maximum.accumulate(STROKE)
    force = SPRING * np.maximum(STROKE - left, 0.0)
    bench = make_bench(
        running(
            np.append(force[:-20], np.zeros(20)),
            np.append(STROKE[:-20], np.full(20, left[-1])),
            imposed="displacement",
        )
    )
    target = bench.observed - prediction(bench)
    found = {v.word for v in troubles_of(bench, base_columns(bench), target)}
    assert (SOFTENING in found) is (stays == 0.0)
    assert DAMAGE in found


def test_half_of_what_is_unknown_has_these_shapes() -> None:
    each = [np.exp(prior_of(frozenset([kind]))) for kind in UNMODELLED]
    assert sum(each) == pytest.approx(0.5 * np.exp(LOG_UNKNOWN))
    pair = prior_of(frozenset([JERKS, "force_drift"])) - prior_of(frozenset([JERKS]))
    assert np.exp(pair) == pytest.approx(0.05 / len(WORDS))
