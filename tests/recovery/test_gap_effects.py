"""The diagnosis on measurements made here, by formulas of their own: one effect each."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.arm import tool_offset
from identification.gap.answer.result import GapResult
from identification.gap.diagnose import diagnose_gap
from identification.gap.effects import EFFECTS, library
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from identification.gap.search.overshoots import overshoots_of_best
from identification.gap.words import WORDS
from rig.diagnosis.diagnose import Diagnosis, diagnose
from rig.diagnosis.gap_data import gap_data
from rig.diagnosis.gap_model import write_model
from rig.errors import InputError
from rig.models.robot import load_robot
from rig.tables import import_table
from tests.conformance.gap_designs import linear
from tests.recovery.one_effect import (
    META,
    STIFFNESS,
    Law,
    Q,
    Sample,
    bends,
    creep_at_once,
    creeps,
    drifts,
    hardens,
    jumps,
    lags,
    measure,
    nothing,
    ripples,
    seats,
    slips,
    wanders,
    yields,
)
from tests.slow import slow_ones

CASES: dict[str, tuple[Law, str]] = {
    "none": (nothing, "none"),
    "yield": (yields, "joint_yield"),
    "creep": (creeps, "joint_creep"),
    "harden": (hardens, "joint_nonlinear_stiffness"),
    "drift": (drifts, "thermal_drift"),
    "jump": (jumps, "zero_shift"),
    "seat": (seats, "contact_seating"),
    "slip": (slips, "base_slip"),
    "ripple": (ripples, "unknown"),
    "lag": (lags, "time_lag"),
    "wander": (wanders, "thermal_drift"),
    "bend": (bends, "displacement_scale"),
}


@cache  # and no fixture of all of them: tests of this file run in several processes
def diagnosis_of(name: str) -> Diagnosis:
    with tempfile.TemporaryDirectory() as folder:
        return diagnose(measure(Path(folder), CASES[name][0]))


def result_of(name: str) -> GapResult:
    return diagnosis_of(name).result


@pytest.mark.parametrize("name", slow_ones(CASES, ("ripple", "slip", "wander")))
def test_verdict(name: str) -> None:
    assert result_of(name).verdict == CASES[name][1]


def test_where_yield_sits() -> None:
    found = result_of("yield")
    assert found.where.directions == ("y",)
    assert found.where.joints == (1,)
    assert found.where.seen_by_encoders is True
    assert result_of("slip").where.seen_by_encoders is False


def test_threshold_of_the_yield() -> None:
    threshold = result_of("yield").effects[0].parameters["threshold"]
    assert threshold.unit == "Nm"
    assert threshold.value == pytest.approx(45.0, rel=0.05)


def test_onset_where_a_direction_reaches_the_threshold() -> None:
    tip = load_robot("ur10e").jacobian(np.array(Q["P1"]), tool_offset(np.array([0, 0, 0.1])))
    found = result_of("yield").effects[0].parameters
    assert found["onset_y"].value == pytest.approx(45.0 / abs(tip[1, 0]), rel=0.05)
    assert "onset_x" not in found  # never so much on joint 1


def test_what_the_law_of_a_yield_misses_is_no_hand_that_went_too_far() -> None:
    found = result_of("yield").found
    best, bench = found.explanations[0], found.engine.bench
    assert best.eta > 0
    assert best.words == {"joint_yield"}  # which remembers
    assert len(bench.rows.edges) > 50  # enough to be looked at
    assert overshoots_of_best(found) is None


def test_creep_fraction_and_time() -> None:
    parameters = result_of("creep").effects[0].parameters
    assert parameters["creep_fraction"].value == pytest.approx(0.2, rel=0.25)
    assert parameters["retardation_time"].low < 20.0 < parameters["retardation_time"].high


def yields_far(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
    """As `yields`, thirty times as far, and sooner the more often it did: millimetres, as an arm
    that is held by its controller."""
    joints, flowed = np.zeros_like(torque), 0.0
    for i, s in enumerate(samples):
        if i and samples[i - 1].direction != s.direction:
            flowed = 0.0
        sooner = 1 + 0.004 * (s.repetition - 2)
        flowed = max(flowed, max(abs(torque[i, 0]) - 45.0 / sooner, 0.0) * 30 / STIFFNESS[0])
        joints[i, 0] = np.sign(lever[i, 0]) * flowed
    return joints, np.zeros(len(samples))


@pytest.mark.slow
def test_what_a_model_has_is_no_gap_of_the_next_measurement(tmp_path: Path) -> None:
    """Nor what such a law leaves of millimetres; what is new beside it is found."""
    first, second, third = (tmp_path / n for n in ("first", "second", "third"))
    for folder in (first, second, third):
        folder.mkdir()
    measured = measure(first, yields_far)
    found = diagnose(measured)
    assert found.result.verdict == "joint_yield"
    model = tmp_path / "model.yaml"
    write_model(found, measured, model)

    def later(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
        joints, more = yields_far(samples, 1.01 * torque, lever)
        return 0.97 * joints, more

    def jumped(samples: list[Sample], torque: np.ndarray, lever: np.ndarray) -> Any:
        return later(samples, torque, lever)[0], 10 * jumps(samples, torque, lever)[1]

    again = diagnose(measure(second, later, seed=1), model=model)
    assert again.result.verdict == "none"
    assert any("no law is met better than that" in n for n in again.result.notes)
    assert diagnose(measure(third, jumped, seed=2), model=model).result.verdict == "zero_shift"


@pytest.mark.slow
@pytest.mark.parametrize("drop", [("q",), pytest.param((), marks=pytest.mark.slow)])
def test_two_joints_that_creep_are_told_without_their_readings(
    tmp_path: Path, drop: tuple[str, ...]
) -> None:
    """What goes on in each direction by an amount and a time of its own is no other trouble."""
    found = diagnose(measure(tmp_path, creep_at_once, drop=drop)).result
    assert found.verdict == "joint_creep"
    assert [e.name for e in found.effects[:2]] == ["joint_creep"] * 2
    assert found.looks_like is None
    assert found.after < 1.2 * found.noise


def test_a_gain_that_bends_is_read_as_its_straight_line() -> None:
    factor = result_of("bend").effects[0].parameters["factor"]
    assert factor.value == pytest.approx(1 - 0.1 * (1 + 0.75 * 0.08), abs=0.004)


def test_named_effect_leaves_the_noise_and_beats_others_on_withheld_data() -> None:
    for name in ("yield", "creep", "drift", "seat"):
        r = result_of(name)
        assert r.after < 1.3 * r.noise, name
        assert all(r.held_out[0].after < other for other in r.runners_up.values()), name


def test_without_readings_and_unloading_yield_and_slip_are_not_told_apart(tmp_path: Path) -> None:
    found = diagnose(measure(tmp_path, yields, drop=("q", "unloading"))).result
    main = found.effects[0]
    assert {main.name, *main.indistinguishable_from} >= {"joint_yield", "base_slip"}
    assert found.next_measurement is not None
    assert "joint positions" in found.next_measurement.text


def test_deleted_word_leaves_unknown(tmp_path: Path) -> None:
    found = diagnose(measure(tmp_path, lags), withhold=["time_lag"]).result
    assert found.probabilities["time_lag"] == 0.0
    assert found.verdict == "unknown"


@pytest.mark.slow
@pytest.mark.parametrize("word", ["joint_hysteresis", "load_misalignment"])
def test_an_effect_that_is_added_takes_no_other_s_place(tmp_path: Path, word: str) -> None:
    """Nor is more left with it: the search may like the word alone better than both, for fewer."""
    with_it = diagnose(measure(tmp_path, yields), add=[word]).result
    plain = result_of("yield")
    assert set(with_it.names) >= {*plain.names, word}
    assert with_it.after < 1.01 * plain.after
    assert with_it.without_added == pytest.approx(plain.after, rel=1e-3)
    assert plain.without_added is None


def test_two_words_may_be_added_to_nothing() -> None:
    found = diagnose_gap(linear("rich"), add=["joint_creep", "zero_shift"])
    assert found.verdict == "none"
    assert set(found.names) == {"joint_creep", "zero_shift"}
    assert found.without_added is not None


def test_unknown_word_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'"magic" is no effect\. Known: '):
        diagnose(measure(tmp_path, nothing), withhold=["magic"])


@pytest.mark.parametrize("word", WORDS)
def test_null_is_exactly_nothing_and_columns_are_finite(tmp_path: Path, word: str) -> None:
    """Coefficient zero switches an effect off; every column is finite and none is all zero."""
    data = gap_data(measure(tmp_path, nothing, ("P1", "P2")))
    bench = make_bench(data)
    variants = EFFECTS[word].variants(bench)
    assert variants
    assert {v.word for v in variants} == {word}
    columns = np.column_stack(bench.columns)
    assert np.isfinite(columns).all()
    assert np.all(columns @ np.zeros(columns.shape[1]) == 0.0)
    base = base_columns(bench)
    assert np.all(np.isfinite(base.columns))
    assert np.all(np.isfinite(prediction(bench)))


def test_an_arm_tells_a_gain_that_bends_and_springs_off_beside_one_joint(tmp_path: Path) -> None:
    """A bench does not: there both are a curve of its one spring."""
    from tests.unit.test_gap_operators import bench_data

    arm = make_bench(gap_data(measure(tmp_path, nothing, ("P1", "P2"))))
    for word in ("force_scale", "displacement_scale"):
        straight, bent, *_ = library(arm, [word])
        assert (straight.label, bent.label) == ("gain", "gain that bends")
        full, excess = (arm.columns[i] for i in (straight.columns[0], bent.columns[1]))
        top = int(np.abs(full[: arm.rows.n]).argmax())
        share = np.abs(excess[top] / full[top])
        assert 0.8 < share <= 1.0  # at full range all of it, in the middle half
        assert np.all(np.abs(excess[: arm.rows.n]) <= np.abs(full[: arm.rows.n]) + 1e-12)
    rest = {v.label: v.info["joints"] for v in library(arm, ["joint_stiffness_error"])}
    assert 1 not in rest["all joints but 2"]
    assert set(rest["all joints but 2"]) | {1} == set(rest["all joints"])
    force = np.linspace(-100, 100, 300)
    bench = make_bench(bench_data(force, force * 1e-5, step=np.full(300, -1)))
    labels = {v.label for v in library(bench, ["force_scale", "displacement_scale"])}
    assert labels == {"gain"}


def test_json_is_plain_and_complete() -> None:
    import json

    out = diagnosis_of("seat").to_json()
    assert json.loads(json.dumps(out, allow_nan=False)) == out
    assert out["schema"] == "rig.diagnosis/1"
    assert sum(out["probabilities"].values()) == pytest.approx(1.0)
    assert set(out["gap"]) >= {"noise_rms_mm", "before_rms_mm", "after_rms_mm", "shrink_factor"}
    assert out["gap"]["held_out"]["fold"] == "repetition"


def test_text_says_the_answer_first() -> None:
    text = diagnosis_of("seat").to_text()
    assert text.startswith("contact_seating (")
    assert "withheld repetition" in text
    assert diagnose_gap.__doc__


def test_very_many_samples_of_friction_on_a_bench() -> None:
    """A stop of 60 N in series with nothing else: friction and share come back."""
    from tests.unit.test_gap_operators import bench_data

    n, rng = 60_000, np.random.default_rng(0)
    t = np.arange(n) * 1e3 / n
    force = 1000 * np.sin(2 * np.pi * t / 50)
    state, path = 0.0, []
    for f in force.tolist():
        state = min(f + 60, max(f - 60, state))
        path.append(state)
    u = np.array(path) * 1e-5 + rng.normal(0, 1e-6, n)
    data = bench_data(
        force + rng.normal(0, 0.1, n), u, time=t, step=np.full(n, -1), branch=np.full(n, 3)
    )
    found = diagnose_gap(data)
    assert found.verdict == "joint_hysteresis"
    friction, share = (
        found.effects[0].parameters[p] for p in ("friction", "share_through_friction")
    )
    assert friction.value == pytest.approx(60.0, rel=0.05)
    # strengths that never slip here and the spring itself are one to these data
    assert share.value == pytest.approx(1.0, abs=0.05)
    assert share.high - share.low < 0.1


@pytest.mark.slow
def test_renamed_poses_and_permuted_directions_change_nothing(tmp_path: Path) -> None:
    dataset = measure(tmp_path, seats)
    text = (tmp_path / "samples.csv").read_text().replace(",P1,", ",Q7,")
    meta = (tmp_path / "meta.yaml").read_text().replace("P1:", "Q7:")
    (tmp_path / "samples.csv").write_text(text)
    (tmp_path / "meta.yaml").write_text(meta)
    renamed = diagnose(import_table(tmp_path / "samples.csv", tmp_path / "meta.yaml"))
    assert dataset.rows == renamed.result.bench.rows.weight.sum()
    assert renamed.result.probabilities == result_of("seat").probabilities


THIN = "direction,repetition,branch,step,force_N,displacement_mm\n"


@pytest.mark.parametrize(
    "rows",
    [
        ["x,1,loading,1,10,0.1"],
        ["x,1,zero,0,0,0", "x,1,loading,1,10,0.1"],
        ["x,1,zero,0,0,0"] * 30,
        ["x,1,loading,1,50,0.5"] * 30,
        [f"x,1,loading,{s},{20 * s},{0.2 * s}" for s in range(1, 11)],
    ],
    ids=["one sample", "two", "all zero", "constant", "one a step"],
)
def test_thin_data_are_diagnosed_without_false_confidence(tmp_path: Path, rows: list[str]) -> None:
    (tmp_path / "samples.csv").write_text(THIN + "\n".join(rows) + "\n")
    meta = META.format(**Q).replace(f"  P2: {{q_rad: {Q['P2']}, tcp_xyz_mm: [0, 0, 100]}}\n", "")
    (tmp_path / "meta.yaml").write_text(meta)
    found = diagnose(import_table(tmp_path / "samples.csv", tmp_path / "meta.yaml"))
    named = {w: p for w, p in found.result.probabilities.items() if w not in ("none", "unknown")}
    assert max(named.values()) < 0.6
    assert found.to_text()
    assert found.result.notes
