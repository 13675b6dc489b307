"""What is said of time where a stamp is wrong, or none was written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.answer.notes import notes_of
from identification.gap.model.bench import make_bench
from identification.gap.model.history import sampling_time
from identification.gap.recording.rows import reduce_rows
from tests.unit.test_gap_force_drops import saw, stroke
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_running import SPRING, running, triangle


def test_one_wrong_stamp_says_nothing_of_the_time_between_samples() -> None:
    data = arm_data()
    second = int(np.flatnonzero((np.diff(data.run) == 0) & (np.diff(data.step) == 0))[0]) + 1
    time = data.time.copy()
    time[second] = time[second - 1] + 1e-3
    for each in (data, replace(data, time=time)):
        assert sampling_time(reduce_rows(each)) == pytest.approx(1.0)


def test_times_that_are_numbers_of_readings_are_said_to_be_so() -> None:
    force = 100.0 * triangle(300, 3.0)
    for timed in (True, False):
        bench = make_bench(running(force, force / SPRING, timed=timed))
        said = [
            n.text for n in notes_of(bench, "none") if n.text.startswith("No time was recorded")
        ]
        assert len(said) == (not timed)


def test_what_lets_go_does_so_at_a_time_or_at_a_reading() -> None:
    force, u = saw(0.4)
    for timed, unit in ((True, " s)"), (False, ")")):
        bench = make_bench(stroke(force, u, timed=timed))
        (said,) = (
            n.text for n in notes_of(bench, "none") if "lets go" in n.text or "sticks" in n.text
        )
        assert f"first at {'reading ' if not timed else ''}" in said
        assert unit in said
