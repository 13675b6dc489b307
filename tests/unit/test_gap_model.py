"""Effects in model files: written as they are, read back, refused where they are none, predicted
along a procedure's path."""

from __future__ import annotations

import json
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from identification.gap.answer.forms import Form, describe, realise
from identification.gap.effects import joint_backlash, library
from identification.gap.evidence.parts import Part
from identification.gap.laws import lost_motion
from identification.gap.laws.law import Law, Term
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.pool import Pool
from identification.gap.model.variants import Variant
from identification.gap.words import WORDS
from rig.diagnosis.gap_forms import FormError, effects_of, from_entry, to_entry
from rig.diagnosis.gap_model import _comment
from rig.diagnosis.gap_path import planned_data
from rig.errors import InputError
from rig.models.model import load_model
from rig.models.robot import MODELS
from rig.models.simulate import Simulation, simulate
from rig.protocol import load_protocol
from tests.unit.shown_results import explained
from tests.unit.test_gap_forms import arm_data, pulled

PROTOCOLS = Path(__file__).parents[2] / "protocols"
F1 = (MODELS / "F1.yaml").read_text()
YIELD: dict[str, Any] = {
    "name": "joint_yield",
    "joint": 1,
    "memory": "kept",
    "flow_time_s": 0,
    "terms": [{"threshold_Nm": 40.0, "compliance_rad_per_Nm": 1e-4}],
}
RUBS: dict[str, Any] = {
    "name": "joint_hysteresis",
    "joint": 1,
    "law": "Iwan",
    "memory": "kept",
    "terms": [{"friction_Nm": 3.0, "compliance_rad_per_Nm": 1e-6}],
}


@pytest.fixture(scope="module")
def bench() -> Bench:
    return make_bench(arm_data(directions="xyz"))


def model(tmp: Path, *effects: dict[str, Any]) -> Path:
    path = tmp / "model.yaml"
    path.write_text(F1.replace("effects: []", f"effects: {json.dumps(list(effects))}"))
    return path


def procedure(tmp: Path, text: str = "loading-unloading", **changes: str) -> Path:
    """Small: y only, up and down, twice."""
    source = (PROTOCOLS / "paper_xy.yaml").read_text()
    lines = [x for x in source.splitlines() if "direction: x" not in x]
    out = "\n".join(lines).replace("branches: loading ", f"branches: {text} ")
    out = out.replace("repetitions: 3", "repetitions: 2")
    for old, new in changes.items():
        out = out.replace(old, new)
    (tmp / "p.yaml").write_text(out)
    return tmp / "p.yaml"


@pytest.mark.parametrize("word", WORDS)
def test_every_shape_of_the_library_survives_the_file(bench: Bench, word: str) -> None:
    assert_survives(bench, word)


def test_shapes_of_a_bench_that_is_pulled_survive_the_file() -> None:
    for word in ("contact_seating", "joint_yield", "joint_creep"):
        assert_survives(pulled("displacement"), word)


def test_plays_whose_one_end_is_softer_survive_the_file(bench: Bench) -> None:
    """They are looked for beside a play that was found only."""
    fresh = replace(bench, columns=Pool())
    found = next(v for v in library(fresh, ("joint_backlash",)) if v.info["kind"] == "soft")
    finer = joint_backlash.uneven(fresh, found)
    assert {v.info["kind"] for v in finer} == set(lost_motion.UNEVEN)
    survive(fresh, {v.info["kind"]: v for v in finer}.values())


def assert_survives(bench: Bench, word: str) -> None:
    fresh = replace(bench, columns=Pool())
    variants = library(fresh, (word,))
    # one of every kind
    kinds = {end: v for v in variants for end in (v.label.split()[0], v.label.split()[-1])}
    survive(fresh, kinds.values())


def survive(fresh: Bench, variants: Iterable[Variant]) -> None:
    """What shapes do, written to a file and read again."""
    for v in variants:
        w = 0.01 * np.arange(1.0, len(v.columns) + 1)
        form = describe(fresh, Part(v, 1.0), w, np.diag(w**2))
        entry = json.loads(json.dumps(to_entry(form, {"name": v.word})))
        back = from_entry(entry)
        np.testing.assert_allclose(
            realise(fresh, back), realise(fresh, form), rtol=1e-9, atol=1e-18
        )
        np.testing.assert_allclose(back.covariance, form.covariance, rtol=1e-9, atol=1e-30)


def test_a_file_says_units_and_counts_joints_from_one() -> None:
    law = Law(
        {"joint": 0, "memory": "kept", "flow_time": 0.0}, (Term("compliance", {"threshold": 56.0}),)
    )
    entry = to_entry(
        Form("joint_yield", law, np.array([3e-4]), np.array([[1e-10]])), {"name": "joint_yield"}
    )
    assert entry == {
        "name": "joint_yield",
        "joint": 1,
        "memory": "kept",
        "flow_time_s": 0.0,
        "terms": [{"threshold_Nm": 56.0, "compliance_rad_per_Nm": 3e-4, "sd": 1e-5}],
    }
    seat = Law({}, (Term("depth", {"law": "exponential", "force_scale": 8.0}),))
    entry = to_entry(Form("contact_seating", seat, np.array([4e-5]), np.array([[1e-12]])), {})
    assert entry["terms"][0]["depth_mm"] == pytest.approx(0.04)
    assert entry["terms"][0]["sd"] == pytest.approx(1e-3)


BAD: list[tuple[dict[str, Any], tuple[str | int, ...], str]] = [
    ({"name": "joint_yeild"}, ("name",), 'Did you mean "joint_yield"?'),
    ({"joint": 7}, ("joint",), "7 is not allowed; allowed: whole numbers, 1 to 6."),
    ({"joint": 1.5}, ("joint",), "1.5 is not allowed; allowed: whole numbers, 1 to 6."),
    ({"memory": "short"}, ("memory",), "'short' is not allowed; allowed: kept, kept across poses"),
    ({"flow_time_s": "slow"}, ("flow_time_s",), "'slow' is not allowed; allowed: a number"),
    ({"flow_time": 0}, ("flow_time",), 'the key "flow_time" is not known here.'),
    ({"terms": []}, ("terms",), "wants a list of terms."),
    ({"terms": [3]}, ("terms", 0), "a term is a mapping"),
    (
        {"terms": [{"threshold_Nm": 3}]},
        ("terms", 0),
        "has the keys threshold_Nm; wanted: (threshold_Nm, compliance_rad_per_Nm)",
    ),
    (
        {"terms": [{"threshold_Nm": -3, "compliance_rad_per_Nm": 1e-4}]},
        ("terms", 0, "threshold_Nm"),
        "-3 is not allowed; allowed: above 0.",
    ),
    (
        {"terms": [{"threshold_Nm": float("nan"), "compliance_rad_per_Nm": 1e-4}]},
        ("terms", 0, "threshold_Nm"),
        "nan is not allowed",
    ),
    ({"covariance": [[1, 2]]}, ("covariance",), "wants 1 rows of 1 numbers"),
]


@pytest.mark.parametrize(("change", "place", "what"), BAD)
def test_what_is_no_effect_is_told_with_its_place(
    change: dict[str, Any], place: tuple[str | int, ...], what: str
) -> None:
    with pytest.raises(FormError) as caught:
        from_entry(YIELD | change)
    assert caught.value.path == place
    assert what in str(caught.value)


@pytest.mark.parametrize("missing", ["joint", "memory", "flow_time_s", "terms"])
def test_a_missing_key_is_named(missing: str) -> None:
    with pytest.raises(FormError, match=missing if missing != "terms" else "list of terms"):
        from_entry({k: v for k, v in YIELD.items() if k != missing})


def test_terms_go_with_the_law_of_their_effect() -> None:
    drift = {
        "name": "force_drift",
        "path": "linear",
        "quantity": "force",
        "terms": [{"time_constant_s": 3, "drift_N": 1}],
    }
    with pytest.raises(FormError, match=r"wanted: \(drift_N_per_s\)"):
        from_entry(drift)
    with pytest.raises(FormError, match=r"wanted: \(reach_Nm, compliance_rad_per_Nm\)"):
        from_entry({**RUBS, "law": "Dahl"})


def test_all_problems_of_a_file_come_at_once(tmp_path: Path) -> None:
    path = model(tmp_path, YIELD | {"joint": 9}, {"name": "joint_jelly"})
    with pytest.raises(InputError) as caught:
        effects_of(load_model(path))
    lines = str(caught.value).splitlines()
    assert len(lines) == 2
    assert all(line.startswith(f"{path}:") for line in lines)
    assert "effects[0].joint: 9 is not allowed" in lines[0]


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-10, 10),
    st.floats(),
    st.text(max_size=5),
    st.lists(st.integers(-3, 3), max_size=6),
    st.dictionaries(st.text(max_size=3), st.integers()),
)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(word=st.sampled_from(WORDS), pick=st.integers(0, 10**6), junk=JUNK, deep=st.booleans())
def test_damaged_entries_are_refused_or_work(word: str, pick: int, junk: Any, deep: bool) -> None:
    """One value of a good entry replaced by anything: a message, or an effect that can be used."""
    entry = deepcopy(entry_of(word))
    target: Any = entry["terms"][pick % len(entry["terms"])] if deep else entry
    target[sorted(target)[pick % len(target)]] = junk
    try:
        read = from_entry(entry)
        made = realise(small_bench(), read)
    except FormError as error:
        assert len(str(error)) > 10  # noqa: PT017
    except ValueError as error:
        assert "segment" in str(error)  # noqa: PT017
    else:
        assert np.isfinite(made).all()


@cache
def small_bench() -> Bench:
    return make_bench(arm_data())


@cache
def entry_of(word: str) -> dict[str, Any]:
    """A good one."""
    fresh = replace(small_bench(), columns=Pool())
    v = library(fresh, (word,))[0]
    form = describe(fresh, Part(v, 1.0), np.full(len(v.columns), 0.01), np.eye(len(v.columns)))
    return to_entry(form, {"name": word})


# --- prediction ----------------------------------------------------------------------------------


def levels(
    found: Simulation, branch: str, repetition: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force N, displacement and that of the springs alone, m, of one branch."""
    (curve,) = found.curves
    assert curve.path is not None
    mine = [
        i
        for i in range(len(curve.force))
        if curve.path.branch[i] == branch and curve.path.repetition[i] == repetition
    ]
    return curve.force[mine], curve.displacement[mine], curve.path.springs[mine]


def test_yield_along_a_path_is_its_closed_form(tmp_path: Path) -> None:
    """Loading: springs and what goes beyond the threshold. Unloading: that stays, until it has
    come back by twice the threshold, which it does not here. The next run begins there."""
    found = simulate(model(tmp_path, YIELD), procedure(tmp_path))
    assert found.effects == ("joint_yield",)
    lever = 0.75  # m, of joint 1 for y in the pose of the protocol
    top = 82 * lever - 40
    for repetition, before in ((1, 0.0), (2, top)):
        force, moved, springs = levels(found, "loading", repetition)
        beyond = np.maximum(np.maximum(force * lever - 40, 0.0), before)
        np.testing.assert_allclose(moved - springs, 1e-4 * lever * beyond, rtol=1e-3, atol=1e-8)
    force, moved, springs = levels(found, "unloading", 1)
    np.testing.assert_allclose(moved - springs, 1e-4 * lever * top, rtol=1e-3)
    np.testing.assert_allclose(force[0], 78.0)
    _, after, _ = levels(found, "zero", 1)
    assert after[0] == 0.0
    assert after[1] == pytest.approx(1e-4 * lever * top, rel=1e-3)
    assert "hold all" not in found.to_text()


def test_a_yield_may_be_one_of_the_torques_beside_another_effect(tmp_path: Path) -> None:
    """With the tool elsewhere joint 1 has another lever, by which it yields and moves the target;
    and is seen up to another torque."""
    offset_mm = {"x": 60.0, "y": -50.0, "z": 80.0}
    about = [mm / 1e3 for mm in offset_mm.values()]
    pose = {
        "name": "pose_error",
        "about_offset_m": about,
        "about_angles_rad": [0.0] * 6,
        "about_turn_rad": [0.0] * 3,
        "terms": [{"axis": a, "offset_mm": mm} for a, mm in offset_mm.items()],
    }
    answers = {**YIELD, "answers_to_the_other_effects": True}
    path = procedure(tmp_path)
    with_yield, other = (simulate(model(tmp_path, e, pose), path) for e in (answers, YIELD))
    plain = simulate(model(tmp_path, pose), path)
    read = load_model(tmp_path / "model.yaml")
    (setup,) = planned_data(read, load_protocol(path)).setups
    lever = float(setup.lever[0] + setup.offset_lever[0] @ np.array(about))
    assert abs(lever - setup.lever[0]) > 0.03
    force, moved, _ = levels(with_yield, "loading", 1)
    wanted = 1e-4 * lever * np.maximum(force * lever - 40, 0.0)
    assert wanted.max() > 1e-4
    np.testing.assert_allclose(moved - levels(plain, "loading", 1)[1], wanted, rtol=1e-3, atol=1e-8)
    assert np.abs(levels(other, "loading", 1)[1] - moved).max() > 0.02 * wanted.max()
    curve = {
        "name": "joint_nonlinear_stiffness",
        "joint": 1,
        "measured_to_Nm": 1.01 * abs(lever) * 82,
        "answers_to_the_other_effects": True,
        "terms": [{"beyond_Nm": 5.0, "compliance_rad_per_Nm": 1e-6}],
    }
    assert abs(lever) > abs(setup.lever[0])  # else it would go beyond in neither
    assert "goes on as it ended" not in simulate(model(tmp_path, curve, pose), path).to_text()
    short = {**curve, "measured_to_Nm": 1.02 * abs(float(setup.lever[0])) * 82}
    assert "goes on as it ended" in simulate(model(tmp_path, short, pose), path).to_text()


def test_the_text_says_that_repetitions_are_left_out(tmp_path: Path) -> None:
    path = procedure(tmp_path)
    path.write_text(path.read_text().replace("repetitions: 2", "repetitions: 3"))
    text = simulate(model(tmp_path, YIELD), path).to_text()
    assert "  The first and the last repetition; --csv and --json hold all.\n  repetition" in text


def test_creep_needs_the_time_that_the_procedure_gives_it(tmp_path: Path) -> None:
    creep = {
        "name": "joint_creep",
        "joint": 1,
        "terms": [{"retardation_time_s": 30, "compliance_rad_per_Nm": 1e-5}],
    }
    short = simulate(model(tmp_path, creep), procedure(tmp_path))
    long = simulate(model(tmp_path, creep), procedure(tmp_path, **{"hold_s: 0": "hold_s: 120"}))
    extra = []
    for found in (short, long):
        force, moved, springs = levels(found, "loading", 1)
        extra.append(float((moved - springs)[-1] / (1e-5 * 0.75**2 * force[-1])))
    assert 0.1 < extra[0] < 0.95
    assert extra[0] < extra[1] - 0.02
    assert extra[1] == pytest.approx(1.0, abs=0.03)  # nearly all of it has come


def test_a_gain_acts_on_everything_else(tmp_path: Path) -> None:
    """Fitted as a share of what is shown: 0.2 of it too much is a gain of 1.25."""
    gain = {"name": "displacement_scale", "terms": [{"excess_share_of_reading": 0.2}]}
    both = simulate(model(tmp_path, gain, YIELD), procedure(tmp_path))
    alone = simulate(model(tmp_path, YIELD), procedure(tmp_path))
    for branch in ("loading", "unloading", "zero"):
        with_gain, without = levels(both, branch, 2)[1], levels(alone, branch, 2)[1]
        np.testing.assert_allclose(with_gain, 1.25 * without, rtol=1e-9)


def test_a_gain_that_bends_follows_the_reading(tmp_path: Path) -> None:
    """Above a range it grows from there on; with the reading, from the first micrometre."""
    range_mm, excess = 0.5, 0.1
    above = {"above_mm": range_mm, "excess_share_of_reading": excess}
    bends = {"at_mm": 2.0, "excess_share_of_reading": excess}
    laser = {"name": "displacement_scale"}
    nothing = {"excess_share_of_reading": 0.0}
    found = simulate(model(tmp_path, {**laser, "terms": [nothing, above]}), procedure(tmp_path))
    _, moved, springs = levels(found, "loading", 1)
    true, knee = springs, range_mm * 1e-3
    assert true[0] < knee < true[-1]
    beyond = knee + (true - knee) / (1 - excess)
    np.testing.assert_allclose(moved, np.where(true > knee, beyond, true), rtol=1e-9)
    found = simulate(model(tmp_path, {**laser, "terms": [nothing, bends]}), procedure(tmp_path))
    _, moved, springs = levels(found, "loading", 1)
    np.testing.assert_allclose(moved - excess * moved**2 / 2e-3, springs, rtol=1e-9)


@pytest.mark.parametrize("law", ["Iwan", "Dahl"])
def test_a_load_saturates_for_one_law_only(law: str) -> None:
    entry = {**RUBS, "law": law, "saturates_at_Nm": 20}
    with pytest.raises(FormError, match=f"goes with law Prandtl only, not with {law}"):
        from_entry(entry)
    assert from_entry({**entry, "law": "Prandtl"}).law.constants["saturates"] == 20.0


def test_what_wears_its_hole_hangs_under_no_weight() -> None:
    slackens = {"slackens_beyond_Nm": 3.0, "compliance_rad_per_Nm": 1e-6}
    entry = {**RUBS, "memory": "under weight", "terms": [slackens]}
    with pytest.raises(FormError, match=r"wanted: \(friction_Nm, compliance_rad_per_Nm\) or "):
        from_entry(entry)
    assert from_entry({**entry, "memory": "kept"}).law.terms[0].shape == {"slackens": 3.0}


def test_what_cannot_be_foretold_is_left_out_and_said(tmp_path: Path) -> None:
    shift = {"name": "zero_shift", "terms": [{"run": 2, "lasts": True, "shift_mm": 0.03}]}
    warm = {
        "name": "thermal_drift",
        "path": "exponential",
        "quantity": "displacement",
        "terms": [{"along": [1, 0, 0], "time_constant_s": 900, "drift_mm": 0.05}],
    }
    bend = {
        "name": "joint_nonlinear_stiffness",
        "joint": 1,
        "measured_to_Nm": 20,
        "terms": [{"compliance_rad_per_Nm3": 1e-10}],
    }
    askew = {
        "name": "load_misalignment",
        "terms": [{"along": [1, 0, 0], "across": [0, 1, 0], "tangent": 0.01}],
    }
    found = simulate(model(tmp_path, shift, warm, bend, askew), procedure(tmp_path))
    assert found.effects == ("joint_nonlinear_stiffness", "load_misalignment")
    notes = " ".join(found.notes)
    assert "zero_shift: jumps of the datum belongs to the measured session; left out." in notes
    assert "thermal_drift: how it drifted with time and temperature belongs to the mea" in notes
    assert "load_misalignment: not measured along y; left out there." in notes
    assert "seen to 20 Nm at joint 1, here up to 61.5 Nm" in notes
    for repetition in (1, 2):
        force, moved, springs = levels(found, "loading", repetition)
        bent = 1e-10 * 0.75 * (0.75 * force) ** 3
        np.testing.assert_allclose(moved - springs, bent, rtol=1e-3, atol=1e-9)


def test_a_load_that_was_askew_in_one_pose_is_so_in_that_pose(tmp_path: Path) -> None:
    def askew(pose: str) -> dict[str, object]:
        term = {"along": [0, 1, 0], "across": [1, 0, 0], "tangent": 0.05, "pose": pose}
        return {"name": "load_misalignment", "terms": [term]}

    there, elsewhere = (
        simulate(model(tmp_path, askew(pose)), procedure(tmp_path)) for pose in ("P1", "P7")
    )
    _, moved, springs = levels(there, "loading", 1)
    assert np.abs(moved - springs).max() > 1e-6
    assert not any("not measured" in note for note in there.notes)
    _, moved, springs = levels(elsewhere, "loading", 1)
    np.testing.assert_array_equal(moved, springs)
    assert any("not measured along y in P1; left out there" in n for n in elsewhere.notes)


def test_drifts_of_a_session_are_in_no_prediction_of_the_next(tmp_path: Path) -> None:
    """Files that were written with them are read as before; what is predicted is the arm."""
    drift = {
        "name": "force_drift",
        "path": "linear",
        "quantity": "force",
        "terms": [{"drift_N_per_s": 1e-3}],
    }
    warm = {
        "name": "thermal_drift",
        "path": "exponential",
        "quantity": "displacement",
        "terms": [{"along": [0, 1, 0], "time_constant_s": 900, "drift_mm": 0.05}],
    }
    term = {"along": [0, 1, 0], "across": [1, 0, 0], "tangent": 0.01, "run": 1}
    each = {"name": "load_misalignment", "terms": [term]}
    plain = simulate(model(tmp_path), procedure(tmp_path))
    found = simulate(model(tmp_path, drift, warm, each), procedure(tmp_path))
    assert found.effects == ()
    np.testing.assert_array_equal(found.curves[0].displacement, plain.curves[0].displacement)
    assert [n.split(":")[0] for n in found.notes if n.endswith("session; left out.")] == [
        "force_drift",
        "thermal_drift",
        "load_misalignment",
    ]
    with_arm = simulate(model(tmp_path, YIELD, drift), procedure(tmp_path))
    alone = simulate(model(tmp_path, YIELD), procedure(tmp_path))
    for mine, other in zip(with_arm.curves, alone.curves, strict=True):
        np.testing.assert_array_equal(mine.displacement, other.displacement)


def test_numbers_that_stand_in_the_springs_count_once(tmp_path: Path) -> None:
    entry = {
        "name": "joint_stiffness_error",
        "contained_in": "joint_stiffness_Nm_per_rad",
        "terms": [{"joint": 1, "compliance_rad_per_Nm": 1e-5}],
    }
    found = simulate(model(tmp_path, entry), procedure(tmp_path))
    assert found.effects == ("joint_stiffness_error",)
    assert found.curves[0].path is None
    assert found.curves[0].stiffness == pytest.approx(57.42e3, rel=1e-3)
    assert found.to_csv().splitlines()[0] == "pose,direction,force_N,displacement_mm"


def test_text_json_and_csv_of_a_path(tmp_path: Path) -> None:
    found = simulate(model(tmp_path, YIELD), procedure(tmp_path))
    out = json.loads(json.dumps(found.to_json(), allow_nan=False))
    curve = out["curves"][0]
    holds = 2 * (12 + 11 + 2)
    for key in ("force_N", "displacement_mm", "branch", "repetition", "step", "session_s"):
        assert len(curve[key]) == holds
    assert curve["branch"][:2] == ["zero", "loading"]
    assert np.all(np.diff(curve["session_s"]) > 0)
    rows = found.to_csv().splitlines()
    assert rows[0].endswith(",repetition,branch,step,session_s")
    assert len(rows) == holds + 1
    text = found.to_text()
    assert "With the effects joint_yield; k is that of the springs." in text
    assert "Springs unload along" not in text


def test_the_planned_clock_holds_rests_and_plateaus(tmp_path: Path) -> None:
    """As the plan times it: 24 s a hold (14 to come there, 5 to sample) and so on."""
    data = planned_data(load_model(MODELS / "F1.yaml"), load_protocol(procedure(tmp_path)))
    loading = (data.branch == 1) & (data.repetition == 1)
    starts = data.session[loading][::5]
    np.testing.assert_allclose(np.diff(starts), 19.0)
    first, second = (data.session[data.repetition == r] for r in (1, 2))
    assert second[0] - first[-1] == pytest.approx(10 + 4 + 2 + 1)  # rest, reset, tare, one sample
    assert data.time[data.repetition == 2][0] == pytest.approx(1.0)
    assert data.tare == "run"


def test_the_comment_of_an_effect_says_where_it_may_sit() -> None:
    both = explained().result.effects[0]
    assert "; it may sit at joint 1, joint 5; not told apart from base_slip" in _comment(both, "")
    assert "sit at" not in _comment(replace(both, places={"joint 1": 1.0}), "")


def test_loads_beyond_those_that_an_effect_was_seen_under_are_told(tmp_path: Path) -> None:
    top = max(simulate(model(tmp_path), procedure(tmp_path)).curves[0].force)
    for seen, told in ((top, False), (0.5 * top, True)):
        entry = {**YIELD, "seen_to_N": {d: float(seen) for d in "xyz"}}
        notes = simulate(model(tmp_path, entry), procedure(tmp_path)).notes
        assert any(f"joint_yield: seen up to {seen:.4g} N along" in n for n in notes) is told
    odd = simulate(model(tmp_path, {**YIELD, "seen_to_N": "far"}), procedure(tmp_path))
    assert not any("seen up to" in n for n in odd.notes)
