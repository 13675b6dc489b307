"""How far a measurement has come: read from its own journal, so that it can be resumed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol


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
    """Repetitions and steps that are done, and the counters that a resumed run goes on with.

    repetitions: (run index, repetition); steps: (run index, repetition, branch, step number).
    A skipped one counts as done.
    """

    repetitions: set[tuple[int, int]] = field(default_factory=set)
    steps: set[tuple[int, int, str, int]] = field(default_factory=set)
    rows: int = 0
    segment: int = 0
    session_s: float = 0.0
    first_rows: dict[tuple[int, int], int] = field(default_factory=dict)  # of each repetition
    open_step_row: int | None = None  # first row of a step that was under way

    def forget_repetition(self, run: int, repetition: int) -> None:
        """The repetition is to be measured again."""
        self.steps = {s for s in self.steps if s[:2] != (run, repetition)}


def read_progress(records: Iterable[JournalRecord]) -> Progress:
    """Replays what the runner wrote."""
    progress = Progress()
    for record in records:
        data = record.data
        if record.kind == "sample":
            progress.rows += 1
            progress.session_s = max(progress.session_s, data["session_s"])
            progress.segment = max(progress.segment, data["segment"])
        elif record.kind == "event":
            _apply(progress, data)
    return progress


def _apply(progress: Progress, event: dict[str, Any]) -> None:
    kind = event["kind"]
    if kind == "repetition_start":
        repetition = (event["run"], event["repetition"])
        progress.first_rows.setdefault(repetition, progress.rows)
    elif kind == "step_start":
        progress.open_step_row = progress.rows
    elif kind == "step_done":
        key = (event["run"], event["repetition"], event["branch"], event["step"])
        progress.steps.add(key)
        progress.open_step_row = None
    elif kind == "repetition_done":
        progress.repetitions.add((event["run"], event["repetition"]))
    elif kind == "repetition_redone":
        progress.forget_repetition(event["run"], event["repetition"])
        progress.open_step_row = None
    elif kind == "tared":
        progress.open_step_row = None
    elif kind == "discard" and progress.open_step_row is not None:
        progress.open_step_row = progress.rows  # what follows still belongs to the open step
