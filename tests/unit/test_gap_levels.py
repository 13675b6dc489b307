"""Levels read at rest, of rigs without an arm: holds read ever more seldom, tables without a clock,
plateaus of a driven displacement."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData, Instruments
from identification.gap.effects import library
from identification.gap.effects.joint_creep import times
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.products import WhitenedColumns
from identification.gap.laws import knees_closer
from identification.gap.model.bench import make_bench
from identification.gap.model.history import _paths
from identification.gap.model.variants import Variant
from identification.gap.recording.holds import hold_ids, swing_within
from identification.gap.recording.imposed import displacement_imposed
from identification.gap.recording.rows import reduce_rows
from identification.gap.search.search import _hidden
from rig.dataset import load
from rig.diagnosis.gap_data import gap_data
from rig.tables import import_table
from tests.conformance.gap_designs import linear
from tests.explained import explained
from tests.unit.test_gap_evidence import small_bench, small_engine
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_weights import UP, hanging


def creeping(n: int = 200) -> tuple[Array, Array]:
    """Times s, ever more seldom, and creep by their logarithm, m."""
    t = np.concatenate([[0.0], np.geomspace(1.0, 1e5, n)])
    return t, 4e-5 * np.log1p(t)


def one_hold(t: Array, u: Array) -> dict[str, Array]:
    n = len(t)
    on = (t > 0).astype(np.int64)
    return {
        "time": t,
        "step": on,
        "branch": on,
        "force": 100.0 * on,
        "displacement": u,
        "run": np.zeros(n, dtype=np.int64),
    }


def test_rows_of_a_hold_follow_its_clock_when_samples_grow_seldom() -> None:
    t, u = creeping()
    given = one_hold(t, u)
    rows = reduce_rows(bench_data(given.pop("force"), given.pop("displacement"), **given))
    assert len(rows.time) > 17
    later = rows.time[rows.step == 1][2:]
    assert (later[1:] / later[:-1]).max() < 4.0
    even = np.arange(65.0)
    given = one_hold(even, u[:65])
    same = reduce_rows(bench_data(given.pop("force"), given.pop("displacement"), **given))
    assert same.weight.tolist() == [1, 1, 1, 2, 4, 8, 16, 32]  # 1, 1, 2, 4 ... as ever


def test_creep_times_of_a_bench_reach_from_a_sample_to_beyond_the_session() -> None:
    t, u = creeping()
    given = one_hold(t, u)
    found = times(make_bench(bench_data(given.pop("force"), given.pop("displacement"), **given)))
    assert found[0] <= 1.5
    assert found[-1] > 5e4  # a third of the session would be 3e4


HEAD = "direction,repetition,branch,step,force_N,displacement_mm"
META = """robot: none
directions: {x: [1, 0, 0]}
instruments: {force: {standard_uncertainty_N: 0.1}, displacement: {standard_uncertainty_mm: 0.001}}
simulation: {stiffness_N_per_mm: {x: 100.0}, stiffness_relative_sd: 0.1}
"""


@pytest.mark.parametrize("clock", [True, False])
def test_a_table_without_a_clock_says_nothing_of_lags_and_creep(
    tmp_path: Path, clock: bool
) -> None:
    forces = [0, 20, 40, 60, 40, 20, 0]
    branches = ["zero", *["loading"] * 3, *["unloading"] * 2, "zero"]
    lines = [("time_s," if clock else "") + HEAD]
    for i, (f, b) in enumerate(zip(forces, branches, strict=True)):
        lines += [
            (f"{7 * i + k}," if clock else "") + f"x,1,{b},{i},{f},{f / 90}" for k in range(3)
        ]
    (tmp_path / "t.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "m.yaml").write_text(META, encoding="utf-8")
    import_table(tmp_path / "t.csv", tmp_path / "m.yaml", tmp_path / "d.h5")
    data = gap_data(load(tmp_path / "d.h5"))
    assert data.timed is clock
    bench = make_bench(data)
    assert bench.load_history.timeless is not clock
    knee = next(v for v in library(bench, ["joint_yield"]) if v.info["knee"] == "sharp")
    assert any(" flow " in v.label for v in knees_closer.refined(bench, knee)) is clock
    words = {v.word for v in library(bench, ["joint_creep", "time_lag", "joint_hysteresis"])}
    assert ({"joint_creep", "time_lag"} <= words) is clock
    assert "joint_hysteresis" in words


def test_one_reading_a_level_in_a_single_pull_shows_no_creep() -> None:
    force = np.arange(10) * 20.0
    once = make_bench(bench_data(force, 1e-5 * force))
    assert once.load_history.never_held
    assert not library(once, ["joint_creep"])
    twice = make_bench(
        bench_data(
            np.repeat(force, 2), 1e-5 * np.repeat(force, 2), step=np.repeat(np.arange(10), 2) + 1
        )
    )
    assert not twice.load_history.never_held
    assert library(twice, ["joint_creep"])


def test_steps_to_and_fro_of_one_number_are_other_holds_and_levels() -> None:
    """A cycle by hand: 0, 1, 2, 1, then on through zero to the other side, steps by their size."""
    force = np.repeat([0.0, 40, 80, 40, -40, -80, -40, 0.0], 3)
    step = np.repeat([0, 1, 2, 1, 1, 2, 1, 0], 3)
    data = bench_data(force, force / 1e5, step=step, branch=np.full(24, 3))
    assert hold_ids(data).tolist() == np.repeat(np.arange(8), 3).tolist()
    rows = reduce_rows(data)
    first = rows.level[rows.hold_starts]
    assert len(set(first[1:7].tolist())) == 6  # coming and going, on both sides
    twice = np.concatenate([force, force])
    again = bench_data(
        twice,
        twice / 1e5,
        step=np.tile(step, 2),
        branch=np.full(48, 3),
        run=np.repeat([0, 1], 24),
        repetition=np.repeat([1, 2], 24),
    )
    rows = reduce_rows(again)
    first = rows.level[rows.hold_starts]
    assert first[:8].tolist() == first[8:].tolist()  # and the same in every repetition


def test_noise_about_no_load_ends_no_hold() -> None:
    force = np.tile([1.0, -1.0], 12)
    for step, u, holds in ((0, 0.01, 1), (1, 0.25, 1), (1, 0.01, 24)):  # four of noise
        data = bench_data(
            force,
            force / 1e5,
            step=np.full(24, step),
            instruments=Instruments(u, 1e-6, 0.005, 0.003),
        )
        assert hold_ids(data)[-1] + 1 == holds


@pytest.mark.parametrize(("branch", "levels"), [(1, 4), (3, 5)])
def test_a_way_there_counts_in_cycles_alone(branch: int, levels: int) -> None:
    """What is called loading goes one way, however a hand got there: 80 N from both sides."""
    force = np.repeat([0.0, 40, 80, 100, 80], 2)
    step = np.repeat([0, 1, 2, 3, 2], 2)
    rows = reduce_rows(bench_data(force, force / 1e5, step=step, branch=np.full(10, branch)))
    assert len(set(rows.level[rows.hold_starts].tolist())) == levels


CLOCKS = "time_s,session_s,repetition,branch,step,force_N,displacement_mm\n"


def test_a_run_whose_clock_stands_goes_by_the_session(tmp_path: Path) -> None:
    rows = [
        f"{7 * s + k if r == 1 else 21},{100 * r + 7 * s + k},{r},loading,{s},{20 * s},{0.2 * s}"
        for r in (1, 2)
        for s in range(4)
        for k in range(3)
    ]
    (tmp_path / "t.csv").write_text(CLOCKS + "\n".join(rows) + "\n", encoding="utf-8")
    (tmp_path / "m.yaml").write_text(META, encoding="utf-8")
    import_table(tmp_path / "t.csv", tmp_path / "m.yaml", tmp_path / "d.h5")
    data = gap_data(load(tmp_path / "d.h5"))
    assert data.time[:12].tolist() == data.time[12:].tolist()
    assert data.notes == ("time_s stands still in 1 of 2 runs: taken from session_s there.",)


def test_levels_on_a_plateau_were_set_by_the_displacement() -> None:
    force = np.array([0, 500, 900, 1000, 1001, 1001, 1002, 1002.0])
    moved = 1e-3 * np.array([0, 0.1, 0.3, 0.6, 1.0, 1.5, 2.0, 2.5])
    assert displacement_imposed(bench_data(force, moved))
    assert not displacement_imposed(bench_data(np.arange(8) * 130.0, moved))  # weights hung on
    assert not displacement_imposed(bench_data(force, moved, imposed="force"))


def test_products_are_those_of_the_columns() -> None:
    bench = small_bench()
    engine = small_engine(bench, (0.0, 3e-6, 1e-5))
    for k in range(4):
        bench.add(bench.stacked(1e-5 * np.sin((k + 2) * np.arange(bench.rows.n))))
    dense = small_engine(small_bench(), (0.0, 3e-6, 1e-5))
    for column in list(bench.columns)[2:]:
        dense.bench.add(column)
    whole = Engine(dense.bench, dense.base, dense.target, np.array([0.0, 3e-6, 1e-5]))
    for level, other in zip(engine.levels, whole.levels, strict=True):
        rows = level.beside((0, 3))
        assert rows == pytest.approx(other.beside(tuple(range(6)))[[0, 3]], rel=1e-9)
        assert level.square((0, 3)) == pytest.approx(rows[:, [0, 3]], rel=1e-9)
        two = np.array([[0, 3], [5, 2]])
        many = engine.squares(two, level.number, engine.unweighed(two))
        assert many[1] == pytest.approx(other.square((5, 2)), rel=1e-9)
        assert level.moment == pytest.approx(other.moment, rel=1e-9)


def test_zeros_left_out_of_products_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    thin = small_engine(small_bench()).levels[1]
    monkeypatch.setattr(WhitenedColumns, "sparsely", WhitenedColumns.between)
    full = small_engine(small_bench()).levels[1]
    assert thin.log_base == pytest.approx(full.log_base, rel=1e-12)
    assert thin.moment == pytest.approx(full.moment, rel=1e-12)


def test_creep_that_grows_with_the_square_is_among_the_shapes_of_an_arm() -> None:
    bench = hanging(UP)
    found: list[Variant] = library(bench, ["joint_creep"])
    bent = [v for v in found if v.info.get("bent")]
    plain = [v for v in found if not v.info.get("bent")]
    assert len(bent) == len(plain)  # spectra, and pairs of times
    small, large = (
        np.abs(bench.columns[v.columns[0]][: bench.rows.n]) for v in (bent[0], plain[0])
    )
    low, top = bench.load == 20.0, bench.load == 80.0
    assert (small[low].max() / small[top].max()) < 0.5 * (large[low].max() / large[top].max())


def test_what_swings_at_rest_is_what_neighbours_within_a_hold_have_in_common() -> None:
    """A vibration of six samples; not what settles, nor noise of single samples; of short holds
    nothing is said."""
    hold, within = np.repeat(np.arange(20), 12), np.tile(np.arange(12.0), 20)
    swings = np.sin(2 * np.pi * within / 6)
    # products of neighbours: half of the cosine of a sixth of a turn
    assert swing_within(swings + 50.0 * hold, hold) == pytest.approx(0.5, rel=0.2)
    assert swing_within(3.0 * within + 50.0 * hold, hold) < 1e-6
    rng = np.random.default_rng(1)
    assert swing_within(rng.normal(0, 1, 240), hold) == 0.0
    assert swing_within(np.tile([1.0, -1.0], 120), hold) == 0.0
    assert swing_within(swings, np.repeat(np.arange(80), 3)) == 0.0


def test_noise_alike_within_holds_may_be_as_large_from_hold_to_hold() -> None:
    """Up to all of what is stated of a sample passes for noise then."""
    bench, hidden = small_bench(), []
    for swings in (0.0, 0.1, 0.2, 0.9):
        noise = replace(bench.noise, sure=True, swings=swings)
        hidden.append(_hidden(small_engine(replace(bench, noise=noise))) / noise.stated)
    assert hidden == pytest.approx([0.6, 0.6, 0.8, 1.0])


def test_what_is_stated_and_holds_do_not_show_may_differ_from_hold_to_hold() -> None:
    """Of both channels; and wander over many holds."""
    rng = np.random.default_rng(6)
    step = np.repeat(np.arange(1, 9), 12)
    load = 10.0 * step
    data = bench_data(
        load + rng.normal(0, 0.1, 96), 1e-5 * load + rng.normal(0, 1e-6, 96), step=step, arm=True
    )
    slow = []
    for stated in (1e-6, 2e-6, 4e-6):
        meter = replace(data.instruments, force=2 * stated / 1e-5, displacement=stated)
        slow.append(make_bench(replace(data, instruments=meter)).noise.slow)
    assert slow == pytest.approx([1.0] * 3, abs=0.05)  # no more than what is stated, of both
    force = replace(data.instruments, force=0.1, displacement=2e-6)
    assert make_bench(replace(data, instruments=force)).noise.slow == pytest.approx(0.87, abs=0.05)
    charge = replace(data.instruments, force=0.12, displacement=1e-6)
    assert make_bench(replace(data, instruments=charge)).noise.slow == pytest.approx(0.66, abs=0.15)
    assert make_bench(replace(data, arm=False)).noise.slow == 0.0
    bench, hidden = small_bench(), []
    for far in (0.3, 0.5, 1.0):
        noise = replace(bench.noise, sure=True, slow=far)
        hidden.append(_hidden(small_engine(replace(bench, noise=noise))) / noise.stated)
    assert hidden == pytest.approx([0.6, 0.75, 1.5])


@pytest.mark.parametrize("stated", [pytest.param(0.3, marks=pytest.mark.slow), 0.5])
def test_an_arm_whose_force_is_stated_far_too_uncertain_is_none(stated: float) -> None:
    """Nothing is wrong, and the noise that could be there reaches beyond all that was seen."""
    data = linear("medium")
    assert (
        explained(replace(data, instruments=replace(data.instruments, force=stated))).verdict
        == "none"
    )


@pytest.mark.parametrize(
    ("gain", "verdict"), [(1.2, "none"), (1.38, "force_scale"), (0.8, "none"), (0.7, "force_scale")]
)
def test_a_gain_beyond_three_of_its_stated_deviations_is_off(gain: float, verdict: str) -> None:
    """Of a cell that is stated to a tenth, by what it reads or by what of that is too much."""
    up = np.arange(6)
    step = np.repeat(np.concatenate([up, up[-2::-1]]), 3)
    branch = np.repeat(np.concatenate([np.minimum(up, 1), [2, 2, 2, 2, 0]]), 3)
    rng = np.random.default_rng(1)
    data = bench_data(
        20.0 * step * gain + rng.normal(0, 0.1, 33),
        2e-4 * step + rng.normal(0, 1e-6, 33),
        step=step,
        branch=branch,
        compliance_relative_sd=np.array([0.005]),
        instruments=Instruments(0.1, 1e-6, 0.1, 0.003),
    )
    assert explained(data).verdict == verdict


def of_three(sd: float, goes_on: float = 0.0, arm: bool = False) -> GapData:
    """Ten levels up and down, three times, each read three times a minute apart."""
    rng = np.random.default_rng(12)
    levels = np.concatenate([np.arange(1, 11), np.arange(9, 0, -1)])
    step = np.tile(np.repeat(levels, 3), 3)
    came = np.sign(np.diff(np.concatenate([[0], levels])))
    late = goes_on * np.tile(np.repeat(came, 3), 3) * np.tile([0.0, 1.0, 1.5], 57)
    n, load = len(step), 10.0 * step
    run = np.repeat([0, 1, 2], n // 3)
    up = np.tile(np.repeat(np.arange(19) < 10, 3), 3)
    noise = sd * rng.standard_normal(n)
    force = load + rng.normal(0, 0.1, n)
    return bench_data(
        force,
        1e-5 * force + late + noise,
        step=step,
        branch=np.where(up, 1, 2),
        run=run,
        repetition=run + 1,
        imposed="force",
        arm=arm,
    )


def test_three_readings_of_a_level_show_their_noise() -> None:
    """What was stated of a bench's sensor was a guess; of an arm's it is known. Not where they
    still go on."""
    for sd, goes_on, arm, found in (
        (3e-6, 0.0, False, 3e-6),
        (3e-6, 5e-6, False, 1e-6),
        (3e-6, 0.0, True, 1e-6),
    ):
        data = of_three(sd, goes_on, arm)
        assert make_bench(data).noise.response[0] == pytest.approx(found, rel=0.15)
    assert explained(of_three(3e-6)).verdict == "none"


def read_once(seconds: float, late: float = 0.0, jitter: float = 0.0) -> GapData:
    """Levels up and down again, each read once; the load goes straight from one to the next."""
    rng = np.random.default_rng(1)
    step = np.concatenate([np.arange(20), np.arange(20)[::-1]])
    force = 5.0 * step + rng.uniform(-1, 1, 40)
    t = seconds * (np.arange(40) + jitter * rng.uniform(-1, 1, 40))
    u = 1e-5 * np.interp(t - late, t, force) + rng.normal(0, 2e-7, 40)
    way = np.repeat([1, 2], 20)
    data = bench_data(force, u, step=step, branch=way, time=t, session=t, imposed="force")
    return replace(data, instruments=Instruments(0.05, 2e-7, 0.005, 0.003))


@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_the_path_through_levels_that_were_read_once_goes_from_one_to_the_next(
    jitter: float,
) -> None:
    rows = make_bench(read_once(10.0, jitter=jitter)).rows
    up = np.arange(20.0)
    ((_, _, t, v),) = _paths(np.append(up, up[::-1]), rows)
    assert np.all(np.diff(t) >= 0)
    assert np.abs(np.diff(v)).sum() == pytest.approx(38.0)  # and never back


@pytest.mark.parametrize("seconds", [3.0, 60.0])
def test_a_lag_is_found_where_every_level_was_read_once(seconds: float) -> None:
    found = explained(read_once(seconds, late=0.6 * seconds))
    assert found.verdict == "time_lag"
    lag = found.effects[0].parameters["lag"]
    assert lag.low < 0.6 * seconds < lag.high
    assert lag.high - lag.low < 0.2 * seconds
