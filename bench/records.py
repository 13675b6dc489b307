"""Runs the diagnosis on measured records with known effects; prints a table for docs/records.md.

    python bench/records.py FOLDER [FOLDER ...] [--jobs 2]

FOLDER holds <record>/samples.csv, meta.yaml, label.json ({"accept": [words], "doubt": ...}) and
SOURCE.md, whose heading names the record and whose first line with an address says where it is
from. The records themselves are other people's and stay out of the project.
"""

from __future__ import annotations

import argparse
import json
import os
import re
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
SURE = 0.85  # a wrong verdict above that is a confident error


def run(folder: Path) -> dict[str, Any]:
    from rig.diagnosis.diagnose import diagnose
    from rig.tables import import_table

    names = {p.name.lower(): p for p in folder.iterdir()}
    out = diagnose(import_table(names["samples.csv"], names["meta.yaml"])).to_json()
    return {"verdict": out["verdict"], "probability": out["probabilities"][out["verdict"]]}


def row(folder: Path, found: dict[str, Any], label: dict[str, Any]) -> str:
    text = (folder / "SOURCE.md").read_text(encoding="utf-8")
    title = text.splitlines()[0].removeprefix("# ").strip()
    link = re.search(r"https://\S+?(?=[\s`)>,;]|$)", text)
    source = f"[{'/'.join(link[0].split('/')[3:5])}]({link[0]})" if link else "see text"
    right = found["verdict"] in label["accept"]
    mark = "yes" if right else "**no**"
    return (
        f"| {title} | {source} | {', '.join(label['accept'])} | {label['doubt']} "
        f"| {found['verdict']} {found['probability']:.2f} | {mark} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    for top in options.folders:
        records = sorted(p.parent for p in top.glob("*/label.json"))
        labels = [json.loads((r / "label.json").read_text(encoding="utf-8")) for r in records]
        with ProcessPoolExecutor(options.jobs) as pool:
            found = list(pool.map(run, records))
        right = [f["verdict"] in label["accept"] for f, label in zip(found, labels, strict=True)]
        sure = [f["probability"] > SURE for f in found]
        wrong = sum(s and not r for s, r in zip(sure, right, strict=True))
        print(f"{sum(right)} of {len(records)} right, {wrong} confident errors\n")
        print("| record | source | right words | doubt of the label | verdict | right |")
        print("| --- | --- | --- | --- | --- | --- |")
        for r, f, label in zip(records, found, labels, strict=True):
            print(row(r, f, label))
        print()


if __name__ == "__main__":
    main()
