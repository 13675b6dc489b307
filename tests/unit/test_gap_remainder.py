"""What an explanation leaves: a known bump is found in size and place, noise is not."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.answer.remainder import Remainder, _excess, _posterior, branches, remainder
from identification.gap.evidence.alike import alike
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from tests.unit.test_gap_operators import bench_data

STEPS, REPETITIONS, SAMPLES = 10, 4, 4
FORCE = 20.0  # N a step
BUMP = 2e-5  # m


def bump(force: np.ndarray) -> np.ndarray:
    """Bends at a middle force, which no spring can follow."""
    return np.asarray(BUMP * np.exp(-(((force - 120) / 30) ** 2)))


def left(
    extra: np.ndarray | None = None, *, bumped: bool = True, scatter: np.ndarray | float = 0.0
) -> tuple[Engine, Fit, Remainder]:
    """Engine, fit of springs alone, and remainder; extra (runs,): slope m/N of each run; scatter
    (samples,): displacement added, m."""
    rng = np.random.default_rng(4)
    step = np.tile(np.repeat(np.arange(1, STEPS + 1), SAMPLES), REPETITIONS)
    repetition = np.repeat(np.arange(REPETITIONS), STEPS * SAMPLES)
    force = FORCE * step
    u = 1e-5 * force + rng.normal(0, 1e-6, len(step)) + scatter
    if bumped:
        u = u + bump(force)
    if extra is not None:
        u = u + extra[repetition] * force
    data = bench_data(
        force + rng.normal(0, 0.02, len(step)),
        u,
        step=step,
        repetition=repetition + 1,
        run=repetition,
    )
    bench = make_bench(data)
    target = bench.observed - prediction(bench)
    bench.add(bench.stacked(np.ones(bench.rows.n)))
    engine = Engine(bench, base_columns(bench), target, np.array([0.0]))
    fitted = fit(engine, Explanation((), 0.0, 0.0, (), 0.0))
    return engine, fitted, remainder(engine, fitted)


def test_a_bump_is_found_in_size_and_place() -> None:
    _, _, m = left()
    assert m.clear
    assert m.largest is not None
    # springs and datum take the bump's line and mean; what is left of it is the truth here
    line = np.polyfit(m.load, bump(m.load), 1)
    truth = bump(m.load) - np.polyval(line, m.load)
    assert m.mean == pytest.approx(truth, abs=2e-6)
    assert m.rms == pytest.approx(np.sqrt(np.mean(truth**2)), rel=0.1)
    assert m.ci95[0] < m.rms < m.ci95[1]
    assert m.largest.force == pytest.approx(120, abs=FORCE + 1)
    assert (m.largest.pose, m.largest.direction, m.visits) == ("", "x", REPETITIONS)


def test_noise_alone_leaves_nothing_clear() -> None:
    _, _, m = left(bumped=False)
    assert not m.clear
    assert m.ci95[1] < 1e-6
    assert m.unrepeated_rms < 3e-7  # the noise of a hold is 4.3e-7


def test_what_differs_from_run_to_run_is_no_repeatable_remainder() -> None:
    slopes = 1e-7 * np.array([-1.5, -0.5, 0.5, 1.5])
    _, _, m = left(slopes, bumped=False)
    assert m.unrepeated_rms > 3e-6
    assert m.rms < 0.5 * m.unrepeated_rms


def test_scatter_of_holds_beyond_the_noise_is_no_structure() -> None:
    rng = np.random.default_rng(8)
    scatter = np.repeat(rng.normal(0, 1e-5, STEPS * REPETITIONS), SAMPLES)
    _, _, m = left(bumped=False, scatter=scatter)
    assert not m.clear
    assert m.unrepeated_rms == pytest.approx(1e-5, rel=0.3)


def test_what_repeats_at_one_level_alone_is_found_there() -> None:
    """Beside runs that differ by more than their noise; nothing of it is said of other levels."""
    corner = np.where(np.tile(np.repeat(np.arange(STEPS), SAMPLES), REPETITIONS) == 6, 6e-5, 0.0)
    slopes = 1e-7 * np.array([-1.5, -0.5, 0.5, 1.5])
    _, _, m = left(slopes, bumped=False, scatter=corner)
    assert m.largest is not None
    assert m.largest.force == pytest.approx(7 * FORCE, abs=1)
    assert m.largest.mean == pytest.approx(m.residual[6], rel=0.1)
    assert np.delete(m.mean, 6) == pytest.approx(0, abs=1e-6)


def test_what_visits_differ_by_does_not_grow_with_the_noise_of_their_level() -> None:
    rng = np.random.default_rng(4)
    level = np.repeat(np.arange(40), 4)
    variance = np.where(level < 20, 1e-14, 1e-9)
    value = level * 1e-4 + rng.normal(0, np.sqrt(variance + 1e-10))
    assert _excess(value, variance, level) == pytest.approx(1e-10, rel=0.3)
    assert _excess(level * 1e-4, variance, level) == 0.0


def test_the_posterior_is_that_of_a_dense_gaussian() -> None:
    """With the size given, mean and variance by the textbook's formulae."""

    load = np.linspace(0, 100, 6)
    zero = np.zeros(6, dtype=np.int64)
    C = alike(zero, zero, load, 100.0)
    assert C[0, 0] == pytest.approx(1)
    assert C[0, 1] == pytest.approx(np.exp(-0.2 / 0.25))
    two = alike(zero, np.array([0, 0, 0, 1, 1, 1]), load, 100.0)
    assert two[2, 3] == pytest.approx(0.5 * C[2, 3])
    y, variance = np.array([3.0, 2, 1, -1, -2, -3]), np.full(6, 1e-4)
    mean, sd, draws = _posterior(C, y, variance)
    # noise is nothing beside y, so that whatever the size, g is y up to that noise
    assert mean == pytest.approx(y, abs=0.01)
    assert np.all(sd < 0.0101)
    assert draws.mean(axis=0) == pytest.approx(mean, abs=0.002)
    assert draws.std(axis=0) == pytest.approx(sd, rel=0.1)


def test_no_remainder_is_half_the_prior() -> None:

    _, _, draws = _posterior(np.eye(4), np.zeros(4), np.ones(4))
    assert np.mean(np.all(draws == 0, axis=1)) > 0.5


def test_no_load_and_one_visit_are_no_obstacle() -> None:
    n = 6
    for force in (np.zeros(n), np.linspace(1, 60, n)):
        data = bench_data(force, np.zeros(n))
        bench = make_bench(data)
        bench.add(bench.stacked(np.ones(n)))
        target = bench.observed - prediction(bench)
        engine = Engine(bench, base_columns(bench), target, np.array([0.0]))
        m = remainder(engine, fit(engine, Explanation((), 0.0, 0.0, (), 0.0)))
        assert m.visits == 1
        assert m.unrepeated_rms == 0
        assert np.isfinite([m.rms, *m.ci95]).all()


def test_branches_of_a_running_recording_ignore_small_returns() -> None:
    load = np.concatenate([np.linspace(0, 100, 100), np.linspace(99, 0, 100)])
    noisy = load + np.where(np.arange(200) % 2, 0.9, -0.9)  # falls by 0.8 at every other sample
    data = bench_data(noisy, noisy * 1e-5, step=np.full(200, -1), imposed="force")
    bench: Bench = make_bench(data)
    assert bench.rows.continuous
    found = branches(bench)
    assert np.flatnonzero(np.diff(found)).tolist() == pytest.approx([100], abs=5)
    assert set(found[:95]) == {1}
    assert set(found[110:]) == {2}
