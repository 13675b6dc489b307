"""Effects in absolute units: on the bench they come from, they are what the library made of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.answer.equivalent_places import equivalent_place
from identification.gap.answer.forms import Form, describe, law_of, lawful, realise, rows_of
from identification.gap.answer.known import NotKnown, knowing
from identification.gap.answer.notes import notes_of
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.effects.joint_hysteresis import REACHES
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.laws.knees_closer import refined
from identification.gap.laws.law import HUNG, KEPT, Law, Term
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.pool import Pool
from identification.gap.words import NEED_ARM, WORDS
from tests.unit.test_gap_operators import bench_data


def arm_data(seed: int = 0, stretch: float = 1.0, directions: str = "xy") -> GapData:
    """Two poses, x and y, twice loaded and unloaded; readings, force across, temperatures.
    stretch: all loads and times that much larger."""
    from rig.diagnosis.gap_data import arm_setup
    from rig.models.robot import load_robot

    arm, rng = load_robot("ur10e"), np.random.default_rng(seed)
    poses = {
        "P1": [0.256, -1.664, -1.684, -1.365, 1.571, -1.336],
        "P2": [0.554, -1.480, -1.948, -1.284, 1.371, -1.036],
    }
    setups = tuple(
        arm_setup(arm, name, np.array(q), np.array([0, 0, 0.1]), d, n)
        for name, q in poses.items()
        for d, n in zip("xyz", np.eye(3), strict=True)
        if d in directions
    )
    rows, clock = [], 0.0
    for s in range(len(setups)):
        for repetition in (1, 2):
            clock, start = clock + 60, clock + 60
            steps = [(0, 0), (1, 1), (1, 2), (1, 3), (1, 4), (2, 3), (2, 2), (2, 1), (0, 0)]
            for branch, step in steps:
                clock += 7
                for _ in range(4):
                    clock += 1
                    rows.append((clock - start, clock, s, repetition, branch, step))
    time, session, setup, repetition, branch, step = np.array(rows).T
    n, whole = len(rows), np.int64
    force = (40.0 * step + rng.normal(0, 0.02, n)) * stretch
    run = (2 * setup + repetition - 1).astype(whole)
    return GapData(
        arm=True,
        setups=setups,
        time=time * stretch,
        session=session * stretch,
        run=run,
        setup=setup.astype(whole),
        repetition=repetition.astype(whole),
        branch=branch.astype(whole),
        step=step.astype(whole),
        force=force,
        displacement=1.1e-5 * force + rng.normal(0, 1e-6, n),
        compliance=1 / arm.joint_stiffness,
        compliance_relative_sd=np.full(6, 0.1),
        tangential=rng.normal(0, 0.1, (n, 2)),
        instruments=replace(bench_data(force, force).instruments),
        q=rng.normal(0, 1e-5, (n, 6)),
        temperature=26 + np.outer(session / session.max(), np.arange(1, 7)),
    )


@pytest.fixture(scope="module")
def bench() -> Bench:
    return make_bench(arm_data())


def test_an_arms_friction_takes_off_its_spring_or_comes_on_top(bench: Bench) -> None:
    """Of every law: what is held back, and what slips, are together the line of the spring."""
    found = [v for v in library(bench, ["joint_hysteresis"]) if v.info["joint"] == 0]
    for law in ("Dahl", "Bouc-Wen"):
        held = [v for v in found if v.info["law"] == law]
        slips = [v for v in found if v.info["law"] == f"{law} that slips"]
        assert len(held) == len(slips) > 2
        for a, b in zip(held, slips, strict=True):
            assert (a.prior, a.info["memory"]) == (b.prior, b.info["memory"])
            assert a.prior == pytest.approx(0.25 / 2 / (len(REACHES) - 1))  # half of it each
            for one, other in zip(a.columns, b.columns, strict=True):
                both = bench.columns[other] - bench.columns[one]
                line = bench.joint_column(0, bench.elastic[:, 0])
                np.testing.assert_allclose(both, line, atol=1e-9 * np.abs(line).max())


def bench_without_arm(imposed: str | None = None) -> Bench:
    t = np.arange(240.0)
    force = 100 * np.sin(t / 15) * np.minimum(1, t / 100)
    data = bench_data(
        force,
        1.05e-5 * force,
        time=t,
        session=t,
        step=np.full(240, -1),
        branch=np.full(240, 3),
        run=np.repeat([0, 1, 2], 80).astype(np.int64),
        repetition=np.repeat([1, 2, 3], 80).astype(np.int64),
        imposed=imposed,
    )
    return make_bench(data)


def pulled(imposed: str) -> Bench:
    """Pulled from one side in three cycles, each further, from slack and beyond what it yields."""
    t = np.arange(240.0)
    way = np.abs(np.sin(t / 25)) * (1 + np.floor(t / 78.5))
    force = 100 * np.minimum(np.maximum(way - 0.3, 0.0), 1.5) + 2.0
    data = bench_data(
        force,
        1e-3 * way,
        time=t,
        session=t,
        step=np.full(240, -1),
        branch=np.full(240, 3),
        imposed=imposed,
    )
    return make_bench(data)


def assert_same(bench: Bench, words: tuple[str, ...]) -> int:
    """Every variant of the words, with coefficients of one, against its law; how many."""
    variants = library(bench, words)
    for v in list(variants):
        if v.word in ("joint_yield", "base_slip") and v.label.endswith("sharp") and v.prior > 0:
            variants += refined(bench, v)[::17]
            break
    pool = np.column_stack(bench.columns)
    for v in variants:
        law, scale = law_of(bench, v)
        made = rows_of(bench, v.word, law) * scale
        wanted = pool[:, list(v.columns)]
        size = np.abs(wanted).max(axis=0) + 1e-300
        assert np.abs((made - wanted) / size).max() < 1e-9, v.label
    return len(variants)


@pytest.mark.parametrize("word", WORDS)
def test_every_shape_of_the_library_is_its_law_on_an_arm(bench: Bench, word: str) -> None:
    assert assert_same(replace(bench, columns=Pool()), (word,)) > 0


def test_memory_may_end_where_the_rig_is_turned_to_another_direction(bench: Bench) -> None:
    """Two directions in each of two poses: four setups, of which two are in a new pose."""
    assert (bench.moved.sum(), bench.rebuilt.sum()) == (2, 4)
    for word in ("joint_yield", "base_slip", "joint_hysteresis"):
        there = replace(bench, columns=Pool())
        labels = [v.label for v in library(there, [word])]
        assert any("set up anew" in label for label in labels), word
    one = make_bench(arm_data(directions="x"))
    assert not any("set up anew" in v.label for v in library(one, ["joint_yield"]))


def test_segments_run_two_ways_where_that_makes_a_difference(bench: Bench) -> None:
    there = replace(bench, columns=Pool())
    named = [v.label for v in library(there, ["link_flexibility"])]
    assert sum("joint to joint" in name for name in named) == len(named) / 2 == 3
    flat = tuple(replace(s, links=s.links[[1, 1]]) for s in bench.data.setups)
    same = make_bench(replace(bench.data, setups=flat))
    assert len(library(same, ["link_flexibility"])) == 3


def test_slow_flow_with_the_square_of_the_overstress_is_for_arms(bench: Bench) -> None:
    """A single spring under a load that stands creeps so."""
    loose = replace(bench_data(30 * np.repeat(np.arange(9.0), 4), np.zeros(36)), timed=True)
    for there, squared in ((replace(bench, columns=Pool()), True), (make_bench(loose), False)):
        knee = next(v for v in library(there, ["joint_yield"]) if v.label.endswith("sharp"))
        assert any("flow" in v.label for v in refined(there, knee))
        assert any("squared" in v.label for v in refined(there, knee)) == squared


@pytest.mark.parametrize("imposed", [None, "displacement"])
def test_every_shape_of_the_library_is_its_law_on_a_bench(imposed: str | None) -> None:
    assert assert_same(bench_without_arm(imposed), WORDS) > 100


@pytest.mark.parametrize("imposed", ["force", "displacement"])
def test_shapes_of_a_bench_that_is_pulled_are_their_laws(imposed: str) -> None:
    bench = pulled(imposed)
    assert assert_same(bench, tuple(w for w in WORDS if w not in NEED_ARM)) > 0
    labels = {v.label.split(" ")[0] for v in library(bench, ["contact_seating"])}
    assert ("toe" in labels) == (imposed == "displacement")
    assert "slack" in labels
    assert any("hardened" in v.label for v in library(bench, ["joint_yield"]))


# Alike but for their place in the file: of a window, half is a delay and half a filter.
_ALIKE = ("time_lag",)


@pytest.mark.parametrize("word", [w for w in WORDS if w not in _ALIKE])
def test_terms_in_another_order_have_the_same_columns(bench: Bench, word: str) -> None:
    """A file is edited by hand, and its coefficients stand beside their terms."""
    there = replace(bench, columns=Pool())
    laws = {}
    for v in library(there, [word]):
        law, _ = law_of(there, v)
        laws[(tuple(law.constants), tuple(tuple(t.shape) for t in law.terms))] = law
    assert laws
    for law in laws.values():
        back = replace(law, terms=law.terms[::-1])
        np.testing.assert_array_equal(
            rows_of(there, word, back), rows_of(there, word, law)[:, ::-1], err_msg=str(law)
        )


@pytest.mark.parametrize(
    ("word", "constants", "key"),
    [
        ("joint_yield", {"memory": KEPT, "flow_time": 0.0}, "threshold"),
        ("joint_hysteresis", {"memory": KEPT, "law": "Iwan"}, "strength"),
        ("joint_hysteresis", {"memory": KEPT, "law": "Dahl"}, "reach"),
    ],
)
def test_a_spring_of_its_own_may_stand_first(
    bench: Bench, word: str, constants: dict[str, object], key: str
) -> None:
    terms = (Term("compliance"), Term("compliance", {key: 5.0}), Term("compliance", {key: 30.0}))
    law = Law({"joint": 0, **constants}, terms)
    made = rows_of(bench, word, law)
    for i, term in enumerate(terms):
        alone = rows_of(bench, word, replace(law, terms=(term,)))
        np.testing.assert_array_equal(made[:, i], alone[:, 0])


def one(word: str, law: Law, *values: float) -> Form:
    return Form(word, law, np.array(values), np.zeros((len(values),) * 2))


def test_a_threshold_stays_where_it_was_when_the_loads_are_others() -> None:
    """40 Nm at joint 1 are 40 Nm on any path: closed form of the first loading."""
    terms = (Term("compliance", {"threshold": 40.0}),)
    form = one("joint_yield", Law({"joint": 0, "memory": "kept", "flow_time": 0.0}, terms), 3e-5)
    for stretch in (0.5, 1.0, 2.0):
        bench = make_bench(arm_data(stretch=stretch))
        first = (bench.rows.setup == 1) & (bench.rows.repetition == 1)
        first &= (
            np.cumsum(bench.rows.branch == 2)
            == np.cumsum(bench.rows.branch == 2)[int(np.argmax(first))]
        )
        torque, lever = bench.torque[first, 0], bench.lever[first, 0]
        beyond = np.sign(torque) * np.maximum(np.abs(torque) - 40.0, 0.0)
        made = realise(bench, form)[: bench.rows.n][first]
        np.testing.assert_allclose(made, lever * 3e-5 * beyond, atol=1e-12)
    assert np.abs(made).max() > 1e-4  # the largest loads go far beyond the threshold


def test_a_time_constant_is_seconds_on_any_clock() -> None:
    law = Law(
        {"path": "exponential", "quantity": "displacement"},
        (Term("drift", {"time_constant": 500.0, "along": (0.0, 1.0, 0.0)}),),
    )
    for stretch in (1.0, 3.0):
        bench = make_bench(arm_data(stretch=stretch))
        made = realise(bench, one("thermal_drift", law, 4e-5))[: bench.rows.n]
        t = bench.rows.session - bench.rows.session.min()
        along_y = np.isin(bench.rows.setup, (1, 3))
        np.testing.assert_allclose(made, np.where(along_y, 4e-5 * (1 - np.exp(-t / 500)), 0))


def test_a_drift_counts_the_other_way_against_its_direction(bench: Bench) -> None:
    terms = tuple(Term("drift_rate", {"along": (0.0, s, 0.0)}) for s in (1.0, -1.0))
    here, against = (
        realise(bench, one("thermal_drift", Law({"path": "linear"}, (t,)), 1e-8)) for t in terms
    )
    assert np.abs(here).max() > 0
    np.testing.assert_allclose(here, -against)


def test_what_belongs_to_a_session_is_left_behind(bench: Bench) -> None:
    terms = (
        Term("width"),
        Term("rub"),
        Term("place", {"pose": "P1", "direction": "x", "first": True}),
    )
    law = Law({"joint": 0, "zone": 2.0, "crossing": "load", "kind": "free"}, terms)
    form = Form("joint_backlash", law, np.array([1e-4, 0.0, 5e-5]), np.diag([1.0, 2.0, 3.0]))
    kept = lawful(form)
    assert [t.coefficient for t in kept.law.terms] == ["width", "rub"]
    assert kept.covariance.tolist() == [[1.0, 0.0], [0.0, 2.0]]
    assert np.abs(realise(bench, form) - realise(bench, kept)).max() > 0
    shift = one("zero_shift", Law({}, (Term("shift", {"run": 1, "lasts": True}),)), 1e-5)
    assert not realise(bench, lawful(shift)).any()


def test_a_fitted_part_becomes_its_contribution(bench: Bench) -> None:
    fresh = replace(bench, columns=Pool())
    v = library(fresh, ("joint_creep",))[3]
    w = np.linspace(0.1, 0.3, len(v.columns))
    form = describe(fresh, Part(v, 1.0), w, np.diag(w**2))
    pool = np.column_stack(fresh.columns)
    np.testing.assert_allclose(realise(fresh, form), pool[:, list(v.columns)] @ w, atol=1e-15)
    relative = np.sqrt(np.diag(form.covariance)) / form.values
    np.testing.assert_allclose(relative, 1.0)  # a standard deviation scales with its value


def test_a_variant_that_says_too_little_is_named(bench: Bench) -> None:
    v = library(replace(bench, columns=Pool()), ("contact_seating",))[0]
    with pytest.raises(ValueError, match=r"contact_seating, exponential .*: the library does not"):
        law_of(bench, replace(v, info={}))


YIELD = one(
    "joint_yield",
    Law(
        {"joint": 0, "memory": "kept", "flow_time": 0.0}, (Term("compliance", {"threshold": 30.0}),)
    ),
    3e-5,
)
DRIFT = one(
    "force_drift", Law({"path": "linear", "quantity": "force"}, (Term("drift_rate"),)), 1e-3
)


@pytest.mark.parametrize("known", [YIELD, DRIFT], ids=["yield", "drift"])
def test_a_known_effect_is_predicted_in_every_channel(known: Form) -> None:
    """From where the laser was zeroed; what is not known of it is a tenth of its size, and the
    loads at which it happens."""
    there = make_bench(arm_data())
    total, n = realise(there, known), there.rows.n
    for s in range(4):  # the laser is zeroed anew in every setup
        mine = np.flatnonzero(there.rows.setup == s)
        total[mine] -= total[mine[0]]
    knows = knowing(there, [known])
    assert np.abs(total[:n]).max() > 1e-6
    np.testing.assert_allclose(prediction(knows) - prediction(there), total, atol=1e-15)
    base = base_columns(knows)
    size, *load = (base.columns[:, i] for i in base.index("known"))
    np.testing.assert_allclose(size, 0.1 * total, atol=1e-15)
    assert len(load) == (known is YIELD)  # a drift happens at any load
    if load:  # 3 % more load does as much more over a threshold of as much less
        both = [
            by * realise(there, replace(known, law=_at_less(known.law, by))) for by in (0.97, 1.03)
        ]
        moved = (both[1] - both[0]) / 2
        for s in range(4):
            mine = np.flatnonzero(there.rows.setup == s)
            moved[mine] -= moved[mine[0]]
        np.testing.assert_allclose(load[0], moved, atol=1e-12)


@pytest.mark.parametrize("memory", ["kept", "kept across poses"])
def test_whether_what_yielded_stays_from_pose_to_pose_these_data_tell(memory: str) -> None:
    """A model that was made in one pose has it gone in the next one."""
    there = make_bench(arm_data())

    def yields(remembers: str) -> Form:
        law = replace(YIELD.law, constants={**YIELD.law.constants, "memory": remembers})
        return replace(YIELD, law=law)

    measured = replace(there, observed=there.observed + realise(there, yields(memory)))
    knows = knowing(measured, [yields("kept")])
    assert knows.known is not None
    assert knows.known.across is (memory != "kept")
    told = [n.text for n in notes_of(knows, "none") if "from pose to pose" in n.text]
    assert bool(told) is knows.known.across
    lost = knowing(measured, [yields("lost between runs")])  # says so itself
    assert lost.known is not None
    assert not lost.known.across


def test_a_play_that_jumps_is_not_known_to_several_of_itself() -> None:
    """By a load that is a little off it jumps at another reading, by no more than it is large."""
    there = make_bench(arm_data())
    for v in [v for v in library(there, ("joint_backlash",)) if v.info["kind"] == "jumps"]:
        play = describe(
            there, Part(v, 1.0), np.eye(len(v.columns))[0] * 1e-4, np.zeros((len(v.columns),) * 2)
        )
        knows = knowing(there, [lawful(play)])
        assert knows.known is not None
        size, load = np.linalg.norm(knows.known.free, axis=0)
        assert load <= 1.001 * size / 0.1


def _at_less(law: Law, by: float) -> Law:
    return Law(
        law.constants,
        tuple(
            Term(t.coefficient, {k: v / by if k == "threshold" else v for k, v in t.shape.items()})
            for t in law.terms
        ),
    )


def test_nothing_is_known_as_a_displacement_where_that_is_imposed() -> None:
    there = make_bench(replace(arm_data(), imposed="displacement", step=arm_data().step - 99))
    with pytest.raises(NotKnown, match="displacement is imposed"):
        knowing(there, [YIELD])
    assert knowing(there, []) is there


@pytest.mark.parametrize("readings", [True, False])
def test_yield_of_joint_1_and_slip_about_the_vertical_are_twins_without_readings(
    readings: bool,
) -> None:
    data = arm_data()
    there = make_bench(data if readings else replace(data, q=None))
    v = next(v for v in library(there, ("joint_yield",)) if v.label.startswith("joint 1 at 0.6 sh"))
    own_columns = [there.columns[c] for c in v.columns]
    there = replace(there, columns=Pool())
    part = Part(replace(v, columns=tuple(there.add(c) for c in own_columns)), 1.0)
    target = there.observed - prediction(there)
    engine = Engine(there, base_columns(there), target, np.array([0.0, 1e-6]))
    w = np.full(len(v.columns), 4.0)
    twin = equivalent_place(engine, part, w, 0.0)
    if readings:
        assert twin is None
        return
    assert twin is not None
    assert (twin.word, twin.constants["axis"]) == ("base_slip", "z")
    own = engine.columns(range(len(w))) @ w
    form = describe(there, part, w, np.eye(len(w)))
    np.testing.assert_allclose(realise(there, twin.form(form)), own, atol=1e-9 * np.abs(own).max())


def test_a_knee_under_weight_may_be_tried_in_the_mounting(bench: Bench) -> None:
    """As a twin: the mounting's moment is counted without the arm's weight."""
    hung, kept = (
        Law(
            {"axis": "z", "depth": 0.0, "memory": memory, "flow_time": 0.0},
            (Term("compliance", {"threshold": 30.0}),),
        )
        for memory in (HUNG, KEPT)
    )
    assert np.array_equal(rows_of(bench, "base_slip", hung), rows_of(bench, "base_slip", kept))
