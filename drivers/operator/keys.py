"""Single keys from the terminal, read in a thread; the terminal is restored in every case."""

from __future__ import annotations

import atexit
import contextlib
import os
import select
import sys
import threading
from collections.abc import Callable


class Keys:
    """Gives each typed character to `on_key`, from its own thread.

    `available` tells whether standard input is a terminal this process can listen to; without,
    `start` does nothing.
    """

    def __init__(self, on_key: Callable[[str], None]) -> None:
        self._on_key = on_key
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._saved: list[object] | None = None
        self._descriptor = -1

    @property
    def available(self) -> bool:
        """Whether keys can come at all."""
        try:
            return sys.stdin is not None and os.isatty(sys.stdin.fileno())
        except (OSError, ValueError):
            return False

    def start(self) -> None:
        """Takes keys one by one (no line editing, no echo; Ctrl-C stays what it is)."""
        if self._thread is not None or not self.available:
            return
        import termios
        import tty

        self._descriptor = sys.stdin.fileno()
        self._saved = termios.tcgetattr(self._descriptor)
        atexit.register(self._restore)
        tty.setcbreak(self._descriptor)
        self._stop.clear()
        self._thread = threading.Thread(target=self._listen, name="keys", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends listening and restores the terminal; never raises, may be called twice."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=2)
            self._thread = None
        self._restore()

    def _restore(self) -> None:
        if self._saved is None:
            return
        import termios

        with contextlib.suppress(termios.error, OSError):  # the terminal itself may be gone
            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._saved)  # type: ignore[arg-type]
        self._saved = None
        atexit.unregister(self._restore)

    def _listen(self) -> None:
        while not self._stop.is_set():
            try:
                ready, _, _ = select.select([self._descriptor], [], [], 0.1)
                data = os.read(self._descriptor, 64) if ready else None
            except OSError:
                return
            if data is None:
                continue
            if not data:
                return  # end of input: the terminal has gone
            for character in data.decode(errors="ignore"):
                self._on_key(character)
