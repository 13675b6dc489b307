"""Before the work: no result takes the place of what it is computed from, of any measurement, of
another result or of another kind of file, and every place can be written to. After it: what
was replaced."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from rig.cli.drawn import is_drawn, standing, where
from rig.cli.kinds import replacing
from rig.cli.options import put_out
from rig.cli.usage import check_given_once, check_words, wrong_value
from rig.errors import InputError, did_you_mean

_READ = {"model", "simulation", "couple", "resume", "station", "prior", "path"}
_FOLDERS = {"figures", "keep"}
_MAKES_DATA = {"measure", "import"}  # their own rules say which data set may be replaced
_HDF5 = b"\x89HDF\r\n\x1a\n"


class _Helped:
    """A command whose help is printed as results are: a disk that refuses it is no bug."""

    def get_help_option(self, ctx: Any) -> Any:
        """The library's, but for how it prints."""
        option = super().get_help_option(ctx)  # type: ignore[misc]
        if option is not None:
            option.callback = _show_help
        return option


def _show_help(ctx: Any, _param: Any, wanted: bool) -> None:
    if wanted and not ctx.resilient_parsing:
        put_out(ctx.get_help())
        ctx.exit()


class Commands(_Helped, TyperGroup):
    """All commands; one that is not there is told with those that are."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """InputError for an unknown command."""
        if args[0] not in self.commands and not ctx.resilient_parsing:
            raise InputError(
                f"rig {args[0]}: no such command.{did_you_mean(args[0], self.commands)}"
            )
        return super().resolve_command(ctx, args)


class Guarded(_Helped, TyperCommand):
    """A command that looks at its words and at its output paths before it begins."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """InputError for a value that is refused or missing, and for an option given twice."""
        if ctx.resilient_parsing:  # a shell that completes half a line
            return super().parse_args(ctx, args)
        check_words(self.params, args)
        given, _, order = self.make_parser(ctx).parse_args(args=list(args))
        check_given_once(order, given)
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            raise wrong_value(error, given) or error from None

    def invoke(self, ctx: Any) -> Any:
        """InputError where a result would overwrite an input, a data set, another result or another
        kind of file, or could not be written once the work is done."""
        _name_page(ctx)
        inputs = [path for _, _, path in _paths(ctx, written=False)]
        places = list(_paths(ctx, written=True))
        _check_apart([*((option, path) for option, _, path in places), *_folders(ctx)])
        for option, _, path in places:
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
            _check_file(option, path)
            if is_drawn(ctx, path):
                raise InputError(
                    f"{option} {path}: a figure of --figures goes there. Give another name."
                )
        for option, path in _folders(ctx):
            _check_may_be_made(option, path)
        with replacing([] if self.name in _MAKES_DATA else places, standing(ctx)):
            return super().invoke(ctx)


def _name_page(ctx: Any) -> None:
    """A report whose name was left to the command is an output as any other."""
    if ctx.command.name == "report" and ctx.params["output"] is None:
        from rig.report.report import default_output

        ctx.params["output"] = default_output(ctx.params["datasets"])


def _check_apart(places: Sequence[tuple[str, Path]]) -> None:
    """InputError where two results would go to one place."""
    for i, (option, path) in enumerate(places):
        for other, place in places[:i]:
            if where(path) == where(place) or _same(path, place):
                raise InputError(
                    f"{other} {place}, {option} {path}: are one place, and only one result can "
                    "stand there. Give another name to one of them."
                )


def _check_file(option: str, path: Path) -> None:
    from rig.storage.files import check_folder

    if path.is_dir():
        or_out = ", or - for stdout" if option == "--json" else ""
        raise InputError(f"{option} {path}: is a folder. Give the name of a file{or_out}.")
    if str(path) == "-":
        raise InputError(f"{option} -: this one goes to a file only. Give its name.")
    if option != "--json" and path.exists() and not path.is_file():
        raise InputError(
            f"{option} {path}: is a pipe or a device, where only JSON may go. Give the name of a "
            "file."
        )
    check_folder(path, f"{option} ")
    if not path.exists():
        _check_open(option, path, path.parent)


def _check_may_be_made(option: str, path: Path) -> None:
    """It is made where it is missing."""
    there = next(p for p in (path, *path.parents) if p.exists())
    if not there.is_dir():
        raise InputError(f"{option} {path}: {there} is a file, no folder. Choose another.")
    _check_open(option, path, there)


def _check_open(option: str, path: Path, folder: Path) -> None:
    if not os.access(str(folder), os.W_OK):
        raise InputError(
            f"{option} {path}: nothing may be written into the folder {folder}. Choose another."
        )


def _folders(ctx: Any) -> Iterator[tuple[str, Path]]:
    for parameter in ctx.command.params:
        path = ctx.params.get(str(parameter.name))
        if parameter.name in _FOLDERS and isinstance(path, Path):
            yield parameter.opts[-1], path


def _paths(ctx: Any, *, written: bool) -> Iterator[tuple[str, str, Path]]:
    """Option, its parameter and the path of everything that is written, or read."""
    for parameter in ctx.command.params:
        name, value = str(parameter.name), ctx.params.get(str(parameter.name))
        reads = parameter.param_type_name == "argument" or name in _READ
        if reads == written or name in _FOLDERS:
            continue
        option = parameter.opts[-1] if parameter.opts else name
        for one in value if isinstance(value, list | tuple) else [value]:
            if isinstance(one, Path) or (name == "json_file" and one not in (None, "-")):
                yield option, name, Path(one)


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
