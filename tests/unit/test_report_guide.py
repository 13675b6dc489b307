"""The analyst's guide, followed literally."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from rig import cli
from tests.recovery.emulated_sets import PAPER_C, REFERENCE_Q, measure, protocol
from tests.unit.report_sets import sketched

HOME = Path(__file__).parents[2]
GUIDE = (HOME / "docs" / "guide_analyst.md").read_text("utf-8")
BLOCK = re.compile(r"^```(\w+)(?: file=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SLOW = ("rig diagnose", "rig report arm.h5 -o", "rig report arm.h5 --no-gap --couple", "rig couple")


def follow(folder: Path, monkeypatch: pytest.MonkeyPatch, *, skip: tuple[str, ...] = ()) -> None:
    """Runs every command of the guide in `folder`, after the files that it shows."""
    runs = [(0, "x", 100.0), (0, "y", 60.0)]
    for name, seed in (("arm", 5), ("again", 6)):
        plan = protocol(REFERENCE_Q[None, :], runs, levels=5)
        measure(plan, np.asarray(PAPER_C), seed, folder / f"{name}.h5")
    shutil.copytree(HOME / "data", folder / "data")
    monkeypatch.chdir(folder)
    for kind, name, text in BLOCK.findall(GUIDE):
        if name:
            (folder / name).write_text(text, "utf-8")
        elif kind == "sh":
            for line in text.splitlines():
                if not line.startswith(skip):
                    run(line, monkeypatch)


def run(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", shlex.split(line))
    with pytest.raises(SystemExit) as ending:
        cli.main()
    monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
    assert ending.value.code in (0, None), line


def test_the_quick_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with sketched():
        follow(tmp_path, monkeypatch, skip=SLOW)
    for name in (
        "line.json",
        "arm.yaml",
        "next.yaml",
        "compared.html",
        "bench.h5",
        "bench.html",
        "arm.csv",
    ):
        assert (tmp_path / name).is_file(), name


@pytest.mark.slow
def test_all_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    follow(tmp_path, monkeypatch)
    for name in ("arm.html", "coupled.html", "report.json"):
        assert (tmp_path / name).is_file(), name
    assert list((tmp_path / "figures").glob("gap_*.svg"))


def test_files_that_the_guide_points_to_are_there() -> None:
    for target in re.findall(r"\]\(([\w./]+)\)", GUIDE):
        assert (HOME / "docs" / target).is_file(), target
