"""Small data sets for the tests of the report, and a reader of its pages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from rig.dataset import Dataset, load, write
from rig.report import drawing
from rig.report import report as reports
from rig.report.wishes import Wishes
from rig.tables import import_table

VOID = {"meta", "path", "use", "image", "rect", "circle", "line", "br"}
META = """robot: none
directions: {x: [1, 0, 0]}
instruments:
  force: {standard_uncertainty_N: 0.1, gain_relative_sd: 0.005}
  displacement: {standard_uncertainty_mm: 0.002, gain_relative_sd: 0.003}
"""
SIMULATION = "simulation: {stiffness_N_per_mm: {x: 95.0}, stiffness_relative_sd: 0.1}\n"
FACTORS = (1.0, 1.005, 0.996)


def linear(k: float) -> Callable[[float, int], float]:
    """Displacement mm of a spring k N/mm in repetition r, which scatters by half a percent."""
    return lambda force, r: force / k * FACTORS[r - 1]


def bench(
    path: Path,
    law: Callable[[float, int], float] | None = None,
    *,
    meta: str = META + SIMULATION,
    forces: tuple[float, ...] = (20.0, 40.0, 60.0, 80.0, 100.0),
    comment: str = "",
) -> Path:
    """An imported bench at `path`: zero, then rising levels, three times, two samples a level."""
    law = law or linear(80.0)
    lines = ["session_s,time_s,repetition,branch,step,force_N,displacement_mm"]
    clock = 0
    for r in (1, 2, 3):
        for step, force in enumerate((0.0, *forces)):
            branch = "loading" if step else "zero"
            for _ in range(2):
                lines.append(f"{clock},{clock},{r},{branch},{step},{force},{law(force, r):.9f}")
                clock += 1
    table, words = path.with_suffix(".csv"), path.with_suffix(".yaml")
    table.write_text((f"# {comment}\n" if comment else "") + "\n".join(lines) + "\n", "utf-8")
    words.write_text(meta, "utf-8")
    import_table(table, words, path)
    return path


def rewritten(path: Path, **changes: object) -> Path:
    """The data set of `path`, with other words around its samples."""
    changed: Dataset = replace(load(path), **changes)  # type: ignore[arg-type]
    write(changed, path)
    return path


@contextmanager
def sketched() -> Iterator[None]:
    """Figures of a report are plotted, but come out empty, and `rig report` starts no process: for
    tests of what stands beside. To write a figure down takes longer than all else in a report."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "svg_of", lambda *_: "<svg></svg>")
        patch.setattr(reports, "usable_cores", lambda: 1)
        yield


def sketch(paths: Sequence[Path], wishes: Wishes | None = None) -> reports.Report:
    """`make` with empty figures."""
    with sketched():
        return reports.make(paths, wishes)


@dataclass
class Element:
    """One element of a page, with all the text within."""

    tag: str
    attributes: dict[str, str]
    text: str = ""
    inside: list[str] = field(default_factory=list)


class Page(HTMLParser):
    """All elements of a page in the order of their start, and its text without the style sheet."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[Element] = []
        self.text = ""
        self._open: list[Element] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        element = Element(tag, values, inside=[e.tag for e in self._open])
        self.elements.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.elements.append(Element(tag, values, inside=[e.tag for e in self._open]))

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop().tag != tag:
            pass

    def handle_data(self, data: str) -> None:
        for element in self._open:
            element.text += data
        if not any(e.tag == "style" for e in self._open):
            self.text += data

    def all(self, *tags: str) -> list[Element]:
        return [e for e in self.elements if e.tag in tags]
