"""The processes that diagnose: fresh interpreters, one case at a time each, with a deadline."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal

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

    command: the program, for tests; left out: `rig.blind.worker` in this interpreter.
    """

    def __init__(self, deadline_s: float, command: Sequence[str] | None = None) -> None:
        self._deadline_s = deadline_s
        self._command = tuple(command or (sys.executable, "-m", "rig.blind.worker"))
        self._child: subprocess.Popen[str] | None = None
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._log: IO[str] | None = None
        self._closed = threading.Event()

    def diagnose(self, path: Path, withhold: Sequence[str]) -> Reply:
        """The reply for one data set; never raises for what happens in the other process."""
        if self._closed.is_set():
            return Reply("crashed", 0.0, reason="the check was stopped")
        start = time.monotonic()
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
        except OSError:
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
        self._log = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        root = str(Path(__file__).parents[2])
        path = os.pathsep.join(p for p in (root, os.environ.get("PYTHONPATH")) if p)
        self._lines = queue.Queue()
        child = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
            encoding="utf-8",
            env={**os.environ, "PYTHONPATH": path, **dict.fromkeys(_THREADS, "1")},
            start_new_session=True,  # Ctrl-C is the parent's to answer
        )
        self._child = child
        threading.Thread(target=_pump, args=(child.stdout, self._lines), daemon=True).start()
        try:
            ready = self._lines.get(timeout=START_S)
        except queue.Empty:
            self._end()
            return Reply("late", START_S, reason=f"did not start within {START_S:g} s")
        return None if ready is not None else self._crashed(0.0)

    def _write(self, question: str) -> None:
        child = self._child
        if child is None or child.stdin is None:
            raise BrokenPipeError
        child.stdin.write(question + "\n")
        child.stdin.flush()

    def _crashed(self, seconds: float) -> Reply:
        reason = "it ended without a word"
        if self._log is not None and not self._log.closed:
            self._log.seek(0)
            said = [line for line in self._log.read().splitlines() if line.strip()]
            reason = said[-1] if said else reason
        self._end()
        return Reply("crashed", seconds, reason=reason)

    def _end(self) -> None:
        child, self._child = self._child, None
        log, self._log = self._log, None
        if child is not None:
            child.kill()
            child.wait(timeout=ENDING_S + START_S)
            if child.stdin is not None:
                _close(child.stdin)
        if log is not None:
            log.close()


def _close(pipe: IO[str]) -> None:
    try:
        pipe.close()
    except OSError:  # what was left to send has no reader any more
        return


def _pump(pipe: IO[str] | None, lines: queue.Queue[str | None]) -> None:
    """Hands on line by line; None at the end."""
    if pipe is not None:
        with pipe:
            for line in pipe:
                lines.put(line)
    lines.put(None)


def _reply(message: dict[str, Any], waited_s: float) -> Reply:
    if "refused" in message:
        return Reply("refused", waited_s, reason=str(message["refused"]))
    return Reply("answered", float(message["seconds"]), diagnosis=message["diagnosis"])
