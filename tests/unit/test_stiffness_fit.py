"""Lines through points: published data, laws of scaling, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.fit import weighted_line, york_line
from identification.uncertainty import Contribution, combined, coverage_factor

# Pearson's data with York's weights: the standard example of a line uncertain in both coordinates
X = np.array([0.0, 0.9, 1.8, 2.6, 3.3, 4.4, 5.2, 6.1, 6.5, 7.4])
Y = np.array([5.9, 5.4, 4.4, 4.6, 3.5, 3.7, 2.8, 2.8, 2.4, 1.5])
WX = np.array([1000.0, 1000, 500, 800, 200, 80, 60, 20, 1.8, 1])
WY = np.array([1, 1.8, 4, 8, 20, 20, 70, 70, 100, 500])


def test_pearsons_data_with_yorks_weights() -> None:
    fit = york_line(X, Y, WX**-0.5, WY**-0.5)
    assert fit.converged
    assert fit.slope == pytest.approx(-0.480533407, abs=1e-9)
    assert fit.intercept == pytest.approx(5.479910224, abs=1e-9)
    assert fit.chi2 == pytest.approx(11.8663532, abs=1e-6)
    assert fit.u_slope == pytest.approx(0.0579850090, abs=1e-9)  # York et al. 2004, table II
    assert fit.u_intercept == pytest.approx(0.2949707357, abs=1e-8)


def test_gum_h3_calibration_of_a_thermometer() -> None:
    t = np.array(
        [21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511]
    )
    b = -1e-3 * np.array([171, 169, 166, 159, 164, 165, 156, 157, 159, 161, 160])
    fit = weighted_line(t - 20.0, b, np.ones(11), intercept=True)
    s = np.sqrt(fit.chi2 / fit.dof)
    r = fit.covariance[0, 1] / (fit.u_intercept * fit.u_slope)
    at_30 = np.array([1.0, 10.0])
    assert fit.dof == 9
    assert round(fit.intercept, 4) == -0.1712
    assert round(s * fit.u_intercept, 4) == 0.0029
    assert round(fit.slope, 5) == 0.00218
    assert round(s * fit.u_slope, 5) == 0.00067
    assert round(r, 3) == -0.930
    assert round(float(s), 4) == 0.0035
    assert round(fit.intercept + 10.0 * fit.slope, 4) == -0.1494
    assert round(float(s * np.sqrt(at_30 @ fit.covariance @ at_30)), 4) == 0.0041


def test_york_becomes_the_weighted_line_where_x_is_exact() -> None:
    sy = WY**-0.5
    for intercept in (True, False):
        exact = weighted_line(X, Y, sy, intercept=intercept)
        fit = york_line(X, Y, np.full(10, 1e-9), sy, intercept=intercept)
        assert fit.slope == pytest.approx(exact.slope, rel=1e-9)
        assert fit.u_slope == pytest.approx(exact.u_slope, rel=1e-6)


def test_york_through_the_origin_minimises_what_it_says() -> None:
    x, y = X + 1.0, 2.0 * X + 2.0 + 0.1 * np.cos(5.0 * X)
    sx, sy = 0.1 + 0.01 * x, 0.2 + 0.0 * y

    def cost(b: float) -> float:
        return float(np.sum((y - b * x) ** 2 / (sy**2 + b**2 * sx**2)))

    b = york_line(x, y, sx, sy, intercept=False).slope
    assert cost(b) < min(cost(b * (1 + 1e-5)), cost(b * (1 - 1e-5)))


def test_york_is_the_same_with_the_axes_exchanged() -> None:
    fit = york_line(X, Y, WX**-0.5, WY**-0.5)
    turned = york_line(Y, X, WY**-0.5, WX**-0.5)
    assert turned.slope == pytest.approx(1.0 / fit.slope, rel=1e-9)


@settings(deadline=None)
@given(factor=st.floats(1e-6, 1e6), scale=st.floats(1e-9, 1e9))
def test_a_common_factor_of_the_weights_changes_nothing_but_the_uncertainty(
    factor: float, scale: float
) -> None:
    s = WY**-0.5
    one = weighted_line(X, Y, s, intercept=True)
    other = weighted_line(X * scale, Y, s * factor, intercept=True)
    assert other.slope * scale == pytest.approx(one.slope, rel=1e-9)
    assert other.intercept == pytest.approx(one.intercept, rel=1e-9)
    assert other.u_slope * scale == pytest.approx(one.u_slope * factor, rel=1e-9)


def test_a_line_far_from_the_origin_loses_no_digits() -> None:
    x = 1e6 + np.arange(5.0)
    assert weighted_line(x, 3.0 * (x - 1e6), np.ones(5), intercept=True).slope == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("x", "y", "s", "text"),
    [
        ([1.0], [1.0], [1.0], "at least 2 points; got 1"),
        ([1.0, 1.0], [1.0, 2.0], [1.0, 1.0], "different x"),
        ([1.0, 2.0], [1.0, 2.0], [1.0, 0.0], "above 0"),
        ([1.0, 2.0], [1.0, np.nan], [1.0, 1.0], "finite"),
        ([1.0, 2.0], [1.0, 2.0, 3.0], [1.0, 1.0], "one length"),
    ],
)
def test_refusals(x: list[float], y: list[float], s: list[float], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        weighted_line(np.array(x), np.array(y), np.array(s), intercept=True)


def test_welch_satterthwaite() -> None:
    """Equal contributions with 2 and 2 degrees of freedom make 4; t(4) = 2.776."""
    q = combined(10.0, [Contribution("a", "A", 3.0, 2.0), Contribution("b", "A", 3.0, 2.0)])
    assert q.dof == pytest.approx(4.0)
    assert q.u == pytest.approx(3.0 * np.sqrt(2.0))
    assert q.interval[1] - 10.0 == pytest.approx(2.7764 * q.u, rel=1e-4)


def test_what_is_not_counted_does_not_count() -> None:
    lines = [Contribution("a", "B", 3.0), Contribution("b", "B", 9.0, counted=False)]
    assert combined(1.0, lines).u == 3.0
    assert combined(1.0, []).interval == (1.0, 1.0)


def test_coverage_factors() -> None:
    assert coverage_factor(np.inf) == pytest.approx(1.95996, abs=1e-5)
    assert coverage_factor(2.0) == pytest.approx(4.30265, abs=1e-5)
