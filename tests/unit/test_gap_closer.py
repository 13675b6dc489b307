"""Closer looks at what grids meet badly: the reach of bristles, flow times."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import nnls

from identification.arrays import Array
from identification.gap.answer.forms import law_of, rows_of
from identification.gap.effects import EFFECTS, joint_backlash, joint_hysteresis, library
from identification.gap.evidence.compare import by_word, closest, score
from identification.gap.evidence.engine import Engine
from identification.gap.laws import knees_closer
from identification.gap.laws.closer import RefinementTarget, closing_in
from identification.gap.laws.friction_forms import REACHES, SATURATES
from identification.gap.laws.friction_law import EXPONENTIAL, SLIPPING, parameters
from identification.gap.laws.interval import NOMINAL, Coefficients
from identification.gap.model.base import base_columns
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant, variant
from identification.gap.search.refine import refine
from tests.unit.test_gap_forms import arm_data, bench_without_arm
from tests.unit.test_gap_model import survive


def assert_lawful(bench: Bench, variants: list[Variant]) -> None:
    for v in variants:
        law, unit = law_of(bench, v)
        made = rows_of(bench, v.word, law) * unit
        for column, place in zip(made.T, v.columns, strict=True):
            wanted = bench.columns[place]
            assert np.abs(column - wanted).max() <= 1e-9 * np.abs(wanted).max(), v.label


@pytest.mark.parametrize("memory", ["", "worked in", "under weight", "rested"])
def test_reaches_of_bristles_close_in(memory: str) -> None:
    """Same joint, law's family and memory; neighbours nearer than on the grid, about what was."""
    bench = make_bench(arm_data())
    grid = [v for v in library(bench, ["joint_hysteresis"]) if v.info["memory"] == memory]
    found = next(v for v in grid if v.info["law"] == "Dahl")
    finer = joint_hysteresis.closer(bench, found)
    assert {v.info["law"] for v in finer} == {*EXPONENTIAL, *SLIPPING}
    assert {(v.info["joint"], v.info["memory"]) for v in finer} == {(found.info["joint"], memory)}
    low, high = (float(r) for r in found.info["radius"])
    assert min(v.info["radius"][0] for v in finer) == pytest.approx(0.9 * low)
    assert max(v.info["radius"][1] for v in finer) == pytest.approx(1.1 * high)
    steps = [v.info["radius"][1] / v.info["radius"][0] for v in finer]
    assert max(steps) < 0.7 * REACHES[1] / REACHES[0]
    assert len({v.label for v in finer} | {v.label for v in grid}) == len(finer) + len(grid)
    assert_lawful(bench, finer)


def test_spectra_have_no_reach_and_a_specimen_keeps_its_other_springs() -> None:
    bench = make_bench(arm_data())
    spectrum = next(v for v in library(bench, ["joint_hysteresis"]) if v.info["law"] == "Iwan")
    assert joint_hysteresis.closer(bench, spectrum) == []
    plain = bench_without_arm()
    grid = library(plain, ["joint_hysteresis"])
    for law in ("Dahl", "Dahl by load"):
        found = next(v for v in grid if v.info["law"] == law)
        finer = joint_hysteresis.closer(plain, found)
        assert sum(v.label.endswith("other springs") for v in finer) == len(finer) / 2
        same = [v.info["radius"] for v in finer if v.info["law"] == law]
        assert min(r[0] for r in same) == pytest.approx(0.9 * found.info["radius"][0])
        assert max(r[1] for r in same) == pytest.approx(1.1 * found.info["radius"][1])


def test_a_specimens_spectrum_has_strengths_between_the_strengths() -> None:
    bench = bench_without_arm()
    grid = library(bench, ["joint_hysteresis"])
    spectrum = next(v for v in grid if v.label == "joint 1 spectrum")
    finer = joint_hysteresis.closer(bench, spectrum)
    assert [v.label for v in finer] == [
        "joint 1 spectrum fine",
        "joint 1 spectrum fine, other springs",
    ]
    before, after = (v.info["radius"] for v in (spectrum, finer[0]))
    assert set(before) < set(after)
    assert len(after) == 2 * len(before) - 2  # between what never slips and the rest there is none
    assert_lawful(bench, finer)


def test_friction_may_outlast_the_way_to_another_pose() -> None:
    """A knee may: what does not is no reason to call all friction that does a yield."""
    bench = make_bench(arm_data())
    lost = next(
        v for v in library(bench, ["joint_hysteresis"]) if v.label == "joint 1 spectrum that slips"
    )
    lasting = joint_hysteresis.outlasting(bench, lost)
    kept = lasting[1]
    assert kept.label == "joint 1 lasting spectrum that slips"
    assert kept.info["memory"] == "lasting"
    before, after = (bench.columns[v.columns[4]][: bench.rows.n] for v in (lost, kept))
    moved = np.flatnonzero(bench.moved)
    first = slice(0, moved[1])
    np.testing.assert_array_equal(after[first], before[first])
    assert before[moved[1]] == 0  # without load
    assert abs(after[moved[1]]) > 0.03 * np.abs(before).max()
    assert_lawful(bench, lasting)
    assert joint_hysteresis.outlasting(bench_without_arm(), lost) == []


@pytest.mark.parametrize("key", ["grows_to", "grows_with_push_to"])
@pytest.mark.parametrize("memory", ["", "worked in", "under weight", "rested"])
def test_friction_may_grow_with_what_the_gear_carries(memory: str, key: str) -> None:
    """Half as strong where half the torque is carried: push and weights together, or the push
    alone where a spring carries the weights."""
    bench = make_bench(arm_data())
    grid = library(bench, ["joint_hysteresis"])
    found = next(v for v in grid if v.info["memory"] == memory and v.info["joint"] == 1)
    finer = [v for v in joint_hysteresis.further(bench, found) if key in v.info]
    assert {v.info["law"] for v in finer} == {*EXPONENTIAL, *SLIPPING}
    assert_lawful(bench, finer)
    net = np.abs(bench.true_torque[:, 1] + (key == "grows_to") * bench.weight(1))
    n = bench.rows.n
    for v in finer:
        assert (v.info["joint"], v.info["memory"]) == (1, memory)
        own = bench.joint_column(1, bench.elastic[:, 1])[:n] * (v.info["law"] in SLIPPING)
        each = [bench.columns[c][:n] - own for c in v.columns]
        for same, grows in (each[:2], each[2:]):
            size = 1e-12 * np.abs(same).max()
            np.testing.assert_allclose(grows, same * net / net.max(), atol=size)
    assert joint_hysteresis.further(bench_without_arm(), found) == []


@pytest.mark.parametrize("reach", [0.015, 0.03, 0.3])
def test_friction_that_grows_sticks_over_short_reaches_as_over_long_ones(reach: float) -> None:
    """As bearings do: of the joint's range of torque."""
    bench = make_bench(arm_data())
    grid = library(bench, ["joint_hysteresis"])
    found = next(v for v in grid if v.info["joint"] == 1)
    torque, net = bench.true_torque[:, 1], bench.true_torque[:, 1] + bench.weight(1)
    span = bench.reach_of(torque)
    held = bench.path(torque).bristles(np.array([reach * span]), True)[:, 0] * np.abs(net)
    rows = slice(0, bench.rows.n)
    truth = bench.joint_column(1, -held)[rows]
    misses = [
        nnls(np.array([bench.columns[c][rows] for c in v.columns]).T, bench.sense * truth)[1]
        for v in joint_hysteresis.further(bench, found)
        if "grows_to" in v.info
    ]
    assert min(misses) < 0.05 * np.linalg.norm(truth)


def test_of_a_joint_without_weight_all_that_it_carries_is_the_push() -> None:
    bench = make_bench(arm_data())
    found = next(v for v in library(bench, ["joint_hysteresis"]) if v.info["joint"] == 0)
    assert not bench.feels_weight(0)
    finer = joint_hysteresis.further(bench, found)
    assert any("grows_to" in v.info for v in finer)
    assert not any("grows_with_push_to" in v.info for v in finer)


def test_friction_that_grows_is_looked_at_where_a_joint_rubs() -> None:
    bench = make_bench(arm_data())
    grid = library(bench, ["joint_hysteresis"])
    truth = joint_hysteresis.further(bench, next(v for v in grid if v.info["joint"] == 1))[2]
    engine = engine_with(bench, bench.columns[truth.columns[1]])
    finer = refine(engine, score(engine, engine.levels, grid))
    assert any("grows_to" in v.info and v.info["joint"] == 1 for v in finer)


@pytest.mark.parametrize("memory", ["", "worked in", "rested"])
def test_loops_may_close_towards_large_loads(memory: str) -> None:
    """Each element follows what comes through of the load, to within its strength."""
    bench = make_bench(arm_data())
    grid = library(bench, ["joint_hysteresis"])
    found = next(v for v in grid if v.info["memory"] == memory and v.info["joint"] == 1)
    finer = [v for v in joint_hysteresis.further(bench, found) if "saturates" in v.info]
    assert len({v.label for v in finer}) == len(SATURATES)
    assert_lawful(bench, finer)
    survive(bench, finer)
    n, torque = bench.rows.n, bench.true_torque[:, 1]
    unit = bench.joint_column(1, bench.elastic[:, 1])[:n] / torque
    for v, share in zip(finer, SATURATES, strict=True):
        most = share * float(np.abs(torque).max())
        for column, radius in zip(v.columns, v.info["radius"], strict=True):
            through = bench.columns[column][:n] / unit
            assert float(np.abs(through).max()) > 0
            off = np.abs(through - most * np.tanh(torque / most))
            assert float(off.max()) <= 1.001 * float(radius)


def test_loops_close_about_no_load_and_where_it_comes_back() -> None:
    bench = make_bench(arm_data())
    grid = library(bench, ["joint_hysteresis"])
    hung = next(v for v in grid if joint_hysteresis.hangs(v))
    assert not any("saturates" in v.info for v in joint_hysteresis.further(bench, hung))


def test_what_never_slips_is_no_friction_of_a_load_that_saturates() -> None:
    """The strengths are those of what comes through: one that is as large as that does nothing."""
    bench = make_bench(arm_data())
    grid = library(bench, ["joint_hysteresis"])
    found = next(v for v in grid if v.info["joint"] == 1 and v.info["memory"] == "")
    for v in joint_hysteresis.further(bench, found):
        if "saturates" not in v.info:
            continue
        through = float(v.info["saturates"]) * np.tanh(
            float(np.abs(bench.torque[:, 1]).max()) / float(v.info["saturates"])
        )
        for w, r in zip(np.eye(len(v.columns)), v.info["radius"], strict=True):
            found = parameters(bench, v, Coefficients(w, 1e-6 * np.eye(len(w)), NOMINAL))
            slips = min((1 - float(r) / through) / 0.2, 1.0)
            assert found["share_through_friction"].value == pytest.approx(slips / (1 + slips))


def test_creep_may_be_forgotten_where_the_rig_is_set_up_anew() -> None:
    """A setup then creeps as if it had been the first; else it still comes back from the last."""
    bench = make_bench(arm_data())
    found = {v.label: v for v in library(bench, ["joint_creep"])}
    kept, fresh = found["joint 2 spectrum"], found["joint 2 set up anew spectrum"]
    starts = np.flatnonzero(bench.rebuilt)[1:]
    assert starts.size

    def slow(v: Variant) -> Array:
        return bench.columns[v.columns[len(v.columns) - 2]][: bench.rows.n]

    left = np.abs(slow(kept)[starts]).min()
    assert left > 0
    assert left > 100 * np.abs(slow(fresh)[starts]).max()
    first = slice(0, starts[0])
    np.testing.assert_array_equal(slow(fresh)[first], slow(kept)[first])
    assert_lawful(bench, [kept, fresh])


def test_flow_times_close_in_between_those_of_the_grid() -> None:
    bench = make_bench(arm_data())
    sharp = next(v for v in library(bench, ["joint_yield"]) if v.info["knee"] == "sharp")
    first = knees_closer.refined(bench, sharp)
    slow = next(v for v in first if v.info["flow_s"] == 5.0 and not v.info["square"])
    finer = knees_closer.refined(bench, slow, knees_closer.CLOSE[0])
    times = sorted({v.info["flow_s"] for v in finer})
    assert times == pytest.approx([5 / 2**0.5, 5 / 2**0.25, 5 * 2**0.25, 5 * 2**0.5])
    assert not any(v.info["square"] for v in finer)
    centres = [v.info["centre"] / slow.info["centre"] for v in finer]
    assert (min(centres), max(centres)) == pytest.approx((1 - 0.4 * 0.16, 1 + 0.4 * 0.2))
    assert_lawful(bench, finer[::7])
    sudden = next(v for v in first if v.info["flow_s"] == 0)
    assert knees_closer.refined(bench, sudden, knees_closer.CLOSE[0]) == []


def engine_with(bench: Bench, effect: Array) -> Engine:
    """Nothing but an effect of half a millimetre at the most, and the noise that is stated."""
    rng = np.random.default_rng(4)
    target = 5e-4 * effect / np.abs(effect[: bench.rows.n]).max()
    target[: bench.rows.n] += rng.normal(0, 1e-6, bench.rows.n)
    return Engine(bench, base_columns(bench), target, np.array([0.0, 1e-6, 4e-6, 2e-5]))


def test_what_stands_out_is_looked_at_closer() -> None:
    """A reach, and a flow time, between those of the grids."""
    bench = make_bench(arm_data())
    dahl = next(v for v in library(bench, ["joint_hysteresis"]) if v.info["law"] == "Dahl")
    truth = next(v for v in joint_hysteresis.closer(bench, dahl) if v.info["law"] == "Dahl")
    engine = engine_with(bench, bench.columns[truth.columns[1]])
    singles = score(engine, engine.levels, library(bench, ["joint_hysteresis"]))
    assert any(v.label.endswith("fine") for v in refine(engine, singles))

    sharp = next(v for v in library(bench, ["joint_yield"]) if v.info["knee"] == "sharp")
    slow = next(v for v in knees_closer.refined(bench, sharp) if v.info["flow_s"] == 5.0)
    truth = knees_closer.refined(bench, slow, knees_closer.CLOSE[0])[0]
    engine = engine_with(bench, bench.columns[truth.columns[0]])
    singles = score(engine, engine.levels, library(bench, ["joint_yield"]))
    times = {v.info["flow_s"] for v in refine(engine, singles)}
    assert times - {0.0, *knees_closer.FLOWS_S, *knees_closer.SQUARE_S}


@pytest.mark.parametrize("word", ["joint_yield", "time_lag", "joint_backlash"])
def test_what_shows_nothing_is_not_looked_at_closely(word: str) -> None:
    """A curve leads; another word that explains half as much alone, and nothing beside it. Plays
    are looked at once, wherever they are."""
    bench = make_bench(arm_data())
    words = ["joint_nonlinear_stiffness", word]
    variants = library(bench, words)
    curve = next(v for v in variants if v.word == words[0] and v.info["joint"] == 1)
    engine = engine_with(bench, bench.columns[curve.columns[0]])
    singles = score(engine, engine.levels, variants)
    first = max(s.log_evidence for s in singles if s.variant.word == words[0])
    none = max(lv.log_base for lv in engine.levels)

    def told(share: float, beside: float) -> int:
        """Closer shapes of the word where it brings so much."""
        alone = [
            s._replace(
                log_evidence=none + share * (first - none)
                if s.variant.word == word
                else s.log_evidence
            )
            for s in singles
        ]
        mine = [s for s in alone if s.variant.word == word][:1]
        families = {w: [s for s in alone if s.variant.word == w] for w in words}
        lead = closest(families[words[0]]).log_evidence
        beside_it = [s._replace(log_evidence=lead + beside) for s in mine]
        finer = EFFECTS[word].finer
        assert finer is not None
        return len(
            finer(RefinementTarget(engine, families, [words[0], word], families[word], beside_it))
        )

    few, many = told(0.5, 1.0), told(0.5, 20.0)
    assert few == 0 if word != "joint_backlash" else few < many
    assert many > 0
    assert told(0.9, 1.0) > few


@pytest.mark.parametrize(("beside", "closely"), [(1.0, False), (20.0, True)])
def test_plays_are_closed_in_on_only_where_one_shows(
    beside: float, closely: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[tuple[float, ...]] = []

    def spy(_: object, __: object, ___: object, closer: tuple[float, ...]) -> list[Variant]:
        looked.append(closer)
        return []

    monkeypatch.setattr(joint_backlash, "closing_in", spy)
    bench = make_bench(arm_data())
    variants = library(bench, ["joint_nonlinear_stiffness", "joint_backlash"])
    curve = next(v for v in variants if v.word != "joint_backlash" and v.info["joint"] == 1)
    engine = engine_with(bench, bench.columns[curve.columns[0]])
    families = by_word(score(engine, engine.levels, variants))
    lead = closest(families["joint_nonlinear_stiffness"]).log_evidence
    mine = families["joint_backlash"][0]
    none = max(lv.log_base for lv in engine.levels)
    alone = [mine._replace(log_evidence=none)]
    families["joint_backlash"] = alone
    seen = [mine._replace(log_evidence=lead + beside)]
    assert joint_backlash.EFFECT.finer is not None
    joint_backlash.EFFECT.finer(RefinementTarget(engine, families, list(families), alone, seen))
    assert looked[0] == (joint_backlash.CLOSE if closely else joint_backlash.CLOSE[:1])


def test_looks_move_on_until_the_best_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps of 1, then halves, then tenths, towards what lies 3.2 away; the last looks are kept."""
    looked: list[float] = []

    def refined(_: object, found: Variant, close: float = 1.0) -> list[Variant]:
        at = float(found.info["at"])
        return [replace(found, info={"at": at + k * close}) for k in (-1, 0, 1)]

    def scored(_: object, family: list[Variant]) -> list[SimpleNamespace]:
        looked.append(len(family))
        return [
            SimpleNamespace(variant=v, log_evidence=-((float(v.info["at"]) - 3.2) ** 2))
            for v in family
        ]

    monkeypatch.setattr("identification.gap.laws.closer.scored", scored)
    word = SimpleNamespace(
        engine=SimpleNamespace(extend=lambda: None, bench=None), families={}, ranked=[]
    )
    start = SimpleNamespace(variant=variant("joint_backlash", "start", [0], (1.0,), at=0.0))
    finer = closing_in(word, refined, [start], (0.5, 0.1))  # type: ignore[arg-type, list-item]
    best = min((float(v.info["at"]) for v in finer), key=lambda at: abs(at - 3.2))
    assert best == pytest.approx(3.2, abs=0.15)
    assert len(finer) == 3 * 3  # one look a share, wherever it ended
    assert len(looked) < 9
