"""Notes of `rig import` on what may be a slip, and what comes of such tables."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from identification.gap.recording.holds import hold_ids, is_continuous
from identification.stiffness import analyze_curve
from rig.analysis.analyze import analyze
from rig.dataset import Dataset
from rig.diagnosis.diagnose import diagnose
from rig.diagnosis.gap_data import gap_data
from rig.reduce import curves
from tests.conformance.gap_designs import DESIGNS, imported, meta, noisy

RICH, MEDIUM, BENCH = (DESIGNS[n] for n in ("rich", "medium", "bench"))


def notes(dataset: Dataset) -> list[str]:
    return [e["text"] for e in dataset.events if e["kind"] == "note"]


@pytest.mark.parametrize("name", DESIGNS)
def test_nothing_is_said_of_what_is_right(name: str) -> None:
    design = DESIGNS[name]
    assert notes(imported(noisy(design), meta(design))) == []


# ------------------------------------------------------------------ units and signs


@pytest.mark.parametrize("name", ["medium", "bench"])
def test_a_displacement_in_micrometres_is_told_at_import_and_beside_k(name: str) -> None:
    design = DESIGNS[name]
    rows = noisy(design)
    rows["displacement_mm"] *= 1000
    dataset = imported(rows, meta(design))
    said = notes(dataset)
    assert len(said) == len(curves(dataset))
    for note in said:
        assert "Are these displacements in um or forces in kN? Check the units of force_N" in note
    minded = analyze(dataset).notes
    assert [f"{note}." for note in said] == [m for m in minded if "META's simulation says" in m]


@pytest.mark.parametrize("name", ["medium", "bench"])
def test_a_sign_that_is_turned_is_told_with_what_to_do(name: str) -> None:
    design = DESIGNS[name]
    rows = noisy(design)
    rows["displacement_mm"] *= -1
    dataset = imported(rows, meta(design))
    turned = [
        note for note in notes(dataset) if "displacement_mm falls while force_N rises" in note
    ]
    assert len(turned) == len(curves(dataset))
    assert all(note.endswith("turn the sign of the one that does not") for note in turned)
    for direction in analyze(dataset).directions.values():
        assert direction.result.sentence == (
            "The displacement falls while the force rises: k is negative. Unless what was loaded "
            "gave way there, one of the two has the wrong sign: turn the one that does not count "
            "along the direction."
        )


# ------------------------------------------------------------------ channels with a column missing


def test_a_missing_joint_is_named_and_nobody_says_that_nothing_was_recorded() -> None:
    rows = noisy(MEDIUM).drop(columns="q6_rad")
    dataset = imported(rows, meta(MEDIUM))
    said = "q6_rad is missing: the joint readings that are there are not used"
    assert notes(dataset) == [said]
    found = " ".join(diagnose(dataset).result.notes)
    assert f"{said}." in found
    assert "No joint readings to go by: joints, links and base look alike." in found
    assert "recorded" not in found


def test_missing_components_are_named_too() -> None:
    rows = noisy(BENCH).drop(columns=["force_x_N", "force_z_N"])
    said = "force_x_N, force_z_N are missing: the force components that are there are not used"
    dataset = imported(rows, meta(BENCH))
    assert notes(dataset) == [said]
    assert f"{said}." in gap_data(dataset).notes


def test_a_rig_without_an_arm_misses_no_joint() -> None:
    rows = noisy(BENCH)
    rows["q1_rad"] = 0.1
    assert notes(imported(rows, meta(BENCH))) == []


# ------------------------------------------------------------------ clocks


def test_clocks_that_do_not_go_alike_are_told() -> None:
    rows = noisy(BENCH)
    rows["time_s"] *= 1000  # milliseconds
    said = "time_s goes 1000 times as fast as session_s: both are in seconds."
    assert notes(imported(rows, meta(BENCH))) == [f"{said} Check the unit of the two"]


# ------------------------------------------------------------------ empty steps


def held(dataset: Dataset) -> bool:
    data = gap_data(dataset)
    same = all(c.held for c in curves(dataset).values())
    assert is_continuous(data, hold_ids(data)) is not same
    return same


def test_an_empty_step_costs_its_sample_and_no_level() -> None:
    rows = noisy(BENCH).astype({"step": "Int64"})
    rows.loc[rows.index[16], "step"] = pd.NA
    dataset = imported(rows, meta(BENCH))
    assert notes(dataset) == [
        "step is empty in 1 sample of held runs, first in sample 17: left out, as on the way from "
        "level to level"
    ]
    assert held(dataset)
    data = gap_data(dataset)
    assert len(data.force) == len(rows) - 1
    assert "1 sample of held runs without a step: set aside." in data.aside
    (curve,) = curves(dataset).values()
    assert "1 sample of held runs without a step: left out." in curve.notes
    whole, k = (
        analyze_curve(c).k for c in (*curves(imported(noisy(BENCH), meta(BENCH))).values(), curve)
    )
    assert whole is not None
    assert k is not None
    assert k.value == pytest.approx(whole.value, rel=1e-3)


@pytest.mark.parametrize("every", [1, 3])
def test_no_load_needs_no_step(every: int) -> None:
    rows = noisy(BENCH).astype({"step": "Int64"})
    whole = gap_data(imported(rows, meta(BENCH)))
    rows.loc[rows.index[rows.branch == "zero"][::every], "step"] = pd.NA
    dataset = imported(rows, meta(BENCH))
    assert notes(dataset) == []
    assert held(dataset)
    np.testing.assert_array_equal(gap_data(dataset).step, whole.step)


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_a_run_that_lacks_many_steps_is_a_running_recording(share: float) -> None:
    rows = noisy(BENCH).astype({"step": "Int64"})
    rows.loc[rows.index % 10 < 10 * share, "step"] = pd.NA
    dataset = imported(rows, meta(BENCH))
    assert notes(dataset) == []
    assert len(gap_data(dataset).force) == len(rows)


# ------------------------------------------------------------------ force and its components


@pytest.mark.parametrize("factor", [1.2, -1.0, 0.0])
def test_a_force_that_is_not_its_components(factor: float) -> None:
    rows = noisy(RICH)
    rows.loc[rows.direction == "y", "force_N"] *= factor
    said, *turned = notes(imported(rows, meta(RICH)))
    assert all("falls while force_N rises" in note for note in turned)
    assert bool(turned) == (factor < 0)
    shown = {1.2: "1.2", -1.0: "-1", 0.0: "0"}[factor]
    assert said == (
        f"direction y: force_N is {shown} times what force_x_N, force_y_N and force_z_N are along "
        "it (expected: 1 within 5 %); force_N counts. Check its gain, and the direction in META"
    )


def test_components_without_any_force_along_the_direction_have_no_ratio() -> None:
    rows = noisy(RICH)
    y = rows.direction == "y"
    rows.loc[y, ["force_x_N", "force_y_N"]] = rows.loc[y, ["force_y_N", "force_x_N"]].to_numpy()
    (said,) = notes(imported(rows, meta(RICH)))
    assert said.startswith("direction y: force_x_N, force_y_N and force_z_N have no force along it")


def test_a_push_that_is_a_little_askew_is_none() -> None:
    rows = noisy(RICH)
    along = rows.direction == "x"
    rows.loc[along, "force_x_N"] *= np.cos(np.radians(15))
    rows.loc[along, "force_y_N"] += np.sin(np.radians(15)) * rows.force_N[along]
    rows["force_N"] += 40.0  # tared elsewhere
    assert notes(imported(rows, meta(RICH))) == []


# ------------------------------------------------------------------ branches

EXCHANGED = (
    "the force falls, and what it moves goes back, along samples labelled loading, or both go up "
    "along those labelled unloading: are the two exchanged? The stiffness is that of loading"
)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("name", ["rich", "medium", "bench", "bench levels imposed"])
def test_labels_that_are_exchanged(name: str, sign: int) -> None:
    design = DESIGNS[name]
    rows = noisy(design)
    for column in rows.columns:
        if column.startswith(("force", "displacement")):
            rows[column] *= sign
    assert notes(imported(rows, meta(design))) == []
    rows["branch"] = rows.branch.replace({"loading": "unloading", "unloading": "loading"})
    (said,) = notes(imported(rows, meta(design)))
    runs = len(rows.groupby([c for c in ("pose", "direction", "repetition") if c in rows]))
    assert said == f"in {runs} of {runs} runs {EXCHANGED}"


def stroke(moved: np.ndarray, force: np.ndarray, branch: np.ndarray) -> Dataset:  # type: ignore[type-arg]
    rows = pd.DataFrame({"branch": branch, "force_N": force, "displacement_mm": moved})
    return imported(rows, meta(BENCH))


def test_running_strokes_are_read_in_parts() -> None:
    moved = np.concatenate([np.linspace(0, 1, 200), np.linspace(1, 0, 200)])
    branch = np.repeat(["loading", "unloading"], 200)
    assert notes(stroke(moved, 95 * moved, branch)) == []
    assert notes(stroke(moved, 95 * moved, branch[::-1])) == [f"in 1 of 1 run {EXCHANGED}"]


def test_a_force_that_falls_while_the_stroke_goes_on_is_no_exchange() -> None:
    """Softening, slip, relaxation; and cycles through zero, in which rising counts as loading."""
    moved = np.linspace(0, 1, 400)
    loading = np.repeat("loading", 400)
    assert notes(stroke(moved, 95 * np.sqrt(moved) * np.exp(-4 * moved), loading)) == []
    moved = np.sin(np.linspace(0, 6 * np.pi, 600))
    rising = np.where(np.gradient(moved) > 0, "loading", "unloading")
    assert notes(stroke(moved, 95 * moved, rising)) == []
