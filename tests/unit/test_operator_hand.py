"""The scripted hand at a simulated screw whose force it sees late and noisy."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from drivers.interfaces import LiveView
from drivers.operator import hand as hand_module
from drivers.operator.hand import LARGEST_TURN_MM, Hand

PERIOD_S = 0.1


def view(
    force_N: float,
    target_N: float,
    phase: str = "step",
    band_N: float = 0.6,
    stale: tuple[str, ...] = (),
) -> LiveView:
    return LiveView(
        phase=phase,
        pose="P1",
        direction="x",
        repetition=1,
        repetitions=1,
        step=1,
        steps=1,
        force_N=force_N,
        target_N=target_N,
        band_N=band_N,
        displacement_mm=0.0,
        stiffness_N_per_mm=float("nan"),
        settle_remaining_s=0.0,
        samples=0,
        samples_wanted=5,
        stale=stale,
    )


@dataclass
class Bench:
    """Force against advance with play, seen `lag` periods late; the hand moves 1 mm/s."""

    law: Callable[[float], float]
    lag: int = 2
    noise_N: float = 0.03
    gap_mm: float = 0.25
    offset_N: float = 0.0
    now: float = 0.0
    wanted_mm: float = 0.0
    reached_mm: float = 0.0
    turns: list[float] = field(default_factory=list)
    highest_N: float = 0.0

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(3)
        self.seen: deque[float] = deque([self.offset_N] * (self.lag + 1), maxlen=self.lag + 1)

    def step(self) -> float:
        self.now += PERIOD_S
        way = self.wanted_mm - self.reached_mm
        self.reached_mm += float(np.clip(way, -PERIOD_S, PERIOD_S))
        force = self.law(max(0.0, self.reached_mm - self.gap_mm))
        self.highest_N = max(self.highest_N, force)
        self.seen.append(force + self.offset_N + self.random.normal(0, self.noise_N))
        return self.seen[0]

    def run(self, hand: Hand, target_N: float, seconds: float = 120.0) -> float:
        """Until the force has stood in the band for 2 s; returns how long it took."""
        begin, quiet = self.now, 0.0
        force = self.seen[0]
        while self.now - begin < seconds:
            advance = hand.decide(view(force, target_N), self.now)
            if advance is not None:
                self.turns.append(advance)
                self.wanted_mm += advance
                quiet = 0.0
            force = self.step()
            inside = abs(force - self.offset_N - target_N) <= 0.6
            quiet = quiet + PERIOD_S if inside else 0.0
            if quiet > 2.0:
                break
        return self.now - begin


@pytest.fixture(autouse=True)
def no_wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hand_module, "PATIENCE_WALL_S", -1.0)


def linear(stiffness: float) -> Callable[[float], float]:
    return lambda x: stiffness * x


@pytest.mark.parametrize("stiffness", [12.0, 57.0, 96.0, 140.0])
def test_reaches_every_target_from_below_without_overshoot(stiffness: float) -> None:
    bench, hand = Bench(linear(stiffness)), Hand()
    bench.run(hand, 0.0)
    for target in range(20, 221, 20):
        bench.highest_N = 0.0
        took = bench.run(hand, float(target))
        assert took < 40, f"{target} N took {took:.0f} s"
        assert bench.highest_N < target + 0.6, f"{target} N: went to {bench.highest_N:.1f} N"
    assert max(abs(t) for t in bench.turns) <= LARGEST_TURN_MM


def test_keeps_turning_in_bounded_steps_when_the_arm_gives_way() -> None:
    def knee(x: float) -> float:
        at = 75.0 / 57.0
        return 57.0 * x if x < at else 75.0 + 1.25 * (x - at)

    bench, hand = Bench(knee), Hand()
    for target in (60.0, 75.0, 78.0, 82.0):
        took = bench.run(hand, target)
        assert took < 60, f"{target} N took {took:.0f} s"
        assert bench.highest_N < target + 0.6
    assert max(bench.turns) <= LARGEST_TURN_MM
    assert bench.reached_mm > 6.5
    # One turn without an answer does not make the next one large; it may stand firm again.
    stalled = bench.turns[-12:]
    assert all(b <= 2.2 * a for a, b in itertools.pairwise(stalled))
    mark = len(bench.turns)
    bench.run(hand, 90.0)
    assert bench.turns[mark] <= 8.6 / 57.0


def test_a_softening_arm_takes_few_turns_a_step() -> None:
    bench, hand = Bench(lambda x: 133.0 * x / (1.0 + 0.27 * x)), Hand()
    for target in range(20, 201, 20):
        mark = len(bench.turns)
        bench.run(hand, float(target))
        assert bench.highest_N < target + 0.6
        if target > 40:
            assert len(bench.turns) - mark <= 3, f"{target} N: {bench.turns[mark:]}"


@pytest.mark.parametrize("lag", [0, 3])
def test_readings_may_lag_behind_the_hand(lag: int) -> None:
    bench, hand = Bench(linear(96.0), lag=lag), Hand()
    for target in range(20, 121, 20):
        bench.highest_N = 0.0
        assert bench.run(hand, float(target)) < 40
        assert bench.highest_N < target + 0.6


def test_begins_moderately_when_the_arm_stands_firm_again() -> None:
    def ledge(x: float) -> float:
        first, second = 75.0 / 57.0, 75.0 / 57.0 + 4.0
        if x < first:
            return 57.0 * x
        return 75.0 + 1.0 * (min(x, second) - first) + 57.0 * max(0.0, x - second)

    bench, hand = Bench(ledge), Hand()
    for target in (60.0, 75.0, 79.0):
        bench.run(hand, target)
    assert bench.reached_mm > 4.5
    bench.run(hand, 90.0)
    assert abs(bench.seen[0] - 90.0) < 0.7
    assert bench.highest_N < 90.6


@pytest.mark.parametrize("offset_N", [0.0, 3.0, -3.0])
def test_unloads_until_the_screw_is_free_even_when_the_amplifier_has_drifted(
    offset_N: float,
) -> None:
    bench, hand = Bench(linear(57.0)), Hand()
    bench.run(hand, 60.0)
    bench.offset_N = offset_N
    begin = bench.now
    while bench.now - begin < 60:
        force = bench.step()
        advance = hand.decide(view(force, 0.0, "unloading"), bench.now)
        if advance is not None:
            assert advance < 0
            bench.wanted_mm += advance
    assert bench.reached_mm < bench.gap_mm - 0.09
    assert bench.reached_mm > bench.gap_mm - 0.6


def test_after_unloading_it_finds_contact_again_and_repeats_the_first_target() -> None:
    bench, hand = Bench(linear(57.0)), Hand()
    for _ in range(3):
        assert bench.run(hand, 7.5) < 60
        assert bench.highest_N < 7.5 + 0.6
        bench.run(hand, 75.0)
        for _ in range(300):
            advance = hand.decide(view(bench.step(), 0.0, "zero"), bench.now)
            bench.wanted_mm += advance or 0.0
        bench.highest_N = 0.0


def test_taring_between_two_runs_does_not_make_play_look_like_stiffness() -> None:
    bench, hand = Bench(linear(96.0)), Hand()
    for _ in range(4):
        for target in (20.0, 40.0, 60.0):
            bench.highest_N = 0.0
            bench.run(hand, target)
            assert bench.highest_N < target + 0.6
        bench.offset_N = -1.6  # drift, seen while unloading
        for _ in range(150):
            bench.wanted_mm += hand.decide(view(bench.step(), 0.0, "zero"), bench.now) or 0.0
        bench.offset_N = 0.0  # tared, while nobody looks
        bench.seen.extend([0.0] * 3)


def test_unloading_steps_are_approached_from_above() -> None:
    bench, hand = Bench(linear(57.0)), Hand()
    bench.run(hand, 80.0)
    for target in (60.0, 40.0, 20.0):
        mark = len(bench.turns)
        assert bench.run(hand, target) < 40
        assert all(turn < 0 for turn in bench.turns[mark:])


@pytest.mark.parametrize("phase", ["mounting", "settling", "sampling", "paused"])
def test_keeps_hands_off(phase: str) -> None:
    assert Hand().decide(view(10.0, 60.0, phase), 0.0) is None


def test_does_not_turn_blind() -> None:
    assert Hand().decide(view(10.0, 60.0, stale=("dynamometer",)), 0.0) is None
    assert Hand().decide(view(float("nan"), 60.0), 0.0) is None
    assert Hand().decide(view(10.0, float("nan")), 0.0) is None


def test_leaves_a_force_in_the_middle_of_the_band_alone() -> None:
    assert Hand().decide(view(59.8, 60.0), 0.0) is None
    assert Hand().decide(view(59.5, 60.0), 0.0) is not None


def test_waits_for_the_effect_of_a_turn() -> None:
    hand = Hand()
    assert hand.decide(view(10.0, 60.0), 0.0) is not None
    assert hand.decide(view(10.0, 60.0), 0.1) is None


def test_gives_up_a_search_that_finds_nothing() -> None:
    bench, hand = Bench(linear(57.0), gap_mm=1e6), Hand()
    bench.run(hand, 20.0, seconds=2000)
    assert bench.wanted_mm < hand_module.LONGEST_SEARCH_MM + LARGEST_TURN_MM
    assert bench.wanted_mm > 1.0
