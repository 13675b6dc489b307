"""A small table with its META, and what the tests of the command line are given."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

HOME = Path(__file__).parents[2]
META = """\
robot: none
directions: {x: [1, 0, 0]}
instruments: {force: {standard_uncertainty_N: 0.1}, displacement: {standard_uncertainty_mm: 0.002}}
simulation: {stiffness_N_per_mm: {x: 95.0}, stiffness_relative_sd: 0.1}
"""
TABLE = "time_s,repetition,branch,step,force_N,displacement_mm\n" + "".join(
    f"{10 * r + s},{r},{'zero' if s == 0 else 'loading'},{s},{20 * s},{0.2 * s + 0.001 * r}\n"
    for r in (1, 2, 3)
    for s in range(6)
)
ARM_META = """\
robot: ur10e
poses: {P1: {q_rad: [0.234398, -1.742537, -1.886701, -1.083151, 1.570796, -1.336399]}}
directions: {x: [1, 0, 0]}
instruments: {force: {standard_uncertainty_N: 0.1}, displacement: {standard_uncertainty_mm: 0.002}}
simulation: {joint_stiffness_Nm_per_rad: [37000, 57000, 18000, 7100, 7500, 8000]}
"""

Rig = Callable[..., tuple[int, str, str]]


def unread(folder: Path, words: str, *, both: bool = False) -> tuple[int, str]:
    """Status and stderr of `rig WORDS` whose reader has left; both: that of stderr, too."""
    reader, pipe = os.pipe()
    os.close(reader)
    ended = subprocess.run(
        [sys.executable, "-m", "rig", *words.split()],
        cwd=folder,
        stdout=pipe,
        stderr=pipe if both else subprocess.PIPE,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(HOME), "TMPDIR": str(folder)},
    )
    os.close(pipe)
    return ended.returncode, ended.stderr or ""
