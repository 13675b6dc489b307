"""The operator of emulated runs: reads the same views as a person and turns the emulated screw."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Literal

from drivers.clock import Clock
from drivers.errors import BadReply, CannotConnect
from drivers.interfaces import Command, LiveView, Prompt
from drivers.operator.hand import HAND_MM_PER_S, Hand
from drivers.operator.screw import ScrewClient
from drivers.operator.settings import OperatorSettings

UNLOAD_S, UNLOAD_WALL_S = 60.0, 5.0
UNWATCHED_S = 0.5  # without a view for so long: nobody shows the force during the prompt
CLEARANCE_MM = 0.1


class ScriptedOperator:
    """Meets `drivers.interfaces.Loader` without a person.

    Knows what a person at the screw would know: the views and what its own turns did. Answers
    prompts with their first answer, or with `answers[prompt.key]`; a prompt "mount" is carried
    out in the emulated scene, "reset" and "operate" at the switch of the emulated amplifier, and
    "unload" by the views that come meanwhile, or, when none come, by turning back what was turned
    since the set-up. `press` queues a command, as a key of the console would. `guide` and `ask` may
    run in different threads.
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
        self._net_mm = 0.0  # turned since the set-up
        self._views = 0  # that showed a force
        self._lock = threading.Lock()
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
        offered = prompt.answers or ("said by the scripted operator",)
        answer = self._answers.get(prompt.key, offered[0])
        if prompt.answers and answer not in prompt.answers:
            raise BadReply(
                self.name,
                f"the prepared answer {answer!r} to {prompt.key!r} is none of "
                + ", ".join(prompt.answers),
                "Correct the answers of the scripted operator.",
            )
        if prompt.key == "mount" and prompt.details is not None:
            self._mount(prompt.details)
        if prompt.key == "unload":
            self._unload()
        if prompt.key in ("reset", "operate"):
            self._screw().request(amplifier=prompt.key)
        return answer

    def withdraw(self) -> None:
        """Nothing: the answer is under way."""

    def guide(self, view: LiveView) -> None:
        """Turns the screw a little when it is time to."""
        with self._lock:
            self._views += math.isfinite(view.force_N)
            advance_mm = self._hand.decide(view, self._clock.now())
            if advance_mm is not None:
                self._turn(advance_mm)

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
        with self._lock:
            self._screw().mount(direction, joints)
            self._hand.reset()
            self._hand.turned_back(0.0)  # set up means: not touching
            self._net_mm = 0.0

    def _unload(self) -> None:
        deadline = time.monotonic() + UNLOAD_WALL_S + UNLOAD_S / self._clock.speed
        watched = time.monotonic()
        views = self._views
        while not self._hand.released:
            if self._views != views:
                views, watched = self._views, time.monotonic()
            if time.monotonic() - watched > UNWATCHED_S or time.monotonic() > deadline:
                self._turn_back()
                return
            time.sleep(0.005)

    def _turn_back(self) -> None:
        with self._lock:
            way_mm = self._net_mm + CLEARANCE_MM
            self._turn(-way_mm)
            self._hand.turned_back(way_mm)
        self._clock.sleep(abs(way_mm) / HAND_MM_PER_S + 1.0)

    def _turn(self, advance_mm: float) -> None:
        self._screw().turn(advance_mm * 1e-3)
        self._net_mm += advance_mm

    def _screw(self) -> ScrewClient:
        if self._client is None:
            raise CannotConnect(self.name, "the operator is not open", "Open it first.")
        return self._client
