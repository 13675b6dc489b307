"""Loads that stand for long and are read at once, and then ever less often: as what creeps is."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.model.history import delayed, hold_time_after_row
from identification.gap.recording.rows import reduce_rows
from tests.unit.test_gap_operators import bench_data

STANDS_S, LAST_S = 2700.0, 2640.0


def test_a_load_stands_until_after_the_last_reading() -> None:
    """Not until after the middle of the last few, which may lie minutes before."""
    weights = np.array([0.0, 250.0, 500.0, 250.0, 0.0])
    each = np.concatenate([[0.0, 1.0], np.geomspace(2.0, LAST_S, 33)])
    session = np.concatenate([k * STANDS_S + each for k in range(len(weights))])
    step = np.repeat(np.arange(len(weights)), len(each))
    force = weights[step]
    rows = reduce_rows(
        bench_data(force, force * 1e-5, time=session, session=session, step=step.astype(np.int64))
    )
    begins = rows.edges[1:]
    last = STANDS_S * np.arange(len(begins)) + LAST_S
    after_the_row = last - rows.session[begins - 1]
    assert np.all(after_the_row > 100.0)
    leaves = last + rows.half_sample
    assert hold_time_after_row(rows)[begins] == pytest.approx(leaves - rows.session[begins - 1])
    # and so for what only comes late: between leaving one load and coming to the next all is on its
    # way, and nothing before
    delay = 100.0
    late = delayed(rows.force, delay, rows)
    stood = (rows.session - delay > STANDS_S) & (rows.session - delay < leaves[1])
    assert np.any(stood[rows.session > leaves[1] - 400.0])
    assert late[stood] == pytest.approx(250.0)
