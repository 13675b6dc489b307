"""Instruments of the response read what other effects do, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.laws.interval import Parameter
from identification.gap.laws.lags import late
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from identification.gap.search.readings import as_moved, reading_all
from identification.gap.search.search import search
from tests.unit.test_gap_forms import arm_data

GAIN = 0.75


def one(bench: Bench, word: str, label: str) -> Variant:
    return next(v for v in library(bench, [word]) if v.label == label)


def read_low(gain: float = GAIN) -> GapData:
    """A joint that creeps, seen by its reading as it is and by a laser that reads low."""
    data = arm_data()
    there = make_bench(data)
    creep = one(there, "joint_creep", "joint 2 spectrum")
    total = prediction(there) + 1.5 * sum(there.columns[c] for c in creep.columns[:3])
    rows, layout = there.rows, there.layout
    count = rows.weight.astype(int)
    holds = np.add.reduceat(count, np.flatnonzero(rows.hold_starts))
    q = np.repeat(total[layout.q].reshape(data.joints, -1).T, holds, axis=0)
    noise = data.displacement - 1.1e-5 * data.force
    assert data.q is not None
    displacement = gain * np.repeat(total[: rows.n], count) + noise
    return replace(data, displacement=displacement, q=data.q + q)


def engine_of(data: GapData) -> Engine:
    bench = make_bench(data)
    target = bench.observed - prediction(bench)
    return Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 4e-6, 2e-5]))


def explanation(engine: Engine) -> Explanation:
    gain = one(engine.bench, "displacement_scale", "gain")
    creep = one(engine.bench, "joint_creep", "joint 2 spectrum")
    return Explanation((Part(gain, 0.2), Part(creep, 0.6)), 0.0, 0.0, (1e-5, 1e-5), 0.0)


def test_a_gain_beside_an_effect_is_a_share_of_what_that_does_too() -> None:
    engine = engine_of(read_low())
    found = explanation(engine)
    fresh = [v for v in reading_all(engine, found) if v.word == "displacement_scale"]
    assert fresh[0].label == "gain, of all that moves"
    n, shown = engine.bench.rows.n, engine.bench.response
    column = engine.bench.columns[fresh[0].columns[0]][:n]
    moved = engine.bench.rows.about_means(np.column_stack([column, shown]))
    # what is read, but for the noise, and for what the plain column could not fit
    assert np.abs(moved[:, 0] - moved[:, 1]).max() < 0.05 * np.ptp(shown)
    assert engine.bench.moves is None


def test_only_instruments_of_the_response_beside_what_moves_are_looked_at() -> None:
    engine = engine_of(read_low())
    both = explanation(engine)
    assert reading_all(engine, replace(both, parts=both.parts[:1])) == []
    assert reading_all(engine, replace(both, parts=both.parts[1:])) == []
    blind = engine_of(replace(read_low(), q=None))
    assert reading_all(blind, explanation(blind)) == []
    force = one(engine.bench, "time_lag", "force delay 1 s")
    laser = one(engine.bench, "time_lag", "displacement delay 1 s")
    beside = Part(force, 1.0), both.parts[1]
    assert reading_all(engine, replace(both, parts=beside)) == []
    fresh = reading_all(engine, replace(both, parts=(Part(laser, 1.0), both.parts[1])))
    assert {v.info["channel"] for v in fresh} == {"displacement"}


def test_a_lag_acts_on_what_there_was_before_it() -> None:
    """Not on what it shows itself: no lag of a lag."""
    engine = engine_of(arm_data())
    creep = one(engine.bench, "joint_creep", "joint 2 spectrum")
    laser = one(engine.bench, "time_lag", "displacement delay 1 s")
    parts = (Part(laser, 1.0), Part(creep, 0.6))
    found = Explanation(parts, 0.0, 0.0, (1e-5, 1e-5), 0.0)
    fresh = next(v for v in reading_all(engine, found) if v.info["kind"] == "delay")
    fitted, n = fit(engine, found), engine.bench.rows.n
    was = engine.bench.response - engine.target[:n] + fitted.response
    was -= fitted.contribution(engine, 0)[:n]
    there = replace(engine.bench, moves=was)
    wanted = late(there, "displacement", "delay", float(fresh.info["lag_s"]))
    np.testing.assert_allclose(engine.bench.columns[fresh.columns[0]], wanted, atol=1e-15)
    assert np.abs(fitted.contribution(engine, 0)[:n]).max() > 1e-8  # it makes a difference


@pytest.mark.parametrize("gain", [GAIN, 1.3])
def test_a_laser_that_reads_wrong_beside_creep_is_met_to_the_noise(gain: float) -> None:
    """The joint reading sees the creep as it is, the laser a share of it."""
    engine = engine_of(read_low(gain))
    variants = library(engine.bench, ["displacement_scale", "joint_creep", "joint_hysteresis"])
    found = search(engine, variants)
    best = found.explanations[0]
    assert best.words == {"displacement_scale", "joint_creep"}
    label = next(p.variant.label for p in best.parts if p.word == "displacement_scale")
    assert label.endswith("of all that moves")
    assert len(found.variants) > len(variants)


@pytest.mark.parametrize(
    ("word", "name", "value"),
    [
        ("contact_seating", "depth", 0.1),
        ("thermal_drift", "drift_over_session_x", 0.1),
        ("time_lag", "lag", 0.125),
    ],
)
def test_a_length_that_the_laser_alone_saw_was_read_by_its_gain_too_large(
    word: str, name: str, value: float
) -> None:
    bench = make_bench(replace(arm_data(), q=None))
    parts = tuple(Part(library(bench, [w])[0], 0.2) for w in (word, "displacement_scale"))
    read = [{name: Parameter(0.125, 0.12, 0.13, "mm")}, {"factor": Parameter(1.25, 1.24, 1.26, "")}]
    assert as_moved(bench, parts, read)[0][name].value == pytest.approx(value)
