"""Builds docs/example.md from docs/example.in.md: python docs/build_example.py
With a name (out/example/paper_xy.h5) it writes the page's data set there instead.

Every fenced block that begins with ```python is run as a notebook runs a cell: in order, in one
namespace, followed by what it printed and by its last value. `picture(path, words)` puts a figure
of the data set onto the page. The data set comes from the simulated rig, straight from its world.
"""

from __future__ import annotations

import ast
import contextlib
import io
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from rig.dataset import Dataset, write
from rig.measured_meta import measured_meta
from rig.protocol import load_protocol
from rig.station import load_station
from rig.worlds import make_world
from rig.worlds.direct import sample_protocol

HERE = Path(__file__).resolve().parent
SOURCE, PAGE, PICTURES = HERE / "example.in.md", HERE / "example.md", HERE / "pictures"
DATA = Path("out/example/paper_xy.h5")  # as the page calls it
SEED = 1
_CELL = re.compile(r"^```python\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
_HEAD = "<!-- Built by `python docs/build_example.py` from example.in.md; edit that one. -->\n"


def measured(path: Path) -> None:
    """Writes the data set that the page works on."""
    path.parent.mkdir(parents=True, exist_ok=True)
    protocol = load_protocol(HERE.parent / "protocols" / "paper_xy.yaml")
    columns = dict(sample_protocol(make_world("paper", SEED), protocol, SEED))
    columns["discarded"] = np.zeros(len(columns["force_N"]), dtype=bool)
    meta = measured_meta(protocol, load_station("emulated"))
    texts = {"protocol": protocol.text, "meta": meta.model_dump_json(exclude_none=True)}
    made = Dataset(
        path=path,
        uuid=f"00000000-0000-0000-0000-{SEED:012d}",
        created="2026-03-01T10:00:00+01:00",
        origin="emulated",
        complete=True,
        meta=meta,
        columns=columns,
        units={},
        long_names={},
        texts=texts,
        title=protocol.title,
    )
    write(made, path)


def build(source: str, pictures: Path | None) -> str:
    """The page's text. pictures: the folder they are copied into; None: only their places."""
    images: list[str] = []

    def picture(path: Path, words: str) -> None:
        if pictures is not None:
            shutil.copy(path, pictures / f"example_{path.name}")
        images.append(f"\n![{words}](pictures/example_{path.name})\n\n*{words}*\n")

    space: dict[str, Any] = {"picture": picture}

    def run(cell: re.Match[str]) -> str:
        images.clear()
        printed = run_cell(cell.group(1), space).rstrip()
        shown = f"\n```text\n{printed}\n```\n" if printed else ""
        return cell.group(0) + shown + "".join(images)

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), _own_cache(folder):
        measured(DATA)
        return _HEAD + _CELL.sub(run, source)


def run_cell(code: str, space: dict[str, Any]) -> str:
    """Runs a cell; what it printed, and the value of its last line where that is an expression."""
    body = ast.parse(code).body
    last = body.pop() if body and isinstance(body[-1], ast.Expr) else None
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(ast.Module(body, []), str(SOURCE), "exec"), space)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), str(SOURCE), "eval"), space)
            if value is not None:
                print(repr(value))
    return out.getvalue()


@contextlib.contextmanager
def _own_cache(folder: str) -> Any:
    """What the user's catalogue knows stays out of the page."""
    before = os.environ.get("RIG_CACHE")
    os.environ["RIG_CACHE"] = str(Path(folder) / "cache")
    try:
        yield
    finally:
        del os.environ["RIG_CACHE"]
        if before is not None:
            os.environ["RIG_CACHE"] = before


def main() -> None:
    """Writes the page and its pictures, or the data set that is named."""
    if sys.argv[1:]:
        path = Path(sys.argv[1])
        measured(path)
        print(f"{path}: written")
        return
    PAGE.write_text(build(SOURCE.read_text("utf-8"), PICTURES), "utf-8")
    print(f"{PAGE}: {len(list(PICTURES.glob('example_*.png')))} pictures")


if __name__ == "__main__":
    main()
