"""The control port of the emulated screw: one JSON object a line, one reply a line, on loopback.

Requests: `{"turn_mm": 0.1}`, `{"mount": {"direction": [1, 0, 0], "q_rad": [..6..] or null}}`,
`{"state": true}`, and whatever else the host hands in handlers for. Replies carry `"ok": true`
and what was asked for, or `"error"` with a sentence.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import socketserver
import threading
from collections.abc import Callable, Mapping, Sequence

from drivers.errors import BadReply, CannotConnect, ReadTimeout
from drivers.scene import Scene

LONGEST_LINE = 65536
Handler = Callable[[object], object]


class ScrewServer:
    """Turns and mounts in a scene on request; `handlers` add requests by name.

    A handler gets the request's value and returns something JSON can say, under "result"; its
    ValueError becomes the reply's error.
    """

    def __init__(self, scene: Scene, handlers: Mapping[str, Handler] | None = None) -> None:
        self._scene = scene
        self._turned_mm = 0.0
        self._lock = threading.Lock()
        self._handlers: dict[str, Handler] = {
            "turn_mm": self._turn,
            "mount": self._mount,
            "state": self._state,
            **(handlers or {}),
        }
        self._server: _Server | None = None

    def start(self) -> str:
        """Serves on a free port of 127.0.0.1; returns address:port."""
        server = _Server(self.answer)
        thread = threading.Thread(
            target=server.serve_forever, args=(0.05,), name="screw", daemon=True
        )
        thread.start()
        self._server = server
        host, port = server.server_address[:2]
        return f"{host!s}:{port}"

    def stop(self) -> None:
        """Ends the service and every connection; may be called twice."""
        if self._server is not None:
            self._server.shutdown()
            self._server.hang_up()
            self._server.server_close()
            self._server = None

    def answer(self, line: bytes) -> bytes:
        """The reply to one line."""
        try:
            reply = self._carry_out(json.loads(line))
        except (ValueError, RecursionError) as error:
            reply = {"error": str(error)}
        return json.dumps(reply).encode() + b"\n"

    def _carry_out(self, request: object) -> dict[str, object]:
        known = ", ".join(self._handlers)
        if not isinstance(request, dict) or len(request) != 1:
            raise ValueError(f"a request is an object with one of the keys {known}")
        name, value = next(iter(request.items()))
        if name not in self._handlers:
            raise ValueError(f"unknown request {name!r}; known: {known}")
        return {"ok": True, "result": self._handlers[name](value)}

    def _turn(self, value: object) -> object:
        advance_mm = _number(value, "turn_mm")
        with self._lock:
            self._turned_mm += advance_mm
            self._scene.turn(advance_mm * 1e-3)
            return {"turned_mm": self._turned_mm}

    def _mount(self, value: object) -> object:
        if not isinstance(value, dict) or "direction" not in value:
            raise ValueError("mount needs direction: [x, y, z], and may have q_rad: six angles")
        direction = _vector(value["direction"], "direction", 3)
        length = math.hypot(*direction)
        if not 0.999 < length < 1.001:
            raise ValueError(f"direction {direction} has length {length:g}; it must be 1")
        q_rad = value.get("q_rad")
        with self._lock:
            if q_rad is not None:
                self._scene.move(_vector(q_rad, "q_rad", 6))
            self._scene.mount(direction)
            self._turned_mm = 0.0
        return {"mounted": direction}

    def _state(self, _: object) -> object:
        with self._lock:
            return {
                "now_s": self._scene.now(),
                "speed": self._scene.speed,
                "turned_mm": self._turned_mm,
            }


def _number(value: object, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{name} is {value!r}; it must be a finite number")
    return float(value)


def _vector(value: object, name: str, length: int) -> list[float]:
    if not isinstance(value, list) or len(value) != length:
        raise ValueError(f"{name} is {value!r}; it must be a list of {length} numbers")
    return [_number(item, name) for item in value]


class _Server(socketserver.ThreadingTCPServer):
    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True

    def __init__(self, answer: Callable[[bytes], bytes]) -> None:
        super().__init__(("127.0.0.1", 0), _Connection)
        self.answer = answer
        self.connections: set[socket.socket] = set()

    def hang_up(self) -> None:
        for connection in tuple(self.connections):
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)


class _Connection(socketserver.StreamRequestHandler):
    disable_nagle_algorithm = True
    server: _Server

    def handle(self) -> None:
        self.server.connections.add(self.connection)
        try:
            while line := self.rfile.readline(LONGEST_LINE):
                self.wfile.write(self.server.answer(line))
        except OSError:
            return  # the client has gone
        finally:
            self.server.connections.discard(self.connection)


class ScrewClient:
    """Talks to a `ScrewServer`; every request has a deadline in wall-clock seconds.

    Raises CannotConnect, ReadTimeout or BadReply.
    """

    REMEDY = "Start the emulated station (`rig emulate`) or correct `screw` in the station file."

    def __init__(self, address: str, deadline_s: float = 5.0) -> None:
        host, _, port = address.rpartition(":")
        if not host or not port.isdigit() or not 0 < int(port) < 65536:
            raise CannotConnect(
                "operator",
                f"the address {address!r} of the emulated screw is not address:port",
                self.REMEDY,
            )
        self._address = (host, int(port))
        self._deadline_s = deadline_s
        self._socket: socket.socket | None = None
        self._rest = b""
        self._lock = threading.Lock()

    def turn(self, advance_m: float) -> None:
        """Turns the screw by so much advance; negative loosens."""
        self.request(turn_mm=advance_m * 1e3)

    def mount(self, direction: Sequence[float], q_rad: Sequence[float] | None = None) -> None:
        """Sets up screw and laser along a unit vector, after moving the arm if `q_rad` is given."""
        joints = None if q_rad is None else [float(q) for q in q_rad]
        self.request(mount={"direction": [float(d) for d in direction], "q_rad": joints})

    def request(self, **json_object: object) -> object:
        """Any request, as keyword; returns the reply's result."""
        with self._lock:
            line = self._exchange(json.dumps(json_object).encode() + b"\n")
        try:
            reply = json.loads(line)
        except ValueError:
            reply = None
        if not isinstance(reply, dict) or not ("ok" in reply or "error" in reply):
            raise BadReply(
                "operator", f"the emulated screw answers {line[:80]!r}, no reply", self.REMEDY
            )
        if "error" in reply:
            raise BadReply("operator", f"the emulated screw refuses: {reply['error']}", self.REMEDY)
        return reply.get("result")

    def close(self) -> None:
        """Ends the connection; may be called twice."""
        with self._lock:
            self._hang_up()

    def _hang_up(self) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
        self._socket, self._rest = None, b""

    def _exchange(self, line: bytes) -> bytes:
        where = f"{self._address[0]}:{self._address[1]}"
        try:
            if self._socket is None:
                self._socket = socket.create_connection(self._address, self._deadline_s)
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.sendall(line)
            return self._receive(self._socket)
        except TimeoutError:
            self._hang_up()
            fault = f"the emulated screw at {where} has not answered for {self._deadline_s:g} s"
            raise ReadTimeout("operator", fault, self.REMEDY) from None
        except OSError as error:
            self._hang_up()
            fault = f"the emulated screw at {where} cannot be reached ({error})"
            raise CannotConnect("operator", fault, self.REMEDY) from None

    def _receive(self, connection: socket.socket) -> bytes:
        while b"\n" not in self._rest:
            data = connection.recv(4096)
            if not data:
                raise ConnectionError("it has closed the connection")
            self._rest += data
            if len(self._rest) > LONGEST_LINE:
                raise ConnectionError("its reply has no end")
        line, _, self._rest = self._rest.partition(b"\n")
        return line
