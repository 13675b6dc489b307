"""Shapes that contradict the word they would carry are none of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data


def springs(data: GapData) -> Array:
    """(n,) m/N of the arm's springs."""
    return np.array([s.lever**2 @ data.compliance for s in data.setups])[data.setup]


def moved(data: GapData, by: Array) -> GapData:
    """The arm on its springs, and moved (n,) m beside them."""
    noise = 1e-6 * np.random.default_rng(1).standard_normal(len(by))
    given = springs(data) * data.force + by + noise
    return replace(data, displacement=given, q=None, tangential=None)


def steps(data: GapData) -> tuple[Array, Array]:
    """(n,) by how much the force changed to the hold of a reading, N; whether it is the first."""
    force, number = data.force, data.run * 1000 + data.branch * 100 + data.step
    first = np.append(True, np.diff(number) != 0)
    hold = np.cumsum(first) - 1
    level = np.bincount(hold, force) / np.bincount(hold)
    change = np.diff(level, prepend=0.0)
    change[np.diff(data.run[first], prepend=-1) != 0] = 0.0
    return change[hold], first


@pytest.mark.parametrize("late", [False, True])
def test_what_is_ahead_of_the_load_does_not_lag(late: bool) -> None:
    """The first reading of every hold: a tenth of the step too far, as a hand leaves it, or too
    little."""
    data = arm_data()
    change, first = steps(data)
    off = springs(data) * change * first * (-0.3 if late else 0.1)
    assert (explained(moved(data, off)).verdict == "time_lag") is late


def test_what_is_stiff_then_soft_then_stiff_again_is_no_seat() -> None:
    """It snaps, in every pose and direction."""
    data = arm_data()
    share = np.abs(data.force) / np.abs(data.force).max()
    snaps = 6e-5 * np.clip((share - 0.27) / 0.18, 0.0, 1.0) * np.sign(data.force)
    assert explained(moved(data, snaps)).verdict != "contact_seating"


@pytest.mark.parametrize("name", ["quadratic", "cubic"])
def test_a_curve_that_goes_back_under_more_load_is_none(name: str) -> None:
    """The least of it leaves no compliance at the largest load, and some at any other."""
    bench = make_bench(arm_data())
    some = [v for v in library(bench, ["joint_nonlinear_stiffness"]) if v.label.endswith(name)]
    assert some
    for v in some:
        assert v.positive is not None
        assert v.joint is not None
        torque = bench.true_torque[:, v.joint]
        spring = bench.lever[:, v.joint] * bench.compliance[v.joint]
        turned = torque + v.least * bench.columns[v.columns[0]][: len(torque)] / spring
        order = np.argsort(torque)
        rise = np.diff(turned[order]) / np.maximum(np.diff(torque[order]), 1e-12)
        apart = np.diff(torque[order]) > 1e-3 * np.ptp(torque)
        assert rise[apart].min() > -1e-6
        assert rise[apart].min() < 0.5
