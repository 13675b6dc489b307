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
_ENDINGS = r"\.(png|svg|csv)"


def is_drawn(ctx: Any, path: Path) -> bool:
    """Whether the command may put a figure, or the numbers behind it, into this place."""
    folder = ctx.params.get("figures")
    if folder is None or os.path.realpath(path.parent) != os.path.realpath(folder):
        return False
    stems = _STEMS[ctx.command.name]
    if ctx.command.name == "report":
        from rig.report.wishes import named

        for one in named(ctx.params["datasets"]):
            stems += f"|{re.escape(one.stem)}_{_OF_EACH}"
    return re.fullmatch(f"({stems}){_ENDINGS}", path.name) is not None


def standing(ctx: Any) -> Iterator[Path]:
    """The files that stand where the command draws."""
    folder = ctx.params.get("figures")
    if folder is not None and folder.is_dir():
        yield from (p for p in sorted(folder.iterdir()) if p.is_file() and is_drawn(ctx, p))
