"""Loads that act askew on rigs without an arm: only the force across tells of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.forms import law_of, rows_of
from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

STEPS, RUNS, HOLD = 9, 3, 6
ACROSS = 0.4  # compliance across over that along


def pressed(
    tangent: float, turns: bool = True, bends: float = 0.0, gives: float = ACROSS, seed: int = 4
) -> GapData:
    """Steps up and down, three times, with force across of a tangent at the top that comes as the
    square of the load where it turns, and gives way; bends: of a curve of its own, no slant."""
    rng = np.random.default_rng(seed)
    levels = np.concatenate([np.arange(STEPS), np.arange(STEPS)[-2::-1]])
    load = np.tile(np.repeat(levels, HOLD), RUNS) * 25.0
    n, top = len(load), 25.0 * (STEPS - 1)
    across = tangent * (load**2 / top if turns else load)
    step = np.tile(np.repeat(levels, HOLD), RUNS)
    branches = np.where(levels == 0, 0, np.where(np.arange(len(levels)) < STEPS, 1, 2))
    branch = np.tile(np.repeat(branches, HOLD), RUNS)
    run = np.repeat(np.arange(RUNS), n // RUNS)
    moved = 1e-5 * (load + gives * across) + bends * 1e-5 * load**2 / top
    return bench_data(
        load + rng.normal(0, 0.1, n),
        moved + rng.normal(0, 1e-6, n),
        step=step,
        branch=branch,
        run=run,
        repetition=run + 1,
        session=np.arange(n, dtype=float),
        imposed="force",
        tangential=np.column_stack([across, 0.3 * across]) + rng.normal(0, 0.1, (n, 2)),
    )


@cache
def turned() -> GapResult:
    return explained(pressed(0.15))


def test_a_slant_that_turns_is_seen_by_the_force_across() -> None:
    found = turned()
    assert found.verdict == "load_misalignment"
    tangents = [found.effects[0].parameters[f"tangent_x_{k}"].value for k in (1, 2)]
    assert np.abs(tangents) == pytest.approx([0.15, 0.045], rel=0.1)
    assert found.after < 1.2 * found.noise


def test_a_curve_is_no_slant_where_nothing_acts_across() -> None:
    """Cross-talk shows across; what is given goes with what is read there."""
    assert explained(pressed(0.004, turns=False, bends=0.06)).verdict == (
        "joint_nonlinear_stiffness"
    )


@pytest.mark.parametrize(("tangent", "verdict"), [(0.05, "load_misalignment"), (0.01, "none")])
def test_a_block_that_gives_nothing_across_shows_a_slant_by_its_force(
    tangent: float, verdict: str
) -> None:
    """Beyond what dynamometers mix up; nothing moves by it, as is said."""
    found = explained(pressed(tangent, turns=False, gives=0.0))
    assert found.verdict == verdict
    said = any("the displacement does not move by it" in n for n in found.notes)
    assert said is (verdict == "load_misalignment")
    assert not any("acts askew" in n for n in turned().notes)


def test_a_hook_that_is_hung_anew_for_every_run_moves_the_target_as_it_pulls_across() -> None:
    """Other tangents in each run; what is given along goes with what was read across, another share
    of it along either tangent."""
    rng, straight = np.random.default_rng(7), pressed(0.0, turns=False)
    across = np.array([[0.06, 0.02], [0.25, -0.12], [0.12, 0.2]])[straight.run]
    across = across * straight.force[:, None]
    data = replace(
        straight,
        displacement=straight.displacement + 1e-5 * across @ np.array([0.4, -0.2]),
        tangential=across + rng.normal(0, 0.1, across.shape),
    )
    found = explained(data)
    assert found.verdict == "load_misalignment"
    assert found.after < 1.2 * found.noise
    bent = 3e-9 * straight.force**2  # what else there is has to be foretold
    assert explained(replace(data, displacement=data.displacement + bent)).verdict != (
        "load_misalignment"
    )
    bench = make_bench(data)
    hung = next(v for v in library(bench, ["load_misalignment"]) if v.label == "each run")
    law, units = law_of(bench, hung)
    columns = np.column_stack([bench.columns[c] for c in hung.columns])
    np.testing.assert_allclose(rows_of(bench, hung.word, law) * units, columns, atol=1e-15)
    plain = make_bench(replace(data, tangential=None))  # of another session nothing is known
    given = [k for k, t in enumerate(law.terms) if t.coefficient == "gives"]
    assert len(given) == 2
    assert not np.any(rows_of(plain, hung.word, law)[:, given])


@pytest.mark.slow
def test_without_components_nobody_speaks_of_a_slant() -> None:
    mute = replace(pressed(0.15), tangential=None)
    assert library(make_bench(mute), ["load_misalignment"]) == []
    assert explained(mute).verdict != "load_misalignment"


def test_its_law_makes_the_same_columns() -> None:
    bench = make_bench(pressed(0.15))
    every = library(bench, ["load_misalignment"])
    assert {v.label for v in every} >= {"direction x", "direction x, turning", "each run"}
    for v in every:
        law, unit = law_of(bench, v)
        columns: Array = np.column_stack([bench.columns[c] for c in v.columns])
        np.testing.assert_allclose(
            rows_of(bench, v.word, law) * unit, columns, atol=1e-9 * np.abs(columns).max()
        )
