"""A Python process of this project beside the measuring one, talked to through two pipes.

What libraries print there must not reach the terminal: it goes to a log, whose last line says why
the process ended. Ctrl-C is for the process that started it, which then ends this one.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

_LAST_WORDS_S = 1.0  # for a process whose pipe has closed to be gone
_KILLED_S = 5.0  # for one that was killed


@dataclass(frozen=True)
class Ending:
    """status: of a process that has ended, None while it has not; line: the last it printed."""

    status: int | None
    line: str


class ChildProcess:
    """`python -m MODULE` in this interpreter, which finds the project as this process does.

    environment: what it finds set beside, or instead of, this process's own variables.
    """

    def __init__(self, module: str, environment: Mapping[str, str] | None = None) -> None:
        root = str(Path(__file__).resolve().parent.parent)
        path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 (`close` does)
        self._process = subprocess.Popen(
            [sys.executable, "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            env={**os.environ, "PYTHONPATH": path, **(environment or {})},
            start_new_session=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input: IO[bytes] = self._process.stdin
        self.output: IO[bytes] = self._process.stdout

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def send(self, data: bytes) -> None:
        """Writes to its standard input. OSError where it has ended, ValueError after `close`."""
        self._input.write(data)
        self._input.flush()

    def close_input(self) -> None:
        """No more comes, which tells it to end."""
        with suppress(OSError):  # it has ended already
            self._input.close()

    def ended_within(self, seconds: float) -> bool:
        """Whether it ends by itself, waiting for so long."""
        try:
            self._process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            return False
        return True

    def ending(self) -> Ending:
        """How it ended, waiting a second for that; also while another thread closes this."""
        status = self._process.returncode if self.ended_within(_LAST_WORDS_S) else None
        try:
            self._log.seek(0)
            said = self._log.read().decode(errors="replace").strip().splitlines()
        except ValueError:  # closed already
            said = []
        return Ending(status, said[-1] if said else "")

    def kill(self) -> None:
        """Ends it by force if it has not ended."""
        if self._process.poll() is None:
            self._process.kill()
            self.ended_within(_KILLED_S)

    def close(self) -> None:
        """Closes pipes and log; only once it has ended, or a full pipe would hold this up."""
        self.close_input()
        self.output.close()
        self._log.close()
