"""Pulls that end in a break, begin before the force was zeroed, or end nearly flat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData, Instruments
from identification.gap.effects import library
from identification.gap.evidence.parts import Part, Sizes
from identification.gap.explanations.penalties import unbent_curves
from identification.gap.explanations.priors import prior_of
from identification.gap.model.bench import make_bench
from identification.gap.recording.ends import after_break, without_ends
from identification.gap.recording.faults import BROKEN, found_in
from tests.explained import explained
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_running import SPRING, running

METER = Instruments(0.1, 1e-6, 0.005, 0.003)
N = 160


def recording(force: Array, u: Array | None = None) -> GapData:
    """A machine pulls by 1 mm."""
    noise = np.random.default_rng(8).normal(0, METER.force, len(force))
    u = np.linspace(0.0, 1e-3, len(force)) if u is None else u
    return running(force + noise, u, imposed="displacement", instruments=METER)


def line(n: int = N) -> Array:
    return SPRING * np.linspace(0.0, 1e-3, n)


def limit_violation(at: int, left: float = 5.0) -> Array:
    return np.where(np.arange(N) < at, line(), left)


def test_a_few_readings_after_a_break_are_set_aside_and_said() -> None:
    found = explained(recording(limit_violation(N - 6)))
    assert len(found.bench.data.force) == N - 6
    assert found.verdict == "none"
    (note,) = [n for n in found.notes if "a break" in n]
    assert note == (
        "The force falls at once while the stroke goes on (at 154 s): a break. 6 readings after it "
        "set aside."
    )


def test_a_break_that_takes_two_readings_ends_where_most_of_it_falls() -> None:
    force = limit_violation(N - 6)
    force[N - 7] *= 0.93
    assert np.flatnonzero(after_break(recording(force)))[0] == N - 6


def test_a_recording_that_goes_on_long_after_a_break_is_unknown() -> None:
    data = recording(limit_violation(N - 50))
    assert without_ends(data) is data
    found = explained(data)
    assert found.verdict == "unknown"
    assert any("31 % of the readings come after that: a break" in n for n in found.notes)


def test_a_break_is_told_by_its_reading_where_no_clock_was_recorded() -> None:
    unclocked = [replace(recording(limit_violation(N - left)), timed=False) for left in (6, 50)]
    (note,) = without_ends(unclocked[0]).aside
    assert "goes on (at reading 155): a break." in note
    (fault,) = [f for f in found_in(unclocked[1]) if f.kind == BROKEN]
    assert "goes on (at reading 111), and 31 % of" in fault.text


@pytest.mark.parametrize("what", ["knee", "slips", "cycle", "stiff", "noise", "levels", "bridged"])
def test_what_goes_on_or_back_has_not_broken(what: str) -> None:
    force, u = line(), np.linspace(0.0, 1e-3, N)
    if what == "knee":  # an upper yield point, and necking
        force = np.minimum(force, 60.0) * np.where(u > 7e-4, 0.9, 1.0)
        force[-40:] *= np.linspace(1.0, 0.4, 40)
    elif what == "slips":  # again and again
        force = SPRING * (u % 2e-4)
    elif what == "cycle":  # let go at once, and the stroke goes back
        u = np.where(np.arange(N) < 80, u, 0.0)
        force = SPRING * u
    elif what == "stiff":  # a cycle across a gap, steep where it ends
        u = 1e-3 * np.sin(np.linspace(0.0, 15.0, N))
        force = 20 * SPRING * np.sign(u) * np.maximum(np.abs(u) - 0.95e-3, 0.0)
    elif what == "noise":  # nothing is pulled
        force = np.where(np.arange(N) < N - 6, np.minimum(np.arange(N), 1) * 0.4, 0.0)
    elif what == "bridged":
        force[60:70] *= 0.6
    data = recording(force, u)
    if what == "noise":
        data = running(force, u, imposed="displacement", instruments=METER)
    if what == "levels":
        step = np.arange(40) // 2
        data = bench_data(np.where(step < 18, 5.0 * step, 5.0), 1e-5 * step, step=step)
    assert not after_break(data).any()
    assert not any(fault.kind == BROKEN for fault in found_in(data))


def test_a_reading_from_before_the_force_was_zeroed_is_set_aside_and_said() -> None:
    force, u = line(), np.linspace(0.0, 1e-3, N)
    force[0], u[0] = -70.0, u[1]
    found = explained(recording(force, u))
    assert len(found.bench.data.force) == N - 1
    assert found.verdict == "none"
    assert any(n.startswith("1 reading at the beginning set aside") for n in found.notes)


@pytest.mark.parametrize("first", ["preload", "moves", "pushed", "cycled"])
def test_first_readings_that_mean_something_stay(first: str) -> None:
    force, u = line(), np.linspace(0.0, 1e-3, N)
    if first == "preload":  # nothing moves until the force is there
        force, u[0] = np.append(-70.0, force[1:] + 30.0), u[1]
    elif first == "moves":
        force[0], u[0] = -70.0, -7e-4
    elif first == "cycled":
        force = np.append(-30.0, 2.0 + 60.0 * np.sin(np.linspace(0.0, 12.0, N - 1)))
    else:  # a load that goes both ways
        force = np.append(-70.0, np.linspace(-60.0, 60.0, N - 1))
    data = recording(force, u)
    assert without_ends(data) is data


def test_what_ends_nearly_flat_flows_rather_than_bends() -> None:
    """A smooth knee, that a curve fits as well."""
    u = np.linspace(0.0, 1e-3, N)
    flat = 60.0 * np.tanh(4 * SPRING * u / 60.0)
    flows, bends = make_bench(recording(flat)), make_bench(recording(60.0 * np.tanh(2e3 * u)))
    assert flows.load_history.flows_out
    assert not bends.load_history.flows_out  # to a seventh of its stiffness
    assert not make_bench(recording(flat, u + 1e-4 * np.sin(np.arange(N)))).load_history.flows_out
    words = frozenset({"joint_nonlinear_stiffness"})
    assert prior_of(words, flows) < prior_of(words, bends) - 10.0
    both = words | {"joint_yield"}
    assert prior_of(both, flows) == prior_of(both, bends)


@pytest.mark.parametrize(("off", "bend", "curve"), [(1.5, 2.4e-5, False), (1.0, 1.6e-5, True)])
def test_a_line_far_off_that_bends_within_the_noise_is_a_spring(
    off: float, bend: float, curve: bool
) -> None:
    """Levels of a rig whose uncertainty somebody guessed: with the spring beside it a curve may
    count, but no curve is the spring as well."""
    step = np.append(np.arange(48), np.arange(47, -1, -1))
    x = step / 47
    u = off * 100.0 * x / SPRING + bend * np.sin(np.pi * x)
    u += np.random.default_rng(2).normal(0, 1e-6, len(u))
    meter = Instruments(0.01, 1e-5, 0.005, 0.003)
    branch = np.repeat([1, 2], 48)
    found = explained(bench_data(100.0 * x, u, step=step, branch=branch, instruments=meter))
    assert (found.verdict == "joint_nonlinear_stiffness") == curve
    alone = next(e for e in found.found.explanations if e.words == {"joint_nonlinear_stiffness"})
    assert (alone.log_weight > found.found.explanations[0].log_weight - 8.0) == curve
    line = next(v for v in library(found.bench, list(alone.words)) if "line" in v.info["kinds"])
    sizes = Sizes(np.array([4e-6]), np.array([1.5e-4 if off > 1 else 1.5e-5]), 0.0)
    assert (unbent_curves(found.engine, (Part(line, 1.0),), sizes) == 0.0) == curve
    measured = explained(recording(SPRING * np.linspace(0.0, 1e-3, 600))).engine
    assert measured.bench.noise.sure
    noise = measured.bench.noise.stated
    sizes = Sizes(np.array([0.4 * noise]), np.array([1.5e-4]), 0.0)
    assert unbent_curves(measured, (Part(line, 1.0),), sizes) == 0.0


def test_a_force_that_grows_while_the_reading_stands_is_no_hold() -> None:
    """An extensometer that grips late."""
    u = np.maximum(np.linspace(-4e-4, 1e-3, N), 0.0)
    assert make_bench(recording(line(), u)).load_history.never_held
    held = np.minimum(np.linspace(0.0, 1.4e-3, N), 1e-3)
    relaxing = SPRING * held * np.where(held < 1e-3, 1.0, np.linspace(1.3, 0.6, N))
    assert not make_bench(recording(relaxing, held)).load_history.never_held
