"""A model's links and mounting are part of the simulation that a diagnosis is made against."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from identification.arm import along, tool_offset
from identification.gap.answer.designs import planned, present_design
from identification.gap.model.bench import make_bench
from rig.dataset import Dataset
from rig.diagnosis.diagnose import Diagnosis, diagnose
from rig.diagnosis.gap_data import gap_data
from rig.diagnosis.gap_model import write_model
from rig.diagnosis.other_setups import elsewhere
from rig.errors import InputError
from rig.models.model import load_model
from rig.models.simulate import simulate, write_csv
from tests.conformance.gap_designs import DESIGNS, STATED, TCP_MM, Array, Q, imported, meta, noisy

PROTOCOLS = Path(__file__).parents[2] / "protocols"
MODEL = f"""robot: ur10e
pose: {{q_rad: {Q["P1"]}}}
tool: {{length_mm: 100}}
joint_stiffness_Nm_per_rad: {STATED.tolist()}
joint_stiffness_relative_sd: 0.1
mounting: {{tilt_Nm_per_rad: 50000, turn_Nm_per_rad: 80000}}
link_segments:
  - {{name: upper arm, frame: 2, from_m: [0, 0, 0.15], to_m: [-0.6, 0, 0.15],
     tube: {{material: aluminium, diameter_mm: 80, wall_mm: 4}}}}
"""


def model(folder: Path, text: str = MODEL) -> Path:
    path = folder / "model.yaml"
    path.write_text(text)
    return path


def outside(folder: Path) -> dict[str, float]:
    """Direction -> m/N of links and mounting in the pose of the design, from the whole arm."""
    read = load_model(model(folder))
    tool = tool_offset(np.array(TCP_MM) * 1e-3)
    q = np.array(Q["P1"])
    whole = read.arm.compliance(q, tool, links=read.links, base=read.mounting)
    springs = read.arm.compliance(q, tool)
    return {
        d: float(1 / along(whole, n) - 1 / along(springs, n))
        for d, n in zip("xyz", np.eye(3), strict=True)
    }


@cache
def measured(folder: Path) -> Dataset:
    """An arm with those links, on that mounting."""
    gives = outside(folder)

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        each = np.array([gives[d] for d in rows.direction])
        return each * rows.force_N.to_numpy(float), np.zeros(lever.shape)

    return imported(noisy(DESIGNS["medium"], law), meta(DESIGNS["medium"]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("outside")


@pytest.fixture(scope="module")
def found(folder: Path) -> Diagnosis:
    return diagnose(measured(folder), model=model(folder))


def test_what_the_model_has_is_no_gap(folder: Path, found: Diagnosis) -> None:
    assert min(outside(folder)[d] for d in "xy") > 2e-6
    assert found.result.verdict == "none"
    assert "The simulation has the model's `link_segments` and `mounting`" in found.to_text()
    alone = MODEL[: MODEL.index("mounting")]
    without = diagnose(measured(folder), model=model(folder, alone))
    assert without.result.verdict != "none"
    assert without.result.before > 3 * found.result.before
    assert "`mounting`" not in without.to_text()


@pytest.mark.slow
def test_a_model_and_its_curves_are_one_simulation(folder: Path, found: Diagnosis) -> None:
    text = (PROTOCOLS / "paper_xy.yaml").read_text("utf-8")
    pose = text[text.index("poses:") : text.index("joint_encoder:")]
    here = f"poses:\n  P1: {{q_rad: {Q['P1']}, tcp_xyz_mm: {TCP_MM}}}\n"
    (folder / "p.yaml").write_text(text.replace(pose, here))
    write_csv(simulate(model(folder), folder / "p.yaml"), folder / "curves.csv")
    curves = diagnose(measured(folder), simulation=folder / "curves.csv")
    assert curves.result.verdict == "none"
    assert curves.result.before == pytest.approx(found.result.before, rel=1e-3)
    with pytest.raises(InputError, match="each says what was simulated"):
        diagnose(measured(folder), model=model(folder), simulation=folder / "curves.csv")


def test_a_corrected_model_keeps_them(folder: Path, found: Diagnosis) -> None:
    write_model(found, measured(folder), folder / "better.yaml")
    before, after = load_model(model(folder)), load_model(folder / "better.yaml")
    assert before.mounting is not None
    assert after.mounting is not None
    np.testing.assert_allclose(after.mounting, before.mounting)
    assert after.links == before.links


def test_a_corrected_model_says_what_it_was_made_from(folder: Path, found: Diagnosis) -> None:
    assert found.model is not None
    given = replace(found, model=replace(found.model, note="Identified from data set a."))
    write_model(given, measured(folder), folder / "better.yaml")
    assert "Given: Identified from data set a." in load_model(folder / "better.yaml").note


def test_what_is_planned_next_has_them_too(folder: Path) -> None:
    read = load_model(model(folder))
    data = gap_data(measured(folder), read)
    assert data.setups[0].outside == pytest.approx(outside(folder)["x"], rel=1e-9)
    assert all(s.outside > 0 for e in elsewhere(measured(folder), read) for s in e.setups)
    bench = make_bench(data)
    there = make_bench(planned(present_design(bench), bench))
    line = there.slope * there.load
    np.testing.assert_allclose(there.response, line, atol=1e-9 * np.abs(line).max())
