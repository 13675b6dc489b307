"""The operator of emulated runs: reads the same views as a person and turns the emulated screw."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Literal

from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect
from drivers.interfaces import Command, LiveView, Prompt
from drivers.operator.hand import Hand
from drivers.operator.screw import ScrewClient
from drivers.operator.settings import OperatorSettings


class ScriptedOperator:
    """Meets `drivers.interfaces.Loader` without a person.

    Knows what a person at the screw would know: the views and what its own turns did. Answers
    prompts with their first answer, or with `answers[prompt.key]`; a prompt "mount" is carried
    out in the emulated scene. `press` queues a command, as a key of the console would.
    """

    name = "operator"

    def __init__(
        self,
        settings: OperatorSettings,
        clock: Clock,
        answers: Mapping[str, str] | None = None,
        emulated: bool = True,
    ) -> None:
        self._settings = settings
        self._clock = clock
        self._answers = dict(answers or {})
        self._source = "emulated+scripted" if emulated else "scripted"
        self._client: ScrewClient | None = None
        self._hand = Hand()
        self._commands: deque[Command] = deque()
        self.notices: deque[tuple[str, str]] = deque(maxlen=100)  # level, text

    def open(self) -> None:
        """Reaches the screw; raises CannotConnect."""
        if self._settings.screw is None:
            raise CannotConnect(
                self.name,
                "the scripted operator has no screw to turn",
                "Give `screw: address:port` of an emulated station in the station file, or take "
                "`driver: console`.",
            )
        self.close()
        client = ScrewClient(self._settings.screw)
        client.request(state=True)
        self._client = client
        self._hand.reset()

    def close(self) -> None:
        """Ends the connection; never raises, may be called twice."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def identity(self) -> Mapping[str, str]:
        """Who turns the screw."""
        return {
            "device": "scripted operator",
            "screw": self._settings.screw or "none",
            "source": self._source,
        }

    def ask(self, prompt: Prompt) -> str:
        """Answers at once; raises BadReply when the prepared answer is none of the prompt's."""
        answer = self._answers.get(prompt.key, prompt.answers[0])
        if answer not in prompt.answers:
            raise BadReply(
                self.name,
                f"the prepared answer {answer!r} to {prompt.key!r} is none of "
                + ", ".join(prompt.answers),
                "Correct the answers of the scripted operator.",
            )
        if prompt.key == "mount" and prompt.details is not None:
            self._mount(prompt.details)
        return answer

    def guide(self, view: LiveView) -> None:
        """Turns the screw a little when it is time to."""
        advance_mm = self._hand.decide(view, self._clock.now())
        if advance_mm is not None:
            self._screw().turn(advance_mm * 1e-3)

    def notify(self, text: str, level: Literal["info", "warning", "error"] = "info") -> None:
        """Kept in `notices`."""
        self.notices.append((level, text))

    def command(self) -> Command | None:
        """The next of the commands that were pressed."""
        return self._commands.popleft() if self._commands else None

    def press(self, command: Command) -> None:
        """Asks for something as a person would by a key."""
        self._commands.append(command)

    def _mount(self, details: Mapping[str, object]) -> None:
        direction, q_rad = details.get("direction"), details.get("q_rad")
        if not isinstance(direction, Sequence):
            raise BadReply(
                self.name,
                f"the prompt to mount names no direction but {direction!r}",
                "Give the prompt details with direction and q_rad.",
            )
        joints = q_rad if isinstance(q_rad, Sequence) else None
        self._screw().mount(direction, joints)
        self._hand.reset()

    def _screw(self) -> ScrewClient:
        if self._client is None:
            raise CannotConnect(self.name, "the operator is not open", "Open it first.")
        return self._client
