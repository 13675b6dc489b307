"""What two effects of one explanation owe each other: which is the larger, and which are one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.evidence.parts import Sizes, needed
from identification.gap.explanations import explanation
from identification.gap.explanations.explanation import _ranking_sizes
from identification.gap.explanations.penalties import _apart, _on_its_own, _same_element
from identification.gap.model.bench import make_bench
from identification.gap.recording.load_history import LoadHistory
from identification.gap.words import DAMAGE, JERKS, SOFTENING, WANDERS
from tests.unit.small_explanations import part, replace_bench, small_engine_of
from tests.unit.test_gap_evidence import small_bench, small_engine
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_weights import UP, hanging


def test_without_an_arm_a_wrong_spring_counts_by_what_friction_leaves_of_the_gap() -> None:
    engine = small_engine_of(small_bench())
    rubs, spring = part("joint_hysteresis", [0]), part("joint_stiffness_error", [1])
    gap = engine.structural * np.array([0.8, 9.0])
    sizes = Sizes(gap, np.full(2, 0.9) * engine.most**0.5, 0.0)
    assert _ranking_sizes(engine, (rubs, spring), sizes, 0) == pytest.approx(
        engine.structural * np.array([0.8, 0.6])
    )
    far = Sizes(gap, np.array([0.0, 2.0]) * engine.most**0.5, 0.0)  # than was measured
    assert _ranking_sizes(engine, (rubs, spring), far, 0)[1] < gap[0]
    slight = Sizes(np.array([0.2, 9.0]) * engine.structural, far.moved, 0.0)
    assert _ranking_sizes(engine, (rubs, spring), slight, 0)[1] < slight.gap[0]
    bent = part("joint_nonlinear_stiffness", [0])
    assert _ranking_sizes(engine, (bent, spring), sizes, 0) is gap  # its line is the spring
    toe, knee = part("contact_seating", [0]), part("joint_yield", [1])
    assert _ranking_sizes(engine, (toe, knee), sizes, 0) is sizes.moved
    arm = replace_bench(engine, replace(engine.bench, data=replace(engine.bench.data, arm=True)))
    assert _ranking_sizes(arm, (rubs, spring), sizes, 0) is gap


def test_two_frictions_without_readings_are_apart_in_different_directions() -> None:
    bench = hanging(UP, poses=(1.0, 1.0))
    setups = tuple(replace(s, direction=d) for s, d in zip(bench.data.setups, "xy", strict=True))
    bench = make_bench(replace(bench.data, setups=setups))
    only = [(bench.rows.setup == s) * 1e-5 * bench.load for s in (0, 1)]
    for column in (*only, only[0] + only[1]):
        bench.add(bench.stacked(column))
    engine = small_engine_of(bench)
    yields, slips = part("joint_yield", [0], joint=0), part("base_slip", [1], axis="z")
    assert _apart(engine, yields, slips)
    assert not _apart(engine, yields, part("base_slip", [2], axis="z"))


def test_springs_far_off_stand_on_their_own_beside_a_mechanism() -> None:
    springs, rubs = part("joint_stiffness_error", [0]), part("joint_hysteresis", [1])
    far = Sizes(np.zeros(2), np.array([12e-5, 1e-5]), 0.0)
    near = Sizes(np.zeros(2), np.array([3e-5, 1e-5]), 0.0)
    assert _on_its_own((springs, rubs), far, 0, 1)
    assert not _on_its_own((springs, rubs), near, 0, 1)
    assert not _on_its_own((part("joint_yield", [0]), rubs), far, 0, 1)
    curves = [part("joint_nonlinear_stiffness", [1], kinds=k) for k in (("line", 0.5), ("even",))]
    assert [_on_its_own((springs, curve), far, 0, 1) for curve in curves] == [False, True]


@pytest.mark.parametrize("second", ["contact_seating", "joint_nonlinear_stiffness"])
def test_where_most_of_the_way_is_left_what_gives_way_is_larger_than_a_curve(second: str) -> None:
    parts = part(second, [0]), part("joint_yield", [1])
    sizes = Sizes(np.array([5e-7, 1e-7]), np.array([4e-7, 2e-7]), 0.0)
    for back, larger in ((0.2, 0), (0.8, 1)):
        load = np.append(np.linspace(0, 80, 9), 0.0)
        moved = np.append(1e-5 * load[:-1], (1 - back) * 8e-4)
        bench = make_bench(bench_data(load, moved, step=np.arange(10)))
        found = _ranking_sizes(small_engine_of(bench), parts, sizes, 0)
        assert found.argmax() == 1 - larger


@pytest.mark.parametrize(("times_s", "same"), [((0.1, 0.3), True), ((1.0, 3.0), False)])
def test_what_creeps_as_soon_as_a_channel_lags_is_the_lag(
    times_s: tuple[float, ...], same: bool
) -> None:
    engine = small_engine_of(small_bench())
    creep = part("joint_creep", [0], times_s=np.array(times_s))
    lag = part("time_lag", [1], lag_s=0.1)
    assert _same_element(engine, creep, lag) is same
    assert _same_element(engine, lag, creep) is same
    arm = replace_bench(engine, replace(engine.bench, data=replace(engine.bench.data, arm=True)))
    assert not _same_element(arm, creep, lag)


def test_springs_are_part_of_what_is_damaged_on_a_bench() -> None:
    """As of every other law there: but jerks have no line."""
    engine = small_engine_of(small_bench())
    spring = part("joint_stiffness_error", [0])
    arm = replace_bench(engine, replace(engine.bench, data=replace(engine.bench.data, arm=True)))
    for word, same in ((DAMAGE, True), (SOFTENING, True), (WANDERS, True), (JERKS, False)):
        assert _same_element(engine, spring, part(word, [1])) is same
        assert not _same_element(arm, spring, part(word, [1]))


def test_what_a_part_is_needed_for_is_what_the_others_can_not_do() -> None:
    """Coefficients with a standard normal prior, fitted anew without each."""
    engine = small_engine(small_bench())
    parts = part("joint_creep", [0]), part("joint_yield", [1])
    gram, moment = engine.square((0, 1))[1], engine.levels[1].moment[[0, 1]]
    both = 0.5 * moment @ np.linalg.solve(np.eye(2) + gram, moment)
    alone = 0.5 * moment**2 / (1 + np.diag(gram))
    assert needed(engine, parts, 1) == pytest.approx(both - alone[::-1])


@pytest.mark.parametrize(
    ("imposed", "one_rate", "larger"), [(True, False, 1), (False, False, 0), (False, True, 1)]
)
def test_of_creep_and_friction_in_an_imposed_stroke_the_needed_one_is_larger(
    monkeypatch: pytest.MonkeyPatch, imposed: bool, one_rate: bool, larger: int
) -> None:
    """Each brings a mean stiffness, which the spring takes over; at one rate the friction is, from
    which creep differs in details only."""
    monkeypatch.setattr(LoadHistory, "one_rate", one_rate)
    engine = small_engine_of(small_bench())
    engine = replace_bench(engine, replace(engine.bench, imposed=imposed))
    monkeypatch.setattr(explanation, "needed", lambda *_: np.array([36.0, 250.0]))
    parts = part("joint_creep", [0]), part("joint_yield", [1])
    sizes = Sizes(np.array([5e-7, 1e-7]), np.array([8e-6, 5e-4]), 0.0)
    found = _ranking_sizes(engine, parts, sizes, 0)
    assert found.argmax() == larger
    assert sorted(found) == sorted(sizes.gap)


@pytest.mark.parametrize("late", ["joint_creep", "time_lag"])
def test_in_loops_at_one_rate_what_rubs_is_larger_than_what_comes_late(
    monkeypatch: pytest.MonkeyPatch, late: str
) -> None:
    engine = small_engine_of(small_bench())
    parts = part(late, [0]), part("joint_hysteresis", [1])
    sizes = Sizes(np.array([5e-7, 2e-7]), np.array([8e-6, 8e-6]), 0.0)
    for one_rate, larger in ((True, 1), (False, 0)):
        monkeypatch.setattr(LoadHistory, "one_rate", one_rate)
        assert _ranking_sizes(engine, parts, sizes, 0).argmax() == larger


def test_a_trace_of_friction_beside_a_lag_is_not_what_leads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(LoadHistory, "one_rate", True)
    engine = small_engine_of(small_bench())
    parts = part("time_lag", [0]), part("joint_yield", [1])
    for share, larger in ((0.1, 0), (0.3, 1)):
        sizes = Sizes(np.array([5e-7, share * 5e-7]), np.array([8e-6, 8e-6]), 0.0)
        assert _ranking_sizes(engine, parts, sizes, 0).argmax() == larger
