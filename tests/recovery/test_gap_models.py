"""From a diagnosis to a model file to a prediction, and to the next procedure."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.gap.answer.discriminate import NextMeasurement
from identification.gap.answer.forms import law_of
from identification.gap.answer.result import EffectFound, GapResult
from identification.gap.effects import EFFECTS, library
from identification.gap.evidence.parts import Part
from identification.gap.explanations.fit import Fit
from identification.gap.model.bench import make_bench
from identification.gap.model.pool import Pool
from identification.gap.model.variants import Variant
from identification.gap.words import WORDS
from rig.dataset import Dataset, write
from rig.diagnosis.diagnose import Diagnosis, diagnose
from rig.diagnosis.gap_forms import left_behind
from rig.diagnosis.gap_model import (
    OF_THIS_SESSION,
    check_writable,
    forms,
    model_text,
    springs,
    write_model,
)
from rig.diagnosis.gap_path import planned_data
from rig.diagnosis.next_protocol import next_text, write_next
from rig.errors import InputError
from rig.measured_meta import measured_meta
from rig.models.model import load_model
from rig.models.robot import MODELS
from rig.models.simulate import simulate
from rig.plan import plan
from rig.protocol import load_protocol, parse_protocol
from rig.station import load_station
from rig.worlds import make_world
from rig.worlds.direct import sample_protocol

PROTOCOLS = Path(__file__).parents[2] / "protocols"
BRANCHES = np.array(["zero", "loading", "unloading"])


def dataset_of(procedure: Any, columns: dict[str, Any], path: Path | None = None) -> Dataset:
    columns["discarded"] = np.zeros(len(columns["force_N"]), dtype=bool)
    meta = measured_meta(procedure, load_station("emulated"))
    texts = {"protocol": procedure.text, "meta": meta.model_dump_json(exclude_none=True)}
    out = Dataset(
        path=path,
        uuid="00000000-0000-0000-0000-000000000007",
        created="2026-03-01T10:00:00+01:00",
        origin="emulated",
        complete=True,
        meta=meta,
        columns=columns,
        units={},
        long_names={},
        texts=texts,
    )
    if path is not None:
        write(out, path)
    return out


def as_planned(tmp: Path) -> tuple[Path, Dataset]:
    """Two poses, up and down, twice; forces and clocks as planned, springs of F1, little noise."""
    text = (PROTOCOLS / "load_unload_hold.yaml").read_text()
    text = text.replace("repetitions: 3", "repetitions: 2").replace("hold_s: 20", "hold_s: 5")
    path = tmp / "p.yaml"
    path.write_text(text)
    procedure = load_protocol(path)
    data = planned_data(load_model(MODELS / "F1.yaml"), procedure)
    lever = np.stack([s.lever for s in data.setups])[data.setup]
    rng = np.random.default_rng(5)
    moved = np.sum(lever**2 * data.compliance, axis=1) * data.force * 1e3
    return path, dataset_of(
        procedure,
        {
            "time_s": data.time,
            "session_s": data.session,
            "pose": np.array([s.pose for s in data.setups])[data.setup],
            "direction": np.array([s.direction for s in data.setups])[data.setup],
            "repetition": data.repetition,
            "branch": BRANCHES[data.branch],
            "step": data.step,
            "force_N": data.force + 0.0,
            "displacement_mm": moved + rng.normal(0, 1e-3, len(moved)),
            **{f"temperature{j}_C": 26 + data.session / 1e3 for j in range(1, 7)},
        },
    )


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Dataset, Diagnosis]:
    path, dataset = as_planned(tmp_path_factory.mktemp("planned"))
    return path, dataset, diagnose(dataset)


def with_effect(result: GapResult, word: str, pick: int) -> tuple[GapResult, np.ndarray]:
    """The result as if one shape of the word had been found; its contribution (n,)."""
    bench = replace(result.bench, columns=Pool())
    variants = library(bench, (word,))
    if word == "time_lag":  # a lag of the force is undone from its readings; a plan has none
        variants = [v for v in variants if v.info["channel"] == "displacement"]
    v: Variant = variants[pick * (len(variants) - 1) // 4]
    columns = np.column_stack([bench.columns[c] for c in v.columns])
    top = np.abs(columns[: bench.rows.n]).max(axis=0)
    w = 1e-4 / np.where(top > 0, top, 1.0) / (1 + np.arange(len(v.columns)))
    if word in ("joint_stiffness_error", "displacement_scale", "time_lag"):
        w = 0.1 / (1 + np.arange(len(v.columns)))
    law, _ = law_of(bench, v)
    laws = EFFECTS[word].laws
    kept = np.array(
        [
            laws.lasts and t.coefficient not in laws.of_session and "run" not in t.shape
            for t in law.terms
        ]
    )
    base, b = result.fit.base, len(result.fit.base)
    fitted: Fit = replace(
        result.fit,
        parts=(Part(v, 1.0),),
        coefficients=w,
        covariance=np.diag(w**2) * 1e-4,
        joint_covariance=np.diag(np.append(np.full(b, 1e-6), w**2 * 1e-4)),
    )
    effect = EffectFound(word, v.label, 1.0, {}, {}, (), 1.0, 1e-4)
    found = replace(result, verdict=word, effects=(effect,), fit=fitted)
    changes = np.zeros(bench.layout.size)
    for name, beta in zip(result.engine.base.names, base, strict=True):
        if name.startswith("spring"):
            j = int(name.removeprefix("spring")) - 1
            changes += beta * bench.joint_column(j, bench.elastic[:, j])
    n = bench.rows.n
    plain = (bench.slope * bench.load + changes[:n]) * np.ones(n)
    return found, np.column_stack([plain, columns[:n] @ (w * kept)])


def as_read(moved: np.ndarray, fitted: Fit) -> np.ndarray:
    """(n,) m: where `read - share of read = moved` for a gain that is off, bends or changes."""
    info, w = fitted.parts[0].variant.info, fitted.coefficients
    read = moved.copy()
    for _ in range(100):
        excess = w[0] * read
        if "full" in info:
            excess = excess + w[1] * read * np.abs(read) / info["full"]
        if "above" in info:
            excess = excess + w[1] * np.sign(read) * np.maximum(np.abs(read) - info["above"], 0)
        read = moved + excess
    return np.asarray(read)


@pytest.mark.parametrize(
    "pick", [0, pytest.param(2, marks=pytest.mark.slow), pytest.param(4, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("word", WORDS)
def test_a_model_predicts_on_its_own_procedure_what_was_fitted(
    planned: tuple[Path, Dataset, Diagnosis], tmp_path: Path, word: str, pick: int
) -> None:
    """Springs and effect, hold by hold, through the file, to a hundredth of the effect; what was
    the session's own stands in the file, marked, and in no prediction."""
    procedure, dataset, diagnosis = planned
    result, parts = with_effect(diagnosis.result, word, pick)
    plain, effect = parts.T
    write_model(replace(diagnosis, result=result), dataset, tmp_path / "m.yaml")
    found = simulate(tmp_path / "m.yaml", procedure)
    assert not any("seen up to" in note for note in found.notes)  # no further than measured
    far = float(np.abs(dataset.columns["force_N"][dataset.columns["direction"] == "x"]).max())
    assert re.search(rf"seen_to_N: {{x: {far:.5g}", (tmp_path / "m.yaml").read_text())
    rows = result.bench.rows
    if not EFFECTS[word].laws.lasts:
        assert found.effects == ()
        assert left_behind(forms(result)) == (word,)
        assert f"; {OF_THIS_SESSION}\n  - name: {word}\n" in (tmp_path / "m.yaml").read_text()
        top = [np.max(plain[rows.setup == s]) for s in range(4)]
        np.testing.assert_allclose([c.displacement[-1] for c in found.curves], top, rtol=1e-3)
        return
    assert found.effects == (word,)
    assert left_behind(forms(result)) == ()
    made = np.concatenate([c.displacement for c in found.curves])
    if word == "joint_stiffness_error":
        top = [np.max(plain[rows.setup == s] + effect[rows.setup == s]) for s in range(4)]
        np.testing.assert_allclose([c.displacement[-1] for c in found.curves], top, rtol=1e-3)
        return
    wanted = plain + effect
    if word == "displacement_scale":  # acts on what is read, that it makes itself
        wanted = as_read(plain, result.fit)
    datum = np.array([wanted[int(np.argmax(rows.setup == s))] for s in range(4)])
    wanted = wanted - datum[rows.setup]
    start = np.flatnonzero(rows.hold_starts)
    total = np.add.reduceat(rows.weight, start)
    wanted = np.add.reduceat(wanted * rows.weight, start) / total
    size = float(np.abs(effect).max())
    assert np.abs(made - wanted).max() < 0.01 * max(size, 1e-5)


def test_springs_of_the_file_are_the_fitted_ones(
    planned: tuple[Path, Dataset, Diagnosis], tmp_path: Path
) -> None:
    """Data made with F1: what the two poses see of its springs is in the file, with its sd."""
    _, dataset, diagnosis = planned
    write_model(diagnosis, dataset, tmp_path / "m.yaml")
    read = load_model(tmp_path / "m.yaml")
    stiffness, sd = springs(diagnosis.result)
    np.testing.assert_allclose(read.arm.joint_stiffness, stiffness, rtol=1e-5)
    np.testing.assert_allclose(read.arm.joint_stiffness_relative_sd, sd / stiffness, rtol=1e-3)
    truth = load_model(MODELS / "F1.yaml").arm.joint_stiffness
    assert np.all(np.abs(stiffness - truth)[:5] < 4 * sd[:5])
    prior = diagnosis.result.bench.data.compliance_relative_sd
    assert sd[0] / stiffness[0] < 0.5 * prior[0]
    assert sd[5] / stiffness[5] == pytest.approx(prior[5], rel=0.01)  # on axis 6 nothing shows
    assert "EMULATED" in read.note
    assert dataset.uuid in read.note


def test_of_an_unknown_gap_no_spring_is_made(
    planned: tuple[Path, Dataset, Diagnosis], tmp_path: Path
) -> None:
    _, dataset, diagnosis = planned
    lost = replace(diagnosis, result=replace(diagnosis.result, verdict="unknown"))
    path = tmp_path / "m.yaml"
    write_model(lost, dataset, path)
    arm, given = load_model(path).arm, lost.result.bench.data
    np.testing.assert_allclose(arm.joint_stiffness, 1 / given.compliance, rtol=1e-6)
    np.testing.assert_allclose(
        arm.joint_stiffness_relative_sd, given.compliance_relative_sd, rtol=1e-3
    )
    note = load_model(path).note
    assert "Nothing explains the measured gap" in note
    assert dataset.uuid not in note  # it may be a prior for these data: nothing of them is in it


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("none", "in which rig diagnose found nothing missing"),
        ("unknown", "in which something is missing, and what is unknown"),
        ("joint_creep", "with what rig diagnose found missing in it: joint_creep"),
    ],
)
def test_the_first_line_of_a_model_says_what_was_missing(
    planned: tuple[Path, Dataset, Diagnosis], verdict: str, said: str
) -> None:
    _, dataset, diagnosis = planned
    other = replace(diagnosis, result=replace(diagnosis.result, verdict=verdict))
    assert model_text(other, dataset).startswith(f"# The simulation {said} (")


@pytest.mark.slow
def test_a_model_with_its_effects_closes_the_gap_that_it_came_from(
    planned: tuple[Path, Dataset, Diagnosis], tmp_path: Path
) -> None:
    """rig diagnose --model: with the effect in the simulation, the same data hold no gap."""
    _, dataset, diagnosis = planned
    result, parts = with_effect(diagnosis.result, "contact_seating", 2)
    write_model(replace(diagnosis, result=result), dataset, tmp_path / "m.yaml")
    added = np.repeat(parts[:, 1], result.bench.rows.weight.astype(int)) * 1e3
    columns = {**dataset.columns, "displacement_mm": dataset.columns["displacement_mm"] + added}
    seated = replace(dataset, columns=columns)
    before = diagnose(seated)
    assert before.result.verdict == "contact_seating"
    after = diagnose(seated, model=tmp_path / "m.yaml")
    assert after.result.verdict == "none"
    assert "The simulation has these effects already: contact_seating." in after.to_text()
    assert after.known_effects[0]["name"] == "contact_seating"
    assert "of the model that was given" in model_text(after, seated)


def test_a_session_s_drift_is_no_part_of_the_simulation_of_the_next(
    planned: tuple[Path, Dataset, Diagnosis], tmp_path: Path
) -> None:
    """rig diagnose --model: it is left out, and not handed on into a further model."""
    _, dataset, diagnosis = planned
    result, _ = with_effect(diagnosis.result, "thermal_drift", 0)
    write_model(replace(diagnosis, result=result), dataset, tmp_path / "m.yaml")
    after = diagnose(dataset, model=tmp_path / "m.yaml")
    assert after.known_effects == ()
    said = "Left out of the model: thermal_drift, of the session that it was made from."
    assert said in after.to_text()
    assert "thermal_drift" not in model_text(after, dataset)
    assert after.result.verdict == "none"


def test_what_a_model_file_leaves_is_what_its_simulation_misses(
    planned: tuple[Path, Dataset, Diagnosis], tmp_path: Path
) -> None:
    """Drifts of this session are fitted, and in no file; the laser is zeroed in every setup, with
    what has drifted until then."""
    _, dataset, _ = planned
    session = dataset.columns["session_s"].astype(float)
    setups = [
        f"{p} {d}"
        for p, d in zip(dataset.columns["pose"], dataset.columns["direction"], strict=True)
    ]
    _, first, setup = np.unique(setups, return_index=True, return_inverse=True)
    since = session - session[first][setup]
    warm = dataset.columns["displacement_mm"] + 0.05 * since / session.max()
    drifting = replace(dataset, columns={**dataset.columns, "displacement_mm": warm})
    found = diagnose(drifting)
    assert found.result.verdict == "thermal_drift"
    write_model(found, drifting, tmp_path / "m.yaml")
    before = diagnose(drifting, model=tmp_path / "m.yaml").result.before
    written = found.result.written
    assert written is not None
    assert written == pytest.approx(before, rel=0.01)
    assert written > 3 * found.result.after
    assert "in a model file" in found.to_text()
    assert found.to_json()["gap"]["written_after_rms_mm"] == pytest.approx(1e3 * before, rel=0.01)


def test_what_has_no_model_file_is_refused(
    planned: tuple[Path, Dataset, Diagnosis], tmp_path: Path
) -> None:
    _, dataset, diagnosis = planned
    bench = replace(dataset, meta=dataset.meta.model_copy(update={"robot": "none"}))
    with pytest.raises(InputError, match=r"robot: none\. A model file holds an arm"):
        model_text(diagnosis, bench)
    with pytest.raises(InputError, match=r"another simulator's curves.*Leave --simulation out"):
        check_writable(dataset, others=True)
    with pytest.raises(InputError, match="cannot be written"):
        write_model(diagnosis, dataset, tmp_path / "nowhere" / "m.yaml")


# --- what to measure next ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paper() -> tuple[Dataset, Diagnosis]:
    """The published procedure on the emulated arm that yields in y; joint readings not recorded."""
    text = (PROTOCOLS / "paper_xy.yaml").read_text().replace("repetitions: 3", "repetitions: 2")
    procedure = parse_protocol(text, PROTOCOLS / "paper_xy.yaml")
    columns = dict(sample_protocol(make_world("paper", 1), procedure, 1))
    columns = {k: v for k, v in columns.items() if not k.startswith("q")}
    dataset = dataset_of(procedure, columns)
    return dataset, diagnose(dataset)


def test_on_the_paper_arm_yield_and_slip_are_not_told_apart(
    paper: tuple[Dataset, Diagnosis],
) -> None:
    result = paper[1].result
    main = result.effects[0]
    assert {main.name, *main.indistinguishable_from} >= {"joint_yield", "base_slip"}
    assert result.probabilities["joint_yield"] > 0.05
    assert result.probabilities["base_slip"] > 0.05
    assert sum(result.probabilities.values()) == pytest.approx(1.0)


def test_on_the_paper_arm_the_knee_is_found_whatever_gives_way(
    paper: tuple[Dataset, Diagnosis],
) -> None:
    onset = paper[1].result.effects[0].parameters["onset_y"]
    assert onset.unit == "N"
    assert onset.value == pytest.approx(75.0, abs=2.0)
    assert onset.low < 75.0 < onset.high


def test_and_joint_readings_are_what_to_measure(paper: tuple[Dataset, Diagnosis]) -> None:
    """Nothing else separates a yielding joint 1 from a stand that slips about the same axis."""
    proposal = paper[1].result.next_measurement
    assert proposal is not None
    assert proposal.kind == "readings"
    assert set(proposal.separates) == {"joint_yield", "base_slip"}
    assert proposal.expected_nats > 10
    rest = {o.kind: o.expected_nats for o in proposal.alternatives}
    assert {"unload", "holds", "nearer", "turned", "axis z", "reversed", "cycles"} <= set(rest)
    assert max(rest.values()) < 3
    out = paper[1].to_json()["next_measurement"]
    assert out["alternatives"][0].keys() == {"kind", "text", "expected_nats", "minutes"}
    assert "joint positions" in paper[1].to_text()


def test_the_next_procedure_can_be_checked(
    paper: tuple[Dataset, Diagnosis], tmp_path: Path
) -> None:
    dataset, diagnosis = paper
    said = write_next(diagnosis, dataset, tmp_path / "next.yaml")
    assert said.endswith(f"Next: rig check {tmp_path / 'next.yaml'}")
    written = load_protocol(tmp_path / "next.yaml")
    assert plan(written, load_station(written.station, tmp_path)).runs
    assert (written.station, written.joint_encoder) == ("emulated", "output")
    old = parse_protocol(dataset.texts["protocol"], PROTOCOLS / "paper_xy.yaml")
    for mine, before in zip(written.runs, old.runs, strict=True):
        assert mine.forces_N == before.forces_N
    assert (written.repetitions, written.branches) == (2, "loading")
    assert "EMULATED" in written.text


def test_every_proposal_is_a_procedure(paper: tuple[Dataset, Diagnosis]) -> None:
    """Each of the candidates, whichever wins, becomes a protocol that the plan accepts."""
    from identification.gap.answer.designs import candidates, present_design
    from rig.diagnosis.other_setups import elsewhere

    dataset, diagnosis = paper
    design = present_design(diagnosis.result.bench)
    seen = {}
    for c in candidates(design, True, elsewhere(dataset)):
        proposal = NextMeasurement(c.text, ("joint_yield", "base_slip"), c.kind, design=c.design)
        text = next_text(proposal, dataset)
        seen[c.kind] = parse_protocol(text, Path("next.yaml"))
        assert plan(seen[c.kind], load_station("emulated")).runs
    readings = replace(proposal, design=replace(design, readings=True))
    meta = dataset.meta.model_copy(update={"joint_encoder": "motor"})
    text = next_text(readings, replace(dataset, meta=meta))  # what the robot has, stays
    assert parse_protocol(text, Path("next.yaml")).joint_encoder == "motor"
    assert seen["unload"].branches == "loading-unloading"
    assert seen["holds"].hold_s == pytest.approx(120)
    assert seen["plateaus"].zero.before_s == 60
    assert {r.direction for r in seen["reversed"].runs} == {"x", "y", "-x", "-y"}
    assert seen["reversed"].directions["-y"] == pytest.approx((0, -1, 0))
    assert {r.direction for r in seen["axis z"].runs} == {"x", "y", "z"}
    assert {r.pose for r in seen["turned"].runs} == {"P1", "P1_turned"}
    assert [r.direction for r in seen["cycles"].runs][:3] == ["x_30", "x_60", "x"]
    assert len(seen["steps"].runs[0].forces_N) == 2 * len(seen["readings"].runs[0].forces_N)


def test_without_a_pair_nothing_is_written(
    planned: tuple[Path, Dataset, Diagnosis], tmp_path: Path
) -> None:
    _, dataset, diagnosis = planned
    nothing = replace(diagnosis, result=replace(diagnosis.result, next_measurement=None))
    assert "No two effects are left" in write_next(nothing, dataset, tmp_path / "n.yaml")
    hopeless = NextMeasurement("No procedure ...", ("force_scale", "pose_error"), "none", 1.0)
    none = replace(diagnosis, result=replace(diagnosis.result, next_measurement=hopeless))
    assert "not written. No procedure" in write_next(none, dataset, tmp_path / "n.yaml")
    assert not (tmp_path / "n.yaml").exists()


def test_other_places_are_where_they_say(paper: tuple[Dataset, Diagnosis]) -> None:
    """Nearer by 200 mm with the same tool; turned at the same point with the other elbow."""
    from identification.arm import tool_offset
    from rig.diagnosis.other_setups import other_poses
    from rig.models.robot import load_robot

    meta = paper[0].meta
    arm, q = load_robot("ur10e"), np.array(meta.poses["P1"].q_rad)
    tool = tool_offset(np.array(meta.poses["P1"].tcp_xyz_mm) / 1e3)
    here = arm.fk(q, tool)
    found = {k: v[1] for k, v in other_poses(arm, meta, "P1").items()}
    near, turned = arm.fk(found["P1_nearer"], tool), arm.fk(found["P1_turned"], tool)
    reach = np.hypot(*here[:2, 3])
    assert np.hypot(*near[:2, 3]) == pytest.approx(reach - 0.2)
    np.testing.assert_allclose(near[:3, :3], here[:3, :3], atol=1e-9)
    np.testing.assert_allclose(turned, here, atol=1e-9)
    assert found["P1_turned"][2] * q[2] < 0
    for other in found.values():  # not into the table: the nearest turned one has its elbow there
        assert arm.frames(other)[2:, 2, 3].min() > 0.149
    data_bench = make_bench(
        planned_data(load_model(MODELS / "F1.yaml"), load_protocol(PROTOCOLS / "paper_xy.yaml"))
    )
    assert data_bench.data.setups[1].lever[0] == pytest.approx(0.75, rel=1e-3)
