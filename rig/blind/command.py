"""`rig blind`: a campaign from its options to its report."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.blind import text
from rig.blind.campaign import Plan, run
from rig.blind.case import generator, plain
from rig.blind.score import report
from rig.terminal import Progress

ANSWERS = "answers.json"


@dataclass(frozen=True, eq=False)
class BlindResult:
    """The report; `to_json` is schema rig.blind/1."""

    report: dict[str, Any]

    @property
    def interrupted(self) -> bool:
        """Whether cases are missing because of Ctrl-C."""
        return bool(self.report["interrupted"])

    def to_json(self) -> dict[str, Any]:
        """Summary, tables, and every case with answers and diagnosis."""
        out: dict[str, Any] = plain(self.report)
        return out

    def to_text(self) -> str:
        """What the terminal shows."""
        return text.terminal(self.report)


def blind(plan: Plan, *, keep: Path | None = None, progress: Progress | None = None) -> BlindResult:
    """Draws, diagnoses in other processes, opens the answers, scores.

    keep: a new folder for the data sets, beside which the answers are laid at the end. InputError
    for what can't be drawn or written.
    """
    draw, words = generator(plan.generator)
    campaign = run(plan, draw, words, keep=keep, progress=progress)
    if keep is not None:
        answers = {f"{o.number:04d}.h5": plain(o.label) for o in campaign.outcomes}
        (keep / ANSWERS).write_text(json.dumps(answers, indent=1) + "\n", encoding="utf-8")
    return BlindResult(report(campaign))


def all_cores() -> int:
    """As many jobs as there are cores."""
    return os.cpu_count() or 1
