"""Files without a row where the displacement ended loading: what the arm remembers has a cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from identification.gap.laws.knees import THRESHOLDS, knee_variants
from identification.gap.model.bench import make_bench
from rig.dataset import Dataset
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import imported
from tests.unit.cli_bench import META

LEVELS, KNEE_N, END_N = (10.0, 20.0, 30.0, 40.0, 50.0), 46.0, 56.0
SAMPLES = 4


def gone(force: float) -> float:
    """Plastic displacement, mm."""
    return max(force - KNEE_N, 0.0) / 2.0


def ended() -> Dataset:
    """A bench that gives way at 46 N and is set back before every run; loading went on from its
    last level, 50 N, to 56 N, as the events say and no row shows."""
    random, rows, events = np.random.default_rng(3), [], []
    for repetition in (1, 2, 3):
        held = [("zero", 0, 0.0, 0.0)]
        held += [("loading", k, f, f / 95 + gone(f)) for k, f in enumerate(LEVELS, start=1)]
        held += [("zero", 0, 0.0, gone(END_N))]
        for branch, step, force, moved in held:
            for _ in range(SAMPLES):
                time = 10.0 * len(rows)
                f, u = force + random.normal(0, 0.03), moved + random.normal(0, 0.001)
                rows.append((time, repetition, branch, step, f, u))
        at = len(rows) - SAMPLES
        events.append({"kind": "top", "branch": "loading", "step": 6, "sample": at, "text": ""})
    names = ["time_s", "repetition", "branch", "step", "force_N", "displacement_mm"]
    table = pd.DataFrame(rows, columns=names)
    table["session_s"] = table["time_s"]
    return replace(imported(table, META), events=events)


def test_loading_is_taken_to_have_gone_on_half_a_level() -> None:
    data = gap_data(ended())
    assert data.onward is not None
    behind = np.flatnonzero(data.onward)
    assert behind.tolist() == [24, 52, 80]  # the first samples of the plateaus
    assert data.onward[behind] == pytest.approx(0.1, abs=0.01)
    assert any("In 3 runs loading went on to stop_at_displacement_mm" in n for n in data.notes)
    told = replace(ended(), events=[])
    assert not np.any(gap_data(told).onward)
    assert not gap_data(told).notes


def test_an_end_ahead_of_the_first_sample_is_none_of_the_last_one() -> None:
    """The last sample in the file is of a loading branch, and has nothing to do with it."""
    whole = ended()
    kept = {name: values[:24] for name, values in whole.columns.items()}
    told = replace(whole, columns=kept, events=[{**whole.events[0], "sample": 0}])
    assert not np.any(gap_data(told).onward)


def test_what_was_discarded_ended_nothing() -> None:
    dataset = ended()
    discarded = dataset.columns["repetition"] == 2
    data = gap_data(replace(dataset, columns={**dataset.columns, "discarded": discarded}))
    assert np.count_nonzero(data.onward) == 2


def test_what_gives_way_remembers_the_end_of_loading() -> None:
    bench = make_bench(gap_data(ended()))
    (state,) = bench.plays(bench.load, np.array([KNEE_N]), bench.rows.starts).T
    behind = np.isin(bench.rows.hold, bench.rows.hold[bench.rows.onward != 0])
    assert state[bench.rows.step == len(LEVELS)] == pytest.approx(50.0 - KNEE_N, abs=0.2)
    assert state[behind] == pytest.approx(55.0 - KNEE_N, abs=0.2)
    other = make_bench(gap_data(replace(ended(), events=[])))
    (state,) = other.plays(other.load, np.array([KNEE_N]), other.rows.starts).T
    assert state.max() < 50.2 - KNEE_N


def test_what_gives_way_is_looked_for_up_to_the_end_of_loading() -> None:
    bench = make_bench(gap_data(ended()))
    found = knee_variants(bench, bench.load, lambda _: 0, "joint_yield", "", {"joint": 0})
    furthest = max(float(np.max(v.info["radius"])) for v in found)
    assert furthest == pytest.approx(55.0 * max(THRESHOLDS), rel=0.01)
