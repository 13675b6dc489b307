"""How far a measurement has come: read from its own journal, so that it can be resumed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import nan
from typing import Any, Protocol

from rig.procedure.unloaded import Unloaded


class JournalRecord(Protocol):
    """What of a journal record matters here."""

    @property
    def kind(self) -> str:
        """One of the journal's kinds of record."""

    @property
    def data(self) -> dict[str, Any]:
        """What was recorded."""


@dataclass
class Progress:
    """Repetitions that are done, and the counters that a resumed run goes on with.

    repetitions: (run index, repetition); steps: (run index, repetition, branch, step number). A
    skipped step counts as done. A repetition counts as a whole: force and datum are zeroed anew for
    every one, and what an arm does on the way down depends on how far it has been up.
    first_rows: of the repetitions that were begun. resting: the rest after the last one had not
    passed. unloaded: where the arm stood without load in the setup that was measured last.
    """

    repetitions: set[tuple[int, int]] = field(default_factory=set)
    steps: set[tuple[int, int, str, int]] = field(default_factory=set)
    rows: int = 0
    segment: int = 0
    session_s: float = 0.0
    first_rows: dict[tuple[int, int], int] = field(default_factory=dict)
    resting: bool = False
    unloaded: Unloaded = field(default_factory=Unloaded)

    @property
    def done_steps(self) -> int:
        """Steps of the repetitions that are done."""
        return sum(step[:2] in self.repetitions for step in self.steps)

    @property
    def interrupted(self) -> tuple[int, int, int] | None:
        """Run index and repetition that are to be measured anew, and how many rows they have."""
        for key, first in self.first_rows.items():
            if key not in self.repetitions and first < self.rows:
                return (*key, self.rows - first)
        return None

    def forget_repetition(self, run: int, repetition: int) -> None:
        """The repetition is to be measured again."""
        self.steps = {s for s in self.steps if s[:2] != (run, repetition)}
        self.repetitions.discard((run, repetition))
        self.first_rows.pop((run, repetition), None)


def read_progress(records: Iterable[JournalRecord]) -> Progress:
    """Replays what the runner wrote."""
    progress = Progress()
    for record in records:
        data = record.data
        progress.session_s = max(progress.session_s, data.get("session_s") or 0.0)
        if record.kind == "sample":
            progress.rows += 1
            progress.segment = max(progress.segment, data["segment"])
            values = data.get("values", {})
            force_N, laser_mm = _value(values, "force_N"), _value(values, "laser_mm")
            progress.unloaded.row(data.get("branch", ""), force_N, laser_mm)
        elif record.kind == "event":
            _apply(progress, data)
    return progress


def _apply(progress: Progress, event: dict[str, Any]) -> None:
    kind = event["kind"]
    if kind == "repetition_start":
        repetition = (event["run"], event["repetition"])
        progress.first_rows.setdefault(repetition, progress.rows)
    elif kind == "step_done":
        key = (event["run"], event["repetition"], event["branch"], event["step"])
        progress.steps.add(key)
    elif kind == "repetition_done":
        progress.repetitions.add((event["run"], event["repetition"]))
        progress.resting = True
    elif kind == "repetition_redone":
        progress.forget_repetition(event["run"], event["repetition"])
    elif kind == "tared":
        progress.resting = False
        setup = (event.get("pose", ""), event.get("direction", ""))
        progress.unloaded.tared(setup, _value(event, "laser_mm"))


def _value(values: dict[str, Any], name: str) -> float:
    """nan where there is none, or an older version has not noted it."""
    value = values.get(name)
    return nan if value is None else float(value)
