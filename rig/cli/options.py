"""What several commands share: options, and how results are given out."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.errors import InputError
from rig.storage.files import in_place_of, legible

JsonOption = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE", help="Write the result as JSON; - : stdout."),
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


def _tell_version(wanted: bool) -> None:
    if wanted:
        from rig.software import software_version

        put_out(software_version())
        raise typer.Exit


def version(
    asked: Annotated[
        bool,
        typer.Option("--version", callback=_tell_version, is_eager=True, help="Name and version."),
    ] = False,
) -> None:
    """What can be asked of the program itself."""


def say(text: str) -> None:
    """Progress and notes go to standard error: standard output belongs to results. Where a disk or
    a terminal refuses them, nobody is left who could be told."""
    from rig.terminal import folded_for

    try:
        typer.echo(folded_for(sys.stderr, legible(text)), err=True)
    except BrokenPipeError:
        raise
    except OSError:
        sys.stderr = io.StringIO()  # or Python would try again at its end


def show(text: str) -> None:
    """A result in words."""
    from rig.terminal import folded_for

    put_out(folded_for(sys.stdout, legible(text)))


def put_out(text: str) -> None:
    """To standard output; InputError where a disk behind it refuses, BrokenPipeError where the
    reader has left."""
    try:
        typer.echo(text)
    except OSError as error:
        sys.stdout = io.StringIO()  # or Python would try again at its end
        if isinstance(error, BrokenPipeError):
            raise
        reason = error.strerror or error
        raise InputError(f"standard output: cannot be written: {reason}.") from error


def give(result: Any, json_file: str | None, files: Iterable[str] = ()) -> None:
    """Prints the text of a result, and writes its JSON where asked; on stdout that is all. files:
    writes the other files while it is gone through, and yields what to say of each.

    Files come first: whoever reads what is printed may leave. A file that fails costs neither the
    JSON nor what is printed.
    """
    text = "" if json_file is None else json.dumps(result.to_json(), indent=2, allow_nan=False)
    said: list[str] = []
    refused: list[str] = []
    try:
        with _keeping(refused):
            for line in files:
                said.append(line)
        if json_file not in (None, "-"):
            with _keeping(refused):
                _write_json(Path(str(json_file)), text + "\n")
    finally:
        try:
            with _keeping(refused):
                if json_file == "-":
                    put_out(text)
                else:
                    show(result.to_text())
        except BrokenPipeError:
            if not refused:
                raise
        finally:
            for line in said:
                say(line)
    if refused:
        raise InputError("\n".join(refused))


@contextmanager
def _keeping(refused: list[str]) -> Iterator[None]:
    """An InputError waits until all the rest is done."""
    try:
        yield
    except InputError as error:
        refused.append(str(error))


def _write_json(path: Path, text: str) -> None:
    """InputError where that fails. Pipes and devices are written to; a file is replaced."""
    if not path.exists() or (path.is_file() and not path.is_symlink()):
        with in_place_of(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}.") from error


def list_written(paths: Iterable[Path]) -> Iterator[str]:
    """A line for every file that was written."""
    for path in paths:
        yield f"{path}: written"
