"""Labelled cases and real measurements beside the project: a few always, all with -m slow."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rig.diagnosis.diagnose import diagnose
from rig.tables import import_table
from tests.slow import slow_ones

SHARED = Path(__file__).parents[2] / "../shared"
CASES, REAL = SHARED / "gap-cases", SHARED / "real"
REAL_ACCEPT = {
    "coupon-cyclic": {"joint_yield", "joint_hysteresis"},
    "seal-stroke": {"joint_yield", "joint_hysteresis"},
    "sheet-pull": {"joint_yield"},
}


def labels() -> dict[str, Any]:
    if not (CASES / "labels.json").exists():
        pytest.skip("no labelled cases beside the project (../shared/gap-cases)")
    cases: dict[str, Any] = json.loads((CASES / "labels.json").read_text())["cases"]
    return cases


def verdict(folder: Path) -> str:
    found = diagnose(import_table(folder / "samples.csv", folder / "meta.yaml"))
    return str(found.to_json()["verdict"])


SHORT, LONGER = ("40a4306f41", "827cbeb4a5"), ("1c1067c6ee", "d6694f0c58")


@pytest.mark.parametrize("case", slow_ones((*SHORT, *LONGER), LONGER))
def test_short_labelled_cases(case: str) -> None:
    known = labels()  # skips where there are none
    assert verdict(CASES / case) in known[case]["accept"]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_nine_of_ten_labelled_cases() -> None:
    known = labels()
    right = [c for c in known if verdict(CASES / c) in known[c]["accept"]]
    assert len(right) >= 0.9 * len(known), sorted(set(known) - set(right))


@pytest.mark.parametrize("name", list(REAL_ACCEPT))
def test_real_measurements(name: str) -> None:
    if not (REAL / name).exists():
        pytest.skip("no real measurements beside the project (../shared/real)")
    assert verdict(REAL / name) in REAL_ACCEPT[name]
