"""Glitches of running recordings are set aside; steps, peaks and gaps of glitches alone are not."""

from __future__ import annotations

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.recording.glitches import without_glitches
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data

N = 300


def recording(u: Array, force: Array | None = None) -> GapData:
    """A running recording: force N from a curved spring unless it is given."""
    n = len(u)
    f = 100.0 * (u + 0.3 * u**2) if force is None else force
    return bench_data(f, u * 1e-3, step=np.full(n, -1), time=0.1 * np.arange(n))


def triangle() -> Array:
    return np.asarray(1 - np.abs(np.linspace(-1, 3, N) % 2 - 1))


def test_single_readings_that_jump_off_are_set_aside_and_said() -> None:
    data = recording(triangle())
    force = data.force.copy()
    force[[60, 61, 200]] += 12.0
    kept = without_glitches(recording(triangle(), force))
    assert len(kept.force) == N - 3
    assert kept.time[60] == pytest.approx(6.2)
    (note,) = kept.aside
    assert note.startswith("3 of 300 readings jump off and come back at once: set aside")
    assert "6 s" in note
    assert len(kept.compliance) == len(data.compliance)


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_turning_points_and_steps_are_no_glitches(noise: float) -> None:
    draw = np.random.default_rng(4)
    for u in (triangle(), np.repeat([0.0, 1.0, 0.4, 1.2, 0.1], N // 5)):
        force = 100 * u + 5 * u**2 + noise * draw.standard_normal(len(u))
        assert not without_glitches(recording(u, force)).aside


def test_a_clean_spring_with_jumping_readings_keeps_them() -> None:
    """They are the gap then."""
    force = 100 * triangle()
    force[[60, 120, 200]] += 20.0
    kept = without_glitches(recording(triangle(), force))
    assert len(kept.force) == N
    assert not kept.aside


def test_many_of_them_are_how_the_rig_behaves() -> None:
    force = 100 * (triangle() + 0.3 * triangle() ** 2)
    force[10::15] += 20.0
    assert not without_glitches(recording(triangle(), force)).aside


def test_the_diagnosis_sets_them_aside_and_says_so() -> None:
    force = 100 * (triangle() + 0.3 * triangle() ** 2)
    force[[60, 61, 200]] += 12.0
    found = explained(recording(triangle(), force))
    assert found.bench.rows.n == N - 3
    assert any(note.startswith("3 of 300 readings jump off") for note in found.notes)


def resting(spikes: dict[int, float], n: int = 30) -> GapData:
    """Levels of eight readings, on a spring as simulated."""
    step = np.repeat(np.arange(n) % 6, 8)
    draw = np.random.default_rng(5)
    u = 20.0 * step / 1e5 + 1e-6 * draw.standard_normal(len(step))
    for at, size in spikes.items():
        u[at] += size
    return bench_data(20.0 * step, u, step=step, branch=np.where(step > 0, 1, 0))


def test_a_reading_at_rest_that_jumps_off_is_set_aside() -> None:
    kept = without_glitches(resting({84: 30e-6, 140: -20e-6}))
    assert len(kept.force) == 8 * N // 10 - 2
    assert kept.aside[0].startswith("2 of 240 readings jump off")
    assert explained(resting({84: 30e-6})).verdict == "none"  # one that is off is no effect


def test_first_readings_of_a_level_and_spells_stay() -> None:
    first = {80: 30e-6, 96: 30e-6}  # what lags
    assert not without_glitches(resting(first)).aside
    assert not without_glitches(resting({84: 30e-6, 85: 30e-6})).aside  # it stayed there
    assert not without_glitches(resting(dict.fromkeys(range(3, 240, 72), 60e-6))).aside  # 1.7%
    assert not without_glitches(resting({84: 6e-6})).aside  # noise does that


def test_a_stray_reading_in_a_thousand_is_set_aside_however_far_it_is_off() -> None:
    """It is most of what a clean spring leaves, and still nothing of the rig."""
    draw = np.random.default_rng(8)
    force = 100 * np.tile(triangle(), 5) + 0.05 * draw.standard_normal(5 * N)
    force[[310, 900]] += 20.0
    kept = without_glitches(recording(np.tile(triangle(), 5), force))
    assert len(kept.force) == 5 * N - 2
