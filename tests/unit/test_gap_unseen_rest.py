"""Creep of runs that are only loaded: when the load is taken off between two of them, no row shows;
and times that lie between those of the grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.data import GapData, Instruments
from identification.gap.effects import joint_creep
from identification.gap.model.bench import make_bench
from identification.gap.model.history import rests, retarded
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

SPRING, LASER_M = 1e-5, 1e-6  # m/N
HOLD_S, WAY_S, REST_S, LEVELS = 20, 4, 25, 8
T_S, SHARE = 120.0, 0.2


def loaded_only(stood: float, *, creeps: float = SHARE, runs: int = 2) -> GapData:
    """Levels of 20 N that are held, up only; after the last one the load stands on for a share of
    the rest but its last five seconds, in which the screw comes to nothing."""
    rng = np.random.default_rng(5)
    clock, load, rows = [], [], []
    t = 0.0
    for run in range(runs):
        for level in range(LEVELS + 1):
            for s in range(HOLD_S):
                rows.append((t + s, s + level * (HOLD_S + WAY_S), run, level))
            clock += [t - 0.5, t + HOLD_S - 0.5]
            load += [20.0 * level] * 2
            t += HOLD_S + WAY_S
        last = t - WAY_S - 0.5
        clock += [last + stood * (REST_S - 5), last + stood * (REST_S - 5) + 1e-3]
        load += [20.0 * LEVELS, 0.0]
        t = last + REST_S + 0.5
    fine = np.arange(-1.0, clock[-1], 0.05)
    along = np.interp(fine, clock, load)
    z = np.zeros_like(fine)
    for i in range(1, len(fine)):
        z[i] = z[i - 1] + ((along[i] + along[i - 1]) / 2 - z[i - 1]) * -np.expm1(-0.05 / T_S)
    at, time, run, level = (np.array(column) for column in zip(*rows, strict=True))
    force = 20.0 * level
    moved = SPRING * (force + creeps * np.interp(at, fine, z))
    data = bench_data(
        force + rng.normal(0, 0.05, len(force)),
        moved + rng.normal(0, LASER_M, len(force)),
        session=at,
        time=time.astype(float),
        step=level.astype(np.int64),
        run=run.astype(np.int64),
        repetition=run.astype(np.int64),
        instruments=Instruments(0.05, LASER_M, 0.005, 0.003),
    )
    return replace(data, branch=np.where(level > 0, 1, 0))


@pytest.mark.parametrize("stood", [0.0, 0.5, 1.0])
def test_a_load_stands_on_for_its_share_of_a_rest(stood: float) -> None:
    data = loaded_only(stood, creeps=1.0)
    rows = make_bench(data).rows
    load = np.round(rows.force / 20.0)[:, None] * 20.0
    z = retarded(load, np.array([T_S]), rows, rests(rows), stood=stood)[:, 0]
    seen = rows.displacement / SPRING - load[:, 0]
    assert z == pytest.approx(seen, abs=1.0)
    other = retarded(load, np.array([T_S]), rows, rests(rows), stood=1 - stood)[:, 0]
    assert stood == 0.5 or np.abs(other - seen).max() > 5.0


@pytest.mark.parametrize("stood", [0.0, 1.0])
def test_nothing_is_left_where_memory_is_fresh(stood: float) -> None:
    """Not of the old load that stood on, either."""
    rows = make_bench(loaded_only(stood, creeps=1.0)).rows
    again, load = rests(rows), rows.force[:, None]
    first = np.flatnonzero(again)[1]
    fresh = np.arange(rows.n) == first
    z = retarded(load, np.array([T_S]), rows, again, fresh, stood)
    assert abs(z[first, 0]) < 0.1


def test_a_rest_that_no_clock_tells_has_the_length_that_is_asked_for() -> None:
    """As the session's clock has it; where there is one, that counts."""
    data = loaded_only(0.0, creeps=1.0)
    told, untold = (make_bench(d).rows for d in (data, replace(data, session=None)))
    load, times = told.force[:, None], np.array([T_S])
    wanted = retarded(load, times, told, rests(told))
    start = data.session[data.run == 1][0] - data.session[data.run == 0][-1]
    found = retarded(load, times, untold, rests(untold), rested=float(start))
    assert found == pytest.approx(wanted, abs=0.2)
    assert np.abs(retarded(load, times, untold, rests(untold)) - wanted).max() > 20.0
    assert np.array_equal(retarded(load, times, told, rests(told), rested=900.0), wanted)


def test_creep_is_known_without_a_clock_of_the_session() -> None:
    found = explained(replace(loaded_only(0.0), session=None))
    assert found.verdict == "joint_creep"
    law = joint_creep.EFFECT.laws.of(found.bench, found.fit.parts[0].variant)[0]
    assert law.constants[joint_creep.RESTED] == 20.0  # of 25


@pytest.mark.parametrize("stood", [0.0, 1.0])
def test_creep_is_known_whenever_the_load_was_taken_off(stood: float) -> None:
    found = explained(loaded_only(stood))
    assert found.verdict == "joint_creep"
    assert found.after < 1.2 * found.noise
    share = found.effects[0].parameters["creep_fraction"]
    assert share.low <= SHARE <= share.high


def test_only_where_no_row_shows_it() -> None:
    """What is unloaded in rows, or begins anew at its load, has one rest."""
    bench = make_bench(loaded_only(0.0))
    pair = next(v for v in joint_creep.variants(bench) if len(v.times_s) == 2)
    assert {v.info["stood"] for v in joint_creep.refined(bench, pair)} == set(joint_creep.STOOD)
    data = loaded_only(0.0)
    seen = replace(data, force=np.where(data.step == LEVELS, 0.01, data.force))
    bench = make_bench(seen)
    pair = next(v for v in joint_creep.variants(bench) if len(v.times_s) == 2)
    assert {v.info["stood"] for v in joint_creep.refined(bench, pair)} == {0.0}


def test_times_lie_closer_together_about_a_pair() -> None:
    bench = make_bench(loaded_only(0.0))
    pair = [v for v in joint_creep.variants(bench) if len(v.times_s) == 2][1]
    found = [v.times_s for v in joint_creep.refined(bench, pair) if not v.info["stood"]]
    assert all(high / low == pytest.approx(3**0.25) for low, high in found)
    assert min(t[0] for t in found) < pair.times_s[0]
    assert max(t[1] for t in found) > pair.times_s[1]


def test_the_law_of_a_model_says_for_which_share_it_stood() -> None:
    bench = make_bench(loaded_only(1.0))
    pair = [v for v in joint_creep.variants(bench) if len(v.times_s) == 2][1]
    laws = joint_creep.EFFECT.laws
    for v in joint_creep.refined(bench, pair):
        law, unit = laws.describe(bench, v)
        assert law.constants.get(joint_creep.STOOD_ON, 0.0) == v.info["stood"]
        found = np.stack(laws.columns(bench, law)) * np.broadcast_to(unit, len(law.terms))[:, None]
        assert np.allclose(found, [bench.columns[c] for c in v.columns], atol=1e-12)


def test_two_close_times_of_which_one_goes_back_are_no_creep() -> None:
    assert not joint_creep._grows(np.array([-1.0, 1.5]))
    assert joint_creep._grows(np.array([0.0, 1.5]))
    assert joint_creep._grows(np.array([1.5, -0.01]))
