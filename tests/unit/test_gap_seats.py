"""Seats: that friction holds on the way, and that only get flatter."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Literal

import numpy as np
import pytest

from identification.gap.effects import contact_seating, library
from identification.gap.effects.contact_seating import LAWS, RUBS, STEPS
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.slow import slow_ones
from tests.unit.arm_as_read import as_read, levels_of
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


@pytest.mark.parametrize(("opens", "seats"), slow_ones(((False, True), (True, False)), (True,)))
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
    force, lever = levels_of(there)
    turned = force[:, None] * lever * there.compliance
    seats = 5e-5 * LAWS["exponential"](force / (share * force.max()))
    found = explained(as_read(there, force, turned, rng, beside=seats, laser_m=1e-6))
    assert found.verdict == "contact_seating"
    (only,) = found.fit.parts
    ((said, scale),) = only.variant.info["laws"]
    assert said == "exponential"
    assert scale == pytest.approx(share * force.max(), rel=0.05)
    depth = found.effects[0].parameters["depth"]
    assert depth.low <= 1e3 * seats.max() <= depth.high


@pytest.mark.parametrize("imposed", [None, "displacement"])
def test_only_slacks_of_an_imposed_stroke_are_looked_at_more_closely(
    monkeypatch: pytest.MonkeyPatch, imposed: Literal["displacement"] | None
) -> None:
    """A stroke tells of no other seat, on an arm as little as elsewhere."""
    data = arm_data()
    step = data.step if imposed is None else data.step - 99
    bench = make_bench(replace(data, imposed=imposed, step=step))
    seats = [SimpleNamespace(variant=v) for v in library(bench, ["contact_seating"])]
    starts: list[SimpleNamespace] = []
    monkeypatch.setattr(contact_seating, "closing_in", lambda _, __, these: starts.extend(these))
    word = SimpleNamespace(engine=SimpleNamespace(bench=bench), alone=seats)
    contact_seating._look_closer(word)  # type: ignore[arg-type]
    laws = {s.variant.info["laws"][0][0] for s in starts}
    assert bench.imposed is (imposed is not None)
    assert (laws <= {"slack", "toe"}) is bench.imposed
