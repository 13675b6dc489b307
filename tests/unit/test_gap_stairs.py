"""Staircases whose steps bear no numbers."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import LOADING, UNLOADING, ZERO, GapData
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.gap.recording.ramps import steps_numbered, with_ramps_marked
from tests.unit.test_gap_operators import bench_data

SPRING, SD = 1e-5, 0.1  # m/N; N of one sample
LEVELS = np.array([0.0, 5.0, 15.0, 40.0, 80.0, 40.0, 0.0])


def stairs(force: Array, response: Array | None = None, sd: float = SD) -> GapData:
    """A recording without step numbers; response: SPRING * force, with noise."""
    rng = np.random.default_rng(3)
    u = SPRING * force if response is None else response
    read, moved = (v + s * rng.standard_normal(len(v)) for v, s in ((force, sd), (u, 1e-7)))
    data = bench_data(read, moved, step=np.full(len(force), -1))
    return replace(data, instruments=replace(data.instruments, force=sd, displacement=1e-7))


def test_levels_are_numbered_by_size_and_met_again() -> None:
    data = steps_numbered(stairs(np.repeat(LEVELS, 4)))
    np.testing.assert_array_equal(data.step, np.repeat([0, 1, 2, 3, 4, 3, 0], 4))
    assert not is_continuous(data, hold_ids(data))


def test_the_way_between_two_levels_bears_the_name_of_the_one_it_leads_to() -> None:
    ramp = np.linspace(0, 1, 4)[1:-1]
    parts = [np.repeat(LEVELS[0], 12)]
    for a, b in pairwise(LEVELS.tolist()):
        parts += [a + (b - a) * ramp, np.repeat(b, 12)]
    force = np.concatenate(parts)
    data = steps_numbered(stairs(force))
    way = ~np.isin(force, LEVELS)
    after = np.array([next(i for i in range(k, len(force)) if not way[i]) for k in range(len(way))])
    np.testing.assert_array_equal(data.step, data.step[after])
    late = replace(stairs(force), branch=np.where(way, UNLOADING, LOADING))
    assert not np.any(steps_numbered(late).branch == UNLOADING)
    assert np.mean(with_ramps_marked(data).ways[way]) > 0.7  # the shortest drown in noise


def test_a_displacement_that_is_set_makes_levels_on_which_the_force_relaxes() -> None:
    level = np.repeat(np.array([1e-4, 3e-4, 6e-4, 3e-4]), 30)
    relaxed = 1 - 0.2 * (1 - np.exp(-(np.arange(len(level)) % 30) / 10))
    data = steps_numbered(stairs(level / SPRING * relaxed, level))
    np.testing.assert_array_equal(data.step, np.repeat([1, 2, 3, 2], 30))


@pytest.mark.parametrize("readings", [3, 30, 1000])
def test_levels_may_be_of_any_length(readings: int) -> None:
    data = steps_numbered(stairs(np.repeat(LEVELS, readings), sd=0.4))
    np.testing.assert_array_equal(data.step, np.repeat([0, 1, 2, 3, 4, 3, 0], readings))


def test_no_load_is_where_the_branch_says_so_and_nothing_moves() -> None:
    level = np.repeat([0.0, 40.0, 80.0, 40.0, 0.0], 10)
    branch = np.where(level > 0, LOADING, ZERO)
    drifted = stairs(level + 0.1 * np.arange(50), SPRING * level)  # by 4 N
    data = steps_numbered(replace(drifted, branch=branch))
    assert np.all((data.step == 0) == (level == 0))
    named = replace(stairs(level - 40), branch=branch)  # what the branch calls zero is loaded
    assert np.all(steps_numbered(named).step[level == 0] > 0)


@pytest.mark.filterwarnings("error")
def test_an_answer_that_comes_a_reading_late_is_no_trouble() -> None:
    level = np.repeat(np.array([1e-4, 3e-4, 6e-4, 3e-4]), 10)
    late = np.concatenate([level[:1], level[:-1]]) / SPRING
    data = bench_data(late, level, step=np.full(40, -1))
    assert steps_numbered(data) is not None


@pytest.mark.parametrize(
    "what",
    [
        "a ramp",
        "read coarsely",
        "both read coarsely",
        "a swing",
        "named",
        "one run of two",
        "jumps alone",
    ],
)
def test_what_is_no_staircase_keeps_its_names(what: str) -> None:
    force = np.linspace(0, 80, 200)
    if what == "read coarsely":  # the displacement goes on where the force seems to stand
        data = stairs(np.round(force / 8) * 8, SPRING * force, 0.01)
    elif what == "both read coarsely":  # the answer more so
        up = np.concatenate([force, force[::-1]])
        data = stairs(np.round(up / 4) * 4, np.round(SPRING * up / 1e-4) * 1e-4, 0.01)
    elif what == "jumps alone":  # of a displacement, under a weight
        data = stairs(np.full(140, 50.0), np.repeat(LEVELS, 20) * SPRING)
    elif what == "a swing":
        data = stairs(40 * (1 - np.cos(np.linspace(0, 6 * np.pi, 200))))
    elif what == "one run of two":
        two = np.concatenate([np.repeat(LEVELS, 20), np.linspace(0, 80, 140)])
        data = replace(stairs(two), run=np.repeat([0, 1], 140))
    else:
        data = stairs(np.repeat(LEVELS, 4) if what == "named" else force)
    if what == "named":
        data = replace(data, step=np.repeat([0, 1, 2, 3, 4, 3, 0], 4))
    assert steps_numbered(data) is data
