"""Starts, watches and ends the process in which the client library receives."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

_PROJECT = Path(__file__).resolve().parents[2]
_END_WAIT_S = 0.5
_KILLED_WAIT_S = 2.0


class ReceiveProcess:
    """One child process and the thread that reads its messages.

    `on_message` gets every message (a dict), `on_end` is called once when the messages have ended;
    both from the thread, the latter not after `stop`. `stop` ends the process
    whatever state it is in.
    """

    def __init__(
        self,
        options: dict[str, Any],
        on_message: Callable[[dict[str, Any]], None],
        on_end: Callable[[ReceiveProcess], None],
    ) -> None:
        self._on_message = on_message
        self._on_end = on_end
        self._stopping = False
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - lives with the process
        self._process = subprocess.Popen(
            [sys.executable, "-m", "drivers.ur10e.child", json.dumps(options)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            cwd=_PROJECT,
        )
        self._thread = threading.Thread(target=self._read, name="ur10e messages", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Number of the child process."""
        return self._process.pid

    def stop(self) -> None:
        """Ends the process: it leaves when its input closes, and is killed where it does not."""
        self._stopping = True
        process = self._process
        with contextlib.suppress(OSError):
            if process.stdin is not None:
                process.stdin.close()
        try:
            process.wait(_END_WAIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            with contextlib.suppress(subprocess.TimeoutExpired):  # stuck in the system
                process.wait(_KILLED_WAIT_S)
        self._thread.join(_END_WAIT_S)
        if process.stdout is not None and not self._thread.is_alive():
            process.stdout.close()
        self._errors.close()

    def ending(self) -> str:
        """How the process ended, in words: its exit status or signal and its last line."""
        try:
            status = self._process.wait(_END_WAIT_S)
        except subprocess.TimeoutExpired:
            return "is still there but closed its output"
        if status < 0:
            try:
                words = f"died of signal {signal.Signals(-status).name}"
            except ValueError:
                words = f"died of signal {-status}"
        else:
            words = f"ended with exit status {status}"
        last = self._last_line()
        return f'{words} ("{last}")' if last else words

    def _last_line(self) -> str:
        if self._errors.closed:
            return ""
        size = self._errors.seek(0, 2)
        self._errors.seek(max(0, size - 2000))
        lines = self._errors.read().decode("utf-8", "replace").strip().splitlines()
        return lines[-1].strip()[:200] if lines else ""

    def _read(self) -> None:
        output = self._process.stdout
        if output is not None:
            for line in output:
                self._on_message(json.loads(line))
        if not self._stopping:
            self._on_end(self)
