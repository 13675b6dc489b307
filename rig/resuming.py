"""What is said and recorded where an interrupted measurement goes on."""

from __future__ import annotations

from datetime import datetime

from rig.digits import counted
from rig.procedure.progress import Progress
from rig.protocol import MeasurementProtocol


def interrupted(protocol: MeasurementProtocol, progress: Progress) -> str:
    """What becomes of the repetition that was under way; "" where none was."""
    if progress.interrupted is None:
        return ""
    index, repetition, rows = progress.interrupted
    run = protocol.runs[index]
    return (
        f"Pose {run.pose}, direction {run.direction}: repetition {repetition} was interrupted and "
        f"is measured anew as a whole. Its {counted(rows, 'row')} so far stay in the file, marked "
        "as discarded."
    )


def resumed(created: str, progress: Progress, *, emulated: bool) -> dict[str, object]:
    """The event, and the session's clock set. It counts from `created`: drifts, warm-up and creep
    went on while nothing was measured. An emulated rig stood still; there it goes on where it
    stopped."""
    now, stopped_s = datetime.now().astimezone(), progress.session_s
    if not emulated:
        progress.session_s = max(stopped_s, (now - datetime.fromisoformat(created)).total_seconds())
    text = "measurement resumed" + (
        "; the emulated rig stood still meanwhile"
        if emulated
        else f" {progress.session_s - stopped_s:.0f} s after the last record"
    )
    when = {"session_s": round(progress.session_s, 3), "at": now.isoformat(timespec="seconds")}
    return {"kind": "resumed", "text": text, **when}
