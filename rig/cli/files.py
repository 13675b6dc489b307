"""Commands about data sets as files: report, list, import, export."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import (
    DatasetArgument,
    DatasetsArgument,
    FiguresOption,
    JsonOption,
    give,
    list_written,
    say,
)

if TYPE_CHECKING:
    from rig.report.report import Report

_Page = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE.html", help="The page.")
]
_Pdf = Annotated[
    Path | None, typer.Option(metavar="FILE.pdf", help="The same as PDF (needs typst).")
]
_Couple = Annotated[
    Path | None, typer.Option(metavar="MODEL.yaml", help="With two arms coupled, too.")
]
_Gap = Annotated[bool, typer.Option("--gap/--no-gap", help="With the diagnosis or not.")]
_Analyze = Annotated[bool, typer.Option("--analyze", help="Compute k where it is not known yet.")]
_Imported = Annotated[Path, typer.Option("-o", "--output", metavar="DATASET.h5")]
_Exported = Annotated[Path, typer.Option("-o", "--output", metavar="FILE.csv|.parquet")]


def report(
    datasets: DatasetsArgument,
    output: _Page = None,
    pdf: _Pdf = None,
    figures: FiguresOption = None,
    couple: _Couple = None,
    gap: _Gap = True,
    json_file: JsonOption = None,
) -> None:
    """One page with figures and tables; several data sets are compared with the first."""
    from rig.catalogue import remember_result
    from rig.report import report as reports
    from rig.terminal import terminal_progress

    assert output is not None  # the guard has seen to that
    page = reports.checked(output, pdf)
    with terminal_progress() as progress:
        wishes = reports.Wishes(
            couple=couple,
            gap=gap,
            made=reports.now(),
            png=figures is not None,
            processes=reports.usable_cores() - 1,
        )
        result = reports.make(datasets, wishes, progress)
    for session in result.gathered.sessions:
        for found in (session.analysis.to_json(), session.diagnosed.json):
            if found is not None:
                remember_result(session.path, found)
    give(result, json_file, _pages(result, page, pdf, figures))


def _pages(result: Report, page: Path, pdf: Path | None, figures: Path | None) -> Iterator[str]:
    """The page, and the same as PDF and the figures where asked for."""
    from rig.report import report as reports

    reports.write_html(result, page)
    yield from list_written([page])
    if pdf is not None:
        reports.write_pdf(result, pdf)
        yield from list_written([pdf])
    if figures is not None:
        yield from list_written(reports.write_figures(result, figures))


def list_(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER")] = Path(),
    analyze: _Analyze = False,
    json_file: JsonOption = None,
) -> None:
    """The data sets of a folder: date, robot, directions, k, verdict, complete or not."""
    from rig.listing import list_folder
    from rig.terminal import terminal_progress, width_of

    with terminal_progress() as progress:
        result = list_folder(folder, analyze=analyze, progress=progress)
    give(replace(result, width=width_of(sys.stdout)), json_file)


def import_(
    table: Annotated[Path, typer.Argument(metavar="TABLE.csv")],
    meta: Annotated[Path, typer.Argument(metavar="META.yaml")],
    output: _Imported,
) -> None:
    """Bring in measurements that were taken with other software."""
    from rig.digits import counted
    from rig.tables import import_table
    from rig.terminal import terminal_progress

    replaced = output.exists()  # by an import only: a measurement is refused
    with terminal_progress() as progress:
        result = import_table(table, meta, output, progress)
    if replaced:
        say(f"{output}: replaced; an earlier import stood there")
    for event in result.events:
        if event["kind"] == "note":
            say(f"note: {event['text']}")
    say(f"{output}: {counted(result.rows, 'row')}. Next: rig analyze {output}")


def export(dataset: DatasetArgument, output: _Exported) -> None:
    """Write a data set as CSV or Parquet."""
    from rig.dataset import load
    from rig.tables_out import export_table

    export_table(load(dataset), output)
    say(f"{output}: written")
