"""Two coupled arms: the reference numbers, the laws, and the volumes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification import workspace
from identification.arm import Arm, along
from identification.coupling import (
    base_distance,
    coupled,
    decide,
    mirror,
    mirror_axes,
    mirrored,
    on_axes,
    parallel,
)
from identification.elastic import STEEL, Material, cantilever, tube
from identification.when import CouplingRule, schedule
from rig.coupling.couple import couple
from rig.errors import InputError
from rig.models.model import ArmModel, load_model
from rig.models.robot import MODELS, load_robot

Array = NDArray[np.float64]
BETA = np.deg2rad(36.5)
BASE = np.eye(3)


@pytest.fixture(scope="module")
def f1() -> ArmModel:
    return load_model(MODELS / "F1.yaml")


@pytest.fixture(scope="module")
def f2() -> ArmModel:
    return load_model(MODELS / "F2.yaml")


@pytest.mark.parametrize(
    ("beta", "kind", "axes", "wanted"),
    [
        (0.0, "rigid", BASE, (339.5, 140.1)),
        (0.0, "point", BASE, (337.0, 117.6)),
        (BETA, "rigid", BASE, (231.9, 221.2)),
        (BETA, "rigid", mirror_axes(BETA), (246.3, 209.5)),
        (BETA, "point", mirror_axes(BETA), (240.7, 167.7)),
    ],
)
def test_f1_coupled(f1: ArmModel, beta: float, kind, axes: Array, wanted) -> None:  # type: ignore[no-untyped-def]
    found = on_axes(coupled(f1.compliance(), beta, kind), axes)[:2] / 1e3
    np.testing.assert_allclose(found, wanted, rtol=5e-3)


def test_f2_single_and_coupled(f2: ArmModel) -> None:
    C = f2.compliance()
    np.testing.assert_allclose(on_axes(C, BASE)[:2] / 1e3, (96.37, 56.05), rtol=5e-4)
    found = on_axes(coupled(C, BETA), mirror_axes(BETA))[:2] / 1e3
    np.testing.assert_allclose(found, (212.0, 2950.0), rtol=5e-3)


@pytest.mark.parametrize(
    ("diameter", "half_length", "wanted"), [(0.03, 0.05, (212, 1531)), (0.02, 0.1, (208, 575))]
)
def test_f2_with_a_beam(f2: ArmModel, diameter: float, half_length: float, wanted) -> None:  # type: ignore[no-untyped-def]
    half = cantilever(tube(STEEL, diameter), half_length)
    found = on_axes(coupled(f2.compliance(), BETA, "compliant", half), mirror_axes(BETA))[:2]
    np.testing.assert_allclose(found / 1e3, wanted, rtol=5e-3)


# --- laws ----------------------------------------------------------------------------------------

springs = st.lists(st.floats(3e3, 2e5), min_size=6, max_size=6)
betas = st.floats(-1.4, 1.4)
free, bent = st.floats(-3.0, 3.0), st.floats(0.3, 2.8)
poses = st.tuples(free, free, bent, free, bent, free).map(np.array)
_ARM: list[Arm] = []


def compliance(q: Array, c: list[float]) -> Array:
    if not _ARM:
        _ARM.append(load_robot("ur10e"))
    return _ARM[0].with_stiffness(c).compliance(q)


@given(poses, springs, betas)
@settings(max_examples=60, deadline=None)
def test_rigid_coupling_is_the_sum_of_both_stiffnesses(q: Array, c: list[float], b: float) -> None:
    C = compliance(q, c)
    S = mirror(b)
    K = np.linalg.inv(C)
    assume(np.linalg.cond(C) < 1e8)  # the plain inverse loses its digits beside a singularity
    np.testing.assert_allclose(coupled(C, b) @ (K + S @ K @ S), np.eye(6), atol=1e-5)
    np.testing.assert_allclose(coupled(C, b), parallel(C, mirrored(C, b)), rtol=1e-6, atol=1e-14)


@given(poses, springs, betas)
@settings(max_examples=60, deadline=None)
def test_laws_of_the_mirror(q: Array, c: list[float], b: float) -> None:
    C = compliance(q, c)
    axes = mirror_axes(b)
    pair = coupled(C, b)
    local = axes.T @ pair[:3, :3] @ axes
    assert abs(local[0, 1]) <= 1e-9 * np.abs(local).max()  # diagonal in (n, t)
    k_pair, k_single = on_axes(pair, axes), on_axes(C, axes)
    assert (k_pair[:2] >= 2 * k_single[:2] * (1 - 1e-9)).all()
    k_base = on_axes(pair, BASE)
    if abs(b) > 0.02:
        assert k_base[1] / k_base[0] <= max(np.tan(b) ** -2, np.tan(b) ** 2) * (1 + 1e-9)
    exchanged = coupled(mirrored(C, b), b)
    np.testing.assert_allclose(exchanged, pair, rtol=1e-7, atol=1e-15)


@given(poses, springs, betas, st.floats(0.005, 0.06), st.floats(0.01, 0.3))
@settings(max_examples=60, deadline=None)
def test_rigid_over_beam_over_point(
    q: Array, c: list[float], b: float, diameter: float, half_length: float
) -> None:
    """Along the mirror axes; the point joint sits at the node, so it takes the same arms, with a
    beam that gives way in rotation only."""
    C = compliance(q, c)
    axes = mirror_axes(b)
    half = cantilever(tube(STEEL, diameter), half_length)
    rigid = on_axes(coupled(C, b), axes)
    beam = on_axes(coupled(C, b, "compliant", half), axes)
    assert (rigid >= beam * (1 - 1e-9)).all()
    hinge = np.diag([0, 0, 0, 1.0, 1.0, 1.0]) * 1e3  # rad/Nm: next to no fixity
    point = on_axes(coupled(C, b, "point"), axes)
    soft = on_axes(coupled(C, b, "compliant", hinge), axes)
    np.testing.assert_allclose(soft, point, rtol=1e-3)
    turning_only = half.copy()
    turning_only[:3] = turning_only[:, :3] = 0.0
    between = on_axes(coupled(C, b, "compliant", turning_only), axes)
    assert (rigid >= between * (1 - 1e-9)).all()
    assert (between >= point * (1 - 1e-9)).all()


def test_a_beam_grows_into_a_weld(f2: ArmModel) -> None:
    C = f2.compliance()
    rigid = on_axes(coupled(C, BETA), mirror_axes(BETA))
    gaps = []
    for factor in (1.0, 10.0, 100.0, 1e6):
        material = Material("scaled", 210e9 * factor, 81e9 * factor)
        half = cantilever(tube(material, 0.03), 0.05)
        k = on_axes(coupled(C, BETA, "compliant", half), mirror_axes(BETA))
        gaps.append(float(np.max(1 - k / rigid)))
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[-1] < 1e-5


def test_singular_poses_couple_too() -> None:
    """Wrist stretched: C has no inverse, the pair's compliance exists and is the limit."""
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.0, 0.2])
    near = q + np.array([0, 0, 0, 0, 1e-5, 0])
    c = [6e4, 6e4, 3e4, 8e3, 8e3, 8e3]
    at, beside = coupled(compliance(q, c), 0.3), coupled(compliance(near, c), 0.3)
    np.testing.assert_allclose(on_axes(at, BASE), on_axes(beside, BASE), rtol=1e-3)


def test_half_belongs_to_a_compliant_connection(f1: ArmModel) -> None:
    with pytest.raises(ValueError, match="half"):
        coupled(f1.compliance(), 0.0, "compliant")
    with pytest.raises(ValueError, match="half"):
        coupled(f1.compliance(), 0.0, "rigid", np.eye(6))


def test_base_distance_of_a_node() -> None:
    assert base_distance(np.array([0.75, 0, 0.4]), 0.0) == pytest.approx(1.5)
    assert base_distance(np.array([0.75, 0, 0.4]), BETA) == pytest.approx(1.5 * np.cos(BETA))


# --- workspace -----------------------------------------------------------------------------------


def test_analytic_workspace() -> None:
    w = workspace.analytic(1.3, 1.5)
    assert w.coupled == pytest.approx(1.0612, rel=1e-3)
    assert w.single == pytest.approx(4.6014, rel=1e-3)
    assert workspace.analytic(1.3, 2.6).coupled == 0.0
    assert workspace.analytic(1.3, 1e-9).coupled == pytest.approx(w.single)


@pytest.mark.parametrize("seed", [0, 1])
def test_sampled_workspace(seed: int) -> None:
    w = workspace.monte_carlo(load_robot("ur10e"), 1.5, 1_000_000, seed)
    assert w.single == pytest.approx(6.35, rel=0.01)
    assert w.coupled == pytest.approx(1.727, rel=0.015)
    assert w.ratio == pytest.approx(0.272, abs=0.004)
    assert "z > 0" in w.definition


def test_sampled_workspace_of_a_joint_that_turns_half_way() -> None:
    """With half a turn of joint 1 the shape is no solid of revolution."""
    from dataclasses import replace

    arm = load_robot("ur10e")
    low, high = np.array(arm.q_min), np.array(arm.q_max)
    low[0], high[0] = 0.0, np.pi
    half = workspace.sample(replace(arm, q_min=low, q_max=high), 400_000, cell=0.05)
    assert half.cells.shape[2] > 1
    whole = workspace.sample(arm, 400_000, cell=0.05)
    # both sides of the shoulder reach backwards, so half a turn covers more than half
    assert 0.5 < half.volume() / whole.volume() <= 1.0


def test_progress_reaches_the_end() -> None:
    seen: list[float] = []
    workspace.sample(load_robot("ur10e"), 120_000, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


# --- when to couple ------------------------------------------------------------------------------


def test_the_rule_at_its_edges() -> None:
    assert decide(95.0, 95.0, 200.0) == "single"
    assert decide(95.0001, 95.0, 200.0) == "couple"
    assert decide(200.0, 95.0, 200.0) == "couple"
    assert decide(200.0001, 95.0, 200.0) == "infeasible"


def test_dead_band_stops_chatter() -> None:
    wobble = [90, 101, 99, 101, 99, 101, 94, 99]
    plain, steady = CouplingRule(), CouplingRule(dead_band=0.05)
    assert [plain.update(r, 100, 300) for r in wobble] == [
        "single",
        "couple",
        "single",
        "couple",
        "single",
        "couple",
        "single",
        "single",
    ]
    assert [steady.update(r, 100, 300) for r in wobble] == [
        "single",
        "couple",
        "couple",
        "couple",
        "couple",
        "couple",
        "single",
        "single",
    ]


def test_schedule_along_a_path(f1: ArmModel) -> None:
    time = np.arange(6.0)
    required = np.array([50, 96.1, 300, 400, 300, 95.0]) * 1e3
    q = np.broadcast_to(f1.q, (6, 6))
    plan = schedule(f1.arm, time, q, np.tile([1.0, 0, 0], (6, 1)), required, beta=0.0)
    assert [(i.start, i.end, i.state) for i in plan.intervals()] == [
        (0, 1, "single"),
        (1, 3, "couple"),
        (3, 4, "infeasible"),
        (4, 5, "couple"),
        (5, 5, "single"),
    ]
    with pytest.raises(ValueError, match="row 2"):
        schedule(f1.arm, [0, -1], q[:2], np.tile([1.0, 0, 0], (2, 1)), [1, 1], beta=0.0)


# --- rig couple ----------------------------------------------------------------------------------


def test_couple_json(tmp_path: Path) -> None:
    text = (
        (MODELS / "F2.yaml")
        .read_text()
        .replace(
            "kind: rigid",
            "kind: {beam: {material: steel, diameter_mm: 30, half_length_mm: 50}}",
        )
    )
    (tmp_path / "m.yaml").write_text(text)
    out = json.loads(json.dumps(couple(tmp_path / "m.yaml", samples=0).to_json(), allow_nan=False))
    assert out["schema"] == "rig.coupling/1"
    assert out["workspace_m3"]["coupled"] == pytest.approx(1.0612, rel=1e-3)
    assert "1.5 m apart" in out["workspace_m3"]["definition"]
    pair = out["coupled_N_per_mm"]
    assert pair["rigid"]["y"] == pytest.approx(2950, rel=5e-3)
    assert pair["compliant"]["y"] == pytest.approx(1531, rel=5e-3)
    assert out["gain"]["rigid"]["y"] == pytest.approx(2950 / 56.05, rel=5e-3)
    assert [d["state"] for d in out["decision"]] == ["couple", "couple"]
    assert out["decision"][1] == {
        "required_N_per_mm": 1000.0,
        "direction": "y",
        "state": "couple",
    }


def test_couple_text_shows_the_published_numbers() -> None:
    result = couple(MODELS / "F2.yaml", samples=0)
    rows = [line.split() for line in result.to_text().splitlines()]
    for row in (
        "single x, N/mm 95.94 96.37",
        "coupled x, N/mm 212 212.0",
        "gain x, % 200 121 120",
        "single y, N/mm 57.42 56.05",
        "coupled y, N/mm 2950 2950.0",
        "gain y, % 5940 5038 5164",
        "gain y, times 37.19 51.38 52.64",
        "workspace single, m^3 3.5 4.60 4.60",
        "workspace coupled, m^3 1.06 1.06",
        "workspace ratio, % 30.23 30.29 23.06",
    ):
        assert row.split() in rows
    table = {(r["quantity"], r["unit"]): r for r in result.to_json()["published"]}
    assert table["gain y", "times"]["stated"] == 37.19
    assert table["gain y", "times"]["follows"] == pytest.approx(2950 / 57.42)
    assert table["workspace single", "m^3"]["model"] == pytest.approx(4.6014, rel=1e-4)
    assert "infeasible" in couple(MODELS / "F1.yaml", samples=0).to_text()


def test_other_set_ups_have_nothing_published(tmp_path: Path) -> None:
    text = (MODELS / "F1.yaml").read_text().replace("1500", "1400")
    (tmp_path / "m.yaml").write_text(text)
    result = couple(tmp_path / "m.yaml", samples=0)
    assert result.to_json()["published"] == []
    assert "Published" not in result.to_text()


def test_uncertainty_of_one_spring(f1: ArmModel) -> None:
    """All springs off by the same factor: stiffness is off by it too, so the parts of
    the variance are shares that sum to one in the first power."""
    result = couple(MODELS / "F1.yaml", samples=0)
    J = f1.arm.jacobian(f1.q)[0]
    share = J**2 / f1.arm.joint_stiffness * along(f1.compliance(), [1, 0, 0])
    assert share.sum() == pytest.approx(1.0)
    wanted = 0.1 * np.sqrt((share**2).sum()) * result.single[0]
    assert result.u_single[0] == pytest.approx(wanted, rel=1e-4)


def refused(tmp_path: Path, old: str, new: str) -> str:
    text = (MODELS / "F1.yaml").read_text()
    assert old in text
    file = tmp_path / "bad.yaml"
    file.write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        couple(file, samples=0)
    return str(caught.value).removeprefix(str(tmp_path))


def test_bad_models_are_refused(tmp_path: Path) -> None:
    assert "joint_stiffness_Nm_per_rad[1]: -5 Nm/rad is not allowed" in refused(
        tmp_path, "56946", "-5"
    )
    assert refused(tmp_path, "direction: x", "direction: [1, 1, 0]").endswith(
        "required[0].direction: direction [1.0, 1.0, 0.0] has length 1.41421; "
        "a unit vector is wanted."
    )
    assert "singular pose" in refused(tmp_path, "-62.06, 90.0,", "-62.06, 0.0,")
    assert "joint 1; ur10e allows -360 to 360 deg" in refused(tmp_path, "13.43", "1343")
    assert "robot:" in refused(tmp_path, "robot: ur10e", "robot: ur10")
    assert 'Did you mean "ur10e"?' in refused(tmp_path, "robot: ur10e", "robot: ur10")
    unreachable = refused(
        tmp_path,
        "{q_deg: [13.43, -99.84, -108.10, -62.06, 90.0, -76.57]}",
        "{position_mm: [2000, 0, 0], direction: [1, 0, 0], branch: left wrist+ elbow+}",
    )
    assert "ur10e does not reach [2000.0, 0.0, 0.0] mm" in unreachable
    short = refused(
        tmp_path,
        "robot: ur10e",
        "dh: {d_m: [1, 2], a_m: [0,0,0,0,0,0], alpha_rad: [0,0,0,0,0,0]}",
    )
    assert "dh.d_m: a list of 2 is not allowed; wanted: a list of 6 numbers in m" in short


def test_a_model_without_coupling(tmp_path: Path) -> None:
    text = (MODELS / "F1.yaml").read_text()
    file = tmp_path / "single.yaml"
    file.write_text(text[: text.index("coupling:")])
    with pytest.raises(InputError, match="no `coupling` block"):
        couple(file)


def test_arms_other_than_the_ur10e(tmp_path: Path) -> None:
    text = (MODELS / "F1.yaml").read_text().replace("robot: ur10e", "robot: ur5e")
    (tmp_path / "m.yaml").write_text(text)
    result = couple(tmp_path / "m.yaml", samples=0)
    assert result.workspaces[0].single == pytest.approx(2 / 3 * np.pi * 0.85**3)
