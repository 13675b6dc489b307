"""The Dashboard server: one line a command, one line a reply, always under a deadline.

Own client because the library's one stays "connected" after the other side has closed. Source of
commands and replies: Universal Robots' description of the Dashboard server of the e-Series. Only
questions, `load`, `play` and `stop` are ever sent: nothing here switches on, releases brakes or
unlocks.
"""

from __future__ import annotations

import time
from types import TracebackType

from drivers.errors import BadReply, CannotConnect
from drivers.ur10e.probe import connect

PORT = 29999
_REMEDY = (
    "Enable the Dashboard server at the pendant (Settings, Security, Services), "
    'or set "dashboard: false" in the station file.'
)
_REMOTE = (
    "Check at the pendant that the controller is in Remote Control, that the program exists under "
    "this name and runs when started there."
)


class Dashboard:
    """One conversation; use as a context manager. `deadline` in time.monotonic() bounds all of it.

    Raises CannotConnect (no route, refused, mute, no greeting) and BadReply (a refused command).
    """

    def __init__(self, device: str, host: str, deadline: float) -> None:
        self._device = device
        self._where = f"the Dashboard server {host}:{PORT}"
        self._deadline = deadline
        self._rest = b""
        self._link = connect(device, host, PORT, deadline, _REMEDY)

    def __enter__(self) -> Dashboard:
        try:
            self._greet()
        except BaseException:
            self._link.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._link.close()

    def ask(self, command: str) -> str:
        """The reply to a question, without the words before its colon (`Robotmode: RUNNING`)."""
        reply = self._exchange(command)
        return reply.rpartition(": ")[2]

    def load(self, program: str) -> None:
        """Loads a program; BadReply if the controller does not."""
        self._order(f"load {program}", "Loading program:")

    def play(self) -> None:
        """Starts the loaded program: the arm moves. BadReply if the controller refuses."""
        self._order("play", "Starting program")

    def stop(self) -> None:
        """Stops the program that plays; BadReply if the controller refuses."""
        self._order("stop", "Stopped")

    def _greet(self) -> None:
        greeting = self._line("a greeting")
        if not greeting.startswith("Connected:"):
            fault = f"{self._where} greets with {greeting[:60]!r}"
            raise CannotConnect(self._device, fault, _REMEDY)

    def _order(self, command: str, wanted: str) -> None:
        reply = self._exchange(command)
        if not reply.startswith(wanted):
            fault = f'{self._where} answers "{reply[:120]}" to "{command}"'
            raise BadReply(self._device, fault, _REMOTE)

    def _exchange(self, command: str) -> str:
        if not command.isprintable():  # a line feed would begin a second command
            fault = f"{command!r} is not one printable line, and was not sent to {self._where}"
            raise BadReply(self._device, fault, "Correct the program's name in the protocol.")
        self._link.settimeout(max(0.01, self._deadline - time.monotonic()))
        try:
            self._link.sendall(command.encode() + b"\n")
        except OSError as error:
            raise self._gone(f'the reply to "{command}"', str(error)) from error
        return self._line(f'the reply to "{command}"')

    def _line(self, what: str) -> str:
        while b"\n" not in self._rest:
            remaining = self._deadline - time.monotonic()
            if remaining <= 0:
                raise self._gone(what, "it stays mute")
            self._link.settimeout(remaining)
            try:
                data = self._link.recv(4096)
            except TimeoutError:
                raise self._gone(what, "it stays mute") from None
            except OSError as error:
                raise self._gone(what, str(error.strerror or error)) from error
            if not data or len(self._rest) > 65536:
                raise self._gone(what, "it closed the connection" if not data else "no line ends")
            self._rest += data
        line, _, self._rest = self._rest.partition(b"\n")
        return line.decode("utf-8", "replace").strip()

    def _gone(self, what: str, why: str) -> CannotConnect:
        return CannotConnect(self._device, f"{self._where} did not send {what}: {why}", _REMEDY)
