"""Import of a large table beside the loop that one would write with the csv module.

    python bench/import_table.py [ROWS]

Prints time, rows per second and peak memory of three ways in one run, each in a process of its own:
reading and checking the table (`import_table` without a target), the same with the HDF5 file
written, and a plain loop over csv.DictReader that only turns cells into numbers.
"""

from __future__ import annotations

import csv
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

META = """robot: ur10e
poses: {P1: {q_rad: [0.25, -1.66, -1.68, -1.36, 1.57, -1.33], tcp_xyz_mm: [0, 0, 0]}}
directions: {x: [1, 0, 0], y: [0, 1, 0]}
instruments:
  force: {standard_uncertainty_N: 0.1, gain_relative_sd: 0.005}
  displacement: {standard_uncertainty_mm: 0.002, gain_relative_sd: 0.003}
"""
WORDS = ("pose", "direction", "branch")


def make_table(path: Path, rows: int) -> None:
    rng = np.random.default_rng(1)
    names = "time_s,session_s,pose,direction,repetition,branch,step,force_N,displacement_mm"
    names += ",q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad"
    with path.open("w") as file:
        file.write(names + "\n")
        for first in range(0, rows, 10_000):
            n = min(10_000, rows - first)
            force = rng.normal(100, 30, n)
            q = rng.normal([0.25, -1.66, -1.68, -1.36, 1.57, -1.33], 1e-5, (n, 6))
            for i in range(n):
                t = first + i
                direction, branch = "xy"[t // 1000 % 2], ("loading", "unloading")[t // 500 % 2]
                angles = ",".join(f"{v:.6f}" for v in q[i])
                file.write(
                    f"{t % 1000}.0,{t}.0,P1,{direction},{t // 2000 + 1},{branch},{t % 500 // 25},"
                    f"{force[i]:.4f},{force[i] / 95.94:.6f},{angles}\n"
                )


def plain_loop(path: Path) -> int:
    columns: dict[str, list[object]] = {}
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            for name, cell in row.items():
                value = cell if name in WORDS else float(cell)
                columns.setdefault(name, []).append(value)
    arrays = {name: np.array(values) for name, values in columns.items()}
    return len(arrays["force_N"])


def measured(way: str, folder: Path) -> None:
    """Runs one way in this process and prints a line of JSON."""
    from rig.tables import import_table

    table, meta = folder / "table.csv", folder / "META.yaml"
    start = time.perf_counter()
    if way == "loop":
        rows = plain_loop(table)
    else:
        rows = import_table(table, meta, folder / "out.h5" if way == "import" else None).rows
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"rows": rows, "s": seconds, "peak_MB": peak}))


def main() -> None:
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_table(folder / "table.csv", rows)
        (folder / "META.yaml").write_text(META)
        size = (folder / "table.csv").stat().st_size / 1e6
        print(f"{rows} rows, 15 columns, {size:.0f} MB of CSV")
        times: dict[str, float] = {}
        for way in ("read", "import", "loop"):
            code = "import sys, pathlib; sys.path[:0] = sys.argv[3:]; import import_table as b; "
            code += "b.measured(sys.argv[1], pathlib.Path(sys.argv[2]))"
            here = Path(__file__).resolve().parent
            command = [sys.executable, "-c", code, way, name, str(here), str(here.parent)]
            run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=600)
            got = json.loads(run.stdout)
            times[way] = got["s"]
            print(
                f"{way:>7}: {got['s']:6.2f} s {rows / got['s']:>12,.0f} rows/s "
                f"peak {got['peak_MB']:5.0f} MB"
            )
        print(f"HDF5 file: {(folder / 'out.h5').stat().st_size / 1e6:.0f} MB")
        read, both = (times["loop"] / times[way] for way in ("read", "import"))
        print(f"{read:.1f} times as fast as the loop, with the file written {both:.1f} times")


if __name__ == "__main__":
    main()
