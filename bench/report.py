"""How long `rig report` takes and how large its page is, for full sessions.

    .venv/bin/python bench/report.py [--runs 3]

Sessions: the published procedure and `load_unload_hold` (two poses, holds, unloading), both on the
simulated rig, as `rig report` gets them from a file. Wall time of the whole command, start of
Python included, with the diagnosis and without it, beside the diagnosis alone; the smallest of the
runs counts, since other work on the machine only adds.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from rig.dataset import Dataset, write
from rig.measured_meta import measured_meta
from rig.protocol import load_protocol
from rig.station import load_station
from rig.worlds.direct import sample_protocol
from rig.worlds.paper import design
from rig.worlds.world import World

HOME = Path(__file__).resolve().parent.parent
SECONDS, MEGABYTES = 5.0, 5.0  # aimed at; a diagnosis may take 3 s of them
DIAGNOSIS = 3.0


def session(name: str, folder: Path) -> Path:
    """A full session of a ready protocol on the published arm's world."""
    protocol = load_protocol(HOME / "protocols" / f"{name}.yaml")
    columns = dict(sample_protocol(World(design(), 0), protocol, 0))
    columns["discarded"] = np.zeros(len(columns["force_N"]), dtype=bool)
    meta = measured_meta(protocol, load_station("emulated"))
    path = folder / f"{name}.h5"
    made = Dataset(
        path=path,
        uuid="bench",
        created="2026-03-01T10:00:00+01:00",
        origin="emulated",
        complete=True,
        meta=meta,
        columns=columns,
        units={},
        long_names={},
        texts={"protocol": protocol.text, "meta": meta.model_dump_json(exclude_none=True)},
        title=protocol.title,
    )
    write(made, path)
    return path


def seconds(runs: int, *words: str) -> float:
    """Smallest wall time of `rig WORDS`."""
    rig = [sys.executable, "-m", "rig", *words]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    taken = []
    for _ in range(runs):
        start = time.perf_counter()
        subprocess.run(rig, check=True, capture_output=True, env=environment, cwd=HOME)
        taken.append(time.perf_counter() - start)
    return min(taken)


def main() -> None:
    """Prints one line a session and kind of report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    runs = parser.parse_args().runs
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        page, pdf = folder / "page.html", folder / "page.pdf"
        print(
            "session             report s  diagnosis s  beyond 3 s left out  no gap s  + PDF s"
            "  page MB"
        )
        for protocol in ("paper_xy", "load_unload_hold"):
            data = str(session(protocol, folder))
            whole = seconds(runs, "report", data, "-o", str(page))
            size = page.stat().st_size / 1e6
            alone = seconds(runs, "diagnose", data)
            bare = seconds(runs, "report", data, "-o", str(page), "--no-gap")
            printed = seconds(runs, "report", data, "-o", str(page), "--no-gap", "--pdf", str(pdf))
            counted = whole - max(0.0, alone - DIAGNOSIS)
            print(
                f"{protocol:<18} {whole:9.2f} {alone:12.2f} {counted:20.2f} {bare:9.2f}"
                f" {printed:8.2f} {size:8.2f}"
            )
        print(
            f"aimed at: {SECONDS:g} s with the excess of the diagnosis left out, {MEGABYTES:g} MB"
        )


if __name__ == "__main__":
    main()
