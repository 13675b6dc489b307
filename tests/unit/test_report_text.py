"""What a report says, word for word, and the command that makes it."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from rig import cli
from rig.dataset import load
from rig.report.document import Block, Bullets, Cell, Facts, Paragraph, Section, Table, Word, rich
from rig.report.measured_section import _protocol
from rig.report.results import Node
from rig.report.wishes import Wishes
from tests.unit.report_sets import bench, rewritten, sketch

GOLDEN = Path(__file__).parents[1] / "golden" / "report_text.txt"


def lines(blocks: tuple[Block, ...]) -> list[str]:
    """The words of a report, a line a row; provenance changes with the file."""
    found: list[str] = []
    for block in blocks:
        match block:
            case Section() if not block.ident.endswith("provenance"):
                found += ["", f"# {block.title}", *lines(block.blocks)]
            case Paragraph():
                found.append(words(block.parts))
            case Bullets():
                found += [f"- {words(item)}" for item in block.items]
            case Facts():
                found += [f"{name}: {words(cell)}" for name, cell in block.rows]
            case Table():
                found += ["", block.caption, " | ".join(block.header)]
                found += [" | ".join(words(c) for c in row) for row in block.rows]
    return found


def words(cell: Cell) -> str:
    marks = {"good": "+", "bad": "!", "open": "?"}
    parts = [
        p
        if isinstance(p, str)
        else (marks.get(p.style, "") if isinstance(p, Word) else "") + p.text
        for p in rich(cell)
    ]
    return "".join(parts)


def giving_way(force: float, r: int) -> float:
    below = min(force, 62.0) / 80 * (1 + 0.004 * (r - 2))
    return below + max(0.0, force - 62.0) / (4 + 0.1 * r)


@pytest.mark.parametrize(
    ("count", "said"), [(1, "1 repetition, loading"), (3, "3 repetitions, loading")]
)
def test_repetitions_are_counted_in_english(count: int, said: str) -> None:
    asked = {
        "repetitions": count,
        "branches": "loading",
        "order": "by_run",
        "rate_Hz": 1.0,
        "samples_per_step": 5,
        "hold_s": 0.0,
        "rest_s": 10.0,
        "zero_before_s": 6.0,
        "zero_after_s": 6.0,
        "runs": [],
    }
    assert f"Procedure: {said}; " in "\n".join(lines(tuple(_protocol(Node(asked)))))


def test_the_text_word_for_word(tmp_path: Path) -> None:
    """After a deliberate change: write `text` to the golden file, and read it."""
    forces = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 65.0, 70.0)
    paths = [bench(tmp_path / "a.h5", giving_way, forces=forces), bench(tmp_path / "b.h5")]
    for path in paths:
        rewritten(path, created="2026-03-01T10:00:00+01:00", origin="emulated")
    text = "\n".join(lines(sketch(paths, Wishes(gap=False)).document.sections)) + "\n"
    assert text == GOLDEN.read_text(encoding="utf-8")


def test_what_makes_the_numbers_doubtful_stands_in_short(tmp_path: Path) -> None:
    """And all of it in the chapter on data quality; what is small there has a small unit."""
    path = bench(tmp_path / "a.h5")
    columns = dict(load(path).columns)
    columns["settled"] = (columns["step"] != 2).astype(float)
    columns["displacement_mm"] = columns["displacement_mm"] + 1e-5 * (columns["repetition"] == 2)
    behind = {"kind": "behind", "text": "This machine can't keep up.", "session_s": 30.0}
    rewritten(path, columns=columns, events=[{**behind, "sample": 36}])
    text = lines(sketch([path], Wishes(gap=False)).document.sections)
    short, quality = text.index("# In short"), text.index("# Data quality")
    (told,) = [line for line in text if line.startswith("Mind: ")]
    assert short < text.index(told) < text.index("# What was measured")
    assert told.startswith("Mind: 3 of 15 levels had not settled when they were sampled")
    chapter = text[quality:]
    assert "Levels that never settled: 3" in chapter
    assert "Unloaded positions, x: 0.0100 µm apart over the repetitions" in chapter
    assert "- 30.00 s: This machine can't keep up." in chapter


def run(monkeypatch: pytest.MonkeyPatch, *args: str) -> int:
    monkeypatch.setattr(sys, "argv", ["rig", "report", *args])
    with pytest.raises(SystemExit) as ending:
        cli.main()
    monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
    return int(ending.value.code or 0)


def test_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    bench(tmp_path / "run.h5")
    assert run(monkeypatch, "run.h5", "--no-gap", "--json", "-", "--figures", "f") == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["schema"] == "rig.report/1"
    assert "run_report.html: written" in err
    assert (tmp_path / "run_report.html").read_text("utf-8").startswith("<!DOCTYPE html>")
    assert (tmp_path / "f" / "run_curve.png").exists()
    assert run(monkeypatch, "run.h5", "-o", "page.h5") == 2
    assert "a name that ends in .html is wanted" in capsys.readouterr().err
    assert run(monkeypatch, "none.h5", "-o", "a.html") == 2
    assert "none.h5: cannot be read: no such file." in capsys.readouterr().err
