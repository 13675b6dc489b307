"""Friction acts from the first load on: what holds half of it and then gives way has yielded."""

from __future__ import annotations

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.effects import library
from identification.gap.laws.friction_law import no_knee
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.path import worked_in
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_running import SPRING, running, triangle

STRENGTHS = np.array([0.02, 0.1, 0.3, 0.4, 0.45, 0.6, 0.9])  # of the largest torque


def arm() -> tuple[Bench, Array, float]:
    bench = make_bench(arm_data())
    torque = bench.true_torque[:, 0]
    return bench, torque, float(np.abs(torque).max())


def allowed(row: Array | None) -> list[bool]:
    """Whether friction of each strength alone keeps the limit."""
    assert row is not None
    return [bool(r >= 0) for r in row[0]]


def test_one_strength_of_more_than_four_tenths_of_the_load_is_a_knee() -> None:
    bench, torque, top = arm()
    row = no_knee(bench, torque, STRENGTHS * top, bench.path(torque))
    assert allowed(row) == [True, True, True, True, False, False, False]
    assert row is not None
    assert row[0, 0] == 0.0  # what slips at once does as a spring does
    assert row[0, 1] > 0.0


def test_a_knee_may_have_a_share_in_friction() -> None:
    """Strengths from 0.18 to 0.7 of the load, all alike, are friction; from 0.3 on they are not."""
    bench, torque, top = arm()
    for low, friction in ((0.18, True), (0.3, False)):
        strengths = np.linspace(low, 0.7, 40)
        row = no_knee(bench, torque, strengths * top, bench.path(torque))
        assert row is not None
        assert (float(row[0].sum()) > 0.0) is friction


def test_what_was_cycled_before_is_as_strong_as_it_was() -> None:
    bench, torque, top = arm()
    path = bench.path(torque)
    cycled, new = (no_knee(bench, torque, STRENGTHS * top, p) for p in (worked_in(path), path))
    assert allowed(cycled) == allowed(new)


@pytest.mark.parametrize(("along", "free"), [(1.0, True), (-1.0, False)])
def test_weights_have_slipped_what_they_push_the_same_way(along: float, free: bool) -> None:
    bench, torque, top = arm()
    way = np.sign(torque[np.abs(torque).argmax()])
    weight = np.full(len(torque), along * way * 0.5 * top)
    row = no_knee(bench, torque, STRENGTHS * top, bench.path(torque, weight=weight))
    assert allowed(row) == [True] * 4 + [free] * 2 + [free]
    # of 0.9 the weight leaves 0.4 to slip


def test_of_a_load_that_saturates_what_comes_through_counts() -> None:
    """Half of the load brings two thirds of what all of it does."""
    bench, torque, top = arm()
    most = 0.8 * top
    through = most * np.tanh(top / most)
    plain = no_knee(bench, torque, np.array([0.5]) * through, bench.path(torque))
    row = no_knee(bench, torque, np.array([0.5]) * through, bench.path(torque), most)
    assert allowed(plain) == [True]
    assert allowed(row) == [True]
    assert row is not None
    assert plain is not None
    early = most * np.tanh(0.5 * top / most) - 0.5 * through
    late = 0.5 * through
    assert row[0, 0] == pytest.approx((early - 0.16 * late) / late)
    assert row[0, 0] > plain[0, 0]


def test_spectra_of_an_arm_have_no_knee_whatever_they_remember() -> None:
    bench = make_bench(arm_data())
    spectra = [v for v in library(bench, ["joint_hysteresis"]) if v.form == "spectrum"]
    assert len({v.label.removeprefix("joint 1") for v in spectra}) > 4
    for v in spectra:
        w = np.zeros(len(v.columns))
        assert v.joint is not None
        top = float(np.abs(bench.true_torque[:, v.joint]).max())
        radius = np.asarray(v.info["radius"])
        w[np.argmin(np.abs(radius - 0.7 * min(top, radius[-1])))] = 1.0
        if "under weight" not in v.label:
            assert (v.within @ w).min() < 0


def test_a_specimen_that_is_driven_to_and_fro_may_slip_at_one_strength() -> None:
    force = 100 * triangle(400, 3)
    one_sided = make_bench(running(force, force / SPRING, imposed="force"))
    both = make_bench(running(force - 50, (force - 50) / SPRING, imposed="force"))
    for bench, asks in ((one_sided, True), (both, False)):
        torque = bench.true_torque[:, 0]
        row = no_knee(bench, torque, np.array([30.0, 60.0]), bench.path(torque))
        assert (row is not None) is asks


def test_no_strength_no_limit() -> None:
    bench, torque, _ = arm()
    row = no_knee(bench, torque, np.zeros(0), bench.path(torque))
    assert row is not None
    assert row.shape == (1, 0)
