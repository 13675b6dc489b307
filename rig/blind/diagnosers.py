"""The processes that diagnose: fresh interpreters, one case at a time each, with a deadline."""

from __future__ import annotations

import json
import queue
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal

from rig.child_process import ChildProcess
from rig.threads import NAMES

Status = Literal["answered", "refused", "crashed", "late"]
START_S = 120.0  # loading the libraries on a busy machine
ENDING_S = 2.0
_THREADS = (*NAMES, "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Reply:
    """What came back for one case; `diagnosis` is None unless the status is `answered`."""

    status: Status
    seconds: float
    diagnosis: dict[str, Any] | None = None
    reason: str = ""


class Diagnoser:
    """One process; started when it is first needed, and again after a crash or a missed deadline.

    module: the program; another one only in tests.
    """

    def __init__(self, deadline_s: float, module: str = "rig.blind.worker") -> None:
        self._deadline_s = deadline_s
        self._module = module
        self._child: ChildProcess | None = None
        self._reader: threading.Thread | None = None
        self._lines: queue.Queue[bytes | None] = queue.Queue()
        self._closed = threading.Event()

    def diagnose(self, path: Path, withhold: Sequence[str]) -> Reply:
        """The reply for one data set; never raises for what happens in the other process."""
        if self._closed.is_set():
            return Reply("crashed", 0.0, reason="the check was stopped")
        if self._child is None:
            failure = self._start()
            if failure is not None:
                return failure
        start = time.monotonic()
        question = json.dumps({"path": str(path), "withhold": list(withhold)})
        try:
            self._write(question)
            line = self._lines.get(timeout=self._deadline_s)
        except queue.Empty:
            self._end()
            return Reply("late", self._deadline_s, reason=f"not done after {self._deadline_s:g} s")
        except (OSError, ValueError):  # it has ended; or another thread has closed it
            line = None
        if line is None:
            return self._crashed(time.monotonic() - start)
        return _reply(json.loads(line), time.monotonic() - start)

    def close(self) -> None:
        """Ends the process, by force if need be; a case under way comes back as crashed."""
        self._closed.set()
        self._end()

    def _start(self) -> Reply | None:
        """Starts the process and waits until it is ready; a reply if it does not come to that."""
        self._lines = queue.Queue()
        self._child = child = ChildProcess(self._module, dict.fromkeys(_THREADS, "1"))
        self._reader = threading.Thread(target=_pump, args=(child.output, self._lines), daemon=True)
        self._reader.start()
        try:
            ready = self._lines.get(timeout=START_S)
        except queue.Empty:
            self._end()
            return Reply("late", START_S, reason=f"did not start within {START_S:g} s")
        return None if ready is not None else self._crashed(0.0)

    def _write(self, question: str) -> None:
        child = self._child
        if child is None:
            raise BrokenPipeError
        child.send(question.encode() + b"\n")

    def _crashed(self, seconds: float) -> Reply:
        child = self._child
        said = "" if child is None else child.ending().line
        self._end()
        return Reply("crashed", seconds, reason=said or "it ended without a word")

    def _end(self) -> None:
        child, self._child = self._child, None
        if child is None:
            return
        child.kill()
        if self._reader is not None:
            self._reader.join(ENDING_S)
        child.close()


def _pump(output: IO[bytes], lines: queue.Queue[bytes | None]) -> None:
    """Hands on line by line; None at the end."""
    for line in output:
        lines.put(line)
    lines.put(None)


def _reply(message: dict[str, Any], waited_s: float) -> Reply:
    if "refused" in message:
        return Reply("refused", waited_s, reason=str(message["refused"]))
    return Reply("answered", float(message["seconds"]), diagnosis=message["diagnosis"])
