"""Runs the diagnosis on labelled cases: verdict against accept, where, shrink, time.

    python bench/gap_cases.py [FOLDER] [--jobs 2] [--only CASE ...] [--withhold-truth] [--json F]

FOLDER holds <case>/samples.csv, <case>/meta.yaml and labels.json.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
DEFAULT = Path(__file__).parents[1] / "../shared/gap-cases"


def run(folder: Path, case: str, withhold: tuple[str, ...] = ()) -> dict[str, Any]:
    from rig.diagnosis.diagnose import diagnose
    from rig.tables import import_table

    dataset = import_table(folder / case / "samples.csv", folder / case / "meta.yaml")
    start = time.perf_counter()
    found = diagnose(dataset, withhold=withhold)
    return {
        **found.to_json(),
        "case": case,
        "seconds": time.perf_counter() - start,
        "text": found.to_text(),
    }


def line(out: dict[str, Any], label: dict[str, Any]) -> str:
    held = out["gap"]["held_out"] or {"shrink_factor": 1.0, "after_rms_mm": 0.0}
    noise = out["gap"]["noise_rms_mm"]
    top = sorted(out["probabilities"].items(), key=lambda i: -i[1])[:2]
    return (
        f"{'ok   ' if out['verdict'] in label['accept'] else 'WRONG'} {out['case']} "
        f"{'+'.join(label['truth']):36s} {'/'.join(label.get('forms', [])):24s} "
        f"{out['verdict']:26s} {top[0][1]:.2f} {top[1][0]} {top[1][1]:.2f} "
        f"found {[e['name'] for e in out['effects']]} joints {out['where']['joints']} "
        f"after/noise {out['gap']['after_rms_mm'] / noise:.2f} "
        f"held {held['after_rms_mm'] / noise:.2f} shrink {held['shrink_factor']:.1f} "
        f"{out['seconds']:.1f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=DEFAULT)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--withhold-truth", action="store_true")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    labels = json.loads((args.folder / "labels.json").read_text())["cases"]
    cases = args.only or list(labels)
    if args.withhold_truth:
        cases = [c for c in cases if labels[c]["truth"][0] not in ("none", "unknown")]
        cases = [c for c in cases if len(labels[c]["truth"]) == 1]
    results, right, times = [], 0, []
    with ProcessPoolExecutor(args.jobs, initializer=os.nice, initargs=(10,)) as pool:
        jobs = []
        for c in cases:
            out = tuple(labels[c]["truth"]) if args.withhold_truth else ()
            jobs.append((c, pool.submit(run, args.folder, c, out)))
        for c, job in jobs:
            result = job.result()
            label = labels[c]
            if args.withhold_truth:
                label = {**label, "accept": ["unknown"]}
            print(line(result, label), flush=True)
            right += result["verdict"] in label["accept"]
            times.append(result["seconds"])
            results.append(result)
    times.sort()
    print(
        f"{right} of {len(cases)} right; median {times[len(times) // 2]:.1f} s, "
        f"slowest {times[-1]:.1f} s"
    )
    if args.json:
        args.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
