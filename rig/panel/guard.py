"""Who may look and who may command: host, origin and tokens of a request.

Reasons: any page in a browser can send requests to 127.0.0.1, and a name on the internet can be
made to point there (DNS rebinding). So the Host must be an address of this server, a request with
an Origin must come from the page itself, and commands also need a token that only the page knows.
"""

from __future__ import annotations

import ipaddress
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")

HEADERS: Mapping[str, str] = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address or name."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def authority(host: str, port: int) -> str:
    """host:port as it stands in an address; IPv6 in brackets."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


@dataclass(frozen=True)
class Guard:
    """`operator_token` gives the right to command; `viewer_token` is what looking needs where
    the server can be reached over a network."""

    host: str
    port: int
    operator_token: str
    viewer_token: str

    @cached_property
    def local(self) -> bool:
        """Whether only this machine can reach the server."""
        return is_loopback(self.host)

    @property
    def cookie(self) -> str:
        """Cookies are shared by all ports of a host, so the name holds the port."""
        return f"rig_panel_{self.port}"

    @cached_property
    def _names(self) -> frozenset[str]:
        names = LOOPBACK_NAMES if self.local else (self.host, socket.gethostname().lower())
        return frozenset(names)

    def host_allowed(self, header: str | None) -> bool:
        """Whether the Host header names this server.

        Over a network an address in digits is always its own: only names can be rebound.
        """
        name, port = _split(header or "")
        if port != self.port:
            return False
        if name in self._names:
            return True
        return not self.local and _is_address(name)

    def origin_allowed(self, origin: str | None, host: str | None) -> bool:
        """Whether an Origin header is the page's own; `host` has been allowed before."""
        return origin is not None and origin == f"http://{host}"

    def may_look(self, token: str | None, cookie: str | None = None) -> bool:
        """Loopback needs no token for looking; a cookie never gives more than that."""
        return (
            self.local
            or _same(token, self.viewer_token)
            or _same(cookie, self.viewer_token)
            or self.may_command(token)
        )

    def may_command(self, token: str | None) -> bool:
        """Whether this is the operator's token."""
        return _same(token, self.operator_token)


def _same(given: str | None, wanted: str) -> bool:
    # Bytes: compare_digest refuses text beyond ASCII, and anybody may send such text.
    return given is not None and secrets.compare_digest(given.encode(), wanted.encode())


def _split(authority_text: str) -> tuple[str, int]:
    """Name without brackets, and port; -1 if there is none."""
    name, colon, port = authority_text.lower().rpartition(":")
    if not colon or not port.isdecimal() or not port.isascii():
        return authority_text.lower(), -1
    return name.removeprefix("[").removesuffix("]"), int(port[:6])


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
