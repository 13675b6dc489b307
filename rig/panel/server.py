"""The web application: the page's own files, the stream, and commands. Knows no devices."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable

import anyio
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from rig.panel.guard import HEADERS, Guard
from rig.panel.hub import Hub, Viewer
from rig.panel.orders import Refused, order

TYPES: Mapping[str, str] = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
    "png": "image/png",
}
CLIENT_WORD = re.compile(r"[A-Za-z0-9_-]{8,64}")
LONGEST_BODY = 4096
MOST_VIEWERS = 40

Pass = Callable[[Mapping[str, str]], None]
Page = Mapping[str, tuple[bytes, str]]


def page_files() -> Page:
    """The page's files by path, content and type, read once: requests never reach a file system."""
    found: dict[str, tuple[bytes, str]] = {}

    def read(folder: Traversable, prefix: str) -> None:
        for entry in folder.iterdir():
            path = f"{prefix}/{entry.name}"
            if entry.is_dir():
                read(entry, path)
            elif (kind := entry.name.rpartition(".")[2]) in TYPES:
                found[path] = (entry.read_bytes(), TYPES[kind])

    read(files("rig.panel") / "page", "")
    if "/index.html" in found:
        found["/"] = found["/index.html"]
    return found


def application(hub: Hub, guard: Guard, page: Page, pass_on: Pass) -> ASGIApp:
    """`pass_on` takes a command for the measuring process and returns at once."""
    site = _Site(hub, guard, page, pass_on)
    routes = [
        Route("/events", site.events, methods=["GET"]),
        Route("/command", site.command, methods=["POST"]),
        Route("/{path:path}", site.file, methods=["GET"]),
    ]
    return _Guarded(Starlette(routes=routes), guard)


class _Guarded:
    """Refuses requests for other hosts or from other pages; sets the headers of every response."""

    def __init__(self, app: ASGIApp, guard: Guard) -> None:
        self._app = app
        self._guard = guard

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        words = self._refusal(scope)
        app = self._app if words is None else PlainTextResponse(words, 403)
        await app(scope, receive, send_with_headers)

    def _refusal(self, scope: Scope) -> str | None:
        headers = Headers(scope=scope)
        host, origin = headers.get("host"), headers.get("origin")
        if len(headers.getlist("host")) != 1 or not self._guard.host_allowed(host):
            return "This server does not answer to that name. Use the link from the terminal."
        own = self._guard.origin_allowed(origin, host)
        reads = scope["method"] == "GET"
        if not own and not (reads and origin is None):
            return "Only the panel's own page may do this."
        # A link from elsewhere may open the page itself, and nothing else.
        foreign = headers.get("sec-fetch-site") in ("cross-site", "same-site")
        if foreign and not (reads and headers.get("sec-fetch-dest") == "document"):
            return "Only the panel's own page may do this."
        return None


class _Site:
    def __init__(self, hub: Hub, guard: Guard, page: Page, pass_on: Pass) -> None:
        self._hub = hub
        self._guard = guard
        self._page = page
        self._pass_on = pass_on
        self._viewers = 0

    def _may_look(self, request: Request) -> bool:
        cookie = request.cookies.get(self._guard.cookie)
        return self._guard.may_look(request.query_params.get("token"), cookie)

    async def file(self, request: Request) -> Response:
        if not self._may_look(request):
            return PlainTextResponse(
                "Use the whole link from the terminal; it ends in a token.", 403
            )
        found = self._page.get(request.url.path)
        if found is None:
            return PlainTextResponse("There is no such page.", 404)
        content, media_type = found
        response = Response(content, media_type=media_type)
        if not self._guard.local:
            # Style sheets and scripts are fetched without the link's token.
            response.set_cookie(
                self._guard.cookie, self._guard.viewer_token, httponly=True, samesite="strict"
            )
        return response

    async def events(self, request: Request) -> Response:
        client = request.query_params.get("client", "")
        if not self._may_look(request):
            return PlainTextResponse(
                "Use the whole link from the terminal; it ends in a token.", 403
            )
        if not CLIENT_WORD.fullmatch(client):
            return PlainTextResponse("client must be 8 to 64 of A-Z a-z 0-9 _ -", 400)
        if self._viewers >= MOST_VIEWERS:
            return PlainTextResponse(f"{MOST_VIEWERS} viewers are the most.", 503)
        may_take = self._guard.may_command(request.query_params.get("token"))
        last = request.headers.get("last-event-id") or request.query_params.get("last")
        viewer = Viewer(client, may_take, seen=self._hub.first_seen(last))
        return _Stream(self, viewer)

    async def serve(self, viewer: Viewer, send: Send) -> None:
        """Sends the viewer what it lacks until the run is over."""
        hub = self._hub
        self._viewers += 1
        hub.seat.join(viewer)
        hub.touch()
        try:
            while not viewer.ended:
                if news := hub.news(viewer):
                    # Waits while the viewer does not read: nothing piles up for it here.
                    await send({"type": "http.response.body", "body": news, "more_body": True})
                if not hub.lacks(viewer):
                    await hub.changed()
        finally:
            self._viewers -= 1
            hub.seat.leave(viewer)
            hub.touch()
        await send({"type": "http.response.body", "body": b""})

    async def command(self, request: Request) -> Response:
        try:
            client = self._operator(request)
            wish = _json(await _body(request))
            if isinstance(wish, dict) and wish.get("command") == "take_over":
                self._hub.seat.take(client)
                self._hub.touch()
            else:
                self._obey(client, wish)
        except Refused as refused:
            return JSONResponse({"ok": False, "error": str(refused)}, refused.status)
        return JSONResponse({"ok": True})

    def _operator(self, request: Request) -> str:
        """The client word of a request that may command at all."""
        if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
            raise Refused(415, "A command is sent as application/json.")
        if not self._guard.may_command(request.headers.get("x-panel-token")):
            raise Refused(403, "This page only looks. Commands need the operator's link.")
        client = request.headers.get("x-panel-client", "")
        if not CLIENT_WORD.fullmatch(client):
            raise Refused(400, "The request does not say which page it comes from.")
        return client

    def _obey(self, client: str, wish: object) -> None:
        if self._hub.seat.holder != client:
            raise Refused(409, "Somebody else operates this measurement. Take over first.")
        self._pass_on(order(wish, self._hub.state))


class _Stream(Response):
    """An endless response of server-sent events, written as the viewer reads."""

    def __init__(self, site: _Site, viewer: Viewer) -> None:
        super().__init__(media_type="text/event-stream")
        del self.headers["content-length"]
        self._site = site
        self._viewer = viewer

    async def __call__(
        self,
        scope: Scope,  # noqa: ARG002 - part of the interface
        receive: Receive,
        send: Send,
    ) -> None:
        head = {"type": "http.response.start", "status": 200, "headers": self.raw_headers}
        await send(head)
        async with anyio.create_task_group() as tasks:

            async def until_gone() -> None:
                while (await receive())["type"] != "http.disconnect":
                    pass
                tasks.cancel_scope.cancel()

            tasks.start_soon(until_gone)
            await self._site.serve(self._viewer, send)
            tasks.cancel_scope.cancel()


async def _body(request: Request) -> bytes:
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > LONGEST_BODY:
            raise Refused(413, f"A command has at most {LONGEST_BODY} bytes.")
    return body


def _json(body: bytes) -> object:
    try:
        value: object = json.loads(body)
    except (ValueError, RecursionError):
        raise Refused(400, "The command is no JSON.") from None
    return value
