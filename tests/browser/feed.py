"""A measurement that is none: serves the operator's page and says what a test wants it to say.

It speaks what `rig.panel.state` fixes, with states built from its dataclasses, so that the page
can be shown any situation at any moment: a device that fails, a stream that stops, a late state.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from rig.panel.state import State, to_json

PAGE = Path(__file__).resolve().parents[2] / "rig" / "panel" / "page"
TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}
TOKEN = "operators-own-token"
POLICY = "default-src 'self'; frame-ancestors 'none'"


class Feed:
    """Serves on loopback until closed. `state` and `items` may be changed at any time.

    `operator` is the client that may command; the first with the token becomes it. `silent`
    keeps connections open and says nothing; `late_s` delays what is said without telling.
    """

    def __init__(self, state: State, items: list[dict[str, object]] | None = None) -> None:
        self.state = state
        self.items = items or []
        self.recent: list[tuple[float, float | None, float | None]] = []
        self.commands: list[dict[str, Any]] = []
        self.refusal = ""
        self.on_command: Callable[[dict[str, Any]], None] = lambda _: None
        self.operator = ""
        self.silent = False
        self.late_s = 0.0
        self.end: dict[str, str] | None = None
        self.viewers = 0
        self.resumed: list[int] = []  # items that a viewer had when it opened each stream
        self.clients: list[str] = []  # who opened each stream
        self._server: _Server | None = None
        self.start()

    def start(self, port: int = 0) -> None:
        """Begins to serve, after `stop` on the same port."""
        self._server = _Server(("127.0.0.1", port), self)
        threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True).start()

    def stop(self) -> int:
        """Cuts every connection; returns the port."""
        assert self._server is not None
        server, self._server = self._server, None
        server.stopping.set()
        server.shutdown()
        server.server_close()
        return int(server.server_address[1])

    def close(self) -> None:
        """Stops, if it still serves."""
        if self._server is not None:
            self.stop()

    @property
    def url(self) -> str:
        """The operator's link."""
        assert self._server is not None
        return f"http://127.0.0.1:{self._server.server_address[1]}/?token={TOKEN}"

    def show(self, **changes: Any) -> None:
        """Changes fields of the state."""
        self.state = replace(self.state, **changes)

    def message(self, seq: int, client: str) -> dict[str, Any]:
        """The state as one client gets it."""
        message: dict[str, Any] = json.loads(to_json(self.state))
        you = client == self.operator
        message["seq"] = seq
        message["t_s"] = time.monotonic() - self.late_s
        message["operator"] = {"you": you, "taken": bool(self.operator), "may_take": True}
        return message


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True

    def __init__(self, address: tuple[str, int], feed: Feed) -> None:
        super().__init__(address, _Handler)
        self.feed = feed
        self.stopping = threading.Event()


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base's name
        """Nothing: a test prints its own words."""

    def do_GET(self) -> None:
        address = urlsplit(self.path)
        if address.path == "/events":
            self._events(parse_qs(address.query))
            return
        file = PAGE / (address.path.lstrip("/") or "index.html")
        if file.parent != PAGE or not file.is_file():
            self.send_error(404)
            return
        self._send(200, TYPES[file.suffix], file.read_bytes())

    def do_POST(self) -> None:
        feed = self.server.feed
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if body["command"] == "take_over":
            feed.operator = self.headers["X-Panel-Client"]
        feed.commands.append(body)
        feed.on_command(body)
        reply = {"ok": False, "error": feed.refusal} if feed.refusal else {"ok": True}
        self._send(409 if feed.refusal else 200, "application/json", json.dumps(reply).encode())

    def _send(self, status: int, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def _events(self, query: dict[str, list[str]]) -> None:
        feed, client = self.server.feed, query["client"][0]
        feed.operator = feed.operator or client
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        last = self.headers.get("Last-Event-ID") or query.get("last", ["0"])[0]
        told, seq = int(last), 0
        feed.resumed.append(told)
        feed.clients.append(client)
        if not told:
            self._event({"reset": "run"})
        if feed.recent:
            self._event({"recent": feed.recent})
        feed.viewers += 1
        try:
            while not self.server.stopping.is_set():
                if not feed.silent:
                    told = self._tell(feed, client, told, seq)
                    seq += 1
                if feed.end is not None:
                    self._event({"end": feed.end})
                    return
                time.sleep(0.1)
        except OSError:
            return  # the page has gone
        finally:
            feed.viewers -= 1

    def _tell(self, feed: Feed, client: str, told: int, seq: int) -> int:
        items = feed.items[told:]
        if items:
            told += len(items)
            self._event({"batch": items}, told)
        self._event(feed.message(seq, client))
        return told

    def _event(self, message: object, number: int | None = None) -> None:
        lines = f"id: {number}\n" if number is not None else ""
        self.wfile.write(f"{lines}data: {json.dumps(message)}\n\n".encode())
        self.wfile.flush()
