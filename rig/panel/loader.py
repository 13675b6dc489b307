"""The person at the screw with the page beside the console, or beside the scripted hand."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Literal, Protocol, runtime_checkable

from drivers.errors import DeviceError
from drivers.interfaces import WITHDRAWN, Command, LiveView, Loader, Prompt
from rig.errors import MeasurementStopped
from rig.panel.panel import Panel, Question
from rig.procedure.limits import UNLOAD

# An emulated run asks its first question so soon that nobody could have opened the page yet.
JOIN_S = 20.0
POLL_S = 0.05
END_S = 1.0
# Questions whose answer is work in the emulated scene, whoever gives it.
MANUAL_WORK = ("mount", "unload", "reset", "operate")


@runtime_checkable
class TakesAnswers(Protocol):
    """A loader whose open question can be answered from elsewhere."""

    def answer(self, answer: str) -> None:
        """Answers the question that is open; without one nothing happens."""


class PanelLoader:
    """Meets `drivers.interfaces.Loader`: passes all on to the loader, and to the page.

    A question stands at both places, and the first answer counts. The scripted hand leaves it to
    the page while somebody sits at the controls there, and answers itself otherwise.
    """

    def __init__(self, loader: Loader, panel: Panel, *, scripted: bool) -> None:
        self.name = loader.name
        self._loader = loader
        self._panel = panel
        self._scripted = scripted
        self._join_until = 0.0
        self._closed = threading.Event()
        self._mourned = False
        self._question: Question | None = None

    def open(self) -> None:
        """Opens the loader; says what an emulated run waits for."""
        self._loader.open()
        self._closed.clear()
        if self._scripted:
            self._join_until = time.monotonic() + JOIN_S
            self._loader.notify(
                f"The first question waits {JOIN_S:g} s for somebody to open the operator's page; "
                "without an operator there the emulated one answers."
            )

    def close(self) -> None:
        """Ends the loader and every open question; never raises."""
        self._closed.set()
        self._loader.close()

    def identity(self) -> Mapping[str, str]:
        """The loader's, and that there was a page."""
        return {**self._loader.identity(), "page": "served"}

    def guide(self, view: LiveView) -> None:
        """Shows the view at both places."""
        self._panel.look(view)
        self._loader.guide(view)
        if self._panel.trouble and not self._mourned:
            self._mourned = True
            self.notify(
                f"The operator's page is gone: {self._panel.trouble}. The measurement goes on "
                "without it.",
                "warning",
            )

    def notify(self, text: str, level: Literal["info", "warning", "error"] = "info") -> None:
        """Says it at both places."""
        self._panel.log(text, level)
        self._loader.notify(text, level)

    def command(self) -> Command | None:
        """The next wish, from wherever."""
        return self._loader.command() or self._panel.wish()

    def ask(self, prompt: Prompt) -> str:
        """The first answer, from wherever. Raises MeasurementStopped when the page says abort."""
        question = self._question = self._panel.ask(prompt)
        try:
            answer = self._by_script(question) if self._scripted else self._by_console(question)
        finally:
            self._question = None
            self._panel.withdraw(question)
        if question.aborted:
            raise MeasurementStopped(f"the operator ended the measurement. {UNLOAD}")
        return answer

    def withdraw(self) -> None:
        """Takes the open question back, from both places."""
        question = self._question
        if question is not None and not question.done.is_set():
            question.answer = WITHDRAWN
            question.done.set()

    def _by_script(self, question: Question) -> str:
        prompt = question.prompt
        while self._left_to_the_page():
            if question.done.wait(POLL_S):
                break
        if question.aborted:
            return ""
        if question.answer is None:
            return self._loader.ask(prompt)
        if prompt.key in MANUAL_WORK and question.answer != WITHDRAWN:
            self._loader.ask(prompt)
        return question.answer

    def _left_to_the_page(self) -> bool:
        if self._closed.is_set() or self._panel.trouble:
            return False
        if self._panel.attended:
            self._join_until = 0.0
        return self._panel.attended or time.monotonic() < self._join_until

    def _by_console(self, question: Question) -> str:
        """Waits for both; the console's own failure counts once the page can't answer either."""
        console = _Asked(self._loader, question)
        while not question.done.wait(POLL_S):
            if self._closed.is_set():
                raise DeviceError(
                    self.name, f"left {question.prompt.text!r} unanswered", "Start again."
                )
            if console.error is not None and self._panel.trouble:
                raise console.error
        console.end()
        return question.answer or ""


class _Asked:
    """Asks the loader in a thread, and lets its answer end the question."""

    def __init__(self, loader: Loader, question: Question) -> None:
        self.error: DeviceError | None = None
        self._loader = loader
        self._question = question
        self._thread = threading.Thread(target=self._ask, name="console-prompt", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Takes an answer of the page to the console, so that it asks no longer."""
        deadline = time.monotonic() + END_S
        while self._thread.is_alive() and time.monotonic() < deadline:
            if isinstance(self._loader, TakesAnswers):
                self._loader.answer(self._question.answer or "")
            self._thread.join(POLL_S)

    def _ask(self) -> None:
        try:
            answer = self._loader.ask(self._question.prompt)
        except DeviceError as error:
            self.error = error
            return
        if not self._question.done.is_set():
            self._question.answer = answer
            self._question.done.set()
