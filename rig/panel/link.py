"""The measuring process's end: starts the page's process, feeds it, and never waits for it."""

from __future__ import annotations

import contextlib
import json
import secrets
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rig.child_process import ChildProcess
from rig.panel.guard import authority, is_loopback
from rig.panel.state import State, to_json

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 8321
STATE_EVERY_S = 0.1  # as often as the procedure ticks in real time, however fast it runs
START_S = 20.0
MOST_WAITING = 20_000  # items that the page's process has not taken: by then it never will
ENDING_S = 4.0

Receive = Callable[[Mapping[str, Any]], None]


class PanelUnavailable(Exception):
    """The page can't be served; the text says why. No reason not to measure."""


@dataclass(frozen=True)
class PanelOptions:
    """Where the page is served: `port` None: the usual one, or any free one when that is busy."""

    host: str = DEFAULT_HOST
    port: int | None = None


@dataclass(frozen=True)
class Links:
    """Addresses for people: the operator's holds the right to command."""

    operator: str
    viewer: str


class PanelLink:
    """The page's process, seen from the measurement.

    `show` and `add` return at once whatever the other side does: a thread of this class writes.
    Of states only the newest is kept until it can be written; items are all kept. `receive` is
    called in a thread with what comes back: {"command": ...} or {"operator": bool}.
    """

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._child: ChildProcess | None = None
        self._ready = threading.Event()
        self._first: Mapping[str, Any] = {}
        self._wake = threading.Condition()
        self._state: tuple[State, float] | None = None
        self._items: deque[Mapping[str, object]] = deque()
        self._end: Mapping[str, str] | None = None
        self._next_state = 0.0
        self._writer = threading.Thread(target=self._write, name="panel-out", daemon=True)
        self._reader = threading.Thread(target=self._read, name="panel-in", daemon=True)
        self.trouble = ""  # why there is no page any more

    def start(self, options: PanelOptions) -> Links:
        """Starts the process; returns the links when it serves, or raises PanelUnavailable."""
        settings = {
            "host": options.host,
            "port": DEFAULT_PORT if options.port is None else options.port,
            "or_any_port": options.port is None,
            "run": secrets.token_urlsafe(6),
            "operator_token": secrets.token_urlsafe(24),
            "viewer_token": secrets.token_urlsafe(24),
        }
        self._child = ChildProcess("rig.panel")
        self._reader.start()
        with contextlib.suppress(OSError):  # it has ended already; the lack of a reply says so
            self._send(json.dumps(settings).encode() + b"\n")
        try:
            self._ready.wait(START_S)
        except BaseException:
            self._kill()
            raise
        if "ready" not in self._first:
            reason = str(self._first.get("error") or self._how_it_ended())
            self._kill()
            raise PanelUnavailable(reason)
        self._writer.start()
        return _links(settings, int(self._first["ready"]["port"]))

    def show(self, state: State) -> None:
        """The newest state; an earlier one that still waits is dropped."""
        with self._wake:
            self._state = (state, time.monotonic())
            self._wake.notify()

    def add(self, item: Mapping[str, object]) -> None:
        """One item of the history; none is dropped."""
        with self._wake:
            if self.trouble:
                return
            self._items.append(item)
            if len(self._items) > MOST_WAITING:
                self._give_up("its process takes nothing any more")
            self._wake.notify()

    def finish(self, phase: str, text: str) -> None:
        """Sends what waits and the end, and ends the process; by force after some seconds."""
        with self._wake:
            self._end = {"phase": phase, "text": text}
            self._wake.notify()
        self._writer.join(ENDING_S)
        if self._child is not None and not self._writer.is_alive():
            self._child.ended_within(ENDING_S)
        self._kill()

    def _write(self) -> None:
        while True:
            with self._wake:
                while not self._due():
                    self._wake.wait(self._patience())
                items, self._items = self._items, deque()
                state, end = None, self._end
                if end is not None or time.monotonic() >= self._next_state:
                    state, self._state = self._state, None
            lines = [b'{"item":' + to_json(item) + b"}\n" for item in items]
            if state is not None:
                self._next_state = time.monotonic() + STATE_EVERY_S
                lines.append(to_json({"state": state[0], "at": state[1]}) + b"\n")
            if end is not None:
                lines.append(to_json({"end": end}) + b"\n")
            try:
                self._send(b"".join(lines))
            except (OSError, ValueError):  # ValueError: closed by _kill meanwhile
                self._lost()
                return
            if end is not None:
                assert self._child is not None
                self._child.close_input()  # the process can't end while it still listens
                return

    def _due(self) -> bool:
        fresh = self._state is not None and time.monotonic() >= self._next_state
        return bool(self._items) or self._end is not None or fresh

    def _patience(self) -> float | None:
        """How long to sleep at most: until the waiting state may go."""
        return None if self._state is None else max(0.001, self._next_state - time.monotonic())

    def _send(self, data: bytes) -> None:
        assert self._child is not None
        self._child.send(data)

    def _read(self) -> None:
        assert self._child is not None
        with contextlib.suppress(ValueError):  # closed by _kill
            for line in self._child.output:
                message = json.loads(line)
                if not self._ready.is_set():
                    self._first = message
                    self._ready.set()
                else:
                    self._receive(message)
        self._ready.set()
        self._lost()

    def _lost(self) -> None:
        why = self._how_it_ended()  # takes a while: the measurement must not wait at the lock
        with self._wake:
            if self._end is None:
                self._give_up(why)

    def _give_up(self, why: str) -> None:
        """Only with the lock held."""
        self.trouble = self.trouble or why
        self._items.clear()
        self._state = None

    def _how_it_ended(self) -> str:
        assert self._child is not None
        ending = self._child.ending()
        if ending.status is None:
            return "its process does not answer"
        words = f": {ending.line}" if ending.line else ""
        return f"its process has ended, status {ending.status}{words}"

    def _kill(self) -> None:
        if self._child is None:
            return
        self._child.kill()
        self._reader.join(1.0)  # it has read to the end
        self._child.close()


def _links(settings: Mapping[str, Any], port: int) -> Links:
    host = str(settings["host"])
    base = f"http://{authority(_reachable(host), port)}/"
    viewer = base if is_loopback(host) else f"{base}?token={settings['viewer_token']}"
    return Links(f"{base}?token={settings['operator_token']}", viewer)


def _reachable(host: str) -> str:
    """The address that others use for this machine when it listens on all of them."""
    if host not in ("0.0.0.0", "::"):
        return host
    # Connecting a datagram socket sends nothing; it only looks up the way out.
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    outside = "2001:db8::1" if ":" in host else "192.0.2.1"
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((outside, 9))
            return str(probe.getsockname()[0])
    except OSError:
        return socket.gethostname()
