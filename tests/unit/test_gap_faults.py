"""Faults of an instrument: readings in spells, a displacement that stands still under more load."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.data import Array
from identification.gap.diagnose import diagnose_gap
from identification.gap.faults import bursts, faults, frozen_since
from tests.unit.test_gap_levels import creeping, one_hold
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running


def test_creep_of_a_hold_is_no_burst_and_bursts_are() -> None:
    t, u = creeping()
    given = one_hold(t, u)
    assert not bursts(bench_data(given.pop("force"), given.pop("displacement"), **given))
    shaken = u + np.where(np.arange(len(u)) % 11 == 5, 4e-5, 0.0)
    given = one_hold(t, shaken)
    assert bursts(bench_data(given.pop("force"), given.pop("displacement"), **given))


def test_a_lag_that_takes_half_a_hold_is_no_burst() -> None:
    """A moving average catches up in one sample, three after the load has changed."""
    step = np.repeat(np.arange(40), 10)
    late = np.tile(np.where(np.arange(10) < 4, 0.3, 1.0), 40)
    data = bench_data(20.0 * step, 2e-4 * (step - 1 + late), step=step)
    assert not bursts(data)


def test_a_line_read_at_odd_times_is_no_burst() -> None:
    steps = np.where(np.arange(200) % 20 == 7, 30.0, 1.0)
    t = np.concatenate([[0.0], np.cumsum(steps)])
    given = one_hold(t, 5e-6 * t)
    assert not bursts(bench_data(given.pop("force"), given.pop("displacement"), **given))


def lost_target(at: int = 60, back: float = 3e-5, n: int = 160) -> tuple[Array, Array]:
    """Force N and displacement m: pulled on and on, the reading jumps back and stays there."""
    force = np.linspace(0.0, 100.0, n)
    u = force / SPRING + np.random.default_rng(3).normal(0, 1e-6, n)
    u[at:] = u[at - 1] - back
    return force, u


def test_a_reading_that_stands_still_under_more_load_than_ever_is_a_fault() -> None:
    force, u = lost_target()
    data = running(force, u, imposed="displacement")  # creep, if that were possible
    assert frozen_since(data) == 60.0
    found = diagnose_gap(data)
    assert found.verdict == "unknown"
    assert any("lost its target" in note for note in found.notes)


@pytest.mark.parametrize("what", ["relaxes", "stop", "coarse", "short"])
def test_what_stands_still_for_a_reason_is_none(what: str) -> None:
    force, u = lost_target()
    if what == "relaxes":  # the stroke is held, the force goes down
        force = np.append(force[:60], force[59] * np.exp(-np.arange(100) / 50))
    elif what == "stop":  # a hard stop, at the largest displacement of all
        u[60:] = u[:60].max()
    elif what == "coarse":  # as far back as noise goes
        u[60:] = u[:60].max() - 5e-6
    else:  # it goes on after nine readings
        force, u = lost_target(at=12, n=40)
        u[21:] = force[21:] / SPRING
    assert frozen_since(running(force, u)) is None
    assert faults(running(force, u)) == ()
