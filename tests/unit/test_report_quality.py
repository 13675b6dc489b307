"""What a data set says of its own quality."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rig.analysis.quality import assess
from rig.dataset import Dataset, load
from tests.unit.example_data import dataset as measured
from tests.unit.report_sets import bench


@pytest.fixture
def plain(tmp_path: Path) -> Dataset:
    return load(bench(tmp_path / "a.h5"))


def test_devices_and_lateness_of_a_measured_set() -> None:
    facts = assess(measured(5)).facts
    assert (facts["samples"], facts["used"], facts["discarded"]) == (5, 5, 0)
    assert facts["lateness_s"] == {"median": 1e-4, "p95": pytest.approx(1e-4), "max": 1e-4}
    assert facts["duration_s"] == 7.0
    assert facts["devices"] == [
        {
            "name": "laser",
            "values": 510,
            "invalid": 10,
            "samples_without_value": 0,
            "oldest_value_s": 0.01,
        },
        {
            "name": "robot",
            "values": 625,
            "invalid": 0,
            "samples_without_value": 0,
            "oldest_value_s": 0.008,
        },
    ]


def test_what_was_not_recorded_is_null(plain: Dataset) -> None:
    facts = assess(plain).facts
    for key in ("lateness_s", "slots_missed", "unsettled_levels", "force_zero", "temperature_C"):
        assert facts[key] is None
    assert facts["devices"] == facts["discards"] == facts["events"] == []


def test_how_fast_the_clock_of_an_emulated_run_went() -> None:
    found = measured(5)
    assert assess(found).facts["clock"] is None
    devices = {**found.devices, "hand": {"clock": "50 times real time"}}
    assert assess(replace(found, devices=devices)).facts["clock"] == "50 times real time"


def test_discards_and_events(plain: Dataset) -> None:
    discarded = plain.columns["discarded"].copy()
    discarded[3:6] = True
    events = [
        {"kind": "discard", "text": "rows 3 to 5", "reason": "redone", "first": 3, "last": 5},
        {"kind": "limit", "text": "force near its limit", "session_s": 12.5},
        {"kind": "step_start", "text": "as planned", "session_s": 13.0},
        {"kind": "note", "text": "without a time", "session_s": float("nan")},
        {"kind": "values_lost", "text": "300 values of laser", "session_s": 14.0},
    ]
    columns = {**plain.columns, "discarded": discarded}
    facts = assess(replace(plain, columns=columns, events=events)).facts
    assert (facts["used"], facts["discarded"]) == (plain.rows - 3, 3)
    assert facts["discards"] == [{"reason": "redone", "samples": 3}]
    assert [(e["kind"], e["session_s"]) for e in facts["events"]] == [
        ("limit", 12.5),
        ("note", None),
        ("values_lost", 14.0),
    ]


def zeros_after(plain: Dataset, drift_N_per_s: float) -> Dataset:
    """With a zero hold at the end of every run too, and a force that drifts."""
    columns = {k: v.copy() for k, v in plain.columns.items()}
    last = columns["step"] == 5
    columns["branch"][last] = "zero"
    columns["force_N"] = drift_N_per_s * columns["session_s"]
    return replace(plain, columns=columns)


def test_drift_of_the_force_at_zero_load(plain: Dataset) -> None:
    zero = assess(zeros_after(plain, 0.01)).facts["force_zero"]
    assert zero["runs"] == 3
    assert zero["largest_drift_N_per_min"] == pytest.approx(0.6)
    assert zero["median_drift_N_per_min"] == pytest.approx(0.6)
    assert zero["largest_change_N"] == pytest.approx(0.01 * 10)


def test_unloaded_positions_apart(plain: Dataset) -> None:
    columns = {**plain.columns}
    shifted = columns["displacement_mm"] + 0.25 * (columns["repetition"] == 2)
    columns["displacement_mm"] = shifted
    (found,) = assess(replace(plain, columns=columns)).facts["displacement_zero"]
    assert found["apart_mm"] == pytest.approx(0.25)
    assert (found["pose"], found["direction"], found["repetitions"]) == ("", "x", 3)


def test_levels_that_never_settled(plain: Dataset) -> None:
    columns = {**plain.columns, "settled": np.ones(plain.rows)}
    columns["settled"][(columns["step"] == 2) & (columns["repetition"] == 3)] = 0
    columns["settled"][np.flatnonzero(columns["step"] == 4)[0]] = 0  # its neighbour is settled
    assert assess(replace(plain, columns=columns)).facts["unsettled_levels"] == 1


def test_no_samples_at_all_and_no_finite_value(plain: Dataset) -> None:
    none = {k: v[:0] for k, v in plain.columns.items()}
    facts = assess(replace(plain, columns=none)).facts
    assert (facts["samples"], facts["force_zero"]) == (0, None)
    broken = {**plain.columns, "force_N": np.full(plain.rows, np.nan)}
    assert assess(replace(plain, columns=broken)).zeros == ()
