"""Recordings that run on, of rigs without an arm: their noise, what stands still, which drifts and
other effects they can show at all."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.parameters import parameters
from identification.gap.data import GapData, Instruments
from identification.gap.effects import library
from identification.gap.evidence.parts import Part
from identification.gap.explanations.priors import prior_of
from identification.gap.judging.residual_checks import _FALL
from identification.gap.laws.drift import free_paths, shares
from identification.gap.laws.isotropic_hardening import grown
from identification.gap.model.bench import Bench, make_bench
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.gap.recording.rows import reduce_rows
from identification.gap.recording.turns import passes, turns
from identification.gap.words import STANDING
from rig.diagnosis.diagnose_text import render
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

SPRING = 1e5  # N/m


def running(force: Array, displacement: Array, **changes: object) -> GapData:
    n = len(force)
    return bench_data(
        force,
        displacement,
        step=np.full(n, -1),
        branch=np.full(n, 3),
        session=np.arange(n, dtype=float),
        **changes,
    )


def triangle(n: int, cycles: float) -> Array:
    """From 0 to 1 and back, from one side."""
    phase = np.linspace(0, cycles, n, endpoint=False) % 1.0
    return np.asarray(1 - np.abs(1 - 2 * phase))


def words_with(bench: Bench, word: str) -> list[str]:
    return [v.label for v in library(bench, [word])]


@pytest.mark.parametrize("word", ["thermal_drift", "force_drift"])
def test_one_running_pass_or_cycle_shows_no_drift(word: str) -> None:
    for cycles in (0.5, 1.0):
        force = 100 * triangle(400, cycles)
        bench = make_bench(running(force, force / SPRING, imposed="force"))
        assert bench.load_history.passes < 3
        assert words_with(bench, word) == []


@pytest.mark.parametrize(("cycles", "pieces"), [(1.5, 0), (2, 0), (3, 9), (5, 21), (50, 40)])
def test_a_free_path_is_no_finer_than_what_comes_again_bears(cycles: float, pieces: int) -> None:
    force = 100 * triangle(2000, cycles)
    bench = make_bench(running(force, force / SPRING, imposed="force"))
    assert {way.pieces for way in free_paths(bench).values()} == ({pieces} if pieces else set())


@pytest.mark.parametrize("word", ["thermal_drift", "force_drift"])
def test_cycles_and_an_unloaded_rig_show_drifts_of_any_path(word: str) -> None:
    rng = np.random.default_rng(5)
    force = 100 * triangle(900, 3)
    assert "free path" in words_with(make_bench(running(force, force / SPRING)), word)
    still, moving = rng.normal(0, 0.1, 900), np.cumsum(rng.normal(0, 1e-7, 900))
    rest = make_bench(running(still, moving, imposed="force"))
    assert rest.load_history.stands
    assert "free path" in words_with(rest, word)
    assert {w.pieces for w in free_paths(rest).values()} == {20}  # a quicker one could be anything
    assert max(shares(rest, (0.1, 0.3))) == 3.0
    assert max(shares(make_bench(running(force, force / SPRING)), (0.1, 0.3))) == 0.3


def test_under_a_load_that_stands_what_runs_is_creep_and_no_free_drift() -> None:
    rng = np.random.default_rng(6)
    force = 100 + rng.normal(0, 0.1, 900)
    creeping = 1e-3 * (1 + 0.1 * np.log1p(np.arange(900.0)))
    bench = make_bench(running(force, creeping, imposed="force"))
    assert words_with(bench, "thermal_drift") == []
    assert words_with(bench, "joint_creep")


@pytest.mark.parametrize("jitter", [0.0, 0.1])
def test_under_a_load_that_stands_creep_may_be_as_slow_and_large_as_was_seen(jitter: float) -> None:
    rng = np.random.default_rng(8)
    t = np.arange(300.0)
    force = 100 + rng.normal(0, 1.0, 300) * jitter
    force[[100, 120]] += 5 * jitter  # a jerk of the machine is no motion of the load
    flowing = 0.05 * t / 300 + 0.01 * (1 - np.exp(-t / 20)) + rng.normal(0, 1e-6, 300)
    bench = make_bench(data := running(force, flowing, imposed="force"))
    assert bench.load_history.stands
    assert not bench.load_history.always_moves
    creep = library(bench, ["joint_creep"])
    assert max(v.info["times_s"].max() for v in creep) > 300
    assert max(v.scales[-1] for v in creep) > 0.06 / (100 / SPRING)
    found = explained(data)
    assert found.verdict == "joint_creep"
    assert found.after < 0.05 * found.before


def test_a_record_that_rests_all_the_time_runs_on() -> None:
    """A drift recording: one hold without load, which must not be thinned to nine rows."""
    nothing = np.zeros(150)
    data = bench_data(nothing, np.linspace(0, 1e-4, 150), step=np.zeros(150, dtype=int))
    rows = reduce_rows(data)
    assert rows.continuous
    assert rows.n == 150


def test_a_stiffening_specimen_that_relaxes_creeps() -> None:
    """Fung's quasi-linear law: an exponential toe times fading memory, as tissue shows."""
    rng = np.random.default_rng(7)
    t = np.concatenate([np.arange(0, 2, 0.05), np.arange(2, 40, 0.25)])
    u = 1e-3 * np.minimum(t / 2, 1.0)
    elastic = 20 * np.expm1(2.5 * u / 1e-3) / np.expm1(2.5)
    force = np.zeros_like(t)
    for i in range(1, len(t)):
        since = np.maximum(t[i:] - t[i], 0.0)
        memory = 0.5 + 0.3 * np.exp(-since / 1.5) + 0.2 * np.exp(-since / 12)
        force[i:] += memory * (elastic[i] - elastic[i - 1])
    force += rng.normal(0, 0.02, t.size)
    data = bench_data(
        force,
        u,
        step=np.full(t.size, -1),
        branch=np.full(t.size, 3),
        session=t,
        time=t,
        instruments=Instruments(0.02, 1e-6, 0.005, 0.003),
        compliance=np.array([1e-3 / 8]),
        imposed="displacement",
    )
    found = explained(data)
    assert found.verdict in ("joint_creep", "joint_nonlinear_stiffness")
    assert "joint_creep" in {e.name for e in found.effects}


@pytest.mark.parametrize("falls", [True, False])
def test_a_pull_whose_force_falls_is_not_said_to_be_elastic(falls: bool) -> None:
    """A line that slips and takes hold again, or a spring that softens."""
    rng = np.random.default_rng(8)
    x = np.linspace(0, 1, 200)
    force = 25 * np.sin(2.2 * np.pi * x) if falls else 60 * x / (1 + x)
    data = running(
        force + rng.normal(0, 0.02, 200),
        1e-3 * x,
        imposed="displacement",
        instruments=Instruments(0.02, 1e-6, 0.005, 0.003),
        compliance=np.array([1e-3 / force[10] * x[10]]),
    )
    found = explained(data)
    assert found.verdict == ("unknown" if falls else "joint_nonlinear_stiffness")


def test_one_reading_that_jumps_is_no_fall_of_the_force() -> None:
    """A specimen that locks, with one reading, or four, a third of the range too high."""
    u = np.linspace(0, 1e-3, 80)
    for many, falls in ((1, False), (4, True)):
        force = 40 * (u / 1e-3) ** 3 + 20 * u / 1e-3
        force[30 : 30 + many] += 20.0
        bench = make_bench(running(force, u, imposed="displacement"))
        assert (bench.load_history.fall > _FALL) == falls


@pytest.mark.slow
def test_a_curve_off_its_zero_that_comes_again_is_elastic() -> None:
    """A pin that bears at one side before it does at the other, moved to and fro."""
    t = np.arange(400.0)
    u = 1e-3 * np.sin(t / 20)
    force = 2e5 * (np.maximum(u - 1e-4, 0) - np.maximum(-6e-4 - u, 0)) + 2e4 * u
    force += np.random.default_rng(5).normal(0, 0.1, 400)
    said = explained(running(force, u, imposed="displacement"))
    assert said.verdict in ("joint_nonlinear_stiffness", "joint_backlash")
    assert said.after < 0.1 * said.before
    labels = [v.label for v in library(make_bench(running(force, u, imposed="displacement")))]
    assert any("uneven" in label for label in labels)
    half = [v.label for v in library(make_bench(running(force[:90], u[:90])))]
    assert not any("uneven" in label for label in half)


def test_a_specimen_that_is_only_let_go_does_not_flow_back() -> None:
    load = 100 * np.sin(np.arange(300) / 15)
    for force, back in ((load, True), (np.abs(load), False)):
        labels = [
            v.label for v in library(make_bench(running(force, force / SPRING)), ["joint_yield"])
        ]
        assert any("flows back" in label for label in labels) == back


@pytest.mark.parametrize(("both", "seats"), [(False, True), (True, False)])
def test_what_bears_both_ways_is_no_seat(both: bool, seats: bool) -> None:
    load = 100 * np.sin(np.arange(300) / 15)
    force = load if both else np.abs(load)
    assert bool(library(make_bench(running(force, force / SPRING)), ["contact_seating"])) == seats


def test_one_factor_is_shared_as_calibrations_are_stated() -> None:
    rng = np.random.default_rng(9)
    force = 100 * triangle(600, 3)
    moved = 1.3 * force / SPRING + rng.normal(0, 1e-6, 600)
    for gain, sure in ((0.005, "joint_stiffness_error"), (0.1, "force_scale")):
        meter = Instruments(0.1, 1e-6, gain, 0.003)
        data = running(
            force,
            moved,
            imposed="force",
            instruments=meter,
            compliance_relative_sd=np.array([0.05]),
        )
        p = explained(data).probabilities
        others = {"joint_stiffness_error", "force_scale", "displacement_scale"} - {sure}
        assert p[sure] > max(p[w] for w in others)


def test_one_pull_that_never_stood_shows_neither_creep_nor_exponential_friction() -> None:
    force = 100 * triangle(400, 0.5)
    bench = make_bench(running(force, force / SPRING, imposed="force"))
    assert bench.load_history.monotonic
    assert bench.load_history.always_moves
    assert words_with(bench, "joint_creep") == []
    assert not any("Dahl" in w or "worked in" in w for w in words_with(bench, "joint_hysteresis"))
    cycled = make_bench(running(100 * triangle(400, 2), 1e-3 * triangle(400, 2), imposed="force"))
    assert any("Dahl" in w for w in words_with(cycled, "joint_hysteresis"))


def test_hardened_metal_yields_on_only_beyond_what_it_has_seen() -> None:
    load = np.array([0.0, 3, 5, 2, 4, 6, 0, 1])
    fresh = np.arange(8) == 0
    assert grown(load, np.array([4.0]), fresh)[:, 0].tolist() == [0, 0, 1, 1, 1, 2, 2, 2]
    assert grown(-load, np.array([4.0]), fresh)[:, 0].tolist() == [0, 0, -1, -1, -1, -2, -2, -2]
    both = np.array([5.0, -6.0, -5.0, 8.0])  # from either side only beyond what was borne
    assert grown(both, np.array([4.0]), fresh[:4])[:, 0].tolist() == [1, 0, 0, 2]


def test_what_is_below_the_noise_of_a_sample_is_no_effect_of_a_running_recording() -> None:
    """A wander of a third of the noise, which thousands of samples show: 1/f noise does that."""
    rng = np.random.default_rng(9)
    force = 100 * triangle(3000, 6)
    wander = 4e-7 * np.sin(np.linspace(0, 9, 3000))
    u = force / SPRING + wander + rng.normal(0, 1e-6, 3000)
    found = explained(running(force, u, imposed="force"))
    assert found.verdict == "none"
    larger = explained(running(force, u + 20 * wander, imposed="force"))
    assert larger.verdict in ("thermal_drift", "force_drift")


def test_a_bench_that_is_pressed_from_one_side_seats_from_where_its_load_begins() -> None:
    force = 100 * triangle(300, 3)
    u = force / SPRING
    zero = make_bench(running(force, u, imposed="force"))
    shifted = make_bench(running(force - 5.0, u, imposed="force"))
    first, second = library(zero, ["contact_seating"])[0], library(shifted, ["contact_seating"])[0]
    assert shifted.columns[second.columns[0]].min() == 0.0
    assert zero.columns[first.columns[0]].max() > 0.9


def test_a_ball_on_a_plate_seats_by_the_law_of_hertz() -> None:
    """In series with what is pressed: `F^(2/3)` begins as steeply as no exponential does."""
    rng = np.random.default_rng(12)
    force = 100 * triangle(600, 3)
    u = force / SPRING + 6e-5 * (force / 100) ** (2 / 3) + rng.normal(0, 1e-6, 600)
    found = explained(running(force, u, imposed="force"))
    assert found.verdict == "contact_seating"
    assert found.effects[0].label.startswith("Hertz")
    depth = found.effects[0].parameters["depth"]
    assert depth.low < 0.06 < depth.high  # mm


@pytest.mark.parametrize("imposed", ["force", "displacement"])
def test_what_is_pressed_is_what_is_pulled_the_other_way_round(imposed: str) -> None:
    force = 100 * np.maximum(triangle(300, 3) - 0.2, 0.0)
    u = 1e-3 * triangle(300, 3)
    pulled = make_bench(running(force, u, imposed=imposed))
    pressed = make_bench(running(-force, -u, imposed=imposed))
    for word in ("contact_seating", "joint_yield", "joint_backlash"):
        one, other = library(pulled, [word]), library(pressed, [word])
        assert [v.label for v in one] == [v.label for v in other]
        for v, w in zip(one, other, strict=True):
            for k, (i, j) in enumerate(zip(v.columns, w.columns, strict=True)):
                sense = 1 if word == "joint_backlash" and k > 1 else -1  # free places have none
                assert pressed.columns[j] == pytest.approx(sense * pulled.columns[i], abs=1e-15)


@pytest.mark.parametrize("imposed", ["force", "displacement"])
def test_every_shape_of_a_bench_has_parameters(imposed: str) -> None:
    force = 100 * np.maximum(triangle(300, 3) * (1 + np.arange(300) // 100) - 0.2, 0.0)
    u = 1e-3 * triangle(300, 3) * (1 + np.arange(300) // 100)
    bench = make_bench(running(force, u, imposed=imposed))
    variants = library(bench)
    assert {"joint_yield", "contact_seating", "time_lag"} <= {v.word for v in variants}
    for v in variants:
        k = len(v.columns)
        found = parameters(bench, Part(v, 1.0), np.full(k, 0.3), 1e-4 * np.eye(k))
        values = [x for p in found.values() for x in (p.value, p.low, p.high)]
        assert np.all(np.isfinite(values)), v.label


def test_a_single_sample_is_diagnosed_as_nothing() -> None:
    found = explained(running(np.array([5.0]), np.array([5e-5])))
    assert found.verdict in ("none", "unknown")


def test_a_bench_spring_is_neither_gone_nor_negative() -> None:
    force = 100 * triangle(200, 2)
    bench = make_bench(running(force, force / SPRING))
    (spring,) = library(bench, ["joint_stiffness_error"])
    assert spring.positive is not None
    assert spring.least == -0.9


def test_turns_are_where_the_load_goes_back_by_a_quarter() -> None:
    path = np.concatenate(
        [
            np.linspace(0, 10, 50),
            np.linspace(10, 8, 10),
            np.linspace(8, 12, 20),
            np.linspace(12, 0, 60),
        ]
    )
    assert turns(path) == [79]  # the small way back is none
    assert passes(path) == 2
    assert turns(np.linspace(0, 1, 30)) == []


@pytest.mark.parametrize(("slower", "one"), [(1.5, True), (10.0, False)])
def test_passes_that_go_about_as_fast_go_at_one_rate(slower: float, one: bool) -> None:
    force = 100 * triangle(400, 4)
    seconds = np.where(np.arange(400) < 200, 1.0, slower).cumsum()
    data = bench_data(
        force,
        force / SPRING,
        step=np.full(400, -1),
        branch=np.full(400, 3),
        session=seconds,
        time=seconds,
        imposed="force",
    )
    bench = make_bench(data)
    assert bench.load_history.one_rate is one
    # there, creep in proportion to anything would be a loop of any shape
    assert any(v.info["bent"] for v in library(bench, ["joint_creep"])) is not one
    slow = prior_of(frozenset(["joint_creep"]), bench)
    assert (slow < prior_of(frozenset(["joint_creep"])) - 20) is one
    both = frozenset(["joint_creep", "time_lag"])
    assert (prior_of(both, bench) < prior_of(both) - 50) is one


def test_what_was_held_goes_at_no_rate() -> None:
    force = 100 * np.minimum(np.arange(400) / 100, 1.0)
    assert not make_bench(running(force, force / SPRING, imposed="force")).load_history.one_rate


def test_a_stroke_that_hardly_comes_back_has_come_back() -> None:
    """Metal under an indenter: the force goes to and fro, nearly all of the depth stays."""
    depth = (
        np.concatenate(
            [np.linspace(0, 1, 100), np.linspace(1, 0.98, 50), np.linspace(0.98, 1.5, 80)]
        )
        * 1e-3
    )
    force = np.concatenate(
        [np.linspace(0, 50, 100), np.linspace(50, 10, 50), np.linspace(10, 70, 80)]
    )
    meter = Instruments(0.1, 1e-7, 0.005, 0.003)
    assert not make_bench(
        running(force, depth, imposed="displacement", instruments=meter)
    ).load_history.monotonic
    slipped = np.linspace(0, 1e-3, 230)  # the force falls, the stroke goes on
    assert make_bench(
        running(force, slipped, imposed="displacement", instruments=meter)
    ).load_history.monotonic


def test_a_load_that_wavers_without_any_bearing_stands() -> None:
    rng = np.random.default_rng(10)
    force = rng.normal(0, 0.5, 400)  # five times what is stated
    drifting = make_bench(running(force, np.linspace(0, 1e-3, 400), imposed="force"))
    assert drifting.load_history.stands
    assert "free path" in words_with(drifting, "thermal_drift")
    spring = make_bench(running(force, force / SPRING, imposed="force"))
    assert not spring.load_history.stands


def test_a_cell_at_rest_says_nothing_of_any_stiffness() -> None:
    """Force trembles, nothing moves: that is no infinitely stiff spring."""
    rng = np.random.default_rng(11)
    force = np.round(rng.normal(0, 0.1, 250), 2)
    bench = make_bench(running(force, np.zeros(250), imposed="force"))
    assert bench.load_history.stands
    assert {v.word for v in library(bench)} <= set(STANDING)
    found = explained(running(force, np.zeros(250), imposed="force"))
    assert found.verdict in ("none", "force_drift")


@pytest.mark.parametrize(("cycles", "many"), [(2.0, False), (3.0, True)])
def test_several_rates_at_once_are_as_free_as_a_path_of_pieces(cycles: float, many: bool) -> None:
    force = 100 * triangle(2000, cycles)
    bench = make_bench(running(force, force / SPRING, imposed="force"))
    assert ("rates" in words_with(bench, "thermal_drift")) is many
    assert "linear" in words_with(bench, "thermal_drift")


def test_strokes_that_grow_in_the_same_time_go_at_one_rate() -> None:
    t = np.arange(600) / 600
    force = 100 * (0.1 + t) * np.sin(2 * np.pi * 5 * t)
    assert make_bench(running(force, force / SPRING, imposed="force")).load_history.one_rate


def test_a_melt_that_flows_on_creeps_however_far() -> None:
    """Constant force, read at times that grow: a power law first, then a flow without end."""
    rng = np.random.default_rng(13)
    t = np.concatenate([[0.0], np.geomspace(0.01, 3000, 200)])
    force = np.where(t > 0, 10.0, 0.0)
    moved = np.where(t > 0, 1e-6 * (1 + 3 * t**0.4 + 0.8 * t), 0.0)
    data = bench_data(
        force + rng.normal(0, 0.02, t.size),
        moved + rng.normal(0, 2e-7, t.size),
        step=np.full(t.size, -1),
        branch=np.full(t.size, 3),
        session=t,
        time=t,
        imposed="force",
        instruments=Instruments(0.02, 2e-7, 0.005, 0.003),
        compliance=np.array([1e-7]),
    )
    bench = make_bench(data)
    creep = library(bench, ["joint_creep"])
    assert max(v.info["times_s"].max() for v in creep) > 3000
    assert max(v.scales[-1] for v in creep) > 1000
    found = explained(data)
    assert found.verdict == "joint_creep"
    assert found.after < 0.1 * found.before


def test_turning_points_of_a_crank_are_no_holds() -> None:
    for cycles in (2, 3, 5, 8):
        force = 100 * np.sin(2 * np.pi * cycles * np.arange(900) / 900)
        assert make_bench(
            running(force, force / SPRING, imposed="force")
        ).load_history.always_moves, cycles


@pytest.mark.parametrize("seed", range(3))
def test_a_straight_line_read_with_noise_bends_at_its_ends_and_is_no_curve(seed: int) -> None:
    """About a turn of the load the noise of its readings counts as elsewhere."""
    rng = np.random.default_rng(seed)
    force = 50 - 50 * np.cos(2 * np.pi * np.arange(800) / 40)
    read, shown = force + rng.normal(0, 1.0, 800), force / SPRING + rng.normal(0, 1e-6, 800)
    data = running(read, shown, imposed="force", instruments=Instruments(1.0, 1e-6, 0.005, 0.003))
    noise = make_bench(data).noise.response
    assert np.quantile(noise, 0.01) > 5e-6  # of 10 um that the force makes
    assert explained(data).verdict == "none"


@pytest.mark.parametrize("runs", [1, 2])
def test_a_hold_of_which_only_the_ends_were_kept_is_one_and_a_pause_is_none(runs: int) -> None:
    t = np.concatenate([np.arange(0, 6, 0.05), np.arange(150, 152, 0.05)])
    force = 100 * np.minimum(t, 1.0)
    run = (t > 100) * (runs - 1)
    data = running(force, force / SPRING, imposed="force", run=run, repetition=run + 1)
    bench = make_bench(replace(data, time=t, session=t))
    assert bench.load_history.always_moves is (runs == 2)
    assert words_with(bench, "joint_creep")
    later = make_bench(replace(data, time=t, session=t, run=(t > 5).astype(np.int64)))
    assert not later.load_history.always_moves  # the run that was held began within the first piece


@pytest.mark.parametrize(("imposed", "holds"), [(None, False), ("force", True)])
def test_a_stroke_that_runs_on_while_the_force_stands_is_no_hold(
    imposed: str | None, holds: bool
) -> None:
    """Metal that flows: nobody says what is driven, and the force stands as under a weight."""
    t = np.arange(120.0)
    force = 50 * np.minimum(t / 80, 1.0)
    u = force / SPRING + 4e-5 * np.maximum(t - 80, 0.0)
    assert make_bench(running(force, u, imposed=imposed)).load_history.always_moves != holds
    slow = np.where(t > 80, 1e-4 * (1 - np.exp(-(t - 80) / 20)), 0.0)  # creep slows down
    assert not make_bench(running(force, 10 * force / SPRING + slow)).load_history.always_moves


@pytest.mark.parametrize(
    ("load", "holds"),
    [
        ("later", False),
        ("later, pressed", False),
        ("at once", True),
        ("at once, and gone", True),
        ("a preload", True),
    ],
)
def test_before_the_load_comes_nothing_is_held(load: str, holds: bool) -> None:
    """Grips that are slack pull with next to nothing; what was loaded before creeps back."""
    t = np.arange(240.0)
    slack, pull = 1 + 0.005 * t, np.clip((t - 80) / 160, 0, 1)
    force = {
        "later": slack + 50 * pull,
        "later, pressed": -slack - 50 * pull,
        "at once": 50 + 50 * pull,
        "a preload": 4 + 46 * pull,
        "at once, and gone": 50 * np.clip(1 - t / 60, 0, 1) + 0.1,
    }[load]
    bench = make_bench(running(force, force / SPRING, imposed="force"))
    assert bench.load_history.always_moves != holds
    assert bool(words_with(bench, "joint_creep")) == holds


def test_waiting_before_loops_is_a_stand_and_takes_no_time_of_them() -> None:
    force = np.append(np.zeros(600), 50 * triangle(300, 6))
    course = make_bench(running(force, force / SPRING, imposed="force")).load_history
    assert not course.always_moves
    assert course.stroke_s == pytest.approx(25, rel=0.15)


def test_a_specimen_that_relaxes_before_its_stroke_is_held() -> None:
    t = np.arange(240.0)
    stroke = 1e-3 * np.clip((t - 80) / 160, 0, 1)
    force = 40 * np.exp(-np.minimum(t, 80) / 30) + stroke * SPRING
    data = running(force, stroke, imposed="displacement")
    assert not make_bench(data).load_history.always_moves


def test_a_long_table_of_numbered_readings_runs() -> None:
    """Sixty levels and more, each read once, are no levels; fewer are a table of them, and what is
    read several times rests, or is met again on the way back."""

    def held(n: int, each: int = 1, back: bool = False) -> bool:
        step = np.arange(n) // each
        step = np.minimum(step, n - 1 - step) if back else step
        force = 1.0 + step
        return not reduce_rows(bench_data(force, force / SPRING, step=step)).continuous

    assert not held(60)
    assert held(59)
    assert held(240, each=4)
    assert held(240, back=True)
    arm = bench_data(np.arange(80.0), np.arange(80.0) / SPRING, step=np.arange(80))
    assert is_continuous(arm, hold_ids(arm))
    assert not is_continuous(replace(arm, arm=True), hold_ids(arm))  # is read as it was planned


@pytest.mark.parametrize("creeps", [0.4, 0.6])
def test_a_force_that_runs_through_zero_under_one_step_runs(creeps: float) -> None:
    """Where the force changes its side from one reading to the next, a hold ends; and on neither
    side it runs through half of what it does on both."""
    force = 100 * np.sin(np.arange(300) / 2)
    data = replace(running(force, force / SPRING), step=np.ones(300, dtype=int))
    assert hold_ids(data)[-1] > 1
    assert is_continuous(data, hold_ids(data))
    levels = np.repeat([0.0, 50, 100, 50, 0, -50, -100, -50, 0, 50], 30)
    levels *= 1 - creeps * np.tile(np.linspace(0, 1, 30), 10)  # a screw that relaxes at each
    held = replace(running(levels, levels / SPRING), step=np.repeat(np.arange(10), 30))
    assert is_continuous(held, hold_ids(held)) is (creeps > 0.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("imposed", "told"), [("displacement", "it may pass 1"), ("force", "1: nothing moves before")]
)
def test_what_goes_through_friction_is_told_with_what_it_is_counted_against(
    imposed: Literal["displacement", "force"], told: str
) -> None:
    """A friction half as stiff as the spring stands beside it; or half of the spring is held."""
    way = np.sin(np.linspace(0, 6 * np.pi, 900))
    held = np.zeros(len(way))
    for i, step in enumerate(np.diff(way), 1):
        held[i] = np.clip(held[i - 1] + step, -0.15, 0.15)
    other = way + 0.5 * held if imposed == "displacement" else way - 0.5 * held
    force, u = (other, way) if imposed == "displacement" else (way, other)
    rng, meter = np.random.default_rng(1), Instruments(0.1, 1e-6, 0.005, 0.003)
    found = explained(
        running(
            100 * force + rng.normal(0, 0.1, len(way)),
            1e-3 * u + rng.normal(0, 1e-6, len(way)),
            imposed=imposed,
            instruments=meter,
        )
    )
    assert found.verdict == "joint_hysteresis"
    share = found.effects[0].parameters["share_through_friction"]
    assert share.value == pytest.approx(0.5, abs=0.05)
    (line,) = (s for s in render(found).splitlines() if s.startswith("  share_through_friction:"))
    assert line.endswith(told)
