"""What a table and its META can't both say, in which words, and what they may well say."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rig.analysis.identify import identify
from rig.contradictions import contradictions
from rig.dataset import write
from rig.diagnosis.diagnose import diagnose
from rig.diagnosis.gap_data import gap_data
from rig.errors import InputError
from rig.meta import Meta
from rig.yaml.yamlfile import load_yaml_text
from tests.conformance.gap_designs import DESIGNS, imported, meta, noisy

ARM, BENCH = DESIGNS["medium"], DESIGNS["bench"]
READINGS = [f"q{j}_rad" for j in range(1, 7)]


def refused(rows: pd.DataFrame, text: str) -> str:
    with pytest.raises(InputError) as told:
        imported(rows, text)
    return re.sub(r"^\S*/", "", str(told.value))


def arm() -> pd.DataFrame:
    return noisy(ARM)


# ------------------------------------------------------------------ poses


def test_degrees_are_no_radians() -> None:
    rows = arm()
    rows[READINGS] = np.degrees(rows[READINGS])
    said = refused(rows, meta(ARM))
    assert said.startswith(
        "meta.yaml:3:15: poses.P1.q_rad: the joints were read elsewhere in pose P1, by the median "
        "of the columns: q1_rad is 14.7 rad (META: 0.256 rad), q2_rad is -95.3 rad (META: "
        "-1.664 rad), "
    )
    assert said.endswith(
        "; allowed: up to 0.5 rad beside META, whole turns aside. "
        "Are these degrees? Convert the columns to rad."
    )


def test_signs_and_columns_that_were_taken_for_others() -> None:
    rows = arm()
    rows[READINGS] = -rows[READINGS]
    assert refused(rows, meta(ARM)).endswith("Are the signs of these columns turned? Correct them.")
    rows = arm().rename(columns={"q1_rad": "q2_rad", "q2_rad": "q1_rad"})
    assert refused(rows, meta(ARM)).endswith(
        "Are columns mixed up (q1_rad is as META has joint 2, q2_rad is as META has joint 1)? "
        "Rename them."
    )
    rows = arm()
    rows["q4_rad"] = 0.7
    assert refused(rows, meta(ARM)).endswith(
        "by the median of the columns: q4_rad is 0.7 rad (META: -1.365 rad); allowed: up to "
        "0.5 rad beside META, whole turns aside. Correct the pose in META, or the columns."
    )


def test_an_arm_may_stand_elsewhere_by_a_little_and_be_turned_right_round() -> None:
    rows, text = arm(), meta(ARM)
    elsewhere = rows.copy()
    elsewhere["q2_rad"] += 0.3
    assert gap_data(imported(elsewhere, text)).q is not None
    turned, plain = rows.copy(), gap_data(imported(rows, text)).q
    turned["q6_rad"] += 2 * np.pi
    np.testing.assert_allclose(gap_data(imported(turned, text)).q, plain, rtol=0, atol=1e-14)


def test_a_jump_in_a_few_readings_is_no_other_pose() -> None:
    rows = arm()
    rows.loc[rows.index[:20], "q3_rad"] = 57.0
    assert imported(rows, meta(ARM)).rows == len(rows)


# ------------------------------------------------------------------ numbers of META


@pytest.mark.parametrize(
    ("stated", "instead", "place", "wanted"),
    [
        (
            "standard_uncertainty_N: 0.05",
            "standard_uncertainty_N: 1e-9",
            "instruments.force.standard_uncertainty_N: 1e-09 N is not allowed",
            r"goes up to 200\.\d N, .* wanted: 2\.\d+e-05 N or more",
        ),
        (
            "standard_uncertainty_mm: 0.002",
            "standard_uncertainty_mm: 1e-300",
            "instruments.displacement.standard_uncertainty_mm: 1e-300 mm is not allowed",
            r"wanted: 2\.\d+e-11 mm or more",
        ),
        (
            "{x: 95.0}",
            "{x: 1e-30}",
            "simulation.stiffness_N_per_mm.x: 1e-30 N/mm is not allowed",
            "wanted: within a factor of 10000 of the slope that was measured",
        ),
        (
            "{x: 95.0}",
            "{x: 95e7}",
            "simulation.stiffness_N_per_mm.x: 9.5e+08 N/mm is not allowed",
            r"the readings cover 200\.\d N \(up to 200\.\d N\) over 2\.\d+ mm, of which one ",
        ),
    ],
)
def test_numbers_that_no_rig_has(stated: str, instead: str, place: str, wanted: str) -> None:
    said = refused(noisy(BENCH), meta(BENCH).replace(stated, instead))
    assert re.match(rf"meta\.yaml:\d+:\d+: {re.escape(place)}", said)
    assert re.search(wanted, said)


def test_a_joint_that_no_arm_has() -> None:
    said = refused(arm(), meta(ARM).replace("[37000.0,", "[1e-2,"))
    assert (
        ": simulation.joint_stiffness_Nm_per_rad[0]: 0.01 Nm/rad is not allowed: joint 1 " in said
    )
    assert "of a ur10e has about 60000 Nm/rad; wanted: within a factor of 10000 of that." in said


def test_small_forces_are_as_good_as_others() -> None:
    rows, tiny = noisy(BENCH), 1e-10
    for column in rows.columns:
        if column.startswith(("force", "displacement")):
            rows[column] *= tiny
    text = meta(BENCH)
    for u in ("0.05", "0.002"):
        text = text.replace(f": {u},", f": {float(u) * tiny!r},")
    assert diagnose(imported(rows, text)).result.verdict == "none"


def test_a_drift_without_a_load_has_no_slope() -> None:
    """However stiff the rig: what moves there is no deflection."""
    rows, rng = noisy(BENCH), np.random.default_rng(1)
    rows["force_N"] = rng.normal(0, 0.05, len(rows))
    rows["displacement_mm"] = np.linspace(0, 1, len(rows))
    assert imported(rows, meta(BENCH).replace("{x: 95.0}", "{x: 1e7}")).rows == len(rows)


@pytest.mark.parametrize(("column", "value"), [("displacement_mm", 0.0), ("force_N", 7.0)])
def test_a_channel_that_stands_still_leaves_no_room_for_any_number(
    column: str, value: float
) -> None:
    rows = noisy(BENCH)
    rows[column] = value
    diagnose(imported(rows, meta(BENCH).replace("{x: 95.0}", "{x: 1e-5}")))
    assert "simulation.stiffness_N_per_mm.x" in refused(
        rows, meta(BENCH).replace("{x: 95.0}", "{x: 1e-30}")
    )
    least = "_N: 1e-9" if value else "_mm: 1e-30"
    stated = "_N: 0.05" if value else "_mm: 0.002"
    assert "is not allowed" in refused(rows, meta(BENCH).replace(stated, least))


JUST_ALLOWED = [
    ("bench", "standard_uncertainty_N: 0.05", "standard_uncertainty_N: 4.1e-5"),
    ("bench", "standard_uncertainty_mm: 0.002", "standard_uncertainty_mm: 5e-11"),
    ("bench", "{x: 95.0}", "{x: 9e5}"),
    ("bench", "{x: 95.0}", "{x: 1e-2}"),
]


@pytest.mark.parametrize(
    ("name", "stated", "instead"),
    [
        *JUST_ALLOWED,
        ("bench imposed", "standard_uncertainty_N: 0.05", "standard_uncertainty_N: 4.1e-5"),
        *(
            pytest.param("bench imposed", *numbers, marks=pytest.mark.slow)
            for _, *numbers in JUST_ALLOWED[1:]
        ),
    ],
)
def test_what_is_just_allowed_is_diagnosed(name: str, stated: str, instead: str) -> None:
    design = DESIGNS[name]
    found = diagnose(imported(noisy(design), meta(design).replace(stated, instead)))
    assert sum(found.result.probabilities.values()) == pytest.approx(1.0)  # no NaN


# ------------------------------------------------------------------ data sets that were written


def test_data_sets_that_exist_are_refused_before_anything_is_computed(tmp_path: Path) -> None:
    dataset = imported(arm(), meta(ARM))
    columns = dataset.columns | {n: np.degrees(dataset.columns[n]) for n in READINGS}
    path = tmp_path / "old.h5"
    write(replace(dataset, columns=columns), path)
    start = re.escape(f"{path}: META: poses.P1.q_rad: the joints were read elsewhere in pose P1")
    with pytest.raises(InputError, match=start):
        identify([path])
    with pytest.raises(InputError, match="Are these degrees"):
        diagnose(replace(dataset, columns=columns))


def test_discarded_samples_contradict_nothing() -> None:
    dataset = imported(arm(), meta(ARM))
    bad = np.arange(dataset.rows) % 4 > 0
    columns = dataset.columns | {"q1_rad": dataset.columns["q1_rad"] + bad, "discarded": bad}
    assert list(contradictions(dataset.meta, columns)) == []
    assert list(contradictions(dataset.meta, columns | {"discarded": ~bad}))


def test_the_shipped_robots_are_no_contradiction() -> None:
    dataset = imported(arm(), meta(ARM))
    for robot in ("ur5e", "ur16e"):
        text = meta(ARM).replace("ur10e", robot)
        assert list(contradictions(load_yaml_text(text, "m", Meta), dataset.columns)) == []
