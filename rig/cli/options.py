"""What several commands share: options, and how results are given out."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

JsonOption = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write the result as JSON; - : stdout.")
]
StationOption = Annotated[
    str | None,
    typer.Option(
        help="A station's name or file, instead of the protocol's; emulated: none needed."
    ),
]
FiguresOption = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Draw the figures into this folder.")
]
MujocoOption = Annotated[
    Path | None, typer.Option(metavar="FILE.xml", help="Write the arm for MuJoCo.")
]
UrdfOption = Annotated[Path | None, typer.Option(metavar="FILE.urdf", help="Write it as URDF.")]
ProtocolArgument = Annotated[Path, typer.Argument(metavar="PROTOCOL.yaml")]
DatasetArgument = Annotated[Path, typer.Argument(metavar="DATASET.h5")]
DatasetsArgument = Annotated[list[Path], typer.Argument(metavar="DATASET.h5 ...")]
ModelArgument = Annotated[Path, typer.Argument(metavar="MODEL.yaml")]


def say(text: str) -> None:
    """Progress and notes go to standard error: standard output belongs to results."""
    typer.echo(text, err=True)


def give(result: Any, json_file: str | None) -> None:
    """Prints the text of a result, or writes its JSON where asked."""
    if json_file is not None:
        text = json.dumps(result.to_json(), indent=2, allow_nan=False)
        if json_file == "-":
            typer.echo(text)
            return
        Path(json_file).write_text(text + "\n", encoding="utf-8")
    typer.echo(result.to_text())


def list_written(paths: Iterable[Path]) -> None:
    """A line for every file that was written."""
    for path in paths:
        say(f"{path}: written")
