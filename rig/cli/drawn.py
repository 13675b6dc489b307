"""What commands draw into the folder of `--figures`."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# Names without their endings; several commands may share a folder.
_STEMS = {
    "analyze": "curve|pointwise",
    "couple": "stiffness|map|schedule|placement",
    "diagnose": "gap_(curve|map|points|residual|probabilities|withheld|remainder)",
    "report": "joints|coupling|compared_.+",
}
_OF_EACH = "(setup|curve|pointwise|joints|gap|quality)(_.+)?"  # of every data set of a report
_NUMBERS = ("diagnose", "report")  # which write the numbers behind their figures, too


def where(path: Path) -> str:
    """The same for all names of one place, whatever stands there."""
    return os.path.normcase(os.path.realpath(path))


def is_drawn(ctx: Any, path: Path) -> bool:
    """Whether the command may put a figure, or the numbers behind it, into this place."""
    folder = ctx.params.get("figures")
    if folder is None or where(path.parent) != where(folder):
        return False
    stems = _STEMS[ctx.command.name]
    if ctx.command.name == "report":
        from rig.report.wishes import named

        for one in named(ctx.params["datasets"]):
            stems += f"|{re.escape(one.stem)}_{_OF_EACH}"
    endings = "png|svg|csv" if ctx.command.name in _NUMBERS else "png|svg"
    return re.fullmatch(rf"({stems})\.({endings})", path.name) is not None


def standing(ctx: Any) -> Iterator[Path]:
    """The files that stand where the command draws."""
    folder = ctx.params.get("figures")
    if folder is not None and folder.is_dir():
        yield from (p for p in sorted(folder.iterdir()) if p.is_file() and is_drawn(ctx, p))
