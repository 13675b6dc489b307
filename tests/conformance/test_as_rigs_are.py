"""Rigs as they are: bases that stand turned, tips that stick, feet that stiffen, slow amplifiers;
and what is no effect: a little more noise, a component that moves nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from identification.arm import tool_offset
from identification.gap.answer.forms import law_of, rows_of
from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.effects import load_misalignment
from identification.gap.effects.pose_error import turned
from identification.gap.evidence.compare import score
from identification.gap.laws.across_law import Shape
from identification.gap.model.bench import make_bench
from rig.diagnosis.gap_data import gap_data
from rig.models.robot import load_robot
from tests.conformance.gap_designs import (
    DESIGNS,
    TCP_MM,
    TRUE,
    Array,
    Law,
    Q,
    imported,
    levers,
    linear,
    meta,
    noisy,
)
from tests.explained import explained

MEDIUM, RICH = DESIGNS["medium"], DESIGNS["rich"]
ARM, TOOL = load_robot("ur10e"), tool_offset(np.array(TCP_MM) * 1e-3)


def about(axis: int, angle: float) -> Array:
    """Rotation matrix about a base axis."""
    i, k = (axis + 1) % 3, (axis + 2) % 3
    out, c, s = np.eye(3), np.cos(angle), np.sin(angle)
    out[i, i], out[i, k], out[k, i], out[k, k] = c, -s, s, c
    return out


def seen_turned(rows: pd.DataFrame, axis: int, angle: float) -> Array:
    """(n, 6) levers of an arm whose base stands turned against the directions of the push."""
    out = np.zeros((len(rows), 6))
    for (pose, direction), mine in rows.groupby(["pose", "direction"]).indices.items():
        n = about(axis, angle).T @ np.eye(3)["xyz".index(direction)]
        out[mine] = ARM.jacobian(np.array(Q[str(pose)]), TOOL)[:3].T @ n
    return out


@pytest.mark.parametrize("axis", range(3))
def test_columns_of_a_turned_base_are_exact_where_it_is(axis: int) -> None:
    bench = make_bench(linear("medium"))
    turn = 0.2 * np.eye(3)[axis]
    rows = pd.DataFrame(
        {"pose": "P1", "direction": [bench.data.setups[s].direction for s in bench.rows.setup]}
    )
    there, force = seen_turned(rows, axis, 0.2), bench.load[:, None]
    moved = (there**2 - bench.lever**2) @ bench.compliance * bench.load
    column = 0.2 * turned(bench, turn, bench.compliance)[axis]
    np.testing.assert_allclose(column[: bench.rows.n], moved, atol=1e-8 * np.abs(moved).max())
    q = (there - bench.lever) * bench.compliance * force
    own = bench.stacked(q=q)[bench.layout.q]
    np.testing.assert_allclose(column[bench.layout.q], own, atol=1e-8 * np.abs(own).max())


@pytest.mark.slow
def test_a_base_that_stands_turned_is_found() -> None:
    angle = 0.15

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        there, force = seen_turned(rows, 2, angle), rows["force_N"].to_numpy(float)[:, None]
        joints = there * force / TRUE
        deflection = joints - lever * force / TRUE
        return np.sum(there * joints, axis=1) - np.sum(lever * joints, axis=1), deflection

    found = diagnosed(law, RICH)
    assert [e.name for e in found.effects] == ["pose_error"]
    assert found.after < 1.1 * found.noise
    p = found.effects[0].parameters["base_turned_about_z"]
    assert p.low < angle < p.high
    assert p.value == pytest.approx(angle, abs=0.005)


def diagnosed(law: Law, design=MEDIUM, across: Array | None = None) -> GapResult:  # type: ignore[no-untyped-def]
    """across (n, 2) N: along the axes that follow the direction's."""
    table = noisy(design, law)
    for direction, others in (("x", "yz"), ("y", "zx")):
        mine = (table["direction"] == direction).to_numpy()
        for k, axis in enumerate(others if across is not None else ""):
            assert across is not None
            table.loc[mine, f"force_{axis}_N"] += across[mine, k]
    return explained(gap_data(imported(table, meta(design))))


def sticking(rows: pd.DataFrame) -> Array:
    """(n, 2) N: a tip that holds on to its pad until the load has gone back by a third of it."""
    out, held = np.zeros(len(rows)), 0.0
    top = rows.groupby("direction")["force_N"].transform("max").to_numpy()
    fresh = (
        rows[["pose", "direction", "repetition"]].shift()
        != rows[["pose", "direction", "repetition"]]
    ).any(axis=1)
    for i, force in enumerate(rows["force_N"]):
        reach = 0.15 * top[i]
        held = 0.0 if fresh.iloc[i] else held
        held = min(max(held, force - reach), force + reach)
        out[i] = held
    return np.column_stack([0.15 * out, -0.09 * out])


def askew(pulls: Callable[[pd.DataFrame], Array]) -> GapResult:
    """pulls: (n, 2) N across, of the rows; the dynamometer's components show it."""
    design = replace(MEDIUM, components=True)

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        arm = ARM.jacobian(np.array(Q["P1"]), TOOL)[:3]
        moved, pull = np.zeros((len(rows), 6)), pulls(rows)
        for direction, others in (("x", [1, 2]), ("y", [2, 0])):
            mine = (rows["direction"] == direction).to_numpy()
            moved[mine] = pull[mine] @ arm[others] / TRUE
        return np.zeros(len(rows)), moved

    return diagnosed(law, design, pulls(noisy(design)))


@pytest.mark.slow
def test_a_tip_that_sticks_as_the_load_goes_back_is_a_load_askew() -> None:
    found = askew(sticking)
    assert found.verdict == "load_misalignment"
    assert found.effects[0].label.startswith("as it was read")
    laws = [v for v in found.found.variants if v.word == found.verdict and not v.cost]
    best = max(score(found.engine, found.engine.levels, laws), key=lambda s: s.log_evidence)
    assert "dragging" in best.variant.label
    assert found.after < 1.15 * found.noise


SEATS = np.random.default_rng(3).normal(0.0, 0.05, (2, 3, 2))  # tangents per direction and run


def seated(rows: pd.DataFrame) -> Array:
    """(n, 2) N: the tip stands on another place of its pad in every run."""
    direction = rows["direction"].map({"x": 0, "y": 1}).to_numpy()
    tangent = SEATS[direction, rows["repetition"].to_numpy(int) - 1]
    return tangent * rows["force_N"].to_numpy()[:, None]


def test_a_tip_that_seats_anew_in_every_run_is_a_load_askew() -> None:
    """What the components tell of a withheld run is given, as its load is: so it is foreseen."""
    found = askew(seated)
    assert found.verdict == "load_misalignment"
    assert "each run" in found.effects[0].label
    assert found.held_out[0].fold == "repetition"
    assert found.held_out[0].after < 1.2 * found.noise
    p = found.effects[0].parameters
    for k, direction in enumerate("xy"):
        mean = np.hypot(*SEATS[k].mean(axis=0))
        seen = np.hypot(*(p[f"tangent_{direction}_{i}"].value for i in (1, 2)))
        assert seen == pytest.approx(mean, rel=0.3)
    part = found.fit.parts[0]
    law_, unit = law_of(found.bench, part.variant)
    runs = [t.shape["run"] for t in law_.terms if "run" in t.shape]
    assert runs == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    columns = found.engine.columns(part.variant.columns)
    rebuilt = rows_of(found.bench, part.word, law_) * unit
    np.testing.assert_allclose(rebuilt, columns, atol=1e-9 * np.abs(columns).max())


@pytest.mark.parametrize("components", [False, True])
def test_where_no_component_tells_it_no_run_has_an_angle_of_its_own(components: bool) -> None:
    design = replace(MEDIUM, components=components)
    bench = make_bench(gap_data(imported(noisy(design), meta(design))))
    labels = [v.label for v in load_misalignment.variants(bench)]
    assert ("each run" in labels) == components


@pytest.mark.slow
def test_a_vibration_that_the_samples_follow_is_no_noise_of_the_instruments() -> None:
    """Once in 6.3 samples, twice what is stated; white noise of the same size is none."""
    swinging = noisy(RICH)
    swinging["displacement_mm"] += 0.006 * np.sin(np.arange(len(swinging)))
    found = explained(gap_data(imported(swinging, meta(RICH))))
    assert found.verdict == "unknown"
    assert any("a vibration" in n for n in found.notes)
    rough = noisy(RICH)
    rough["displacement_mm"] += np.random.default_rng(1).normal(0, 0.0042, len(rough))
    found = explained(gap_data(imported(rough, meta(RICH))))
    assert found.verdict == "none"
    assert not any("a vibration" in n for n in found.notes)


def test_without_components_nothing_is_said_to_drag() -> None:
    labels = [
        [
            v.label
            for v in load_misalignment.variants(
                make_bench(gap_data(imported(noisy(replace(MEDIUM, components=c)), meta(MEDIUM))))
            )
        ]
        for c in (False, True)
    ]
    assert not any("dragging" in label for label in labels[0])
    assert any("dragging" in label for label in labels[1])


def test_what_drags_turns_over_its_reach_and_begins_anew_with_every_run() -> None:
    bench = make_bench(linear("medium"))
    reach = 0.1 * float(bench.load.max())
    pull = load_misalignment.across(bench, Shape(0, 50.0, reach))
    loading = (bench.rows.branch == 1) & (bench.load > 1.05 * reach)
    np.testing.assert_allclose(pull[loading], 50.0)
    first = bench.rows.starts
    assert np.all(np.abs(pull[first]) < 5.0)
    assert pull[bench.rows.branch == 2].min() == pytest.approx(-50.0)


@pytest.mark.slow
def test_feet_that_stiffen_under_a_large_moment() -> None:
    """Axes through the base; half as soft at 100 Nm."""

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        out, force = np.zeros(len(rows)), rows["force_N"].to_numpy(float)
        for (pose, direction), mine in rows.groupby(["pose", "direction"]).indices.items():
            n = np.eye(3)["xyz".index(direction)]
            arm = np.cross(ARM.fk(np.array(Q[str(pose)]), TOOL)[:3, 3], n)[:2]
            moment = arm * force[mine, None]
            out[mine] = (6e-6 * moment / (1 + np.abs(moment) / 60.0)) @ arm
        return out, np.zeros((len(rows), 6))

    found = diagnosed(law, RICH)
    assert found.verdict == "base_compliance"
    assert "on feet" in found.effects[0].label
    assert found.after < 1.1 * found.noise


def about_base(rows: pd.DataFrame, axis: Array, turns: Callable[[Array], Array]) -> Array:
    """(n,) m: what a base does that a moment (Nm) about an axis through it turns (rad)."""
    out, force = np.zeros(len(rows)), rows["force_N"].to_numpy(float)
    for (pose, direction), mine in rows.groupby(["pose", "direction"]).indices.items():
        n = np.eye(3)["xyz".index(direction)]
        arm = float(np.cross(ARM.fk(np.array(Q[str(pose)]), TOOL)[:3, 3], n) @ axis)
        out[mine] = arm * turns(arm * force[mine])
    return out


@pytest.mark.slow
def test_a_plate_that_its_bolts_let_go_of() -> None:
    """Three times as soft about y once the moment has lifted it off, at 30 Nm."""

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        def turns(m: Array) -> Array:
            return np.asarray(1e-6 * (m + 2 * np.sign(m) * np.maximum(np.abs(m) - 30.0, 0.0)))

        return about_base(rows, np.eye(3)[1], turns), np.zeros((len(rows), 6))

    found = diagnosed(law, RICH)
    assert found.verdict == "base_compliance"
    assert "on feet" in found.effects[0].label
    assert found.after < 1.1 * found.noise


@pytest.mark.slow
def test_a_base_that_slips_about_an_axis_between_those_of_the_base() -> None:
    """Of x and y, at 18 Nm, and comes back over a play of as much."""
    between = np.array([1.0, 1.0, 0.0]) / 2**0.5

    def slips(m: Array) -> Array:
        out, last = np.zeros(len(m)), 0.0
        for i, x in enumerate(m):
            last = min(max(last, x - 18.0), x + 18.0)
            out[i] = 4e-6 * last
        return out

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        return about_base(rows, between, slips), np.zeros((len(rows), 6))

    found = diagnosed(law, RICH)
    assert found.verdict == "base_slip"
    assert next(iter(found.effects[0].places)) == "axis x+y"
    assert found.effects[0].parameters["threshold"].value == pytest.approx(18.0, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_twice_the_stated_noise_is_no_effect(seed: int) -> None:
    """Of force and displacement: a lag of a third of a sample averages two readings, and a spring
    that fits exactly is as good as one with a little more of anything."""
    design = replace(DESIGNS["bench"], steps=20, hold=12)
    found = explained(gap_data(imported(noisy(design, seed=seed, noise=2.0), meta(design))))
    assert found.verdict == "none"


def test_joint_readings_that_scatter_more_are_no_structure() -> None:
    """Two samples a step: no hold tells their noise, how levels repeat does."""
    design = replace(DESIGNS["paper"], readings=True, hold=2)
    table, rng = noisy(design), np.random.default_rng(5)
    for j in range(6):
        table[f"q{j + 1}_rad"] += rng.normal(0, 1.3e-5, len(table))
    data = gap_data(imported(table, meta(design)))
    assert explained(data).verdict == "none"
    np.testing.assert_allclose(make_bench(data).noise.q, np.hypot(1e-5, 1.3e-5), rtol=0.3)


def test_a_component_that_moves_nothing_is_no_effect() -> None:
    """Half a per cent of the push across, which only the dynamometer feels."""
    design = replace(RICH, components=True)
    across = np.column_stack([noisy(design)["force_N"] * s for s in (0.008, -0.008)])
    data: GapData = gap_data(imported(noisy(design), meta(design)))
    assert data.tangential is not None
    found = diagnosed(
        lambda rows, _: (np.zeros(len(rows)), np.zeros((len(rows), 6))), design, across
    )
    assert found.verdict == "none"


def test_levers_are_those_of_the_arm() -> None:
    rows = noisy(MEDIUM)
    np.testing.assert_allclose(seen_turned(rows, 2, 0.0), levers(rows), atol=1e-12)
