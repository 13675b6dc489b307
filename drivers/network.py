"""TCP connections whose deadline holds for the name lookup, too."""

from __future__ import annotations

import socket
import threading
import time
from typing import Any

Address = tuple[Any, ...]  # family, kind, protocol, canonical name, address: as of getaddrinfo


def connect(host: str, port: int, deadline: float, family: int = socket.AF_UNSPEC) -> socket.socket:
    """A connection to the first of the host's addresses that takes one, before `deadline`
    (time.monotonic()). Raises OSError (TimeoutError, gaierror, ...), or UnicodeError for what is
    no host name.
    """
    failure: OSError = TimeoutError()
    for kind_of_address, kind, protocol, _, address in _resolve(host, port, deadline, family):
        link = socket.socket(kind_of_address, kind, protocol)
        try:
            link.settimeout(max(0.01, deadline - time.monotonic()))
            link.connect(address)
        except OSError as error:
            link.close()
            failure = error
        else:
            return link
    raise failure


def _resolve(host: str, port: int, deadline: float, family: int) -> list[Address]:
    """The host's addresses; TimeoutError where the name service, which has no deadline, is mute."""
    found: list[list[Address]] = []
    failed: list[OSError | UnicodeError] = []

    def ask() -> None:
        try:
            found.append(list(socket.getaddrinfo(host, port, family, socket.SOCK_STREAM)))
        except (OSError, UnicodeError) as error:
            failed.append(error)

    thread = threading.Thread(target=ask, name="name lookup", daemon=True)
    thread.start()
    thread.join(max(0.01, deadline - time.monotonic()))
    if failed:
        raise failed[0]
    if not found:
        raise TimeoutError
    return found[0]
