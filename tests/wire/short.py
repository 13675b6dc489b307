"""A short measurement on an emulated station of its own, run as a user runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

HOME = Path(__file__).resolve().parents[2]

PROTOCOL = """\
schema: rig.protocol/1
title: short
station: test
robot: ur10e
poses: {P1: {q_deg: [13.43, -99.84, -108.10, -62.06, 90.0, -76.57], tcp_xyz_mm: [0, 0, 0]}}
move_arm: false
joint_encoder: output
directions: {x: [1, 0, 0]}
runs: [{pose: P1, direction: x, steps_N: [20, 40, 60]}]
repetitions: 2
branches: loading
order: by_run
sampling: {rate_Hz: 1, samples_per_step: 3}
hold_s: 0
force_band: {absolute_N: 1.0, relative: 0.02}
settle: {window_s: 3, force_slope_N_per_s: 0.1, force_spread_N: 0.5,
  displacement_slope_mm_per_s: 0.005, displacement_spread_mm: 0.02, deadline_s: 60,
  at_deadline: record}
step_deadline_s: 300
zero: {before_s: 3, after_s: 3}
rest_s: 2
rated_load_N: null
limits:
  force_N: {max: 240, at: stop}
  displacement_mm: {max: 9, at: stop}
  joint_deviation_deg: {max: 5, at: stop}
  joint_temperature_C: {max: 60, at: stop}
prompts: {}
"""


def station(speed: float = 30, faults: str = "[]", seed: int = 1, **others: str) -> str:
    """The emulated station of the project with another speed, other faults, another seed, and
    `others` by their key. Where no device is to fail, none does because the machine is busy."""
    if faults == "[]":
        others.setdefault("stale_after_s", "10")
    text = (HOME / "protocols" / "stations" / "emulated.yaml").read_text(encoding="utf-8")
    lines = []
    for line in text.splitlines():
        key = line.strip().split(":")[0]
        indent = line[: len(line) - len(line.lstrip())]
        changed = {"name": "test", "speed": speed, "seed": seed, "faults": faults, **others}
        lines.append(f"{indent}{key}: {changed[key]}" if key in changed else line)
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Outcome:
    """How a command ended."""

    status: int
    stdout: str
    stderr: str


def run_rig(
    *words: str, cwd: Path, timeout: float = 90, largest_file: int | None = None
) -> Outcome:
    """`rig` in a process of its own. largest_file: bytes at which the disk refuses."""
    limited = [] if largest_file is None else ["prlimit", f"--fsize={largest_file}"]
    result = subprocess.run(
        [*limited, sys.executable, "-m", "rig", *words],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(HOME)},
    )
    return Outcome(result.returncode, result.stdout, result.stderr)


def write_files(
    folder: Path,
    *,
    repetitions: int = 2,
    steps_N: Sequence[float] = (20, 40, 60),
    samples: int = 3,
    **changes: object,
) -> list[str]:
    """Protocol and station in `folder`; the words of a `rig measure` that writes run.h5 there.
    changes: of the station, which reads the force five times less often than the project's. Ask for
    no more than the question at hand needs: every second of a run costs one of a processor."""
    text = PROTOCOL.replace("repetitions: 2", f"repetitions: {repetitions}")
    text = text.replace("steps_N: [20, 40, 60]", f"steps_N: {list(steps_N)}")
    text = text.replace("samples_per_step: 3", f"samples_per_step: {samples}")
    (folder / "short.yaml").write_text(text, encoding="utf-8")
    changes.setdefault("sample_rate_Hz", 200)
    (folder / "test.yaml").write_text(station(**changes), encoding="utf-8")  # type: ignore[arg-type]
    return ["measure", "short.yaml", "--station", "test.yaml", "-o", "run.h5"]
