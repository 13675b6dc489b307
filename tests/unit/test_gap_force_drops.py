"""Forces that let go while the stroke goes on; channels that wander without load; friction that
grows with the load: of rigs without an arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.parameters import parameters
from identification.gap.data import GapData, Instruments
from identification.gap.effects import library
from identification.gap.evidence.parts import Part
from identification.gap.judging.residual_checks import COMES_BACK, _checked_armless
from identification.gap.laws.friction_law import BY_LOAD
from identification.gap.laws.interval import NOMINAL
from identification.gap.model.bench import make_bench
from identification.gap.recording.force_drops import TOGETHER, let_go
from identification.gap.recording.wandering import wanders
from tests.explained import explained
from tests.unit.test_gap_running import SPRING, running, triangle

METER = Instruments(0.1, 1e-6, 0.005, 0.003)
N = 600


def stroke(force: Array, u: Array, **changes: object) -> GapData:
    noise = np.random.default_rng(5).normal(0, METER.force, len(force))
    return running(force + noise, u, instruments=METER, **changes)


def saw(drop: float, teeth: int = 5) -> tuple[Array, Array]:
    """Force and stroke, once to and fro: 100 N of a spring that lets go of a share of it."""
    u = 1e-3 * triangle(N, 1.0)
    held = np.abs(np.diff(u, prepend=0.0)).cumsum() * teeth / u.max() % 1.0
    sense = np.where(np.arange(N) < N // 2, 1.0, -1.0)
    return 100.0 * sense * (1 - drop + drop * held), u


def test_a_force_that_lets_go_again_and_again_is_counted() -> None:
    found = let_go(stroke(*saw(0.4)))
    assert found is not None
    assert found.count == 8  # the last of five teeth is still held when it turns
    assert found.largest == pytest.approx(0.4 / 2, rel=0.05)
    assert found.together == pytest.approx(8 * 0.2, rel=0.05)
    assert found.first == pytest.approx(N / 2 / 5, abs=3)


def test_what_lets_go_of_next_to_nothing_or_only_turns_back_is_none() -> None:
    assert let_go(stroke(*saw(0.1))) is None  # 5 % of the range
    u = 1e-3 * triangle(N, 1.0)
    pull = np.linspace(0.0, 1e-3, N)
    once = 100 * np.minimum(pull / 2e-4, 1.0) - 15.0 * (pull > 3e-4)  # an upper yield point
    assert 15 / np.ptp(once) < TOGETHER
    assert let_go(stroke(once, pull)) is None
    lag = np.interp(np.arange(N) + 12.0, np.arange(N), SPRING * u)
    assert let_go(stroke(lag, u)) is None  # the force turns first
    often = 1e-3 * triangle(N, 15.0)
    assert let_go(stroke(SPRING * np.roll(often, -9), often)) is None  # as fast as it came
    assert let_go(stroke(SPRING * u, u)) is None
    assert let_go(stroke(np.random.default_rng(1).normal(0, 1.0, N), u)) is None  # all noise


def test_a_force_that_relaxes_or_turns_between_two_readings_is_not_let_go() -> None:
    """Stretched between two readings and held; strokes of few readings each."""
    u = np.where(np.arange(N) < 40, 0.0, 1e-3)
    assert let_go(stroke(30 + 70 * np.exp(-np.maximum(np.arange(N) - 40, 0)) * (u > 0), u)) is None
    quick = 1e-3 * np.sin(2.5 * np.arange(N))
    assert let_go(stroke(100 * np.sin(2.5 * np.arange(N) + 0.6), quick)) is None


def test_a_force_that_is_driven_is_let_go_by_who_drives_it() -> None:
    data = stroke(*saw(0.4))
    assert let_go(replace(data, imposed="force")) is None
    assert let_go(replace(data, imposed="displacement")) is not None
    short = slice(0, 50)
    few = running(data.force[short], data.displacement[short], instruments=METER)
    assert let_go(few) is None


@pytest.mark.slow
def test_no_law_explains_what_sticks_and_slips() -> None:
    found = explained(stroke(*saw(0.4), imposed="displacement"))
    assert found.verdict == "unknown"
    assert found.probabilities["unknown"] > 0.7
    (note,) = [n for n in found.notes if "at once" in n]
    assert note.startswith("The force falls at once while the stroke goes on, 8 times, by up to 39")
    assert "(first at 59 s)" in note


def resting(force: Array, u: Array) -> GapData:
    """Loaded and let go six times, at rest in between."""
    on = np.repeat(np.tile([0.0, 1.0], 6), N // 12)
    return stroke(100 * on + force, 1e-3 * on + u, imposed="force")


WALK = np.cumsum(np.random.default_rng(2).normal(0, 1.0, N)) / 20


@pytest.mark.parametrize(
    ("force", "u", "channel"),
    [(0.0, 2e-5, "displacement"), (2.0, 0.0, "force"), (2.0, 2e-5, None)],
)
def test_the_channel_that_moves_without_load(force: float, u: float, channel: str | None) -> None:
    data = resting(force * WALK, u * WALK + np.random.default_rng(3).normal(0, 1e-6, N))
    assert wanders(data) == channel
    assert wanders(replace(data, force=np.zeros(N))) is None
    still = replace(data, displacement=np.zeros(N))  # a load that wanders would move it
    assert wanders(still) == "force"
    short = slice(0, 15)
    few = running(data.force[short], data.displacement[short], instruments=METER)
    assert wanders(few) is None


def test_a_channel_that_comes_back_has_not_drifted() -> None:
    data = resting(0 * WALK, 2e-5 * WALK + np.random.default_rng(3).normal(0, 1e-6, N))
    found = explained(data)
    assert found.verdict == "thermal_drift"
    engine, ranked = found.engine, found.found.explanations
    weights = [e.log_weight for e in ranked]
    assert weights == sorted(weights, reverse=True)
    first = next(e for e in ranked if e.words == {"thermal_drift"})
    drift = replace(first, parts=(Part(library(found.bench, ["force_drift"])[0], 1.0),))
    judged = _checked_armless(engine, drift)
    beside = replace(drift, parts=(first.parts[0], *drift.parts), sizes=(2e-5, 1e-5))
    assert (
        _checked_armless(engine, beside).log_weight == drift.log_weight
    )  # a little of it may be there
    assert judged.log_weight == pytest.approx(drift.log_weight - COMES_BACK)
    assert judged.log_adequate == pytest.approx(drift.log_adequate - COMES_BACK)
    assert _checked_armless(engine, first).log_weight == first.log_weight


def leaf(share: float = 0.1) -> tuple[Array, Array]:
    """Force on leaves that are pressed together by what they carry, bent thrice."""
    u = 1e-3 * triangle(N, 3.0) + 1e-5
    sense = np.sign(np.gradient(u))
    z, reach = np.zeros(N), 1.2e-4
    for i in range(1, N):
        way = abs(u[i] - u[i - 1])
        z[i] = sense[i] + (z[i - 1] - sense[i]) * np.exp(-way / reach)
    return SPRING * u * (1 + share * z), u


def test_friction_in_proportion_to_the_load_is_hysteresis() -> None:
    found = explained(stroke(*leaf(), imposed="displacement"))
    assert found.verdict == "joint_hysteresis"
    part = found.fit.parts[0]
    assert part.variant.info["law"] in BY_LOAD
    assert found.after < 1.5 * found.noise
    friction = found.effects[0].parameters["friction"]
    assert friction.value == pytest.approx(0.1 * 100.0, rel=0.25)  # at the largest load


def test_friction_by_the_load_turns_no_force_around() -> None:
    force, u = leaf()
    both = make_bench(stroke(force, u, imposed="displacement"))
    turned = make_bench(stroke(force - 20.0, u, imposed="displacement"))
    for bench, known in ((both, True), (turned, False)):
        laws = {v.info["law"] for v in library(bench, ["joint_hysteresis"])}
        assert set(BY_LOAD) <= laws if known else not set(BY_LOAD) & laws


def test_a_wrong_spring_that_rubs_within_the_noise_is_a_wrong_spring() -> None:
    """Levels at rest, of an instrument that scatters as stated."""
    on = np.repeat(np.append(np.arange(12), np.arange(11, -1, -1)), 12)
    x = on / 11.0
    back = np.arange(len(x)) >= len(x) // 2
    u = 1.5e-3 * x + np.where(back, 2.0e-6, -2.0e-6) * np.sin(np.pi * x)
    u += np.random.default_rng(6).normal(0, 4e-6, len(u))
    meter = Instruments(0.01, 4e-6, 0.005, 0.003)
    data = replace(running(100 * x, u, instruments=meter), step=on, branch=1 + back.astype(int))
    found = explained(data)
    assert found.verdict in ("joint_stiffness_error", "force_scale", "displacement_scale")


def test_every_law_by_the_load_has_its_friction_at_the_largest_one() -> None:
    bench = make_bench(stroke(*leaf(), imposed="displacement"))
    for law in BY_LOAD:
        v = next(v for v in library(bench, ["joint_hysteresis"]) if v.info["law"] == law)
        k = len(v.columns)
        found = parameters(bench, Part(v, 1.0), np.full(k, 0.05), np.eye(k) * 1e-9, NOMINAL)
        assert found["friction"].value == pytest.approx(0.1 * np.abs(bench.torque).max(), rel=0.05)
