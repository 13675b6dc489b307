"""Loads that no row shows, as one word alone asks for them: several wrong laws together miss less
along the straight path than the right one does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap import explore
from identification.gap.data import GapData
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.model.bench import make_bench
from identification.gap.model.variants import variant
from identification.gap.search import overshoots
from identification.gap.search.overshoots import by_one_word
from tests.explained import explained
from tests.unit.arm_as_read import as_read, levels_of
from tests.unit.test_gap_forms import arm_data

SLIPS_NM, SHARE = 6.0, 0.4
GOES_BEYOND_N = 12.0


def rubbed(often: float, seed: int = 3) -> tuple[GapData, int]:
    """Joint 1 sticks by a share of its compliance until it slips; a hand goes beyond so many of the
    levels, whichever way it comes to them, and back before they are read. How many of these the
    joint feels."""
    there, rng = arm_data(), np.random.default_rng(seed)
    force, _ = levels_of(there)
    turned, count = np.zeros((len(force), 6)), 0
    for run in np.unique(there.run):
        mine = np.flatnonzero(there.run == run)
        lever = there.setups[there.setup[mine[0]]].lever
        state = before = 0.0
        for i in mine:
            way = [force[i]]
            if force[i] != before and force[i] > 0 and rng.random() < often:
                way.insert(0, force[i] + GOES_BEYOND_N * np.sign(force[i] - before))
                count += abs(lever[0]) * GOES_BEYOND_N > SLIPS_NM / 2
            for f in way:
                torque = f * lever[0]
                state = min(max(state, torque - SLIPS_NM), torque + SLIPS_NM)
            before = force[i]
            turned[i] = there.compliance * force[i] * lever
            turned[i, 0] += SHARE * there.compliance[0] * (state - force[i] * lever[0])
    return as_read(there, force, turned, rng), count


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_friction_under_a_hand_is_friction(seed: int) -> None:
    data, _ = rubbed(0.3, seed)
    found = explained(data)
    assert found.verdict == "joint_hysteresis"
    assert found.after < 1.4 * found.noise


@pytest.mark.slow
def test_the_word_that_is_right_asks_for_the_loads_that_there_were() -> None:
    data, count = rubbed(0.3)
    searched = explore.searched(*explore.prepared(make_bench(data), explore.Library()))
    asked = {next(iter(more.words)): more for more in by_one_word(searched)}
    assert abs(asked["joint_hysteresis"].count - count) <= 0.4 * count


def test_nobody_asks_where_the_hand_was_calm() -> None:
    data, _ = rubbed(0.0)
    searched = explore.searched(*explore.prepared(make_bench(data), explore.Library()))
    assert list(by_one_word(searched)) == []
    far = replace(searched, explanations=searched.explanations[1:])
    assert list(by_one_word(far)) == []


def test_what_flows_is_asked_in_shorter_tables_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it flows a path takes ten times as long: nobody waits two minutes for it."""
    rows, at = make_bench(arm_data()).rows, np.arange(20)
    monkeypatch.setattr(overshoots, "_MOST", len(at) * rows.n)
    sharp, slow = (variant("joint_yield", "", [0], (1.0,), flow_s=s) for s in (0.0, 5.0))
    each = [Explanation((Part(v, 1.0),), 0.0, 0.0, (0.0,), 0.0) for v in (sharp, slow)]
    assert [overshoots._is_quick(e, at, rows) for e in each] == [True, False]
    assert overshoots._is_quick(each[1], at[:2], rows)
