"""Single pulls and pulls that are repeated, of rigs without an arm: what only gets stiffer, what
flows far beyond its knee, toes, dents, cracks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.result import GapResult
from identification.gap.data import GapData, Instruments
from identification.gap.effects import contact_seating, library
from identification.gap.effects.contact_seating import refined
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, energies
from identification.gap.explanations.penalties import _same_element
from identification.gap.explanations.priors import prior_of
from identification.gap.explanations.verdict import ARMLESS_DOUBT, discounted
from identification.gap.model.base import base_columns
from identification.gap.model.bench import make_bench
from identification.gap.search.unmodelled_shapes import unmodelled_variants
from identification.gap.words import WORDS
from rig.diagnosis.diagnose_text import meanings, render
from tests.explained import explained
from tests.unit.test_gap_linear import charged
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running

METER = Instruments(0.1, 1e-6, 0.005, 0.003)
STROKE = 1e-3  # m


def pulled(
    force: Array, u: Array, imposed: str | None = "displacement", **changes: object
) -> GapResult:
    noise = np.random.default_rng(5).normal(0, METER.force, len(u))
    return explained(running(force + noise, u, imposed=imposed, instruments=METER, **changes))


def voce(u: Array, knee: float = 30.0, more: float = 40.0) -> Array:
    """N: elastic, a knee, then hardening that ends (Voce 1948)."""
    elastic = knee / SPRING
    beyond = np.maximum(u - elastic, 0.0)
    return np.minimum(SPRING * u, knee) + more * -np.expm1(-beyond / (0.2 * u.max()))


def test_what_only_gets_stiffer_is_a_curve_however_late() -> None:
    """Two magnets: force over the cube of the gap."""
    u = np.linspace(0.0, STROKE, 80)
    found = pulled(10.0 * ((1.1 - u / STROKE) ** -3 - 1.1**-3), u)
    assert found.verdict == "joint_nonlinear_stiffness"
    assert found.fit.parts[0].variant.label.startswith("joint 1 locks")
    assert found.after < 0.06 * found.before


def test_what_draws_out_under_a_weight_yields_however_far() -> None:
    """Plastics under one weight after the other: the last of a few readings is a hundred times as
    far as the spring would go."""
    force = 10.0 * np.arange(8)
    u = force / SPRING + np.array([0, 0, 0, 0, 0, 1e-5, 3e-5, 0.02])
    found = pulled(force, u, imposed="force")
    assert found.verdict == "joint_yield"
    assert found.after < 0.05 * found.before


@cache
def drawn_far() -> GapResult:
    u = np.concatenate([np.linspace(0, 6e-4, 20), np.linspace(1e-3, 3e-2, 40)])
    return pulled(voce(u), u)


def test_metal_that_flows_far_beyond_its_knee_yields() -> None:
    """A hundred times as far as it was elastic: how far a law is off is no matter of that."""
    found = drawn_far()
    assert found.verdict == "joint_yield"
    assert found.probabilities["joint_yield"] > 0.6
    assert found.probabilities["unknown"] < 0.25
    assert found.engine.most < (0.1 * SPRING**-1 * 1e4) ** 2
    assert "): it gives way above a threshold load." in render(found)  # no joint there


def test_a_polymer_that_softens_beyond_its_knee_and_then_flows_has_yielded() -> None:
    """Up to a maximum halfway, and down to a level: intrinsic softening. No elastic curve falls."""
    u = np.linspace(0.0, STROKE, 220)
    knee = 0.55 * STROKE
    rises = SPRING * u / (1 + (u / knee) ** 8) ** (1 / 8)
    softens = 0.17 * rises.max() / (1 + np.exp(-(u - 0.68 * STROKE) / (0.04 * STROKE)))
    found = pulled(rises - softens, u)
    assert found.verdict == "joint_yield"
    assert found.after < 0.1 * found.before


@pytest.mark.parametrize("back", [False, True])
def test_what_is_pulled_once_may_soften_what_comes_back_may_not(back: bool) -> None:
    u = STROKE * np.linspace(0, 1, 120)
    u = np.concatenate([u, u[::-1]]) if back else u
    bench = make_bench(running(voce(u), u, imposed="displacement"))
    knees = [v for v in library(bench, ["joint_yield"]) if v.info["knee"] == "round"]
    assert knees
    for v in knees:
        k = len(v.columns)
        assert v.each == (back,) * k
        softens = np.append(np.ones(k - 1), -0.5)  # a force that falls, and then stays
        assert np.all(v.within @ softens[np.argsort(np.argsort(v.info["radius"]))] > 0)
        assert len(v.within) == (0 if back else k - 1)


def test_every_word_is_said_in_words() -> None:
    assert set(meanings(arm=True)) == set(meanings(arm=False)) == set(WORDS)
    assert "torque" in meanings(arm=True)["joint_yield"]


def test_a_toe_before_a_knee_is_two_things_and_the_knee_is_the_larger() -> None:
    u = np.linspace(0.0, STROKE, 200)
    slack = 1e-4
    straight = np.where(u < 2 * slack, u**2 / (4 * slack), u - slack)
    found = pulled(SPRING * straight - 0.9 * np.maximum(SPRING * straight - 60.0, 0.0), u)
    assert found.verdict == "joint_yield"
    assert {e.name for e in found.effects} == {"contact_seating", "joint_yield"}


def test_a_knee_that_is_recorded_from_its_middle_on_has_no_seat() -> None:
    """A seat of several scales stiffens and never gives way again, as the foot of a knee does."""
    u = np.linspace(0.2 * STROKE, STROKE, 400)
    force = voce(u, knee=50.0)
    bench = make_bench(running(force, u, imposed="displacement", instruments=METER))
    seats = [v for v in library(bench, ["contact_seating"]) if v.label == "mixture"]
    assert seats
    assert all(all(v.each) for v in seats)
    assert pulled(force, u).verdict == "joint_yield"


def test_what_bends_over_all_of_the_stroke_is_a_curve_and_no_toe() -> None:
    """In proportion to its square."""
    u = np.linspace(0.0, STROKE, 200)
    found = pulled(SPRING * u**2 / STROKE, u)
    assert found.verdict == "joint_nonlinear_stiffness"
    laws = [law for v in library(found.bench, ["contact_seating"]) for law in v.info["laws"]]
    top = np.abs(found.bench.load).max()
    assert 0 < max(force for kind, force in laws if kind == "toe") < 0.5 * top
    toe, slack = (
        next(v for v in library(found.bench, ["contact_seating"]) if v.label == f"{law} 0.4")
        for law in ("toe", "slack")
    )
    assert max(v.info["force_N"] for v in contact_seating.refined(found.bench, toe)) < 0.5 * top
    assert max(v.info["force_N"] for v in contact_seating.refined(found.bench, slack)) > 0.5 * top


@pytest.mark.parametrize("slacks", [(1.2e-4,), (3e-5, 1.4e-4)])
def test_a_toe_alone_is_a_seat(slacks: tuple[float, ...]) -> None:
    """Slack that is taken up bit by bit, at once or in two, then the line that was simulated."""
    u = np.linspace(0.0, STROKE, 200)
    lost = [np.where(u < 2 * s, u - u**2 / (4 * s), s) for s in slacks]
    share = 1 / len(slacks)  # no more than all of the stiffness is gone at first
    found = pulled(SPRING * (u - share * sum(lost, np.zeros(200))), u)
    assert found.verdict == "contact_seating"
    assert found.fit.parts[0].variant.label.startswith("toe")
    depth = found.effects[0].parameters["depth"]
    assert depth.low < 1e3 * share * sum(slacks) < depth.high


def test_a_curve_that_locks_gets_stiffer_in_both_its_powers() -> None:
    bench = make_bench(running(SPRING * LINE, LINE, imposed="displacement", instruments=METER))
    variants = library(bench, ["joint_nonlinear_stiffness"])
    for v in (v for v in variants if "locks" in v.label):
        first, second = v.root[:, 1], v.root[:, 2]
        assert charged(v, list(first + second)) > -1.0
        for bad in (first - 0.2 * second, second - 0.2 * first):
            assert charged(v, list(bad)) < -10.0


LINE = np.linspace(0.0, STROKE, 60)


def test_no_energy_is_larger_than_the_response() -> None:
    engine = drawn_far().engine
    for v in library(engine.bench, ["joint_yield"])[:3]:
        assert energies(engine, (Part(v, 14.0),)).max() <= engine.most


def test_pulls_that_start_from_zero_again_show_that_a_curve_comes_back() -> None:
    """Soft in the middle and stiff at both ends, twice from the start, never unloaded."""
    x = np.linspace(0.0, 1.0, 80)
    force = 60 * x - 25 * x**2 + 60 * x**12
    n = len(x)
    run = np.repeat([0, 1], n)
    found = pulled(np.tile(force, 2), np.tile(x * STROKE, 2), run=run, repetition=run + 1)
    assert found.bench.load_history.repeats
    assert not found.bench.load_history.unloads
    assert found.verdict == "joint_nonlinear_stiffness"
    assert found.fit.parts[0].variant.label == "joint 1 fine curve"


@pytest.mark.parametrize(("left", "under_a_tip"), [(0.45, True), (0.1, False)])
def test_a_dent_that_stays_yields_from_the_first_load_on(left: float, under_a_tip: bool) -> None:
    """Pressed once and let go: depth goes with the root of the load, what is elastic comes back."""
    x = np.concatenate([np.linspace(0, 1, 80), np.ones(10), np.linspace(1, 0, 80)])
    most = np.maximum.accumulate(x)
    depth = STROKE * (left * most**0.5 + (1 - left) * x**0.7)
    data = running(100 * x, depth, imposed="force", instruments=METER)
    assert make_bench(data).load_history.left_behind == pytest.approx(left, abs=0.02)
    labels = [v.label for v in library(make_bench(data), ["joint_yield"])]
    assert ("joint 1 hardened beyond 0.01" in labels) is under_a_tip
    if under_a_tip:
        assert explained(data).verdict == "joint_yield"


@pytest.mark.slow
def test_cracks_under_an_imposed_stroke_are_no_drift_of_it() -> None:
    """Every cycle goes further, and what has cracked stays soft: a machine that moves by its own
    reading would take a drift back."""
    t = np.arange(900) / 900
    u = STROKE * (0.2 + 0.8 * t) * np.abs(np.sin(np.pi * 6 * t))
    damage = 0.6 * np.maximum.accumulate(u) / STROKE
    found = pulled(SPRING * u * (1 - damage), u)
    assert found.verdict != "thermal_drift"
    assert found.probabilities["thermal_drift"] < 0.4


def test_nobody_is_surer_of_the_unknown_than_of_a_word() -> None:
    doubted = {"joint_yield", "none", "unknown"}
    for word in doubted:
        sure = discounted({w: float(w == word) for w in doubted}, doubted, ARMLESS_DOUBT)
        assert sum(sure.values()) == pytest.approx(1.0)
        assert sure[word] < 1 - 0.6 * ARMLESS_DOUBT


def approached(travel: float = 2e-3, faster: float = 5.0, n: int = 160) -> tuple[Array, Array]:
    """Displacement m and force N: a platen comes nearer for a quarter of the readings, faster than
    it presses afterwards; forces are noise before."""
    u = np.concatenate(
        [
            np.linspace(0.0, travel, n // 4, endpoint=False),
            travel + np.linspace(0.0, 3 * travel / faster, 3 * n // 4),
        ]
    )
    return u, SPRING * np.maximum(u - travel, 0.0)


def test_a_way_at_no_force_before_a_contact_is_taken_up_slack() -> None:
    """Nobody says that the machine drives the displacement; the force is as simple."""
    u, force = approached()
    found = pulled(force, u, imposed=None)
    assert found.bench.imposed
    assert found.bench.load_history.approaches
    assert found.verdict == "contact_seating"
    assert found.probabilities["contact_seating"] > 0.6
    (depth,) = (p for n, p in found.effects[0].parameters.items() if n == "depth")
    assert depth.value == pytest.approx(2.0, rel=0.05)
    plain = make_bench(running(force[40:], u[40:], instruments=METER, imposed="displacement"))
    for word, less in (("joint_nonlinear_stiffness", True), ("contact_seating", False)):
        words = frozenset({word})
        assert (prior_of(words, found.bench) < prior_of(words, plain) - 10.0) == less


@pytest.mark.parametrize("slack", [0.33e-3, 0.72e-3])
def test_the_width_of_a_slack_is_met_between_those_of_the_grid(slack: float) -> None:
    u = np.linspace(0.0, STROKE, 200)
    found = pulled(SPRING * np.maximum(u - slack, 0.0), u)
    assert found.verdict == "contact_seating"
    assert found.after < 1.5 * found.noise


@pytest.mark.parametrize("what", ["slow", "short", "preload", "curve", "again"])
def test_a_way_at_some_force_or_a_slow_one_is_no_approach(what: str) -> None:
    u, force = approached()
    driven: str | None = "displacement"
    if what == "slow":  # as fast as all of it, and nobody says what was driven: a drift
        (u, force), driven = approached(faster=1.7), None
    elif what == "short":
        u, force = approached(travel=1e-4, faster=0.2)
    elif what == "preload":
        force = np.where(np.arange(len(u)) > 0, force + 30.0, 0.0)
    elif what == "again":
        u, force = (np.concatenate([v, v[::-1]]) for v in (u, force))
    else:
        force = 100.0 * (u / u[-1]) ** 2
    assert not make_bench(
        running(force, u, instruments=METER, imposed=driven)
    ).load_history.approaches


@pytest.mark.parametrize("power", [1, 6])
def test_a_driven_approach_need_not_be_fast_but_nothing_may_be_felt_on_it(power: int) -> None:
    u, force = approached(faster=1.7)
    if power > 1:  # stiffens so late that half of the way looks like no force at a glance
        force = 1500.0 * (u / u[-1]) ** power
    bench = make_bench(running(force, u, instruments=METER, imposed="displacement"))
    assert bench.load_history.approaches == (power == 1)


def test_what_is_met_after_an_approach_may_seat_itself() -> None:
    """A gap, a soft stage, then the specimen: a stiffness that rises by steps, from nothing."""
    u = np.linspace(0.0, STROKE, 200)
    soft, stiff = np.maximum(u - 0.37 * STROKE, 0.0), np.maximum(u - 0.53 * STROKE, 0.0)
    found = pulled(0.2 * SPRING * soft + 0.8 * SPRING * stiff, u)
    assert found.verdict == "contact_seating"
    assert "then seats" in found.effects[0].label
    shapes = {v.label: v for v in library(found.bench)}
    for start in ("slack 0.4", "slack 0.4, then seats"):
        nearer = {v.label for v in refined(found.bench, shapes[start], close=0.5)}
        assert start.replace("0.4", "0.384") in nearer
    plain = library(make_bench(running(SPRING * u, u, imposed="displacement")))
    assert not any("then seats" in v.label for v in plain)
    assert found.after < 1.5 * found.noise


@pytest.mark.slow
def test_a_tip_that_is_lifted_off_and_comes_back_meets_a_contact() -> None:
    """The stroke passes zero, the force keeps its sign: there is nothing to pull at."""
    u = 1e-4 * np.concatenate([np.linspace(0, -4, 60), np.linspace(-4, 2, 90)])
    found = pulled(SPRING * np.maximum(u, 0.0), u)
    assert found.verdict == "contact_seating"
    both = pulled(SPRING * (np.maximum(u, 0.0) + np.minimum(u + 2e-4, 0.0)), u)
    assert both.verdict == "joint_backlash"  # what bears both ways


def test_an_arm_is_asked_nothing_of_all_that() -> None:
    u, force = approached()
    flat = 60.0 * np.tanh(4e3 * np.linspace(0.0, STROKE, 160))
    of_pulls = [
        make_bench(running(f, x, instruments=METER, imposed="displacement"))
        for f, x in ((force, u), (flat, np.linspace(0.0, STROKE, 160)))
    ]
    assert of_pulls[0].load_history.approaches
    assert of_pulls[1].load_history.flows_out
    near, flows = (replace(b, data=replace(b.data, arm=True)) for b in of_pulls)
    assert not near.load_history.approaches
    assert not flows.load_history.flows_out


def pulled_and_pressed(again: bool = False) -> GapData:
    """Rubber in two runs from zero, each way a curve of its own, 34 levels; again: both pulled, and
    softer the second time."""
    pull, push = np.linspace(0, 80, 17), np.linspace(0, -140, 17)
    u = [np.interp(pull, [0, 20, 60, 80], [0, 8e-3, 40e-3, 46e-3]), 0.06 * np.expm1(push / 150)]
    if again:
        push, u[1] = pull, 1.3 * u[0]
    force = np.concatenate([pull, push])
    rng = np.random.default_rng(4)
    return bench_data(
        force,
        np.concatenate(u) + rng.normal(0, 2e-5, 34),
        run=np.repeat([0, 1], 17),
        repetition=np.repeat([1, 2], 17),
        compliance=np.array([4e-4]),
        instruments=Instruments(0.1, 2e-5, 0.005, 0.003),
    )


def test_pull_and_press_may_each_have_a_curve_of_its_own() -> None:
    found = explained(pulled_and_pressed())
    assert found.verdict == "joint_nonlinear_stiffness"
    assert "uneven" in found.effects[0].label
    assert (
        not found.bench.load_history.comes_again
    )  # no load was met twice: that no stiffness wanders
    for data, told in ((pulled_and_pressed(), False), (pulled_and_pressed(again=True), True)):
        bench = make_bench(data)
        assert bench.load_history.comes_again == told
        found_there = unmodelled_variants(bench, base_columns(bench), bench.observed)
        assert any(v.word == "slopes" for v in found_there) == told
    data = pulled_and_pressed(again=True)  # along two directions, once each
    bench = make_bench(replace(data, setups=data.setups * 2, setup=data.run))
    assert not bench.load_history.comes_again


@pytest.mark.parametrize("off", [0.0, 0.04])
def test_what_is_at_its_zero_without_load_has_not_slipped_on_its_way_there(off: float) -> None:
    """Rubber from pressed to pulled, one way: stiff under pressure, soft under tension; the same
    with its zero elsewhere may as well be half a loop."""
    stretch = np.linspace(0.55, 1.9, 34)
    found = pulled(12.0 * (stretch - stretch**-2), (stretch - 1 + off) * STROKE)
    assert found.bench.load_history.crosses_its_zero == (off == 0)
    assert (found.verdict == "joint_nonlinear_stiffness") == (off == 0)


@pytest.mark.parametrize("imposed", ["force", "displacement"])
def test_what_stiffens_from_the_first_weight_on_is_a_curve(imposed: str) -> None:
    """A sensor that saturates: of each further weight it shows less, in proportion to the load."""
    force = np.array([0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0])
    u = 1e-3 * np.log1p(force / 0.04)
    meter = Instruments(0.001, 5e-6, 0.005, 0.003)
    data = bench_data(force, u, compliance=np.array([2e-2]), instruments=meter, imposed=imposed)
    labels = [v.label for v in library(make_bench(data))]
    assert any("stops" in label for label in labels) == (imposed == "force")
    if imposed == "force":
        found = explained(data)
        assert found.verdict == "joint_nonlinear_stiffness"
        assert "stops" in found.effects[0].label


def test_what_stiffens_early_does_so_from_where_its_load_begins() -> None:
    """Under a preload of 50 N: the shapes bend within the first newtons beyond it."""
    force = 50.0 + np.linspace(0.0, 5.0, 30)
    labels = {
        v.label: v
        for v in library(make_bench(bench_data(force, (force - 50) / SPRING, imposed="force")))
    }
    first = labels["joint 1 stops 0.01"]
    early = first.root[1:4, 1] / first.root[1:, 1].sum()
    assert early[0] > 2 * early[1]


@pytest.mark.parametrize(("lost", "verdict"), [(0.2, "joint_yield"), (0.97, "unknown")])
def test_what_loses_nearly_all_its_force_has_not_just_yielded(lost: float, verdict: str) -> None:
    """Metal that necks, and a shell that snaps through."""
    u = np.linspace(0.0, STROKE, 160)
    rise, end = np.minimum(SPRING * u, 30.0), 30.0 * (1 - lost)
    falls = 30.0 - (30.0 - end) * np.maximum(u / STROKE - 0.35, 0.0) / 0.65
    assert pulled(np.minimum(rise, falls), u).verdict == verdict


def test_what_comes_late_in_a_single_pull_is_part_of_its_curve() -> None:
    """With a hold on the way it would be seen apart."""
    t = np.arange(150.0)
    for hold, one in ((0, True), (60, False)):
        u = STROKE * np.concatenate([t[:80] / 150, np.full(hold, 80 / 150), t[80:] / 150])
        bench = make_bench(running(SPRING * u, u, imposed="displacement"))
        engine = Engine(bench, base_columns(bench), bench.observed, np.array([0.0, 3e-6]))
        variants = library(bench, ["time_lag", "joint_nonlinear_stiffness"])
        lag, curve = (next(v for v in variants if v.word == w) for w in LATE_AND_BENT)
        assert _same_element(engine, Part(lag, 1.0), Part(curve, 1.0)) == one


LATE_AND_BENT = ("time_lag", "joint_nonlinear_stiffness")
