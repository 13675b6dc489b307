"""What is wrong with a command's words, with the word that is meant and what is allowed there; the
library's own messages leave out one or the other."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import typer

from rig.errors import InputError


def check_words(params: Sequence[Any], words: Sequence[str]) -> None:
    """Before they are read. InputError for an option at the end that lacks its value."""
    last = words[-1] if words and "--" not in words else ""
    for param in params:
        if last in param.opts and last.startswith("-") and not _is_flag(param):
            raise InputError(f"{last}: its value is missing. Wanted: {last} {_wanted(param)}.")


def check_given_once(order: Sequence[Any], given: Mapping[str, Any]) -> None:
    """Order: of options and arguments as they were read. InputError for an option that is repeated
    although one counts: the earlier wish would be passed over without a word."""
    for param in order:
        if order.count(param) < 2 or param.multiple or param.param_type_name == "argument":
            continue
        if _is_flag(param):
            names = "/".join((param.opts[-1], *param.secondary_opts))
            raise InputError(f"{names}: is given more than once. Leave one out.")
        option, value = param.opts[-1], given[param.name]
        raise InputError(f"{option} {value}: {option} is given before, too. Leave one of them out.")


def wrong_value(error: typer.BadParameter, given: Mapping[str, Any]) -> InputError | None:
    """The message about a value that was refused or is missing; None where the library has told
    nothing of where."""
    param: Any = error.param
    option = param.opts[-1]
    if (value := given.get(param.name)) is not None:
        for path in value if isinstance(value, list | tuple) else [value]:
            if error.message.endswith("is not readable.") and not os.access(path, os.R_OK):
                place = f"{option} {path}" if option.startswith("-") else path
                return InputError(
                    f"{place}: you may not read this file. Change its permissions, or ask whoever "
                    "owns it."
                )
        return InputError(f"{option} {value}: {_allowed(param, error.message)}.")
    if param.param_type_name == "argument":
        return None if error.ctx is None else _missing_argument(error.ctx, param)
    return InputError(f"{option}: is missing. Give {' or '.join(param.opts)} {_wanted(param)}.")


def _missing_argument(ctx: Any, param: Any) -> InputError:
    """With how the command is called."""
    name = ctx.command.name
    wanted = [p.metavar for p in ctx.command.params if p.param_type_name == "argument"]
    return InputError(
        f"rig {name}: {param.metavar} is missing. Give rig {name} {' '.join(wanted)}; "
        f"rig {name} -h lists the options."
    )


def _is_flag(param: Any) -> bool:
    return bool(getattr(param, "is_flag", False))


def _wanted(param: Any) -> str:
    return str(param.metavar or _range(param) or "TEXT")


def _allowed(param: Any, said: str) -> str:
    """Said: why the library refuses; where there is no range, that has to do."""
    if not (span := _range(param)):
        return said.removeprefix("Value error, ").rstrip(".")
    kind = "whole number" if "integer" in said else "number"
    return f"allowed: a {kind}, {span}"


def _range(param: Any) -> str:
    low, high = _bound(param, "min"), _bound(param, "max")
    if low is None:
        return "" if high is None else f"at most {high:g}"
    return f"at least {low:g}" if high is None else f"{low:g} to {high:g}"


def _bound(param: Any, name: str) -> float | None:
    """Of the option itself, or of its type, as older libraries have it."""
    found = getattr(param, name, getattr(getattr(param, "type", None), name, None))
    return found if isinstance(found, int | float) else None
