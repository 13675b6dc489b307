"""The process that serves the page: lines of JSON from the measuring process, commands back.

In, one object a line: the settings {"host", "port", "or_any_port", "run", "operator_token",
"viewer_token"}, then {"state", "at"}, {"item"}, {"end"}. Out: {"ready": {"port"}} or {"error"},
then {"command": {...}} and {"operator": whether somebody sits at the controls}.
When the input closes without an end, the measuring process has died: viewers are told, and this
process ends too.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import sys
import threading
from collections.abc import Mapping
from typing import Any, BinaryIO

import uvicorn

from rig.panel.guard import Guard
from rig.panel.hub import Hub
from rig.panel.server import application, page_files

NICENESS = 5  # whoever looks on must not take the processor from the measurement
FAREWELL_S = 2.0  # for viewers to read the end
LATEST_END_S = 5.0
NO_ANSWER_S = 20  # a viewer that has read nothing for so long is gone
OPEN_CONNECTIONS = 80
DIED = {
    "phase": "fault",
    "text": "The measuring process has ended without a word. The rows so far are kept: "
    "rig measure --resume goes on. Turn the screw back until it no longer touches the arm.",
}


def main() -> int:
    """Serves until told to end, or until standard input closes."""
    # Whatever a library prints goes to standard error: here only answers are written.
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    settings = json.loads(sys.stdin.buffer.readline() or b"{}")
    if not settings:
        return 0  # the parent has gone before it said anything
    try:
        bound = listen(settings["host"], settings["port"], or_any=settings["or_any_port"])
    except OSError as error:
        _reply(output, {"error": _why(settings, error)})
        return 1
    asyncio.run(_serve(settings, bound, sys.stdin.buffer, output))
    return 0


def listen(host: str, port: int, *, or_any: bool) -> socket.socket:
    """A listening socket; another free port instead of a busy one if `or_any`. OSError."""
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    bound = socket.socket(family, kind, protocol)
    if os.name == "posix":  # elsewhere it would let two servers share the port
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # inherited by every connection
        bound.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 1000 * NO_ANSWER_S)
    try:
        bound.bind(address)
        bound.listen(64)
    except OSError:
        bound.close()
        if not or_any or port == 0:
            raise
        return listen(host, 0, or_any=False)
    return bound


def _why(settings: Mapping[str, Any], error: OSError) -> str:
    place = f"{settings['host']}, port {settings['port']}"
    return f"no page can be served on {place}: {error.strerror or error}"


async def _serve(
    settings: Mapping[str, Any], bound: socket.socket, source: BinaryIO, output: BinaryIO
) -> None:
    port = bound.getsockname()[1]
    hub = Hub(settings["run"])
    guard = Guard(settings["host"], port, settings["operator_token"], settings["viewer_token"])
    app = application(hub, guard, page_files(), lambda c: _reply(output, {"command": c}))
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            log_level="error",  # addresses hold tokens: no access log
            access_log=False,
            server_header=False,
            lifespan="off",
            ws="none",
            proxy_headers=False,
            limit_concurrency=OPEN_CONNECTIONS,
            timeout_graceful_shutdown=1,
        )
    )
    _read_in_background(source, hub)
    _reply(output, {"ready": {"port": port}})
    steward = asyncio.create_task(_watch(hub, server, output))
    await server.serve(sockets=[bound])
    steward.cancel()


def _read_in_background(source: BinaryIO, hub: Hub) -> None:
    loop = asyncio.get_running_loop()

    def read() -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended: nothing is read any more
            with contextlib.suppress(ValueError):  # killed in the middle of a line
                for line in source:
                    loop.call_soon_threadsafe(take, hub, json.loads(line))
            loop.call_soon_threadsafe(hub.finish, DIED)

    threading.Thread(target=read, name="measurement", daemon=True).start()


def take(hub: Hub, message: Mapping[str, Any]) -> None:
    """Hands one message of the measuring process to the hub."""
    if "state" in message:
        hub.set_state(message["state"], message["at"])
    elif "item" in message:
        hub.add(message["item"])
    elif "end" in message:
        hub.finish(message["end"])


async def _watch(hub: Hub, server: uvicorn.Server, output: BinaryIO) -> None:
    """Tells who sits at the controls, and ends the server when the run is over."""
    present = False
    while hub.end is None:
        if (hub.seat.holder is not None) != present:
            present = not present
            _reply(output, {"operator": present})
            hub.touch()
        await hub.changed()
    _end_surely()
    deadline = asyncio.get_running_loop().time() + FAREWELL_S
    while not hub.seat.empty and asyncio.get_running_loop().time() < deadline:
        await asyncio.sleep(0.02)
    server.should_exit = True


def _end_surely() -> None:
    """A connection that hangs must not keep the process: nobody would be left to end it."""
    watchdog = threading.Timer(LATEST_END_S, os._exit, args=(0,))
    watchdog.daemon = True
    watchdog.start()


def _reply(output: BinaryIO, message: Mapping[str, Any]) -> None:
    # Where nobody listens any more standard input closes next, and that ends everything.
    with contextlib.suppress(BrokenPipeError):
        output.write(json.dumps(message).encode() + b"\n")
        output.flush()
