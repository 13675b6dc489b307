"""Builds docs/faults.md from a run of the fault tests.

RIG_FAULT_TABLE=faults.jsonl .venv/bin/python -m pytest tests/wire/test_faults.py -m "slow or not slow"
.venv/bin/python docs/build_faults.py faults.jsonl
"""  # noqa: E501

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

HEAD = """\
# Faults: what the software says and how the measurement ends

Made by `docs/build_faults.py` from a run of `tests/wire/test_faults.py`: each fault is shown by the
emulators to a whole `rig measure`, from the start or in mid-run. Exit status 3: a device failed;
4: stopped for safety; 0: the fault costs values at most, which are counted and named in the data.
In every case the rows taken so far are kept, and `rig measure --resume` goes on from there; a
measurement that never began, because a device did not open, leaves no file.

"""


def main() -> None:
    """Reads the JSON lines, writes the table."""
    lines = Path(sys.argv[1]).read_text(encoding="utf-8").splitlines()
    rows = {(r["device"], r["fault"], r["when"]): r for r in map(json.loads, lines)}
    text = HEAD
    for device in ("robot", "dynamometer", "laser"):
        text += f"## {device}\n\n| fault | when | status | message |\n| --- | --- | --- | --- |\n"
        for (name, fault, when), row in sorted(rows.items()):
            if name == device:
                status = row["outcome"].removeprefix("exit ")
                text += f"| `{fault}` | {when} | {status} | {_tidy(row['message'])} |\n"
        text += "\n"
    Path(__file__).with_name("faults.md").write_text(text.rstrip() + "\n", encoding="utf-8")


def _tidy(message: str) -> str:
    """Addresses differ from run to run, and a bar ends a cell."""
    message = re.sub(r"127\.\d+\.\d+\.\d+", "127.x.x.x", message)
    message = re.sub(r"(127\.x\.x\.x:)(?!30004|29999)\d+", r"\1PORT", message)
    return re.sub(r"/dev/pts/\d+", "/dev/pts/N", message).replace("|", "\\|")


if __name__ == "__main__":
    main()
