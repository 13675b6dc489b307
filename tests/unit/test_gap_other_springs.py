"""Another simulator, known by its curves alone: how its arm gives way, not which joint turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import Curve, GapData
from identification.gap.model.base import prediction
from identification.gap.model.bench import make_bench
from identification.gap.model.other_springs import springs_behind
from tests.conformance.gap_designs import linear
from tests.explained import explained

ENDS = np.array([-1000.0, 1000.0])  # N


def slopes(data: GapData, compliance: Array) -> list[float]:
    """m/N, of each setup."""
    return [float(s.lever**2 @ compliance) for s in data.setups]


def with_curves_of(data: GapData, compliance: Array) -> GapData:
    """Simulated by a program whose springs have that compliance (m,) rad/Nm."""
    return replace(data, curves=tuple(Curve(ENDS, k * ENDS) for k in slopes(data, compliance)))


def test_springs_behind_give_the_curves_slopes_and_lie_near_the_stated_ones() -> None:
    data = linear("medium")
    other = data.compliance * np.array([1.1, 0.95, 1.05, 1.0, 0.9, 1.0])
    found = springs_behind(with_curves_of(data, other))
    np.testing.assert_allclose(slopes(data, found), slopes(data, other), rtol=1e-3)
    away, needed = (np.linalg.norm(c / data.compliance - 1) for c in (found, other))
    assert 0 < away <= needed


def test_curves_of_the_stated_springs_leave_these() -> None:
    data = linear("medium")
    found = springs_behind(with_curves_of(data, data.compliance))
    np.testing.assert_allclose(found, data.compliance, rtol=1e-9)


@pytest.mark.slow
def test_a_simulator_a_little_off_is_no_gain_of_the_laser() -> None:
    """Its joints turn as its arm gives way: were they those of the stated springs, readings and
    laser would disagree by what the simulators do."""
    data = linear("medium")
    assert data.q is not None
    result = explained(with_curves_of(data, 1.07 * data.compliance))
    assert result.probabilities["displacement_scale"] < 0.05
    assert result.verdict in ("none", "force_scale", "joint_stiffness_error")  # a common factor


@pytest.mark.slow
def test_a_simulator_with_soft_links_needs_no_joint_that_turns_further() -> None:
    """What its curves have beyond the joints is there, and no joint reading sees it."""
    data = linear("medium")
    softer = np.array(slopes(data, 0.15 * data.compliance))
    measured = replace(data, displacement=data.displacement + softer[data.setup] * data.force)
    result = explained(with_curves_of(measured, 1.15 * data.compliance))
    assert result.verdict == "none"


def test_curves_are_taken_at_the_load_that_counts() -> None:
    """At each reading of a force they would repeat its noise as a motion."""
    data = linear("medium")
    bench, other = make_bench(data), make_bench(with_curves_of(data, data.compliance))
    assert other.simulated == pytest.approx(bench.stated_slope * bench.load, rel=1e-9)


def test_where_the_displacement_is_imposed_curves_say_what_is_carried() -> None:
    data = replace(linear("bench"), imposed="displacement")
    (stated,) = slopes(data, data.compliance)
    softer = make_bench(replace(data, curves=(Curve(ENDS, 2 * stated * ENDS),)))
    assert prediction(softer) == pytest.approx(prediction(make_bench(data)) / 2, abs=1e-12)


def test_a_curve_that_stands_or_goes_back_is_read_by_its_displacement() -> None:
    curve = Curve(np.array([0.0, 10.0, 20.0, 30.0]), np.array([0.0, 1.0, 0.8, 3.0]))
    np.testing.assert_allclose(curve.carried(np.array([-1.0, 0.5, 1.0, 2.0])), [-10, 5, 10, 20])
    down = Curve(np.array([0.0, 10.0]), np.array([0.0, -2.0]))
    np.testing.assert_allclose(down.carried(np.array([-1.0])), [5.0])
