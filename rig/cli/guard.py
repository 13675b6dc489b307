"""No result takes the place of what it was computed from, nor of any measurement."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

_READ = {"model", "simulation", "couple", "resume", "station", "prior", "path"}
_FOLDERS = {"figures", "keep"}
_MAKES_DATA = {"measure", "import"}  # their own rules say which data set may be replaced
_HDF5 = b"\x89HDF\r\n\x1a\n"


class Guarded(TyperCommand):
    """A command that looks at its output paths before it begins."""

    def invoke(self, ctx: Any) -> Any:
        """InputError where a result would overwrite an input, or a data set."""
        from rig.errors import InputError

        inputs = [path for _, path in _paths(ctx, written=False)]
        for option, path in _paths(ctx, written=True):
            if any(_same(path, other) for other in inputs):
                raise InputError(
                    f"{option} {path}: is read by this command, and would be overwritten. "
                    "Give another name."
                )
            if self.name not in _MAKES_DATA and _is_data_set(path):
                raise InputError(
                    f"{option} {path}: is a data set; no result takes the place of a measurement. "
                    "Give another name."
                )
        return super().invoke(ctx)


def _paths(ctx: Any, *, written: bool) -> Iterator[tuple[str, Path]]:
    """Option and path of everything that is written, or read."""
    for parameter in ctx.command.params:
        name, value = str(parameter.name), ctx.params.get(str(parameter.name))
        reads = parameter.param_type_name == "argument" or name in _READ
        if reads == written or name in _FOLDERS:
            continue
        option = parameter.opts[-1] if parameter.opts else name
        for one in value if isinstance(value, list | tuple) else [value]:
            if isinstance(one, Path) or (name == "json_file" and one not in (None, "-")):
                yield option, Path(one)


def _same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except OSError:
        return False


def _is_data_set(path: Path) -> bool:
    if not path.is_file():  # reading a pipe would wait for ever
        return False
    try:
        with path.open("rb") as file:
            return file.read(len(_HDF5)) == _HDF5
    except OSError:
        return False
