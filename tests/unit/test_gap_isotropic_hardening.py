"""Joints that give way alike in both senses: beyond the largest load they have borne, and not back
when they are unloaded from more than twice their threshold."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.laws import isotropic_hardening
from identification.gap.laws.memories import memories
from identification.gap.model.bench import make_bench
from identification.gap.model.variants import RESET_PER_RUN, RESET_PER_SETUP
from tests.explained import explained
from tests.unit.arm_as_read import as_read, levels_of
from tests.unit.test_gap_forms import arm_data

THRESHOLD_NM, ADDED = 43.0, 1.5


def gives_way(memory: str) -> GapData:
    """Joint 1, by 1.5 times its compliance; it is as it was at the beginning of every run, in
    another direction, or in another pose only."""
    there, rng = arm_data(), np.random.default_rng(7)
    force, lever = levels_of(there)
    setup = np.array([[s.pose, s.direction] for s in there.setups])[there.setup]
    kept = {
        RESET_PER_RUN: np.char.add(np.char.add(*setup.T), there.run.astype(str)),
        RESET_PER_SETUP: np.char.add(*setup.T),
        "": setup[:, 0],
    }[memory]
    torque = force[:, None] * lever
    turned = torque * there.compliance
    for one in np.unique(kept):
        mine = kept == one
        most = np.maximum.accumulate(np.maximum(np.abs(torque[mine, 0]) - THRESHOLD_NM, 0.0))
        way = np.cumsum(np.sign(torque[mine, 0]) * np.diff(most, prepend=0.0))
        turned[mine, 0] += ADDED * there.compliance[0] * way
    return as_read(there, force, turned, rng)


@pytest.mark.slow
@pytest.mark.parametrize("memory", ["", RESET_PER_SETUP, RESET_PER_RUN])
def test_it_is_a_yield_and_its_threshold_is_found(memory: str) -> None:
    """The torque goes to 123 Nm, and flows back by no law of kinematic hardening."""
    found = explained(gives_way(memory))
    assert found.verdict == "joint_yield"
    assert found.after < 1.3 * found.noise
    values = found.effects[0].parameters
    assert values["threshold"].low <= THRESHOLD_NM <= values["threshold"].high
    assert values["threshold"].value == pytest.approx(THRESHOLD_NM, rel=0.01)
    slope = values["slope_beyond_over_elastic"]
    assert slope.low <= ADDED <= slope.high


def test_a_closer_look_lies_about_the_knee_that_several_radii_make_together() -> None:
    bench = make_bench(gives_way(""))
    whole = next(
        v
        for v in library(bench, ["joint_yield"])
        if v.info["knee"] == isotropic_hardening.HARDENED
        and v.joint == 0
        and v.info["memory"] == ""
    )
    radius = np.asarray(whole.info["radius"])
    w = np.zeros(len(radius))
    w[np.abs(radius - THRESHOLD_NM).argsort()[:2]] = 1.0
    found = isotropic_hardening.refined(bench, whole, w)
    centres = np.array([v.info["centre"] for v in found])
    assert centres.min() < THRESHOLD_NM < centres.max()
    assert np.ptp(centres) < 0.5 * THRESHOLD_NM
    closer = isotropic_hardening.refined(bench, whole, w, 0.4)
    assert np.ptp([v.info["centre"] for v in closer]) < 0.5 * np.ptp(centres)
    assert isotropic_hardening.refined(bench, whole, -w) == []


def test_it_remembers_as_all_knees_do() -> None:
    bench = make_bench(gives_way(""))
    mine = [
        v for v in library(bench, ["joint_yield"]) if v.info["knee"] == isotropic_hardening.HARDENED
    ]
    assert {v.info["memory"] for v in mine} == set(memories(bench))
