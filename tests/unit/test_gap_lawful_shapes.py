"""Shapes that contradict the word they would carry are none of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.effects import contact_seating, library
from identification.gap.model.bench import Bench, make_bench
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_running import running, triangle


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


@pytest.mark.slow
@pytest.mark.parametrize("late", [False, True])
def test_what_is_ahead_of_the_load_does_not_lag(late: bool) -> None:
    """The first reading of every hold: a tenth of the step too far, as a hand leaves it, or too
    little."""
    data = arm_data()
    change, first = steps(data)
    off = springs(data) * change * first * (-0.3 if late else 0.1)
    assert (explained(moved(data, off)).verdict == "time_lag") is late


@pytest.mark.slow
def test_what_is_stiff_then_soft_then_stiff_again_is_no_seat() -> None:
    """It snaps, in every pose and direction."""
    data = arm_data()
    share = np.abs(data.force) / np.abs(data.force).max()
    snaps = 6e-5 * np.clip((share - 0.27) / 0.18, 0.0, 1.0) * np.sign(data.force)
    assert explained(moved(data, snaps)).verdict != "contact_seating"


CURVES = ("curve", "quadratic", "cubic", "even", "bend 0.5", "odd curve, tool 1.5 kg")


@pytest.mark.parametrize("name", CURVES)
def test_a_curve_that_goes_back_under_more_load_is_none(name: str) -> None:
    """With one coefficient at the limit of what is allowed a joint hardly gives at some load, and
    goes back at none."""
    bench = make_bench(arm_data())
    some = [v for v in library(bench, ["joint_nonlinear_stiffness"]) if v.label.endswith(name)]
    assert some
    for v in some:
        assert v.joint is not None
        for i in range(len(v.columns)):
            signed = v.within[:, i] != 0
            limits = v.floor[signed] / v.within[signed, i]
            either = limits[limits < 0].max(initial=-np.inf), limits[limits > 0].min(initial=np.inf)
            column = bench.columns[v.columns[i]]
            left = [gives(bench, v.joint, w * column) for w in either if np.isfinite(w)]
            assert 0.0 < min(left) < (0.5 if i == 0 else 1.0)


@pytest.mark.parametrize("name", ["curve", "bend 0.5", "odd curve, tool 1.5 kg"])
def test_pieces_that_each_leave_compliance_may_leave_none_together(name: str) -> None:
    bench = make_bench(arm_data())
    v = next(v for v in library(bench, ["joint_nonlinear_stiffness"]) if v.label.endswith(name))
    pair = np.zeros((2, len(v.columns)))
    pair[0, 0] = pair[1, 1] = -0.6
    assert np.all(v.within @ pair.T > v.floor[:, None])
    assert np.any(v.within @ pair.sum(axis=0) < v.floor)


def test_a_gap_of_a_seat_closes_at_low_force() -> None:
    """At nearly half of the load it is a knee; what is looked for about one that was found, too."""
    bench = make_bench(arm_data())
    top = float(np.abs(bench.load).max())
    seats = library(bench, ["contact_seating"])
    closing = [f for v in seats for law, f in v.info["laws"] if law == "slack"]
    assert max(closing) == pytest.approx(0.35 * top)
    last = next(v for v in seats if v.label == "slack 0.2")
    about = [v.info["force_N"] for v in contact_seating.refined(bench, last, 3.0)]
    assert 0.3 * top < max(about) <= 0.35 * top


def gives(bench: Bench, joint: int, by: Array) -> float:
    """The least by which a joint turns further under more torque, on its spring and moved by what a
    column (size,) does to the target, over what it turns on the spring."""
    out, torque = np.inf, bench.true_torque[:, joint]
    spring = bench.lever[:, joint] * bench.compliance[joint]
    for s in range(len(bench.data.setups)):
        mine = np.flatnonzero(bench.rows.setup == s)
        mine = mine[np.argsort(torque[mine])]
        step = np.diff(torque[mine])
        turned = torque[mine] + by[mine] / spring[mine]
        apart = step > 1e-2 * np.ptp(torque)
        out = min(out, float((np.diff(turned)[apart] / step[apart]).min(initial=np.inf)))
    return out


def test_a_displacement_that_is_imposed_may_be_resisted_less_and_less() -> None:
    """Foams and shells do, and are elastic: what falls too far is judged by what it leaves."""
    stroke = 1e-3 * triangle(400, 2.5)
    bench = make_bench(running(1e5 * stroke, stroke, imposed="displacement"))
    assert bench.imposed
    some = library(bench, ["joint_nonlinear_stiffness"])
    assert some
    assert not any(len(v.floor) and v.floor.min() < 0 for v in some)
