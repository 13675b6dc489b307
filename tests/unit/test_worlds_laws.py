"""Laws of single elements against numbers worked out by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.worlds.balance import root
from rig.worlds.laws import Law, Spring, Yield

EVER = math.inf
LOADS = st.lists(st.floats(-150, 150), min_size=1, max_size=12)


def test_a_softening_spring_doubles_at_its_softening_load() -> None:
    spring = Spring(1000.0, softening=50.0)
    assert spring.respond(5.0, EVER) == pytest.approx(0.0055)
    assert spring.respond(50.0, EVER) == pytest.approx(0.1)
    assert spring.respond(-50.0, EVER) == pytest.approx(-0.1)


def test_the_delayed_share_follows_with_its_time_constant() -> None:
    spring = Spring(100.0, delayed=0.02, delay_s=2.0)
    assert spring.advance(10.0, 0.0) == pytest.approx(0.098)
    assert spring.advance(10.0, 2.0) == pytest.approx(0.098 + 0.002 * (1 - math.exp(-1)))
    assert spring.advance(10.0, 2.0) == pytest.approx(0.098 + 0.002 * (1 - math.exp(-2)))
    assert spring.advance(10.0, EVER) == pytest.approx(0.1)
    assert spring.advance(0.0, 0.0) == pytest.approx(0.002)
    assert spring.advance(0.0, EVER) == pytest.approx(0.0)


def test_settling_does_not_depend_on_the_step() -> None:
    fine, coarse = (Spring(100.0, delayed=0.1, delay_s=1.0) for _ in range(2))
    for _ in range(10):
        last = fine.advance(10.0, 0.1)
    assert last == pytest.approx(coarse.advance(10.0, 1.0), rel=1e-12)


def test_yield_remains_until_the_controller_takes_it_back() -> None:
    law = Yield(threshold=56.0, hardening=700.0, return_per_s=0.002)
    assert law.advance(56.0, 1.0) == 0.0
    assert law.advance(63.0, 1.0) == pytest.approx(0.01)
    assert law.advance(0.0, 1.0) == pytest.approx(0.01)
    assert law.advance(63.0, 1.0) == pytest.approx(0.01)  # elastic up to where it has been
    assert law.advance(70.0, 1.0) == pytest.approx(0.02)
    # the elastic range has moved along: 70 - 2 * 56 = -42
    assert law.advance(-42.0, 1.0) == pytest.approx(0.02)
    assert law.advance(-49.0, 1.0) == pytest.approx(0.01)
    law.return_to_position(1.5)
    assert law.advance(0.0, 1.0) == pytest.approx(0.007)
    law.return_to_position(EVER)
    assert law.advance(0.0, 1.0) == 0.0


@pytest.mark.parametrize(
    "make",
    [lambda: Spring(500.0, 80.0, 0.05, 1.0), lambda: Yield(40.0, 300.0)],
    ids=["spring", "yield"],
)
@given(loads=LOADS, further=st.floats(0, 50))
def test_what_a_law_would_do_is_what_it_does_and_rises_with_load(
    make: type[Law], loads: list[float], further: float
) -> None:
    law = make()
    for load in loads:
        would, more = law.respond(load, 0.1), law.respond(load + further, 0.1)
        assert more >= would - 1e-15
        assert law.respond(load, 0.1) == would  # asking changes nothing
        assert law.advance(load, 0.1) == would


def test_root_of_a_curve_that_gives_way() -> None:
    def excess(force: float) -> float:
        return 1e-5 * force + 8e-4 * max(0.0, force - 75.0) - 3e-3

    # 8.1e-4 F = 3e-3 + 8e-4 * 75
    assert root(excess, 10.0, 1e-5, 1e4) == pytest.approx(63.0 / 0.81, abs=1e-6)


@pytest.mark.parametrize("guess", [0.0, 70.0, 5000.0])
@pytest.mark.parametrize("compliance", [2e-7, 1e-3], ids=["thought stiff", "thought soft"])
def test_root_takes_few_trials(guess: float, compliance: float) -> None:
    trials = []

    def excess(force: float) -> float:
        trials.append(force)
        return 1e-5 * force + 8e-4 * max(0.0, force - 75.0) + 1e-8 * force**2 - 3e-3

    force = root(excess, guess, compliance, 1e4)
    assert abs(excess(force)) < 2e-11
    assert len(trials) < 22


def test_root_takes_few_trials_where_contact_stiffens() -> None:
    trials = []

    def excess(force: float) -> float:
        trials.append(force)
        return 1e-3 * (1.0 - math.exp(-force / 2.0)) + 2e-7 * force - 0.9e-3

    assert abs(excess(root(excess, 0.0, 1e-3, 4500.0))) < 2e-11
    assert abs(excess(root(excess, 400.0, 1e-5, 4500.0))) < 2e-11
    assert len(trials) < 44


def test_root_closes_in_on_a_jump() -> None:
    def excess(force: float) -> float:
        return 1e-6 * force + (1e-3 if force > 20.0 else 0.0) - 5e-4

    assert root(excess, 0.0, 1e-6, 500.0) == pytest.approx(20.0, abs=1e-6)


def test_no_contact_is_no_force() -> None:
    assert root(lambda force: 1e-6 * force + 1e-4, 50.0, 1e-6, 0.0) == 0.0


@given(
    slope=st.floats(1e-7, 1e-3),
    reach=st.floats(1e-9, 1e-2),
    guess=st.floats(0, 1e4),
    bend=st.floats(0, 1e-5),
)
def test_root_leaves_no_excess(slope: float, reach: float, guess: float, bend: float) -> None:
    def excess(force: float) -> float:
        return slope * force + bend * force * force - reach

    assert abs(excess(root(excess, guess, slope, reach / slope))) < 2e-11 + 1e-9 * (slope + bend)
