"""Seats that friction holds on the way."""

from __future__ import annotations

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.effects.contact_seating import RUBS, STEPS
from identification.gap.model.bench import make_bench
from tests.unit.test_gap_closer import assert_lawful
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_model import survive


def test_seats_that_rub_are_pressed_by_what_friction_lets_through() -> None:
    bench = make_bench(arm_data())
    rubbing = [v for v in library(bench, ["contact_seating"]) if v.info.get("rubs")]
    top, n = float(np.abs(bench.load).max()), bench.rows.n
    assert [v.info["rubs"] / top for v in rubbing] == pytest.approx(RUBS)
    assert_lawful(bench, rubbing)
    survive(bench, rubbing)
    far = np.array([bench.load[bench.rows.run == r].argmax() for r in np.unique(bench.rows.run)])
    place = np.arange(n) - np.searchsorted(bench.rows.run, bench.rows.run)
    before = place < far[bench.rows.run]
    for v in rubbing:
        rubs, last = float(v.info["rubs"]), STEPS[-1] * top
        taken, loaded = bench.columns[v.columns[-1]][:n], bench.load > rubs
        for mine, friction in ((before, -rubs), (~before, rubs)):
            slack = mine & loaded & (bench.load + abs(friction) < last)
            assert slack.sum() > 20
            wanted = (bench.load[slack] + friction) / last
            assert taken[slack] == pytest.approx(wanted, abs=5e-3)
