"""`rig report`: one page about one or several data sets, and the files beside it."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.banners import marks
from rig.errors import InputError
from rig.plotting import MADE_BY
from rig.report.diagnosing import Job, diagnosing, usable_cores
from rig.report.document import Document, Figure, figures
from rig.report.wishes import Wishes, named
from rig.storage.files import check_folder, in_place_of
from rig.terminal import Progress, silent

if TYPE_CHECKING:
    from rig.report.gather import Gathered

__all__ = [
    "Report",
    "Wishes",
    "checked",
    "default_output",
    "make",
    "now",
    "usable_cores",
    "write_figures",
    "write_html",
    "write_pdf",
]


@dataclass(frozen=True, eq=False)
class Report:
    """What was gathered, and the document that shows it."""

    gathered: Gathered
    document: Document

    def to_json(self) -> dict[str, Any]:
        """Schema rig.report/1: results of the other commands, and every number of the page."""
        return self.gathered.to_json()

    def to_text(self) -> str:
        """The first lines of the page, for a terminal."""
        return summary(self.gathered)

    def to_html(self) -> str:
        """The page."""
        from rig.report.html import render

        return render(self.document)

    def to_pdf(self) -> bytes:
        """The same as PDF; InputError where typst is not installed."""
        from rig.report.pdf import pdf

        return pdf(self.document)


def make(
    paths: Sequence[Path], wishes: Wishes | None = None, progress: Progress = silent
) -> Report:
    """A report about data sets, the first of which the others are compared with.

    InputError for files that cannot be read, or no file at all.
    """
    wishes, names = wishes or Wishes(), named(paths)
    if not names:
        raise InputError("rig report: give at least one data set.")
    jobs = [Job(n.path, n.stem, wishes.png) for n in names] if wishes.gap else []
    with diagnosing(jobs, wishes.processes) as begun:
        # Only now: the diagnosis takes longest, and while it loads what it needs, so does the rest.
        from rig.report.compose import compose
        from rig.report.gather import gather, with_gaps
        from rig.report.pictures import Pictures

        gathered, pictures = gather(names, wishes, progress), Pictures(png=wishes.png)
        if jobs:
            if wishes.processes:
                compose(gathered, pictures)  # a rehearsal, which draws all that needs no diagnosis
            gathered = with_gaps(gathered, begun, progress)
    progress("drawing", 0.92)
    return Report(gathered, compose(gathered, pictures.again()))


def summary(gathered: Gathered) -> str:
    """One sentence a data set: banners, every k."""
    from rig.analysis.analyze_text import answer

    lines = [*gathered.banners]
    lines += [f"{s.label}: {answer(s.analysis)}" for s in gathered.sessions]
    return "\n".join(lines)


def now() -> str:
    """The time that a report made now shows."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def default_output(paths: Sequence[Path]) -> Path:
    """In the working folder, under the first data set's name."""
    return Path(f"{paths[0].stem if paths else 'rig'}_report.html")


def checked(page: Path, pdf: Path | None) -> Path:
    """The page's path, before long work begins; InputError where a name says another kind of file
    (a data set must not be overwritten by its report), or where there is no typst for the PDF."""
    from rig.report.pdf import typesetter

    for path, kinds, option in ((page, (".html", ".htm"), "-o"), (pdf, (".pdf",), "--pdf")):
        if path is not None and path.suffix.lower() not in kinds:
            raise InputError(f"{option} {path}: a name that ends in {kinds[0]} is wanted.")
        if path is not None:
            check_folder(path)
    if pdf is not None:
        typesetter()
    return page


def write_html(report: Report, path: Path) -> None:
    """Writes the page whole or not at all; InputError if the folder refuses."""
    with in_place_of(path) as temporary:
        temporary.write_text(report.to_html(), "utf-8")


def write_pdf(report: Report, path: Path) -> None:
    """Likewise as PDF."""
    content = report.to_pdf()
    with in_place_of(path) as temporary:
        temporary.write_bytes(content)


def write_figures(report: Report, folder: Path) -> list[Path]:
    """Every figure as SVG and PNG, and the numbers behind it as CSV; the files written."""
    written: list[Path] = []
    words = marks(report.document.banners)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for figure in figures(report.document.sections):
            for kind, content in _files(figure, words).items():
                path = folder / f"{figure.name}.{kind}"
                path.write_bytes(content)
                written.append(path)
    except OSError as error:
        raise InputError(
            f"{folder}: the figures can't be written there ({error.strerror}). "
            "Give another folder with --figures."
        ) from error
    return written


def _files(figure: Figure, words: Sequence[str]) -> dict[str, bytes]:
    prologue = f'<?xml version="1.0" encoding="utf-8"?>\n<!-- {MADE_BY} -->\n'
    files = {"svg": f"{prologue}{figure.svg}\n".encode()}
    if figure.png is not None:
        files["png"] = figure.png
    if figure.header:
        files["csv"] = _csv(figure, words).encode("utf-8", "replace")
    return files


def _csv(figure: Figure, words: Sequence[str]) -> str:
    buffer = io.StringIO()
    for mark in words:
        buffer.write(f"# {mark}\n")
    buffer.write(f"# rig report: {figure.name}\n")
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(figure.header)
    writer.writerows(figure.rows)
    return buffer.getvalue()
