"""Laws with memory of the hidden worlds, against what mechanics says of them."""

from __future__ import annotations

import numpy as np
import pytest

from rig.worlds.hidden import memory

UP = np.linspace(0.0, 10.0, 201)
CYCLE = np.concatenate([UP, UP[::-1], UP, UP[::-1]])
STANDING = np.zeros(len(CYCLE), dtype=np.int64)


def test_play_stays_below_its_width_and_keeps_what_is_left() -> None:
    path = memory.play(CYCLE, 6.0, STANDING)
    assert np.all(path[CYCLE[:201].size - 201 : 120] == 0.0)  # 6 of 10 is not reached
    assert path[200] == pytest.approx(4.0)
    assert path[401] == pytest.approx(4.0)  # unloading takes nothing back
    assert path[602] == pytest.approx(4.0)  # the same load again adds nothing


def test_play_starts_anew_when_the_arm_has_moved() -> None:
    moved = (np.arange(len(CYCLE)) >= 402).astype(np.int64)
    path = memory.play(CYCLE, 6.0, moved)
    assert path[401] == pytest.approx(4.0)
    assert path[402] == 0.0


def test_many_plays_are_plays() -> None:
    random = np.random.default_rng(3)
    load = np.repeat(np.cumsum(random.standard_normal(200)), 2)
    fresh = (np.arange(400) > 250).astype(np.int64)
    widths = np.array([0.3, 1.0, 4.0])
    many = memory.plays(np.repeat(load[:, None], 3, axis=1), widths, fresh)
    for k, width in enumerate(widths):
        assert many[:, k] == pytest.approx(memory.play(load, width, fresh), abs=1e-12)


def test_loops_of_a_quadratic_backbone_are_a_spectrum_of_plays() -> None:
    """Strengths spread evenly from 0 to s: the backbone is x^2 / 2s (Iwan 1967)."""
    random = np.random.default_rng(4)
    ends = random.uniform(-1.0, 1.0, 40)
    load = np.interp(np.arange(0, 39, 0.05), np.arange(40), ends)
    still = np.zeros(len(load), dtype=np.int64)
    widths = (np.arange(400) + 0.5) / 400
    spectrum = memory.plays(np.repeat(load[:, None], 400, axis=1), widths, still).mean(axis=1)
    loops = memory.loops(load, lambda x: x**2 / 2, still)
    assert loops == pytest.approx(spectrum, abs=2e-3)


def test_closed_loops_are_forgotten() -> None:
    load = np.array([0.0, 5.0, 2.0, 5.0, 8.0])
    straight = np.array([0.0, 5.0, 5.0, 5.0, 8.0])
    still = np.zeros(5, dtype=np.int64)
    with_loop = memory.loops(load, lambda x: x**3, still)
    without = memory.loops(straight, lambda x: x**3, still)
    assert with_loop[[1, 3, 4]] == pytest.approx(without[[1, 3, 4]])


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_flow_follows_its_rate_equation(power: float) -> None:
    limit, slow = 2.0, 5.0
    time = np.linspace(0.0, 30.0, 4)
    load = np.full(4, 5.0)
    still = np.zeros(4, dtype=np.int64)
    path = memory.flow(time, load, limit, slow, power, still)
    fine = np.linspace(0.0, 30.0, 60001)
    y = 0.0
    for _ in fine[1:]:
        y += (fine[1] / slow) * limit * max((5.0 - y - limit) / limit, 0.0) ** power
    assert path[-1] == pytest.approx(y, rel=1e-3)
    assert path[-1] < 3.0  # never beyond the limit's distance


def test_flow_comes_to_the_play_when_there_is_time() -> None:
    time = 1e5 * np.arange(len(CYCLE))
    path = memory.flow(time, CYCLE, 6.0, 3.0, 1.0, STANDING)
    assert path == pytest.approx(memory.play(CYCLE, 6.0, STANDING), abs=1e-6)
    many = memory.flows(time, CYCLE[:, None], np.array([6.0]), 3.0, STANDING)
    assert many[:, 0] == pytest.approx(path, abs=1e-6)


def test_rounded_knee_has_its_asymptotes() -> None:
    ratio, limit = 0.3, 5.0
    load = np.linspace(0.0, 60.0, 601)
    still = np.zeros(601, dtype=np.int64)
    path = memory.rounded_knee(load, limit, ratio, 12.0, still)
    assert path[20] == pytest.approx(0.0, abs=1e-3)  # elastic at first
    slope = (path[-1] - path[-51]) / (load[-1] - load[-51])
    assert slope == pytest.approx(1 / ratio - 1, rel=1e-3)  # plastic beside the elastic one


def test_rounded_knee_unloads_elastically() -> None:
    path = memory.rounded_knee(CYCLE, 5.0, 0.3, 12.0, STANDING)
    assert path[200] > 5.0
    assert path[240] == pytest.approx(path[200], abs=0.02 * path[200])
    assert path[401] > 0.8 * path[200]


def test_backstress_hardens_towards_the_second_modulus() -> None:
    load = np.linspace(0.0, 40.0, 4001)
    still = np.zeros(4001, dtype=np.int64)
    path = memory.backstress(load, 5.0, 0.8, 0.4, 1.25, still)
    assert np.all(path[:500] == 0.0)
    slope = (path[-1] - path[-101]) / (load[-1] - load[-101])
    assert slope == pytest.approx(1 / 1.25, rel=0.02)  # the first one has saturated


def test_bristles_saturate_and_turn() -> None:
    state = memory.bristles(CYCLE, 1.0, 1.0, 1.0, STANDING)
    assert state[200] == pytest.approx(1.0, abs=1e-3)
    assert state[401] == pytest.approx(-1.0, abs=1e-3)
    assert state[10] == pytest.approx(1 - np.exp(-CYCLE[10]), abs=0.02)  # Dahl's closed form


def test_retarded_is_exact_under_a_ramp() -> None:
    time = np.array([0.0, 1.0, 7.0, 20.0])
    slow = 4.0
    path = memory.retarded(time, 2.0 * time, np.array([slow]), np.array([1.0]))
    exact = 2.0 * (time - slow * (1 - np.exp(-time / slow)))
    assert path == pytest.approx(exact, rel=1e-12)
