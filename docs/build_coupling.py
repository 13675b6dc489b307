"""Builds docs/coupling.md from docs/coupling.in.md: python docs/build_coupling.py

Every fenced block of the source that begins with ```python is run, in order and in one namespace,
and followed by what it printed. ```python hide runs without being shown. `show(figure, name,
text)` puts a figure (PNG on the page, SVG beside it) where it is called.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
SOURCE, PAGE, FIGURES = HERE / "coupling.in.md", HERE / "coupling.md", HERE / "figures"
_CELL = re.compile(r"^```python( hide)?\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
_HEAD = "<!-- Built by `python docs/build_coupling.py` from coupling.in.md; edit that one. -->\n"


def build(source: str, figures: Path | None) -> str:
    """The page's text. figures: the folder they are drawn into; None: only their places."""
    sys.path.insert(0, str(HERE.parent))
    images: list[str] = []

    def show(figure: Any, name: str, text: str) -> None:
        if figures is not None:
            _save(figure, figures, name)
        images.append(f"![{text}](figures/{name}.png)\n\n*{text}*\n")

    space: dict[str, Any] = {"show": show, "ROOT": HERE.parent}

    def run(cell: re.Match[str]) -> str:
        hidden, code = cell.groups()
        images.clear()
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(code, str(SOURCE), "exec"), space)
        shown = "" if hidden else f"```python\n{code}```\n"
        printed = out.getvalue()
        if printed:
            shown += f"\n```text\n{printed.rstrip()}\n```\n"
        return shown + "".join(f"\n{image}" for image in images)

    import matplotlib as mpl

    from rig.plotting import STYLE

    with mpl.rc_context(STYLE):
        return _HEAD + _CELL.sub(run, source)


def _save(figure: Any, folder: Path, name: str) -> None:
    folder.mkdir(exist_ok=True)
    figure.savefig(folder / f"{name}.png", dpi=110)
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None})


def main() -> None:
    """Writes page and figures."""
    PAGE.write_text(build(SOURCE.read_text("utf-8"), FIGURES), "utf-8")
    print(f"{PAGE} and {len(list(FIGURES.glob('coupling_*.png')))} figures")


if __name__ == "__main__":
    main()
