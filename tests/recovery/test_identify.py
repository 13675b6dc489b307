"""`rig identify` from data sets on disk to joints, model file and next protocol, and what it costs
to believe a proposal. Worlds share no code with the identification."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.joints import JointFit
from rig.analysis.identify import IdentifyResult, identify, prior_of
from rig.analysis.identify_text import model_text, protocol_text, write_model, write_protocol
from rig.coupling.couple import couple
from rig.dataset import load, write
from rig.errors import InputError
from rig.models.model import load_model
from rig.models.model_export import write as write_export
from rig.models.robot import MODELS, load_robot
from rig.models.simulate import simulate
from rig.plan import plan
from rig.protocol import load_protocol
from rig.station import load_station
from tests.recovery.emulated_sets import (
    AXES,
    OFFSET_MM,
    PAPER_C,
    REFERENCE_Q,
    measure,
    protocol,
    rich,
)

Array = NDArray[np.float64]


def one_pose(encoder: str = "motor", tcp_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)):  # type: ignore[no-untyped-def]
    runs = [(0, "x", 200.0), (0, "y", 70.0)]
    return protocol(REFERENCE_Q[None], runs, tcp_mm, encoder)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """rich.h5: six poses; single.h5: the published pose and directions; seen.h5: the same with
    joint readings that see the deflection."""
    folder = tmp_path_factory.mktemp("identify")
    measure(rich(), PAPER_C, 1, folder / "rich.h5")
    measure(one_pose(), PAPER_C, 2, folder / "single.h5")
    measure(one_pose("output"), PAPER_C, 3, folder / "seen.h5")
    return folder


@pytest.fixture(scope="module")
def single(files: Path) -> IdentifyResult:
    return identify([files / "single.h5"])


@pytest.fixture(scope="module")
def found_of_rich(files: Path) -> IdentifyResult:
    return identify([files / "rich.h5"], proposals=0)


def test_rich_data_find_the_springs(found_of_rich: IdentifyResult) -> None:
    fit = found_of_rich.fit
    assert fit.rank == 6
    assert fit.identified[:3].all()
    error = np.abs(fit.stiffness / PAPER_C - 1)
    assert error[fit.identified].max() < 0.05
    assert (error < 3 * fit.relative_sd).all()
    assert fit.birge == 1.0


def test_the_published_pose_leaves_four_open(single: IdentifyResult) -> None:
    fit = single.fit
    assert fit.rank == 2
    assert (~fit.identified).sum() >= 4
    assert single.to_json()["null_dimension"] == 4
    # whatever the other joints do: ky times the lever squared, less the uncertainty
    assert 30e3 < fit.lower_bound[0] < 0.75**2 * 57.42e3
    assert any(note.startswith("Joint 6 has no lever") for note in single.notes)


def test_springs_of_bent_curves_are_said_to_be_averages(
    files: Path, found_of_rich: IdentifyResult, tmp_path: Path
) -> None:
    straight = load(files / "rich.h5")
    columns = dict(straight.columns)
    bent = (columns["pose"] == "P2") & (columns["direction"] == "y")
    more = np.where(bent, 1e-4 * columns["force_N"] ** 2, 0.0)  # 0.25 mm at 50 N
    columns["displacement_mm"] = columns["displacement_mm"] + more
    write(replace(straight, columns=columns), tmp_path / "bent.h5")
    assert not any("not straight" in n for n in found_of_rich.notes)
    assert identify([tmp_path / "bent.h5"], proposals=0).notes[0] == (
        f"{tmp_path / 'bent.h5'}: the curve of P2/y is not straight within the noise: the springs "
        "are averages over what was loaded. rig diagnose separates springs from effects."
    )


def test_joint_readings_count_where_they_see(files: Path) -> None:
    seen = identify([files / "seen.h5"], proposals=0)
    assert seen.fit.rank == 5
    assert seen.fit.identified[[0, 2]].all()
    assert (~seen.fit.identified).sum() >= 4
    np.testing.assert_allclose(seen.fit.stiffness[[0, 2]], PAPER_C[[0, 2]], rtol=0.03)
    blind = identify([files / "seen.h5"], proposals=0, joint_readings=False)
    assert blind.fit.rank == 2


def test_several_sets_count_together(files: Path, found_of_rich: IdentifyResult) -> None:
    alone = found_of_rich.fit
    both = identify([files / "rich.h5", files / "seen.h5"], proposals=0).fit
    assert (both.relative_sd < alone.relative_sd * (1 + 1e-9)).all()
    assert both.relative_sd[0] < 0.9 * alone.relative_sd[0]


def test_json_has_the_agreed_keys(single: IdentifyResult) -> None:
    out = json.loads(json.dumps(single.to_json(), allow_nan=False))
    assert out["schema"] == "rig.joints/1"
    assert len(out["joint_stiffness_Nm_per_rad"]) == len(out["identified"]) == 6
    for joint in out["joint_stiffness_Nm_per_rad"]:
        assert joint["ci95"][0] < joint["value"] < joint["ci95"][1]
        assert joint["standard_uncertainty"] > 0
    assert out["rank"] + out["null_dimension"] == 6
    assert out["condition_number"] is None
    assert [len(p["q_rad"]) for p in out["next_poses"]] == [6] * 6
    assert all(np.linalg.norm(p["direction"]) == pytest.approx(1) for p in out["next_poses"])
    assert "standard uncertainty" in out["next_poses"][0]["why"]


def test_emulated_data_are_said_to_be(single: IdentifyResult, files: Path) -> None:
    assert single.to_text().startswith("EMULATED: ")
    assert 'note: "EMULATED: ' in model_text(single)
    assert "station: emulated" in protocol_text(single)
    measure(one_pose(), PAPER_C, 2, files / "real.h5", origin="measured")
    real = identify([files / "real.h5"], proposals=1)
    assert "EMULATED" not in real.to_text() + model_text(real) + protocol_text(real)
    assert "station: ur10e_lab" in protocol_text(real)
    measure(one_pose(), PAPER_C, 7, files / "cut.h5", complete=False)
    cut = identify([files / "single.h5", files / "cut.h5"], proposals=0)
    assert [b.split(":")[0] for b in cut.banners] == ["EMULATED", "INCOMPLETE"]


def test_the_model_goes_on(single: IdentifyResult, tmp_path: Path) -> None:
    """rig couple and rig simulate read what rig identify writes; simulators get the numbers."""
    write_model(single, tmp_path / "m.yaml")
    model = load_model(tmp_path / "m.yaml")
    np.testing.assert_allclose(model.arm.joint_stiffness, single.fit.stiffness, rtol=1e-6)
    np.testing.assert_allclose(
        model.arm.joint_stiffness_relative_sd, single.fit.relative_sd, rtol=1e-3
    )
    np.testing.assert_allclose(model.q, REFERENCE_Q, atol=1e-8)
    # the springs may be wrong one by one; what was measured comes out right
    found = couple(tmp_path / "m.yaml", samples=0)
    np.testing.assert_allclose(found.single[:2] / 1e3, [95.94, 57.42], rtol=0.02)
    text = single_protocol(tmp_path)
    curves = simulate(tmp_path / "m.yaml", text).curves
    np.testing.assert_allclose([c.stiffness / 1e3 for c in curves], [95.94, 57.42], rtol=0.02)
    assert "EMULATED" in found.to_text()
    written = write_export(single, mujoco=tmp_path / "m.xml", urdf_file=tmp_path / "m.urdf")
    for path in written:
        assert repr(float(single.fit.stiffness[0])) in path.read_text()


def single_protocol(folder: Path) -> Path:
    path = folder / "p.yaml"
    path.write_text(one_pose().text)
    return path


def test_the_next_protocol_can_be_carried_out(single: IdentifyResult, tmp_path: Path) -> None:
    write_protocol(single, tmp_path / "next.yaml")
    following = load_protocol(tmp_path / "next.yaml")
    planned = plan(following, load_station("emulated"))
    assert len(planned.runs) == len(single.proposals)
    for run, proposal in zip(planned.runs, single.proposals, strict=True):
        assert run.forces_N[-1] == pytest.approx(proposal.force, rel=1e-3)
        assert run.displacement_mm < 10
    measure(following, PAPER_C, 4, tmp_path / "next.h5")
    after = identify([single.datasets[0], tmp_path / "next.h5"], proposals=0).fit
    assert after.relative_sd.sum() < single.fit.relative_sd.sum() / 2
    error = np.abs(after.stiffness / PAPER_C - 1)
    assert error[after.identified].max() < 0.05
    with pytest.raises(InputError, match="no next poses were looked for"):
        protocol_text(identify([single.datasets[0]], proposals=0))


def test_no_measurement_counts_again_as_its_own_prior(
    files: Path, single: IdentifyResult, tmp_path: Path
) -> None:
    write_model(single, tmp_path / "first.yaml")
    with pytest.raises(InputError, match=r"first\.yaml: was made from .*single\.h5; every measure"):
        identify([files / "single.h5"], prior=prior_of(tmp_path / "first.yaml"), proposals=0)
    second = identify([files / "seen.h5"], prior=prior_of(tmp_path / "first.yaml"), proposals=0)
    write_model(second, tmp_path / "second.yaml")  # knows of both
    for name in ("single.h5", "seen.h5"):
        with pytest.raises(InputError, match="every measurement counts once"):
            identify([files / name], prior=prior_of(tmp_path / "second.yaml"), proposals=0)


def test_a_model_file_as_prior(files: Path, tmp_path: Path) -> None:
    prior = prior_of(MODELS / "F1.yaml")
    found = identify([files / "single.h5"], prior=prior, proposals=0)
    assert found.fit.stiffness[5] == pytest.approx(8000)
    assert found.fit.relative_sd[5] == pytest.approx(np.sqrt(np.log1p(0.1**2)))
    assert "F1.yaml" in found.to_json()["prior"]["source"]
    text = (MODELS / "F1.yaml").read_text().replace("relative_sd: 0.1", "relative_sd: 0")
    (tmp_path / "sure.yaml").write_text(text)
    with pytest.raises(InputError, match=r"sure\.yaml: as a prior it needs"):
        prior_of(tmp_path / "sure.yaml")


def test_data_that_contradict_the_prior(
    files: Path, single: IdentifyResult, tmp_path: Path
) -> None:
    """In micrometres: said before anything else, in every output, with the unit that fits; of a
    spring that no unit explains, how far it is away."""
    assert single.doubts == ()
    assert single.to_json()["prior_conflict"] is None
    measured = load(files / "single.h5")
    columns = dict(measured.columns)
    columns["displacement_mm"] = 1000 * columns["displacement_mm"]
    write(replace(measured, columns=columns), tmp_path / "um.h5")
    found = identify([tmp_path / "um.h5"], proposals=0)
    (doubt,) = found.doubts
    assert re.fullmatch(
        r"Data and prior contradict each other: they agree if all joints are 0\.000\d+ times as "
        r"stiff as the prior has them, 2\d of its standard deviations away\. Are these "
        r"displacements in um or forces in kN\? The joints were taken with that factor, those that "
        r"repeat the prior, too\.",
        doubt,
    )
    lines = found.to_text().splitlines()
    assert f"See to this first: {doubt}" == next(k for k in lines if k[0] not in " JPE")
    assert found.to_json()["notes"][0] == doubt
    assert found.to_json()["prior_conflict"]["common_factor"] < 1e-3
    assert doubt in model_text(found)
    stated = prior_of(MODELS / "F1.yaml")
    stiff = replace(stated, stiffness=stated.stiffness * [10, 1, 1, 1, 1, 1])
    (doubt,) = identify([files / "seen.h5"], prior=stiff, proposals=0).doubts
    assert re.match(
        r"Data and prior .*: they agree best if joint 1 is 0\.1\d* times .*taken as \d", doubt
    )


# --- what cannot be identified -------------------------------------------------------------------


def test_contradictory_sets_are_named(files: Path) -> None:
    measure(one_pose(), 1.5 * PAPER_C, 5, files / "other.h5")
    with pytest.raises(InputError) as caught:
        identify([files / "single.h5", files / "other.h5"], proposals=0)
    message = str(caught.value)
    assert message.count("\n") == 0
    for words in ("single.h5", "other.h5", "contradict each other", "N/mm", "pose P0"):
        assert words in message


def test_bent_curves_of_other_ranges_say_what_to_do(files: Path, tmp_path: Path) -> None:
    """One softening arm, loaded far and loaded a little: the averages contradict each other."""
    for seed, name, top in ((11, "far", 200.0), (12, "near", 50.0)):
        runs = [(0, "x", top), (0, "y", 70.0)]
        asked = protocol(REFERENCE_Q[None], runs, (0.0, 0.0, 0.0), "motor")
        found = measure(asked, PAPER_C, seed)
        columns = dict(found.columns)
        along_x = columns["direction"] == "x"
        bent = np.where(along_x, 1.0 + columns["force_N"] / 250.0, 1.0)
        columns["displacement_mm"] = columns["displacement_mm"] * bent
        write(replace(found, columns=columns), tmp_path / f"{name}.h5")
    paths = [tmp_path / "far.h5", tmp_path / "near.h5"]
    with pytest.raises(InputError, match="contradict each other") as caught:
        identify(paths, proposals=0)
    message = str(caught.value).replace(f"{tmp_path}/", "")
    ranges = re.findall(r"(far|near)\.h5: pose P0, direction x over [\d.]+ to ([\d.]+) N", message)
    assert [(name, round(float(top), -1)) for name, top in ranges] == [("far", 200), ("near", 50)]
    assert message.endswith(
        "Give the data set whose range of force matters, or measure both at the same levels; rig "
        "diagnose separates springs from effects."
    )


@pytest.mark.parametrize("encoder", ["motor", "output"])
def test_a_repetition_that_was_cut_short_is_as_if_not_measured(
    tmp_path: Path, encoder: str
) -> None:
    made = measure(one_pose(encoder), PAPER_C, 8)
    c = made.columns
    third = (c["direction"] == "x") & (c["repetition"] == 3)
    for name, kept in {"cut": ~third | (c["step"] <= 3), "without": ~third}.items():
        columns = {n: values[kept] for n, values in c.items()}
        write(replace(made, columns=columns), tmp_path / f"{name}.h5")
    cut, without = (
        identify([tmp_path / f"{n}.h5"], proposals=0, joint_readings=False)
        for n in ("cut", "without")
    )
    np.testing.assert_allclose(cut.fit.stiffness, without.fit.stiffness)
    np.testing.assert_allclose(cut.fit.relative_sd, without.fit.relative_sd)
    seen, alike = (identify([tmp_path / f"{n}.h5"], proposals=0) for n in ("cut", "without"))
    np.testing.assert_allclose(seen.fit.stiffness, alike.fit.stiffness, rtol=5e-5)
    assert any(
        "direction x: repetition 3 ended at " in n and n.endswith(" N: left out of the mean.")
        for n in seen.notes
    )


def test_a_data_set_counts_once(files: Path, tmp_path: Path) -> None:
    single, copy = files / "single.h5", tmp_path / "copy.h5"
    copy.write_bytes(single.read_bytes())
    with pytest.raises(InputError) as caught:
        identify([single, files / "seen.h5", single], proposals=0)
    assert str(caught.value) == (
        f"{single}: is given twice; every measurement counts once. Leave one of them out."
    )
    with pytest.raises(InputError) as caught:
        identify([single, copy], proposals=0)
    assert str(caught.value) == (
        f"{copy}: is the same data set as {single} (UUID 00000000-0000-0000-0000-000000000002); "
        "every measurement counts once. Leave one of them out."
    )


def test_bad_input(files: Path) -> None:
    with pytest.raises(InputError, match="at least one data set"):
        identify([])
    with pytest.raises(InputError, match=r"nowhere\.h5"):
        identify([files / "nowhere.h5"])
    made = measure(one_pose(), PAPER_C, 6)
    none = made.meta.model_copy(update={"robot": "none", "poses": {}, "simulation": None})
    texts = {**made.texts, "meta": none.model_dump_json(exclude_none=True)}
    columns = {**made.columns, "pose": np.full(made.rows, "")}
    write(replace(made, meta=none, texts=texts, columns=columns), files / "none.h5")
    with pytest.raises(InputError, match=r"none\.h5: robot: none; joint stiffnesses need an arm"):
        identify([files / "none.h5"])
    other = made.meta.model_copy(update={"robot": "ur5e"})
    texts = {**made.texts, "meta": other.model_dump_json(exclude_none=True)}
    write(replace(made, meta=other, texts=texts), files / "ur5e.h5")
    with pytest.raises(InputError, match=r"ur5e\.h5 is of a ur5e, .*single\.h5 of a ur10e"):
        identify([files / "single.h5", files / "ur5e.h5"])


def test_data_without_stiffness(files: Path) -> None:
    made = measure(one_pose(), PAPER_C, 6)
    columns = {**made.columns, "force_N": np.zeros(made.rows)}
    columns |= {f"force_{a}_N": np.zeros(made.rows) for a in AXES}
    write(replace(made, columns=columns), files / "unloaded.h5")
    with pytest.raises(InputError, match=r"unloaded\.h5: no pose and direction has a stiffness"):
        identify([files / "unloaded.h5"])
    none = {name: values[:0] for name, values in made.columns.items()}
    write(replace(made, columns=none, events=[], complete=False), files / "empty.h5")
    with pytest.raises(InputError) as caught:
        identify([files / "empty.h5"])
    assert str(caught.value) == (
        f"{files / 'empty.h5'}: no pose and direction has a stiffness: the data set holds no "
        "samples. The measurement did not reach its end: go on with rig measure --resume, or "
        "leave this data set out."
    )


# --- campaigns -----------------------------------------------------------------------------------


def random_truth(rng: np.random.Generator) -> Array:
    arm = load_robot("ur10e")
    return np.asarray(arm.joint_stiffness * np.exp(0.35 * rng.standard_normal(6)))


def recover(
    count: int, folder: Path, seed: int = 0, encoder: str = "motor"
) -> tuple[float, list[float], int]:
    """Coverage of the 95 % intervals, errors of identified joints, how many there were."""
    rng = np.random.default_rng(seed)
    covered, errors, identified = [], [], 0
    for i in range(count):
        truth = random_truth(rng)
        measure(rich(encoder=encoder), truth, 1000 * seed + i, folder / "set.h5")
        fit = identify([folder / "set.h5"], proposals=0).fit
        covered.append((fit.ci95[:, 0] <= truth) & (truth <= fit.ci95[:, 1]))
        errors += list(np.abs(fit.stiffness / truth - 1)[fit.identified])
        identified += int(fit.identified.sum())
    return float(np.mean(covered)), errors, identified


def test_recovery_in_short(tmp_path: Path) -> None:
    """Three sets: far from a coverage."""
    coverage, errors, identified = recover(3, tmp_path)
    assert coverage >= 0.8
    assert identified >= 8
    assert max(errors) < 0.05


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("encoder", ["motor", "output"])
def test_recovery_of_200_sets(encoder: str, tmp_path: Path) -> None:
    coverage, errors, identified = recover(200, tmp_path, encoder=encoder)
    print(f"coverage {coverage:.4f}, {identified} identified, worst {max(errors):.4f}")
    assert 0.92 <= coverage <= 0.98
    assert identified > 600
    assert max(errors) < 0.05


def gain(folder: Path, truth: Array, chosen: list[tuple[Array, str, float]], seed: int) -> JointFit:
    """The fit after the first set (first.h5) and a second one in the chosen poses."""
    poses = np.array([q for q, _, _ in chosen])
    runs = [(i, axis, force) for i, (_, axis, force) in enumerate(chosen)]
    measure(protocol(poses, runs, OFFSET_MM, "motor", 10), truth, seed, folder / "next.h5")
    return identify([folder / "first.h5", folder / "next.h5"], proposals=0).fit


def duel(folder: Path, number: int) -> tuple[float, bool]:
    """Share of the promise that was kept, and whether random poses did worse."""
    rng = np.random.default_rng([7, number])
    truth = random_truth(rng)
    measure(one_pose(tcp_mm=OFFSET_MM), truth, 10_000 + number, folder / "first.h5")
    first = identify([folder / "first.h5"], proposals=4, seed=number)
    proposed = [(p.q, p.axis, p.force) for p in first.proposals]
    after = gain(folder, truth, proposed, 20_000 + number)
    before = first.fit.relative_sd.sum()
    promised = before - first.proposals[-1].expected.sum()
    rival = gain(folder, truth, chance(first, rng), 20_000 + number)
    kept = float((before - after.relative_sd.sum()) / promised)
    return kept, bool(after.relative_sd.sum() < rival.relative_sd.sum())


def chance(first: IdentifyResult, rng: np.random.Generator) -> list[tuple[Array, str, float]]:
    """As many poses that meet the same limits, drawn blindly."""
    from identification.next_poses import Plan, _candidates

    plan_ = Plan(tool=first.observations[0].tool)
    q, _, force = _candidates(first.arm, plan_, int(rng.integers(1e6)), 300)
    rows = rng.choice(np.flatnonzero(force > 0.05 * plan_.force), len(first.proposals), False)
    return [(q[i // 3], AXES[i % 3], float(force[i])) for i in rows]


@pytest.mark.slow
def test_proposals_help_when_measured(tmp_path: Path) -> None:
    kept, better = zip(*(duel(tmp_path, n) for n in range(2)), strict=True)
    assert min(kept) >= 0.5
    assert all(better)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_proposals_beat_chance_in_ten_draws(tmp_path: Path) -> None:
    kept, better = zip(*(duel(tmp_path, n) for n in range(10)), strict=True)
    print(f"kept {np.round(kept, 2)}, better in {sum(better)} of 10")
    assert min(kept) >= 0.5
    assert sum(better) >= 9
