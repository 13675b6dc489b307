"""How long `rig list` takes over many data sets: the first time, and once they are known.

    python bench/list_files.py [--files 1000] [--samples 700]

Every file has a META of its own. The clock runs around the whole process, its start included.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from rig.dataset import write
from rig.tables import import_table

META = """robot: none
directions: {x: [1, 0, 0]}
instruments: {force: {standard_uncertainty_N: 0.1}, displacement: {standard_uncertainty_mm: 0.002}}
simulation: {stiffness_N_per_mm: {x: 95.0}, stiffness_relative_sd: 0.1}
"""


def make(folder: Path, files: int, samples: int) -> None:
    """Data sets that differ in their identity, in META's text and in their numbers."""
    force = np.linspace(0, 200, samples)
    rows = "\n".join(f"{f:.6f},{f / 95:.6f}" for f in force)
    (folder / "table.csv").write_text(f"force_N,displacement_mm\n{rows}\n")
    (folder / "meta.yaml").write_text(META)
    first = import_table(folder / "table.csv", folder / "meta.yaml")
    (folder / "data").mkdir()
    for i in range(files):
        texts = {**first.texts, "meta": f"{META}# specimen {i}\n"}
        write(
            replace(first, uuid=f"00000000-0000-0000-0000-{i:012d}", texts=texts),
            folder / "data" / f"{i:05d}.h5",
        )


def timed(folder: Path, cache: Path) -> float:
    """Seconds that one `rig list` takes as a process of its own."""
    command = [sys.executable, "-m", "rig", "list", str(folder / "data"), "--json", "-"]
    start = time.perf_counter()
    done = subprocess.run(
        command, env={**os.environ, "RIG_CACHE": str(cache)}, capture_output=True, check=True
    )
    assert done.stdout.startswith(b"{")
    return time.perf_counter() - start


def main() -> None:
    """Prints the times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=1000)
    parser.add_argument("--samples", type=int, default=700)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder, args.files, args.samples)
        size = sum(p.stat().st_size for p in (folder / "data").iterdir()) / args.files
        first = timed(folder, folder / "cache")
        later = [timed(folder, folder / "cache") for _ in range(5)]
    print(
        f"{args.files} files of {size / 1e3:.0f} kB: first {first:.2f} s, then {min(later):.2f} s"
    )


if __name__ == "__main__":
    main()
