"""Lost motion against curved springs: by how sharply the stiffness comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.special import erf

from identification.arrays import Array
from identification.gap.effects import joint_hysteresis
from identification.gap.evidence.engine import Engine
from identification.gap.judging.dead_zone import (
    CURVE,
    PLAINLY,
    PLAY,
    SOMEHOW,
    _curve,
    has_dead_zone,
    spoken_for,
)
from identification.gap.laws.friction_forms import RADII
from identification.gap.model.bench import Bench, KnownEffects
from tests.explained import explained
from tests.unit.small_explanations import part, said, small_engine_of
from tests.unit.test_gap_flanks import N, a_bench, held, to_and_fro

U = np.linspace(-1.0, 1.0, 600)
FRICTION = "joint_hysteresis"
Spring = Callable[[Array], Array]


def gap(half: float, power: float = 1.0, centre: float = 0.0) -> Spring:
    def force(u: Array) -> Array:
        x = u - centre
        return np.asarray(np.sign(x) * np.maximum(np.abs(x) - half, 0.0) ** power)

    return force


def power(exponent: float) -> Spring:
    return lambda u: np.asarray(np.sign(u) * np.abs(u) ** exponent)


def stages(ratio: float, at: float) -> Spring:
    return lambda u: np.asarray(u + (ratio - 1) * np.sign(u) * np.maximum(np.abs(u) - at, 0.0))


PLAYS = {
    "narrow": gap(0.03),
    "wide": gap(0.3),
    "teeth pressed as by Hertz": gap(0.15, 1.1),
    "off the middle": gap(0.1, centre=0.4),
}
CURVES = {
    "straight": power(1.0),
    "contact": power(1.5),
    "cubic": power(3.0),
    "soft at first": power(2 / 3),
    "stages of a gear": stages(1.85, 0.3),
    "helper spring": stages(3.0, 0.3),
    "rubber": lambda u: np.sinh(3 * u),
    "tissue": lambda u: np.sinh(7 * u),
    "saturates": lambda u: np.tanh(2 * u),
    "a seat at the end": gap(0.4, centre=-0.8),
}


@pytest.mark.parametrize("name", PLAYS)
def test_a_play_is_a_dead_zone_with_sharp_ends(name: str) -> None:
    assert has_dead_zone(U, PLAYS[name](U), PLAINLY)


@pytest.mark.parametrize("name", CURVES)
def test_a_curve_has_none(name: str) -> None:
    assert not has_dead_zone(U, CURVES[name](U), PLAINLY)
    hardens = name in ("cubic", "rubber", "tissue")  # as fast as some plays end softly
    assert has_dead_zone(U, CURVES[name](U), SOMEHOW) == hardens


def one_sharp_end(u: Array) -> Array:
    return np.where(u < -0.2, u + 0.2, np.maximum(u + 0.2, 0.0) ** 3)


@pytest.mark.parametrize(
    "force", [one_sharp_end, gap(0.8), lambda u: 0 * u, lambda u: -u], ids=["one", "all", "0", "-"]
)
def test_what_lacks_a_flank_is_no_play(force: Spring) -> None:
    assert not has_dead_zone(U, force(U), PLAINLY)
    assert not has_dead_zone(0 * U, force(U), PLAINLY)


def test_where_a_play_is_likelier_softer_ends_are_enough() -> None:
    x = np.linspace(-1.0, 1.0, 600)
    u = x + 0.3 * np.tanh(x / 0.06)
    assert not has_dead_zone(u, x, PLAINLY)
    assert has_dead_zone(u, x, SOMEHOW)
    assert not has_dead_zone(U, stages(3.0, 0.3)(U), SOMEHOW)


@pytest.mark.slow
@pytest.mark.parametrize("cycles", [4, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["wide", "teeth pressed as by Hertz"])
def test_a_play_that_a_free_curve_meets_as_well_is_a_play(name: str, cycles: int) -> None:
    u = to_and_fro(cycles=cycles)
    found = explained(a_bench(PLAYS[name](u), u, "displacement").data)
    assert found.verdict == PLAY
    assert found.probabilities[PLAY] > 0.6


def test_a_part_that_rubs_in_its_play_meets_the_same_ends_there_and_back() -> None:
    """At other forces: between the two ways it looks stiff and loose by turns."""
    u = to_and_fro(cycles=2)
    rubbing = gap(0.15)(u) + 0.05 * np.sign(np.gradient(u))
    assert has_dead_zone(u, rubbing, PLAINLY)


@pytest.mark.slow
def test_stages_of_a_gear_that_rubs_are_a_curve_beside_friction() -> None:
    """The friction's other way back is no part of what the curve is judged by."""
    swings = [s * top for top in (0.4, 0.7, 1.0) for s in (1, -1, 1, -1)]
    force = np.interp(np.linspace(0, 13, N), np.arange(14), [0.0, *swings, 0.0])
    grid = np.linspace(-1.5, 1.5, 3001)
    u = np.interp(force, stages(1.85, 0.3)(grid), grid)
    u = u + sum(0.06 * held(force, r) for r in (0.05, 0.1, 0.2, 0.4))
    found = explained(a_bench(force, u, "force").data)
    assert {e.name for e in found.effects} == {CURVE, FRICTION}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["contact", pytest.param("cubic", marks=pytest.mark.slow)])
def test_a_curve_that_a_soft_play_beside_a_curve_meets_better_is_a_curve(name: str) -> None:
    u = to_and_fro(cycles=8)
    found = explained(a_bench(CURVES[name](u), u, "displacement").data)
    assert found.verdict == CURVE


def test_a_play_that_is_passed_between_two_readings_is_no_curve() -> None:
    """Rounded as teeth are, and told by few readings of each pass what it is like."""
    u = to_and_fro(cycles=8)
    force = np.asarray(np.interp(u, U + 0.012 * np.tanh(U / 0.005), U))
    found = explained(a_bench(force, u, "displacement").data)
    assert found.verdict == PLAY


def test_a_step_with_no_reading_inside_is_a_play_however_steep_it_looks() -> None:
    """From the reading before to the one behind, 2 % of the range away, it looks half as stiff."""
    force = np.sin(2 * np.pi * np.arange(N) / 300)
    found = explained(a_bench(force, force + 0.025 * erf(force / 0.012), "force").data)
    assert found.verdict == PLAY


@pytest.mark.slow
def test_a_play_that_friction_holds_is_no_curve_however_soft_its_mean_looks() -> None:
    """Its two ways lie apart by the friction, and no curve goes either of them."""
    force = to_and_fro()
    inside = np.clip(held(force, 0.05) / 0.02, -0.2, 0.2)
    found = explained(a_bench(force, force + inside, "force").data)
    assert found.verdict == PLAY


def test_a_play_that_the_simulation_has_is_none_of_a_curve() -> None:
    u = to_and_fro()
    bench = a_bench(gap(0.3)(u), u, "displacement")
    play = bench.stated_slope * bench.load - bench.response
    straight = replace(bench, response=bench.response + play, observed=bench.observed + play)
    known = KnownEffects(-play, np.zeros((bench.layout.size, 0)), (), 0.0)
    for case, is_play in ((straight, False), (bench, True), (replace(bench, known=known), False)):
        curve = said((part(CURVE, [case.add(case.stacked(play))]),), (0.0,))
        assert has_dead_zone(*_curve(small_engine_of(case), curve), SOMEHOW) is is_play


def bolted() -> Bench:
    """A bolt in its hole, which the plates rub along."""
    u = to_and_fro(cycles=5)
    force = gap(0.6)(u) + 0.02 * (u - held(u, 0.01)) / 0.01 * (1 + 0.4 * np.abs(u))
    return a_bench(force, u, "displacement")


@pytest.mark.slow
def test_friction_beside_it_does_not_hide_a_play(monkeypatch: pytest.MonkeyPatch) -> None:
    """What goes two ways has a middle; from one side nothing is said. A spectrum of friction that
    is stiff as well as soft takes the play itself: then the play explains more by far."""
    assert explained(bolted().data).verdict == PLAY
    monkeypatch.setattr(joint_hysteresis, "STIFF", ())
    monkeypatch.setattr(joint_hysteresis, "WITH_STIFF", RADII)
    result = explained(bolted().data)
    assert result.verdict == PLAY
    ranked = result.found.explanations
    both = next(e for e in ranked if e.words == {CURVE, FRICTION} and e.parts[0].word == CURVE)
    said = spoken_for(result.engine, (both, *ranked))
    assert said[both.words].words == {PLAY, FRICTION}
    bench = result.engine.bench
    few = replace(bench, load=np.round(bench.load / np.ptp(bench.load), 1))
    few.__dict__["load_history"] = SimpleNamespace(one_sided=False)
    assert spoken_for(cast(Engine, SimpleNamespace(bench=few)), (both, *ranked)) == {}
    bench.__dict__["load_history"] = SimpleNamespace(one_sided=True)
    assert spoken_for(result.engine, (both, *ranked)) == {}


def test_a_play_that_rubs_is_one_wherever_the_drive_turns_within_it() -> None:
    """A random drive: friction stands otherwise at every passage of a place."""
    rng = np.random.default_rng(4)
    t = np.linspace(0.0, 1.0, 1600)
    swings = np.sin(2 * np.pi * (np.outer(np.arange(3, 40), t) + rng.random((37, 1)))).sum(axis=0)
    u = swings / np.abs(swings).max()
    slider = np.zeros(len(u))
    for i in range(1, len(u)):  # sticks over a fiftieth of the way
        slider[i] = np.clip(slider[i - 1] + (u[i] - u[i - 1]) / 0.02, -1.0, 1.0)
    force = gap(0.15)(u) + 0.02 * slider
    assert has_dead_zone(u, force, SOMEHOW)


def test_a_part_that_sticks_once_in_its_play_leaves_it_one() -> None:
    sticks = 0.006 * np.clip(U / 0.01, -1.0, 1.0)  # stiffer than half of a flank
    assert has_dead_zone(U, gap(0.2)(U) + sticks, PLAINLY)
    bears = 0.03 * np.clip(U / 0.06, -1.0, 1.0)  # over more of it: two plays, and a spring between
    assert not has_dead_zone(U, gap(0.2)(U) + bears, PLAINLY)
