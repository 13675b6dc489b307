"""Seats: that friction holds on the way, and that only get flatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.effects.contact_seating import LAWS, RUBS, STEPS
from identification.gap.model.bench import make_bench
from tests.explained import explained
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


@pytest.mark.parametrize(("opens", "seats"), [(False, True), (True, False)])
def test_what_gives_way_under_more_force_is_no_seat(opens: bool, seats: bool) -> None:
    """A flange that opens at half of the load, in every direction and pose."""
    data = arm_data()
    top = float(np.abs(data.force).max())
    share = np.abs(data.force) / top
    law = np.logaddexp(0.0, (share - 0.5) / 0.03) * 0.06 if opens else share / (share + 0.1)
    moved = 6e-5 * law * np.sign(data.force)
    springs = np.array([s.lever**2 @ data.compliance for s in data.setups])[data.setup]
    noise = 1e-6 * np.random.default_rng(1).standard_normal(len(moved))
    given = replace(data, displacement=springs * data.force + moved + noise, q=None)
    assert (explained(given).verdict == "contact_seating") is seats


@pytest.mark.parametrize("share", [0.137, 0.29])
def test_the_scale_of_an_arms_seat_is_met_between_those_of_the_grid(share: float) -> None:
    """As a share of the largest force; a good laser would see a tenth of 0.05 mm left."""
    there, rng = arm_data(), np.random.default_rng(7)
    force = np.round(there.force / 40.0) * 40.0
    lever = np.stack([s.lever for s in there.setups])[there.setup]
    turned = force[:, None] * lever * there.compliance
    seats = 5e-5 * LAWS["exponential"](force / (share * force.max()))
    data = replace(
        there,
        force=force + rng.normal(0, 0.05, len(force)),
        displacement=np.sum(lever * turned, axis=1) + seats + rng.normal(0, 1e-6, len(force)),
        q=turned + rng.normal(0, 1e-5, turned.shape),
        instruments=replace(there.instruments, force=0.1, displacement=1e-6),
        temperature=None,
    )
    found = explained(data)
    assert found.verdict == "contact_seating"
    (only,) = found.fit.parts
    ((said, scale),) = only.variant.info["laws"]
    assert said == "exponential"
    assert scale == pytest.approx(share * force.max(), rel=0.05)
    depth = found.effects[0].parameters["depth"]
    assert depth.low <= 1e3 * seats.max() <= depth.high
