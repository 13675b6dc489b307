"""A viewer of the operator's page without a browser: the stream, and commands."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import parse_qs, urlsplit

DEADLINE_S = 90.0  # a busy machine takes several times as long as a quiet one


class PanelClient:
    """Reads the stream in a thread, as the page does; `client` is the page's own word."""

    def __init__(self, link: str, client: str = "client-one") -> None:
        parts = urlsplit(link)
        assert parts.hostname is not None
        assert parts.port is not None
        self.host, self.port = parts.hostname, parts.port
        self.origin = f"http://{parts.netloc}"
        self.token = parse_qs(parts.query).get("token", [""])[0]
        self.client = client
        self.states: list[dict[str, Any]] = []
        self.arrivals: list[float] = []
        self.items: list[dict[str, Any]] = []
        self.resets: list[str] = []
        self.end: dict[str, str] | None = None
        self.last_id = ""
        self.closed = threading.Event()
        self._socket: socket.socket | None = None

    def connect(self, last_id: str = "", *, in_address: bool = False) -> PanelClient:
        """Opens the stream; the last id in a header as browsers send it, or in the address."""
        self.closed.clear()
        self._socket = socket.create_connection((self.host, self.port), 10)
        resume = f"Last-Event-ID: {last_id}\r\n" if last_id and not in_address else ""
        query = f"token={self.token}&client={self.client}" + f"&last={last_id}" * in_address
        self._socket.sendall(
            f"GET /events?{query} HTTP/1.1\r\n"
            f"Host: {self.host}:{self.port}\r\n{resume}\r\n".encode()
        )
        threading.Thread(target=self._read, args=(self._socket,), daemon=True).start()
        return self

    def disconnect(self) -> None:
        """Hangs up, as a closed tab does."""
        if self._socket is not None:
            self._socket.shutdown(socket.SHUT_RDWR)
            assert self.closed.wait(10)
            self._socket.close()

    def samples(self) -> list[dict[str, Any]]:
        """All that have come, in order."""
        return [item["sample"] for item in list(self.items) if "sample" in item]

    def wait(self, what: Callable[[PanelClient], object], deadline_s: float = DEADLINE_S) -> None:
        """Until something holds of what has come."""
        end = time.monotonic() + deadline_s
        while not what(self):
            assert time.monotonic() < end, f"not within {deadline_s} s; last: {self.states[-1:]}"
            time.sleep(0.01)

    def wait_state(
        self, what: Callable[[dict[str, Any]], object], deadline_s: float = DEADLINE_S
    ) -> None:
        """Until something has held of a state, from the newest one on: phases may be short."""
        first = max(0, len(self.states) - 1)
        self.wait(lambda me: any(what(state) for state in me.states[first:]), deadline_s)

    def command(self, command: str, **more: str) -> tuple[int, dict[str, Any]]:
        """Status and reply."""
        status, body = self.post({"command": command, **more})
        return status, json.loads(body)

    def post(self, request: object, **headers: str | None) -> tuple[int, bytes]:
        """A command with headers changed (None: left out)."""
        usual: dict[str, str | None] = {
            "Origin": self.origin,
            "Content-Type": "application/json",
            "X-Panel-Token": self.token,
            "X-Panel-Client": self.client,
        }
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        chosen = {key: value for key, value in {**usual, **named}.items() if value is not None}
        return self.request("POST", "/command", json.dumps(request).encode(), chosen)[:2]

    def get(self, path: str, **headers: str) -> tuple[int, bytes, Mapping[str, str]]:
        """Status, body and headers of a file."""
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        return self.request("GET", path, b"", named)

    def request(
        self, method: str, path: str, body: bytes, headers: Mapping[str, str]
    ) -> tuple[int, bytes, Mapping[str, str]]:
        """One request on a connection of its own."""
        connection = http.client.HTTPConnection(self.host, self.port, timeout=10)
        try:
            connection.request(method, path, body or None, dict(headers))
            response = connection.getresponse()
            return response.status, response.read(), dict(response.getheaders())
        finally:
            connection.close()

    def _read(self, connection: socket.socket) -> None:
        connection.settimeout(None)
        try:
            with connection.makefile("rb") as lines:
                for line in lines:
                    if line.startswith(b"id: "):
                        self.last_id = line[4:].decode().strip()
                    elif line.startswith(b"data: "):
                        self._take(json.loads(line[6:]))
        except OSError:
            pass
        finally:
            self.closed.set()

    def _take(self, message: dict[str, Any]) -> None:
        if "seq" in message:
            self.arrivals.append(time.monotonic())
            self.states.append(message)
        elif "batch" in message:
            self.items += message["batch"]
        elif "reset" in message:
            self.resets.append(message["reset"])
            self.items.clear()
        elif "end" in message:
            self.end = message["end"]
