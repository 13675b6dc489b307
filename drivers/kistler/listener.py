"""A loopback port that misbehaves below gRPC: closes, stays mute, or speaks another protocol."""

from __future__ import annotations

import contextlib
import socket
import threading
import time

_NAME = "kistler-emulator-raw"


class RawListener:
    """Listens on `port` until `stop`; `behaviour` is "close", "mute" or "chatter"."""

    def __init__(self, port: int, behaviour: str, deadline_s: float = 2.0) -> None:
        """Raises OSError when the port is not free before the deadline."""
        self._behaviour = behaviour
        self._held: list[socket.socket] = []
        self._socket = _listen(port, deadline_s)
        self._socket.settimeout(0.05)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=_NAME, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Closes everything and ends the thread."""
        self._stopping.set()
        self._thread.join(2.0)
        for held in [self._socket, *self._held]:
            held.close()

    def _run(self) -> None:
        while not self._stopping.is_set():
            with contextlib.suppress(TimeoutError):
                self._greet(self._socket.accept()[0])

    def _greet(self, connection: socket.socket) -> None:
        if self._behaviour == "close":
            connection.close()
            return
        self._held.append(connection)
        if self._behaviour == "chatter":
            with contextlib.suppress(OSError):
                connection.sendall(b"220 printer ready\r\n" * 4)


def _listen(port: int, deadline_s: float) -> socket.socket:
    deadline = time.monotonic() + deadline_s
    while True:
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", port))
            listener.listen()
        except OSError:
            listener.close()
            if time.monotonic() > deadline:
                raise
            time.sleep(0.02)
        else:
            return listener
