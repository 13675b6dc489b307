"""Figures of merit against values by hand and from the literature."""

from __future__ import annotations

import numpy as np
import pytest

from rig.blind.rates import auroc, ece, ece_by_chance, quantiles, rate, reliability, wilson


def test_wilson_against_published_values() -> None:
    # Newcombe 1998 (Statistics in Medicine 17, 857), table I, method 3
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(15, 148) == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)
    assert wilson(1, 29) == pytest.approx((0.0061, 0.1718), abs=5e-5)


def test_a_rate_of_nothing_is_undecided() -> None:
    assert rate([]) == {"value": None, "ci95": [0.0, 1.0], "hits": 0, "n": 0}
    assert quantiles([], 0.5) == [None]


def test_auroc_counts_ties_half() -> None:
    assert auroc([0.9, 0.8], [0.1, 0.2]) == 1.0
    assert auroc([0.1], [0.1, 0.1]) == 0.5
    assert auroc([0.5, 0.1], [0.3]) == 0.5
    assert auroc([], [0.3]) is None


def test_ece_by_hand() -> None:
    # three at 0.95, two of them right; one at 0.55, right
    confidence, right = [0.95, 0.95, 0.95, 0.55], [True, True, False, True]
    expected = (3 * abs(0.95 - 2 / 3) + 1 * abs(0.55 - 1.0)) / 4
    assert ece(confidence, right) == pytest.approx(expected)
    table = reliability(confidence, right)
    assert [(b["from"], b["n"], b["right"]) for b in table] == [
        (0.5, 1, 1.0),
        (0.9, 3, pytest.approx(2 / 3)),
    ]


def test_what_chance_makes_of_right_probabilities() -> None:
    """One case of even odds is off by a half, whatever comes; of many the share of those that are
    right is normal about theirs, and its distance sqrt(2 / pi) of its standard deviation."""
    assert ece_by_chance([0.5]) == [0.5, 0.5]
    mean, p95 = ece_by_chance([0.72] * 400 + [0.97] * 600)
    sds = [0.4 * (0.72 * 0.28 / 400) ** 0.5, 0.6 * (0.97 * 0.03 / 600) ** 0.5]
    assert mean == pytest.approx((2 / np.pi) ** 0.5 * sum(sds), rel=0.04)
    assert p95 is not None
    assert 1.5 * sum(sds) < p95 < 2.0 * sum(sds)
    assert ece_by_chance([]) == [None, None]


def test_certainty_falls_into_the_last_bin() -> None:
    assert reliability([1.0], [True])[0]["to"] == 1.0
    assert ece([], []) is None
