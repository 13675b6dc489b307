"""Stiffness maps and placements against the same quantities computed pose by pose."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from identification.arm import along
from identification.coupling import base_distance, coupled, mirror_axes
from identification.inverse import BRANCHES
from identification.maps import (
    LEAST_SINGULAR,
    Coupling,
    Need,
    Stance,
    Task,
    best_placement,
    branch_of,
    branches_at,
    stiffness_map,
)
from rig.coupling.couple import couple
from rig.coupling.coupling_figures import draw, maps, marks_of_notes, stiffness
from rig.coupling.coupling_task import best_for, between_arms_deg
from rig.errors import InputError
from rig.models.model import ArmModel, load_model
from rig.models.robot import MODELS

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def f1() -> ArmModel:
    return load_model(MODELS / "F1.yaml")


@pytest.fixture(scope="module")
def f2() -> ArmModel:
    return load_model(MODELS / "F2.yaml")


def test_a_cell_is_the_pose_that_stands_there(f1: ArmModel) -> None:
    """The reference pose comes back from its place, with its stiffness, single and coupled."""
    place = f1.arm.fk(f1.q)[:3, 3]
    branch = branch_of(f1.arm, f1.q)
    stance = Stance(f1.arm.fk(f1.q)[:3, 2], f1.tool, branch=branch)
    one = stiffness_map(f1.arm, place, stance, [0, 1, 0])
    assert one.stiffness == pytest.approx(57.42e3, rel=1e-3)
    assert BRANCHES[int(one.branch)] == branch
    np.testing.assert_allclose(one.q[:5], f1.q[:5], atol=1e-9)
    pair = stiffness_map(f1.arm, place, stance, [0, 1, 0], Coupling(0.0))
    assert pair.stiffness == pytest.approx(140.1e3, rel=5e-3)
    point = stiffness_map(f1.arm, place, stance, [0, 1, 0], Coupling(0.0, "point"))
    assert point.stiffness == pytest.approx(117.6e3, rel=5e-3)


def test_every_cell_is_reached_and_the_stiffest(f1: ArmModel) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform([-1.2, -1.2, -0.3], [1.2, 1.2, 1.2], (4, 60, 3))
    stance = Stance(DOWN, f1.tool, turn=0.4)
    cells = stiffness_map(f1.arm, points, stance, [0.6, 0.0, 0.8])
    reached = np.isfinite(cells.stiffness)
    assert 0.2 < reached.mean() < 0.9
    assert (cells.branch[~reached] == -1).all()
    T = f1.arm.fk(cells.q[reached])
    np.testing.assert_allclose(T[:, :3, 3], points[reached], atol=1e-9)
    np.testing.assert_allclose(T[:, :3, 2], np.tile(DOWN, (len(T), 1)), atol=1e-9)
    C = f1.arm.compliance(cells.q[reached])
    np.testing.assert_allclose(cells.stiffness[reached], along(C, [0.6, 0, 0.8]), rtol=1e-9)
    singular = np.linalg.svd(f1.arm.jacobian(cells.q[reached]), compute_uv=False)[:, -1]
    assert (singular >= LEAST_SINGULAR).all()
    for name in BRANCHES:
        other = stiffness_map(
            f1.arm, points, Stance(DOWN, f1.tool, 0.4, name), [0.6, 0, 0.8]
        ).stiffness
        assert (np.nan_to_num(other) <= np.nan_to_num(cells.stiffness) * (1 + 1e-12)).all()
        same = BRANCHES.index(name) == cells.branch
        np.testing.assert_array_equal(other[same], cells.stiffness[same])


def test_bending_links_and_a_soft_stand_count(f1: ArmModel) -> None:
    place = f1.arm.fk(f1.q)[:3, 3]
    mounting = np.diag([0, 0, 0, 1e-6, 1e-6, 1e-6])
    stiff = stiffness_map(f1.arm, place, Stance(DOWN, f1.tool), [1, 0, 0]).stiffness
    for stance in (
        Stance(DOWN, f1.tool, links=f1.arm.links),
        Stance(DOWN, f1.tool, mounting=mounting),
    ):
        assert stiffness_map(f1.arm, place, stance, [1, 0, 0]).stiffness < 0.999 * stiff


def test_joint_limits_close_cells(f1: ArmModel) -> None:
    from dataclasses import replace

    low = np.array(f1.arm.q_min)
    low[2] = 0.0  # elbow+ only
    arm = replace(f1.arm, q_min=low)
    found = branches_at(arm, f1.arm.fk(f1.q)[None, :3, 3], Stance(DOWN, f1.tool))[0]
    assert np.isfinite(found[0::2, 0]).any()
    assert np.isnan(found[1::2]).all()


def test_bad_maps_are_refused(f1: ArmModel) -> None:
    with pytest.raises(ValueError, match=r"length 1\.41421"):
        Stance(np.array([1.0, 1, 0]), f1.tool)
    with pytest.raises(ValueError, match='"elbow" is no branch; allowed: left wrist'):
        Stance(DOWN, f1.tool, branch="elbow")
    with pytest.raises(ValueError, match=r"have shape \(2,\)"):
        stiffness_map(f1.arm, [0, 1], Stance(DOWN, f1.tool), [1, 0, 0])
    with pytest.raises(ValueError, match="joint 6 is free"):
        branch_of(f1.arm, np.array([0.3, -1.0, 1.2, 0.4, 0.0, 0.2]))
    with pytest.raises(ValueError, match="at least one direction"):
        Task(0.4, Stance(DOWN, f1.tool), ())
    with pytest.raises(ValueError, match="above 0 N/m"):
        Need(DOWN, 0.0)


# --- placement -----------------------------------------------------------------------------------


@pytest.mark.parametrize("axes", ["mirror", "base"])
def test_no_placement_of_the_grid_is_better(f1: ArmModel, axes: str) -> None:
    needs = (Need(np.array([1.0, 0, 0]), 300e3), Need(np.array([0, 0.6, 0.8]), 200e3))
    task = Task(0.4, Stance(DOWN, f1.tool), needs, load_axes=axes)  # type: ignore[arg-type]
    distances, betas = np.linspace(1.0, 2.0, 7), np.deg2rad(np.linspace(-40, 40, 7))
    best = best_placement(f1.arm, task, distances, betas)
    assert best.margin > np.nanmax(best.margins)  # the neighbourhood is searched too
    # what it says is so, computed anew from the pose
    assert branch_of(f1.arm, best.q) == best.branch
    node = f1.arm.fk(best.q, f1.tool)
    np.testing.assert_allclose(node[1:3, 3], [0, 0.4], atol=1e-9)
    assert base_distance(node[:3, 3], best.beta) == pytest.approx(best.base_distance)
    load = mirror_axes(best.beta) if axes == "mirror" else np.eye(3)
    pair = coupled(f1.arm.compliance(best.q, f1.tool), best.beta)
    k = [float(along(pair, load @ need.direction)) for need in needs]
    np.testing.assert_allclose(best.stiffness, k, rtol=1e-9)
    assert best.margin == pytest.approx(min(k[0] / 300e3, k[1] / 200e3))
    assert best.feasible == (best.margin >= 1)


def test_placements_out_of_reach(f1: ArmModel) -> None:
    task = Task(0.4, Stance(DOWN, f1.tool), (Need(np.array([1.0, 0, 0]), 1e5),))
    with pytest.raises(ValueError, match=r"reaches the node at 0\.4 m in none"):
        best_placement(f1.arm, task, [3.0], [0.0])
    with pytest.raises(ValueError, match="above 0 m"):
        best_placement(f1.arm, task, [0.0], [0.0])


def test_the_modelled_place_is_among_them(f2: ArmModel) -> None:
    """At the model's own distance and angle the grid gives the model's own stiffness."""
    result = best_for(MODELS / "F2.yaml")
    there = best_placement(f2.arm, result.task, [1.2058], [np.deg2rad(36.5)])
    k = {n.name: v for n, v in zip(f2.required, result.best.stiffness / 1e3, strict=True)}
    assert result.as_modelled == pytest.approx(212 / 150, rel=5e-3)
    assert result.as_modelled * (1 - 1e-3) <= there.margin <= result.best.margin
    assert set(k) == {"x", "y"}


def test_best_for_a_model(tmp_path: Path) -> None:
    result = best_for(MODELS / "F1.yaml")
    out = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert out["feasible"] is True
    assert out["margin"] > out["margin_as_modelled"] == pytest.approx(140.1 / 150, rel=5e-3)
    text = result.to_text()
    assert "as modelled (beta = 0 deg): 0.93" in text
    assert "150 N/mm required" in text
    assert "Links are taken as rigid" in text
    assert between_arms_deg(np.deg2rad(-36.5)) == pytest.approx(107)
    text = (MODELS / "F1.yaml").read_text()
    upright = text.replace("[13.43, -99.84, -108.10, -62.06, 90.0,", "[0, -88, 5, -92, 85,")
    assert upright != text
    (tmp_path / "m.yaml").write_text(upright)
    with pytest.raises(InputError, match=r"in none of the placements.*Move the node nearer\."):
        best_for(tmp_path / "m.yaml")
    (tmp_path / "m.yaml").write_text(text[: text.index("required:")])
    with pytest.raises(InputError, match="needs `coupling`"):
        best_for(tmp_path / "m.yaml")


def test_the_task_is_the_models(tmp_path: Path) -> None:
    """Tool tilted, beside the flange, and off the base x axis: turned about axis 1 onto that axis,
    the model's own pose is one of those that the task is searched in."""
    text = (MODELS / "F1.yaml").read_text()
    for old, new in (
        ("[13.43, -99.84, -108.10, -62.06, 90.0,", "[53.43, -99.84, -108.10, -62.06, 70.0,"),
        ("length_mm: 0", "flange_T_tcp: [[1,0,0,0.08],[0,1,0,0.03],[0,0,1,0.1],[0,0,0,1]]"),
    ):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "m.yaml").write_text(text)
    model = load_model(tmp_path / "m.yaml")
    node = model.arm.fk(model.q, model.tool)[:3, 3]
    azimuth = np.arctan2(node[1], node[0])
    result = best_for(tmp_path / "m.yaml")
    straight = np.array([[np.hypot(node[0], node[1]), 0, node[2]]])
    found = branches_at(model.arm, straight, result.task.stance)[0]
    own = model.q - azimuth * np.eye(6)[0]
    gap = np.abs((found - own + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)
    assert np.nanmin(gap) < 1e-9
    words = f"{np.rad2deg(azimuth):.1f} deg to the base x axis"
    assert any(words in note for note in result.notes)


# --- figures -------------------------------------------------------------------------------------


def test_figures(tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text(
        "time_s,direction_x,direction_y,direction_z,required_N_per_mm\n0,1,0,0,50\n1,1,0,0,150\n"
    )
    track = tmp_path / "path.csv"
    result = couple(MODELS / "F1.yaml", samples=0, path=track, best_placement=True)
    written = draw(result, tmp_path / "figs")
    assert {p.name for p in written} == {
        f"{name}.{kind}"
        for name in ("stiffness", "map", "schedule", "placement")
        for kind in ("png", "svg")
    }
    assert all(p.stat().st_size > 3000 for p in written)
    axes = stiffness(result).axes[0]
    told = [t.get_text() for t in axes.texts]
    for shown in ("95.9", "57.4", "212.0", "2950", "339.5", "140.0", "337.1", "117.6"):
        assert shown in told
    assert not axes.patches  # bars of a logarithmic axis begin nowhere
    assert "standard uncertainty" in axes.get_ylabel()
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="can't be written there"):
        draw(result, tmp_path / "file")


def test_the_two_maps_have_one_scale_beside_them() -> None:
    figure = maps(couple(MODELS / "F2.yaml", samples=0))
    figure.canvas.draw()
    left, right = figure.axes
    norms = [axes.collections[0].norm for axes in (left, right)]
    assert norms[0] is norms[1]
    assert not left.child_axes
    (scale,) = right.child_axes
    ends = scale.yaxis.get_majorticklocs()[[0, -1]]
    assert ends == pytest.approx([norms[0].vmin, norms[0].vmax])
    assert len(scale.yaxis.get_majorticklocs()) > 4
    seen, map_ = scale.get_window_extent(), right.get_window_extent()
    assert (seen.y0, seen.y1) == pytest.approx((map_.y0, map_.y1))  # as high as the map
    assert scale.get_tightbbox().x1 < figure.bbox.x1
    for axes in (left, right):
        assert axes.title.get_window_extent().y1 < figure.bbox.y1
    assert figure.bbox.height - left.get_tightbbox().height < 0.15 * figure.bbox.height


def test_emulated_models_are_marked(tmp_path: Path) -> None:
    text = (MODELS / "F1.yaml").read_text().replace('note: "', 'note: "EMULATED: simulated. ')
    (tmp_path / "m.yaml").write_text(text)
    figure = stiffness(couple(tmp_path / "m.yaml", samples=0))
    assert "EMULATED" in [t.get_text() for t in figure.texts]
    assert marks_of_notes(["nothing", "INCOMPLETE: stopped"]) == ["INCOMPLETE"]
    plain = stiffness(couple(MODELS / "F1.yaml", samples=0))
    assert "EMULATED" not in [t.get_text() for t in plain.texts]


def test_an_arm_without_closed_form_has_no_map(tmp_path: Path) -> None:
    text = (
        (MODELS / "F1.yaml")
        .read_text()
        .replace(
            "robot: ur10e",
            "dh: {d_m: [0.18, 0.01, 0, 0.17, 0.12, 0.12], a_m: [0, -0.61, -0.57, 0, 0, 0], "
            "alpha_rad: [1.5708, 0, 0, 1.5708, -1.5708, 0]}",
        )
    )
    (tmp_path / "m.yaml").write_text(text)
    written = draw(couple(tmp_path / "m.yaml", samples=1000), tmp_path)
    assert {p.stem for p in written} == {"stiffness"}
    with pytest.raises(InputError, match="built like the UR"):
        best_for(tmp_path / "m.yaml")
