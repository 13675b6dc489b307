"""The person at the screw, at a terminal: a live screen, single keys, typed answers."""

from __future__ import annotations

import contextlib
import math
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from drivers.clock import Clock
from drivers.errors import DeviceError
from drivers.interfaces import WITHDRAWN, Command, LiveView, Prompt
from drivers.operator.keys import Keys
from drivers.operator.settings import OperatorSettings

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.live import Live

COMMANDS: Mapping[str, Command] = {
    "p": "pause",
    "r": "redo_step",
    "R": "redo_repetition",
    "s": "skip",
    "a": "abort",
}
NOTICES, NOTICE_S = 4, 60.0
PLAIN_EVERY_S = 2.0
REFRESHES_PER_S = 10


class _Question:
    """A prompt on the screen and the answer that is being typed."""

    def __init__(self, prompt: Prompt) -> None:
        self.prompt = prompt
        self.typed = ""
        self.complaint = ""
        self.answer: str | None = None
        self.answered = threading.Event()

    def key(self, character: str) -> None:
        if character in "\r\n":
            self._enter()
        elif character in "\x7f\b":
            self.typed = self.typed[:-1]
        elif character.isprintable():
            self.typed += character

    def _enter(self) -> None:
        answers, typed = self.prompt.answers, self.typed.strip()
        if not answers:
            matches = [typed] if typed else []
        elif typed in answers:
            matches = [typed]
        elif not typed:
            # Enter alone confirms where there is nothing to choose, and only there.
            matches = list(answers) if len(answers) == 1 else []
        else:
            matches = [a for a in answers if a.lower().startswith(typed.lower())]
        if len(matches) == 1:
            self.answer = matches[0]
            self.answered.set()
            return
        self.complaint = f"{typed!r} is no answer" if typed else "an answer is needed"
        self.typed = ""


class ConsoleOperator:
    """Meets `drivers.interfaces.Loader` at the terminal this process runs in.

    With no terminal to show on, it prints plain lines; with no terminal to type at, keys do
    nothing and `ask` raises a DeviceError instead of waiting for ever. `guide`, `ask` and the
    keys may come from different threads.
    """

    name = "operator"

    def __init__(self, settings: OperatorSettings, clock: Clock, *, emulated: bool = False) -> None:
        self._settings = settings
        self._clock = clock
        self._emulated = emulated
        self._keys = Keys(self._on_key)
        self._lock = threading.Lock()
        self._view: LiveView | None = None
        self._seen = -math.inf
        self._stale_since: dict[str, float] = {}
        self._notices: deque[tuple[float, str, str]] = deque(maxlen=NOTICES)
        self._question: _Question | None = None
        self._commands: deque[Command] = deque()
        self._console: Console | None = None
        self._live: Live | None = None
        self._closed = threading.Event()
        self._printed, self._printed_key = -math.inf, ""

    def open(self) -> None:
        """Takes over the terminal, as far as there is one."""
        from rich.console import Console

        self._closed.clear()
        # Standard output may carry results for another program; the screen is for a person.
        self._console = Console(stderr=not sys.stdout.isatty())
        self._keys.start()
        if self._console.is_terminal:
            from rich.live import Live

            self._live = Live(
                console=self._console,
                get_renderable=self._picture,
                refresh_per_second=REFRESHES_PER_S,
                transient=True,
            )
            self._live.start()

    def close(self) -> None:
        """Gives the terminal back as it was; never raises, may be called twice."""
        self._closed.set()
        if self._live is not None:
            with contextlib.suppress(OSError):  # the terminal itself may be gone
                self._live.stop()
            self._live = None
        self._keys.stop()

    def identity(self) -> Mapping[str, str]:
        """Who turns the screw."""
        return {
            "device": "operator at the console",
            "screw_pitch_mm": f"{self._settings.screw_pitch_mm:g}",
            "source": "console",
        }

    def ask(self, prompt: Prompt) -> str:
        """Waits for one of the answers, or a unique beginning of one; free text if none is given.

        Raises DeviceError when nobody can type, or when the operator's place is closed meanwhile.
        """
        if not self._keys.available:
            raise DeviceError(
                self.name,
                f"is asked {prompt.text!r}, and standard input is no terminal",
                "Run the command in a terminal, or on a station with `driver: scripted`.",
            )
        question = _Question(prompt)
        with self._lock:
            self._question = question
        if self._live is None:
            self._print(f"{prompt.text} [{' / '.join(prompt.answers)}]")
        try:
            while not question.answered.wait(0.1):
                if self._closed.is_set():
                    raise DeviceError(
                        self.name, f"left {prompt.text!r} unanswered", "Start the command again."
                    )
        finally:
            with self._lock:
                self._question = None
        assert question.answer is not None
        return question.answer

    def answer(self, answer: str) -> None:
        """Ends the open question with an answer that was given elsewhere."""
        with self._lock:
            if self._question is not None:
                self._question.answer = answer
                self._question.answered.set()

    def withdraw(self) -> None:
        """Takes the open question off the screen."""
        self.answer(WITHDRAWN)

    def guide(self, view: LiveView) -> None:
        """Shows the view."""
        now = time.monotonic()
        with self._lock:
            self._view, self._seen = view, now
            self._stale_since = {d: self._stale_since.get(d, now) for d in view.stale}
        if self._live is None:
            self._print_view(view, now)

    def notify(self, text: str, level: Literal["info", "warning", "error"] = "info") -> None:
        """Shows a line for a minute; errors stay in the scrollback too."""
        with self._lock:
            self._notices.append((time.monotonic(), level, text))
        if self._live is None or level == "error":
            self._print(f"{level}: {text}")

    def command(self) -> Command | None:
        """The next key that meant something."""
        with self._lock:
            return self._commands.popleft() if self._commands else None

    def _on_key(self, character: str) -> None:
        with self._lock:
            if self._question is not None:
                self._question.key(character)
            elif character in COMMANDS:
                self._commands.append(COMMANDS[character])

    def _picture(self) -> RenderableType:
        from drivers.operator.screen import screen

        now = time.monotonic()
        with self._lock:
            question = self._question
            return screen(
                self._view,
                pitch_mm=self._settings.screw_pitch_mm,
                age_s=now - self._seen,
                stale_s={d: now - since for d, since in self._stale_since.items()},
                notices=[(lv, text) for at, lv, text in self._notices if now - at < NOTICE_S],
                prompt=question.prompt if question else None,
                typed=question.typed if question else "",
                complaint=question.complaint if question else "",
                emulated=self._emulated,
            )

    def _print_view(self, view: LiveView, now: float) -> None:
        from drivers.operator.screen import plain

        key = (
            f"{view.pose} {view.direction} {view.repetition} {view.step} {view.phase} {view.stale}"
        )
        if key == self._printed_key and now - self._printed < PLAIN_EVERY_S:
            return
        self._printed, self._printed_key = now, key
        self._print(plain(view, self._settings.screw_pitch_mm))

    def _print(self, text: str) -> None:
        if self._console is not None:
            self._console.print(text, markup=False, highlight=False, soft_wrap=True)
