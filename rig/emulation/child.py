"""The child process that holds the emulated rig: messages in, answers out, and a sure end."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rig.errors import InputError

if TYPE_CHECKING:
    from rig.emulation.host import EmulationHost
    from rig.station import Station

ENDING_S = 5.0  # for emulators to stop before the process ends all the same


class _Terminated(BaseException):
    """SIGTERM has come."""


class Child:
    """The child's side: answers on its private copy of standard output."""

    def __init__(self) -> None:
        # Whatever a library prints goes to standard error: here only answers are written.
        self._output = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)
        self._host: EmulationHost | None = None

    def run(self, first: Mapping[str, Any] | None = None) -> int:
        """Serves until standard input closes; `first` in place of the first message."""
        signal.signal(signal.SIGTERM, _terminate)
        try:
            settings = first if first is not None else _message(sys.stdin.readline())
            if "station" not in settings:
                return 0  # the parent has gone before it said what to emulate
            if not self._begin(settings):
                return 1
            for line in sys.stdin:
                message = _message(line)
                if "quit" in message:
                    break
                self._reply(self._inject(message.get("fault")))
        except _Terminated:
            pass
        finally:
            self._end()
        return 0

    def _begin(self, settings: Mapping[str, Any]) -> bool:
        from rig.emulation.host import EmulationHost

        try:
            station = _station(settings)
            self._host = EmulationHost(station, **settings["procedure"])
            self._reply({"endpoints": self._host.start(_leave)})
        except InputError as error:
            self._reply({"error": str(error), "input": True})
            return False
        except OSError as error:
            self._reply({"error": f"the emulators can't be started: {error}"})
            return False
        return True

    def _inject(self, fault: Any) -> dict[str, Any]:
        assert self._host is not None
        try:
            self._host.inject(str(fault["device"]), str(fault["kind"]))
        except InputError as error:
            return {"error": str(error), "input": True}
        return {"ok": True}

    def _reply(self, answer: Mapping[str, Any]) -> None:
        # Where nobody listens any more standard input closes next, and that ends everything.
        with contextlib.suppress(BrokenPipeError):
            print(json.dumps(answer), file=self._output, flush=True)

    def _end(self) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        # An emulator that hangs must not keep the process: nobody would be left to end it.
        watchdog = threading.Timer(ENDING_S, os._exit, args=(1,))
        watchdog.daemon = True
        watchdog.start()
        if self._host is not None:
            self._host.stop()
        watchdog.cancel()


def _terminate(*_: object) -> None:
    raise _Terminated


def _leave() -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def _message(line: str) -> dict[str, Any]:
    """One message; an empty line, as at the end of the input, is none and means to end."""
    if not line.strip():
        return {"quit": True}
    message: dict[str, Any] = json.loads(line)
    return message


def _station(settings: Mapping[str, Any]) -> Station:
    from pydantic import TypeAdapter

    from rig.station import Station as StationType

    return TypeAdapter(StationType).validate_python(settings["station"])
