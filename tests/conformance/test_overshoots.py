"""A hand that turns the screw too far and back, while nothing is read: what remembers shows it."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pandas as pd
import pytest

from identification.arrays import Flags
from identification.gap.answer.result import GapResult
from identification.gap.judging.heldout import ALWAYS_IN, folds, held_out, stated_prediction
from identification.gap.search.overshoot_paths import Overshoots, Paths
from identification.gap.search.overshoots import brought_to
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import (
    DESIGNS,
    TOP_N,
    TRUE,
    Array,
    Design,
    Law,
    imported,
    levers,
    meta,
    noisy,
)
from tests.explained import explained

JOINT = 1
STRENGTHS_NM, SHARES = (3.0, 9.0, 25.0), (0.1, 0.1, 0.1)
TOO_FAR, EVERY = 0.1, 0.25  # of the largest load; share of the holds


def overshoots(rows: pd.DataFrame, chance: float) -> Array:
    """(n,) N by which the load went beyond a hold, at its first row: back to none at most."""
    rng, force = np.random.default_rng(11), rows["force_N"].to_numpy(float)
    change = np.diff(force, prepend=0.0)
    new = (change != 0) & (force > 0) & (rows["step"] > 0).to_numpy()
    new &= np.diff(rows["time_s"], prepend=0.0) > 0  # not after the rest between two runs
    top = np.array([TOP_N[d] for d in rows["direction"]])
    further = np.sign(change) * TOO_FAR * top
    return np.where(new & (rng.random(len(rows)) < chance), np.maximum(further, -force), 0.0)


def slipped(rows: pd.DataFrame, lever: Array, chance: float) -> tuple[Array, Array]:
    """Elements that slip at a strength each and spring back (Prandtl 1928), element by element and
    load by load, and what the joint gives way by them."""
    force, further = rows["force_N"].to_numpy(float), overshoots(rows, chance)
    out = np.zeros((len(rows), 6))
    for strength, share in zip(STRENGTHS_NM, SHARES, strict=True):
        carried = slip = 0.0
        for i, arm in enumerate(lever[:, JOINT]):
            for load in ([arm * (force[i] + further[i])] if further[i] else []) + [arm * force[i]]:
                carried = float(np.clip(load - slip, -strength, strength))
                slip = load - carried
            out[i, JOINT] += share * slip / TRUE[JOINT]
    return np.zeros(len(rows)), out


def too_late(rows: pd.DataFrame, lever: Array, chance: float) -> tuple[Array, Array]:
    """A laser that is late: in the first reading of a hold the hand seems to go on, and where it
    went too far it seems to go back."""
    force, further = rows["force_N"].to_numpy(float), overshoots(rows, chance)
    change = np.where(np.diff(rows["time_s"], prepend=0.0) > 0, np.diff(force, prepend=0.0), 0.0)
    behind = np.where(further != 0, further, -change) * 0.3
    return np.sum(lever**2 / TRUE, axis=1) * behind, np.zeros((len(rows), 6))


def pushed_on(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """A joint that gives way just below the largest load, and stays there; in the second
    repetition the hand goes beyond that load."""
    force, joint = rows["force_N"].to_numpy(float), int(np.abs(lever).sum(axis=0).argmax())
    top = (rows["branch"] == "loading") & (rows["step"] == TWICE.steps)
    first = top & (np.diff(rows["time_s"], prepend=0.0) > 1.5)
    further = np.where(first, np.where(rows["repetition"] == 2, FURTHER, 0.0), 0.0)
    load, out = lever[:, joint] * force, np.zeros((len(rows), 6))
    threshold, slip = 0.8 * np.abs(load).max(), 0.0
    for i, x in enumerate(load):
        for at in ([x * (1 + further[i])] if further[i] else []) + [x]:
            slip = float(np.clip(slip, at - threshold, at + threshold))
        out[i, joint] = 0.4 * slip / TRUE[joint]
    return np.zeros(len(rows)), out


FURTHER = 0.3  # of the load


def scattering(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """Beside that friction every level stands off by chance, which no hand does."""
    hold = (rows["force_N"].diff().fillna(1.0) != 0).cumsum().to_numpy()
    off = np.random.default_rng(3).normal(0, 12e-6, hold.max() + 1)
    return off[hold] * (rows["step"] > 0), slipped(rows, lever, 0.0)[1]


TWICE = Design(repetitions=2, readings=False)


@cache
def diagnosed(law: Law, design: Design = DESIGNS["medium"]) -> GapResult:
    return explained(gap_data(imported(noisy(design, law), meta(design))))


FRICTION, CALM = partial(slipped, chance=EVERY), partial(slipped, chance=0.0)
LATE = partial(too_late, chance=EVERY)


def told(found: GapResult) -> bool:
    return any("gone too far, and back" in note for note in found.notes)


@pytest.mark.slow
def test_friction_is_found_and_so_is_where_the_hand_went_too_far() -> None:
    found = diagnosed(FRICTION)
    assert found.verdict == "joint_hysteresis"
    assert found.after < 1.2 * found.noise
    rows, table = found.bench.rows, noisy(DESIGNS["medium"])
    table["force_N"] = np.round(table["force_N"])  # as it was meant
    first = np.cumsum(rows.hold_weight[rows.edges]).astype(int) - DESIGNS["medium"].hold
    seen = rows.overshoot[rows.edges] != 0
    true = overshoots(table, EVERY)[first] != 0
    assert not np.any(seen & ~true)
    lever = levers(table)
    far, calm = (slipped(table, lever, c)[1][:, JOINT] for c in (EVERY, 0.0))
    shows = true & (np.abs((lever[:, JOINT] * (far - calm))[first]) > 5e-6)
    assert np.sum(seen & shows) > 0.8 * np.sum(shows) > 0
    assert told(found)
    top = np.array([TOP_N[s.direction] for s in found.bench.data.setups])[rows.setup]
    size = np.abs(rows.overshoot * found.bench.load / top)[rows.overshoot != 0]
    assert np.median(size) == pytest.approx(TOO_FAR, rel=0.2)
    assert np.isclose(size, TOO_FAR, rtol=0.1).any()  # between the sizes that are looked at first


def test_runs_that_do_not_see_each_other_are_looked_at_at_once() -> None:
    """For the same as one after the other."""
    found = diagnosed(FRICTION)
    at, out = brought_to(found.bench.rows), []
    for apart in (True, False):
        paths = Paths(found.engine, found.found.explanations[0], at, None)
        runs = [run for together in paths.at_once for run in together]
        assert len(paths.at_once) < len(runs) == len(np.unique(found.bench.rows.run))
        if not apart:
            paths.at_once = [[run] for run in runs]
        out.append(paths.found()[0].overshoot)
    assert out[0].any()
    np.testing.assert_array_equal(*out)


def test_a_calm_hand_is_not_said_to_have_gone_too_far() -> None:
    found = diagnosed(CALM)
    assert found.verdict == "joint_hysteresis"
    assert not found.bench.rows.overshoot.any()
    assert not told(found)


@pytest.mark.slow
def test_a_lag_is_found_however_far_the_hand_went() -> None:
    assert diagnosed(LATE).verdict == "time_lag"


@pytest.mark.slow
def test_levels_that_scatter_are_no_hand() -> None:
    assert diagnosed(scattering).verdict == "unknown"


@pytest.mark.slow
def test_a_load_that_only_one_repetition_went_to_is_none_of_the_law_s() -> None:
    """Fitted to all, a rounded knee bends once more at the largest load, and foretells nothing."""
    found = diagnosed(pushed_on, TWICE)
    assert found.verdict == "joint_yield"
    rows = found.bench.rows
    (at,) = np.flatnonzero(rows.overshoot)
    assert (rows.repetition[at], rows.step[at]) == (2, TWICE.steps)
    assert rows.overshoot[at] == pytest.approx(FURTHER, rel=0.2)


def test_the_gap_of_withheld_levels_counts_no_level_that_told_itself() -> None:
    found = diagnosed(FRICTION)
    (name, fold), *_ = folds(found.engine).items()
    bench = found.bench
    gap = bench.response - stated_prediction(found.engine)
    gap = np.sqrt(gap**2 + bench.scatter_about(bench.response - gap))
    withheld = ~bench.rows.zero & (fold != ALWAYS_IN)
    said = held_out(found.engine, found.found.explanations[0], name, fold).before

    def rms(rows: Flags) -> float:
        return float(np.sqrt(np.average(gap[rows] ** 2, weights=bench.rows.weight[rows])))

    assert said == pytest.approx(rms(withheld & ~bench.rows.gone_beyond))
    assert said != pytest.approx(rms(withheld))


def test_more_places_and_more_of_them_cost_more() -> None:
    def cost(count: int, of: int) -> float:
        return Overshoots(frozenset(), np.zeros(1), count, of).cost

    assert cost(0, 40) == pytest.approx(np.log(41))
    assert cost(1, 40) == pytest.approx(np.log(41 * 40 * 16))
    assert cost(5, 40) > cost(4, 40)
    assert cost(5, 80) > cost(5, 40)
