"""Friction and lags: what strokes and steps show of them, and what they can't show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.effects import library, time_lag
from identification.gap.effects.joint_backlash import variants as plays
from identification.gap.evidence.compare import by_word, closest, marginal, score
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.laws.lags import late
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from identification.gap.search.refine import refine
from identification.gap.search.search import search
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running, triangle, words_with
from tests.unit.test_gap_weights import hanging


@pytest.mark.slow
def test_friction_whose_first_slope_was_simulated_is_friction() -> None:
    """Nothing but sliders, moved to and fro: all of the stiffness is theirs."""
    u = 1e-3 * np.sin(np.arange(500) / 20)
    force, state = np.zeros(500), np.zeros(6)
    limits, stiff = np.geomspace(0.5, 8.0, 6), np.full(6, 1.5e4)
    for i, step in enumerate(np.diff(u, prepend=0.0)):
        state = np.clip(state + stiff * step, -limits, limits)
        force[i] = state.sum()
    force += np.random.default_rng(9).normal(0, 0.05, 500)
    said = explained(running(force, u, imposed="displacement"))
    assert said.verdict == "joint_hysteresis"
    assert said.effects[0].name == "joint_hysteresis"


def test_a_lag_is_no_longer_than_half_a_stroke() -> None:
    u = 1e-3 * np.minimum(np.arange(300) / 10, 1.0)
    bench = make_bench(running(SPRING * u, u, imposed="displacement"))
    assert 5 < bench.load_history.stroke_s < 25
    longest = max(v.info["lag_s"] for v in library(bench, ["time_lag"]))
    assert longest <= bench.load_history.stroke_s / 2


def test_a_driven_channel_that_lags_was_ahead_only_while_it_moved() -> None:
    """Ramp and hold: what goes on in the hold is no lag of the channel that was driven."""
    u = 1e-3 * np.minimum(np.arange(300) / 60, 1.0)
    bench = make_bench(running(SPRING * u, u, imposed="displacement"))
    held = np.arange(300) > 70
    for kind in ("delay", "filter"):
        driven = late(bench, "displacement", kind, 5.0)
        assert np.abs(driven[:300][held]).max() < 1e-9 * np.abs(driven).max()
        assert driven[30] == pytest.approx(1e-3 * 5 / 60, rel=1e-6)  # 5 s ahead, of 60
        answering = late(bench, "force", kind, 5.0)
        assert answering[62] < 0  # the force still comes up


def test_lag_of_a_recording_without_lag_is_not_made_of_its_noise() -> None:
    """Noise of what is driven is in the response too; a column with that noise would explain it."""
    rng = np.random.default_rng(7)
    true = 100 * triangle(400, 0.9)
    force = true + rng.normal(0, 1.0, 400)
    bench = make_bench(running(force, true / SPRING, imposed="force"))
    left = bench.response - bench.load / SPRING
    lags = [v for v in library(bench, ["time_lag"]) if v.info["channel"] == "displacement"]
    n = bench.rows.n
    assert lags
    for v in lags:
        column = bench.columns[v.columns[0]][:n]
        assert abs(np.corrcoef(column, left)[0, 1]) < 0.3, v.label


def test_a_channel_may_lag_as_behind_two_filters() -> None:
    """A step's answer begins without a jump: `1 - (1 + t/T) exp(-t/T)`, 2 T late."""
    force = np.repeat([0.0, 50.0, -50.0, 20.0], 60)
    levels = bench_data(force, force / SPRING, step=np.repeat(np.arange(4), 60))
    bench = make_bench(levels)
    behind = late(bench, "displacement", "two filters", 4.0)[: bench.rows.n]
    first = bench.rows.hold == 1
    t = bench.rows.time[first] - 60
    left = -50 / SPRING * (1 + t / 2) * np.exp(-t / 2)
    # the load comes within a second or so
    assert np.abs(behind[first] - left)[t > 4].max() < 0.1 * 50 / SPRING
    assert behind[first][0] == pytest.approx(-50 / SPRING, rel=0.1)
    assert any(v.info["kind"] == "two filters" for v in library(bench, ["time_lag"]))


def test_a_fast_swing_keeps_its_height_in_a_lag() -> None:
    """Thirty readings a swing: what was taken off it as noise would be a gap without a word."""
    t = np.arange(600.0)
    force = 100 * np.sin(2 * np.pi * t / 30) + np.random.default_rng(4).normal(0, 0.1, len(t))
    bench = make_bench(running(force, force / SPRING, imposed="force"))
    lagging = late(bench, "displacement", "delay", 1.0)[: bench.rows.n]
    true = 100 * (np.sin(2 * np.pi * (t - 1) / 30) - np.sin(2 * np.pi * t / 30)) / SPRING
    inner = slice(10, -10)
    assert np.abs(lagging - true)[inner].max() < 0.03 * np.abs(true).max()


@pytest.mark.parametrize("then", [1.0, -1.0])
def test_nobody_knows_the_path_across_a_pause(then: float) -> None:
    """Up, a pause of which nothing was kept, and on, or back: no path swings beyond in between."""
    t = np.concatenate([np.arange(0, 5, 0.05), np.arange(65, 70, 0.05)])
    force = np.where(t < 5, 12 * t, 60 + then * 12 * (t - 65))
    data = running(force, force / SPRING, imposed="force")
    bench = make_bench(replace(data, time=t, session=t))
    behind = late(bench, "displacement", "delay", 0.6)[: len(t)]
    since = np.minimum(t[100:] - 65, 0.6)  # until then it still shows what stood in the pause
    assert behind[100:] == pytest.approx(-then * 12 * since / SPRING, abs=0.01 * 12 * 0.6 / SPRING)


def test_a_time_that_stands_twice_cuts_a_path_there_and_nowhere_else() -> None:
    t = np.arange(600.0)
    force = 100 * np.sin(2 * np.pi * t / 12)
    again = np.where(t == 300, 299.0, t)

    def behind(time: Array) -> Array:
        data = replace(running(force, force / SPRING, imposed="force"), time=time, session=time)
        bench = make_bench(data)
        return late(bench, "displacement", "delay", 0.5)[: bench.rows.n]

    far = np.abs(t - 300) > 20
    assert behind(again)[far] == pytest.approx(behind(t)[far], abs=1e-9)


def test_steps_of_what_is_driven_are_no_noise_and_stay_sharp_in_a_lag() -> None:
    force = np.repeat([0.0, 50.0, 0.0, -50.0, 0.0], 40)
    bench = make_bench(running(force, force / SPRING, imposed="force"))
    behind = late(bench, "displacement", "delay", 3.0)[: len(force)]
    moved = np.flatnonzero(np.abs(behind) > 1e-9)
    assert set(moved) <= {k * 40 + i for k in range(1, 5) for i in range(4)}
    assert behind[41] == pytest.approx(-50.0 / SPRING)


def test_one_reading_a_step_on_one_way_shows_no_lag() -> None:
    up = np.arange(12.0)
    for load, shows in ((up, False), (np.append(up, up[::-1]), True)):
        bench = make_bench(bench_data(load, load * 1e-5))
        assert bool(words_with(bench, "time_lag")) is shows
    held = np.repeat(up, 3)
    bench = make_bench(bench_data(held, held * 1e-5, step=np.repeat(np.arange(12), 3)))
    assert words_with(bench, "time_lag")


def test_friction_beside_a_spring_far_too_stiff_is_as_exact_as_friction() -> None:
    """A pad that is dragged to and fro, sliding from the start: 2.5 N where 300 N were foreseen. A
    law that is met to a few percent of the spring's force would say nothing of the friction."""
    u = 0.03 * (2 * triangle(180, 1.0) - 1)
    force, state = np.zeros(180), 2.5
    for i, step in enumerate(np.diff(u, prepend=u[0])):
        state = float(np.clip(state + 4e3 * step, -2.5, 2.5))
        force[i] = state + 0.15 * np.sin(u[i] * 900)
    force += np.random.default_rng(4).normal(0, 0.03, 180)
    bench = make_bench(running(force, u, imposed="displacement", compliance=np.array([1e-4])))
    variants = library(bench, ["joint_hysteresis", "joint_stiffness_error"])
    base, target = base_columns(bench), bench.observed - prediction(bench)
    engine = Engine(bench, base, target, eta_levels(bench, base, target))
    found = search(engine, variants).explanations
    assert {"joint_hysteresis"} == found[0].words
    assert found[0].parts[0].variant.info["other_springs"]
    together = next(e for e in found if len(e.parts) == 2)
    assert found[0].log_weight > together.log_weight


@pytest.mark.parametrize(("returns", "loops"), [(False, False), (True, True)])
def test_pulls_alone_show_no_loop_however_often(returns: bool, loops: bool) -> None:
    up = np.arange(12.0)
    one = np.append(up, up[::-1]) if returns else up
    load, run = np.tile(one, 3), np.repeat(np.arange(3), len(one))
    data = bench_data(load, load * 1e-5, run=run, repetition=run + 1, step=np.arange(len(load)))
    assert bool(words_with(make_bench(data), "joint_hysteresis")) is loops


@pytest.mark.parametrize(("stroke", "drifts"), [(0.0, True), (1e-3, False)])
def test_a_force_that_is_read_where_nothing_is_moved_is_the_instrument_s(
    stroke: float, drifts: bool
) -> None:
    """Under a stroke that stands the same readings may be relaxation."""
    rng = np.random.default_rng(2)
    force = 14.0 - np.linspace(0, 3, 200) + rng.normal(0, 1.0, 200)
    data = running(force, np.full(200, stroke), imposed="displacement")
    assert bool(words_with(make_bench(data), "force_drift")) is drifts


# Of a force that lags, what is read while the load comes counts little: hands took it there.
@pytest.mark.parametrize(("channel", "gained"), [("force", 3), ("displacement", 20)])
def test_the_search_closes_in_on_a_lag_between_those_of_the_grid(
    channel: str, gained: float
) -> None:
    steps = np.repeat(np.arange(13), 3)
    levels = np.array([0.0, 20, 40, 60, 80, 100, 120, 100, 80, 60, 40, 20, 0])[steps]
    branch = np.where(steps < 7, 1, 2)
    data = bench_data(levels, 1e-5 * levels, step=steps, branch=branch)
    bench = make_bench(data)
    true = 1.42
    assert min(abs(lag - true) for lag in time_lag.LAGS) > 0.1 * true
    target = bench.observed - prediction(bench) + late(bench, channel, "delay", true)
    variants = library(bench, ["time_lag"])
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 5e-6, 2e-5]))
    first = score(engine, engine.levels, variants)
    finer = refine(engine, first)
    second = score(engine, engine.levels, finer)
    best = max(second, key=lambda s: s.log_evidence)
    assert best.variant.info["lag_s"] == pytest.approx(true, rel=0.02)
    assert best.log_evidence > max(s.log_evidence for s in first) + gained


@pytest.mark.parametrize(("swing", "gains"), [(15, False), (5, True)])
def test_lags_of_a_running_recording_are_closed_in_on(swing: int, gains: bool) -> None:
    """A camera 2.35 samples late: between two lags of the grid. Of slow swings a little less of a
    longer lag says the same."""
    at, true = np.arange(400.0), 2.35
    force, shown = (50 - 50 * np.cos(np.maximum(at - 9 - d, 0) / swing) for d in (0.0, true))
    bench = make_bench(running(force, shown / SPRING, imposed="force"))
    target = bench.observed - prediction(bench)
    variants = library(bench, ["time_lag"])
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-7, 5e-7, 2e-6]))
    first = score(engine, engine.levels, variants)
    finer = refine(engine, first)
    best = max(score(engine, engine.levels, finer), key=lambda s: s.log_evidence)
    assert best.variant.info["lag_s"] == pytest.approx(true * bench.rows.time[1], rel=0.02)
    assert not gains or best.log_evidence > max(s.log_evidence for s in first)


def test_flanks_that_approach_slowly_are_a_shape_of_a_play() -> None:
    """Taken up as the arcus tangent, which the library does not have."""
    up = np.concatenate([np.arange(0, 84, 8.0), np.arange(72, -1, -8.0)])
    bench = hanging(np.concatenate([up, -up]), gravity=0.0)
    wide = bench.joint_column(0, np.arctan(bench.true_torque[:, 0] / 8.0) / np.pi)
    target = bench.observed - prediction(bench) + 5e-4 * wide
    variants = plays(bench)
    engine = Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 5e-6, 2e-5]))
    best: dict[str, float] = {}
    for s in score(engine, engine.levels, variants):
        kind = str(s.variant.info["kind"])
        best[kind] = max(best.get(kind, -np.inf), s.log_evidence)
    assert best.pop("slow") > max(best.values()) + 20


def test_growing_presses_of_a_tip_yield_from_the_first_load_on() -> None:
    """What one press leaves may be friction's; that the next one goes on from there is not."""
    load = np.concatenate([top * triangle(80, 1.0) for top in (25.0, 50.0, 75.0, 100.0)])
    largest = np.maximum.accumulate(load)
    rng = np.random.default_rng(6)
    pressed = 1e-5 * load + 4e-7 * largest**1.5 + rng.normal(0, 1e-6, len(load))
    said = explained(running(load, pressed, imposed="force"))
    assert said.verdict == "joint_yield"
    assert said.fit.parts[0].variant.info["centre"] < 10.0  # N
    once = make_bench(running(load[:80], load[:80] / SPRING, imposed="force"))
    labels = [v.label for v in library(once, ["joint_yield"])]
    assert any("hardened beyond 0.18" in label for label in labels)
    assert not any(label.endswith("hardened beyond 0.01") for label in labels)


def power_law(torque: Array, power: float) -> Array:
    """(n,) path `x^power` of torques, at the largest 1, and back along the same curve twice as
    large (Ramberg and Osgood 1943, Masing 1926): sliders of all strengths, ever more of them."""
    top = np.abs(torque).max()
    strength = np.linspace(top / 400, top, 400)
    weight, last, out = strength ** (power - 2), np.zeros(400), np.zeros(len(torque))
    for i, x in enumerate(torque):
        last = np.clip(last, x - strength, x + strength)
        out[i] = weight @ last
    return np.asarray(out / (weight @ (top - strength)))


@pytest.mark.parametrize(("power", "word"), [(5.0, "joint_yield"), (1.3, "joint_hysteresis")])
def test_what_holds_small_loads_firmly_yields_what_slips_from_the_first_on_rubs(
    power: float, word: str
) -> None:
    steps = np.concatenate([np.arange(0, 101, 5.0), np.arange(95, -1, -5.0)])
    bench = hanging(steps, gravity=0.0)
    torque = bench.true_torque[:, 0]
    path = 0.3 * float(np.ptp(bench.elastic[:, 0])) * power_law(torque, power)
    variants = library(bench, ["joint_yield", "joint_hysteresis"])
    target = bench.observed - prediction(bench) + bench.stacked(path)
    engine = Engine(
        bench, base_columns(bench), target, eta_levels(bench, base_columns(bench), target)
    )
    scored = by_word(score(engine, engine.levels, variants))
    evidence = {w: marginal(s) for w, s in scored.items()}
    assert max(evidence, key=lambda w: evidence[w]) == word
    if word == "joint_yield":
        assert closest(scored[word]).variant.info["knee"] == "slow"
