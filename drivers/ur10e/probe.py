"""A look at the controller's RTDE port before the client library gets to see it.

The library never returns from a server that stays mute, and its process dies of malformed
frames. The probe goes through the same handshake under a deadline and says in plain words what
is wrong. It also learns what the library hides: the controller's version.
"""

from __future__ import annotations

import socket
import struct
import time
from collections import deque

from drivers import network
from drivers.errors import BadReply, CannotConnect, DeviceError
from drivers.ur10e import rtde

_SERVICES = (
    "Check that the address is the controller's, and that RTDE is enabled at the pendant "
    "(Settings, Security, Services)."
)
_RESTART = "Restart the controller, and check that no other device answers at this address."


def connect(device: str, host: str, port: int, deadline: float, remedy: str) -> socket.socket:
    """A TCP connection before `deadline` (time.monotonic()); CannotConnect in plain words."""
    where = f"{host}:{port}"
    began = time.monotonic()
    try:
        return network.connect(host, port, deadline, socket.AF_INET)  # as the client library
    except socket.gaierror as error:
        fault = f'the host name "{host}" is unknown ({error.strerror})'
    except UnicodeError:
        fault = f'"{host}" is no host name'
    except ConnectionRefusedError:
        fault = f"{where} refuses the connection"
    except TimeoutError:
        fault = f"{where} did not answer within {time.monotonic() - began:.1f} s"
    except OSError as error:
        fault = f"there is no way to {where} ({error.strerror or error})"
    raise CannotConnect(device, fault, remedy)


def probe(device: str, host: str, frequency_Hz: float, deadline: float) -> str:
    """The controller's version, after the whole handshake up to data whose timestamp moves on.

    `deadline` in time.monotonic(). Raises CannotConnect (no route, refused, mute, closed, no RTDE,
    wrong version, no data) or BadReply (a variable is not delivered, the timestamp stands still).
    """
    with connect(device, host, rtde.PORT, deadline, _SERVICES) as link:
        return _Probe(device, host, link, deadline).run(frequency_Hz)


class _Probe:
    def __init__(self, device: str, host: str, link: socket.socket, deadline: float) -> None:
        self._device = device
        self._where = f"{host}:{rtde.PORT}"
        self._link = link
        self._deadline = deadline
        self._began = time.monotonic()
        self._frames = rtde.Frames()
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._timestamp: float | None = None
        self._said = ""

    def run(self, frequency_Hz: float) -> str:
        version = struct.pack(">H", rtde.PROTOCOL_VERSION)
        accepted = self._ask(rtde.PROTOCOL, version, "the protocol version")
        if accepted[:1] != b"\x01":
            raise self._error(
                f"{self._where} does not accept RTDE protocol version {rtde.PROTOCOL_VERSION}",
                "Update the controller's software (PolyScope 3.3 or later speaks version 2).",
            )
        numbers = self._unpack(">4I", self._ask(rtde.CONTROLLER, b"", "the controller version"))
        layout = self._outputs(frequency_Hz)
        started = self._ask(rtde.START, b"", "the start of the data")
        if started[:1] != b"\x01":
            raise self._error(f"{self._where} refuses to start sending data", _RESTART)
        self._await_moving_timestamp(layout)
        return ".".join(str(n) for n in numbers)

    def _outputs(self, frequency_Hz: float) -> struct.Struct:
        names = ",".join(rtde.VARIABLES)
        request = struct.pack(">d", frequency_Hz) + names.encode()
        reply = self._ask(rtde.OUTPUTS, request, "the list of variables")
        types = reply[1:].decode("ascii", "replace").split(",")
        for (name, wanted), given in zip(rtde.VARIABLES.items(), types, strict=False):
            if given != wanted:
                fault = f'{self._where} delivers the variable "{name}" as {given}, not as {wanted}'
                remedy = "Update the controller's software, or end the client that holds it."
                raise BadReply(self._device, fault, remedy)
        if len(types) != len(rtde.VARIABLES):
            raise self._error(
                f"{self._where} confirms {len(types)} of {len(rtde.VARIABLES)} variables", _RESTART
            )
        return rtde.package(types)

    def _await_moving_timestamp(self, layout: struct.Struct) -> None:
        while True:
            data = self._next(rtde.DATA, "data")
            timestamp = float(self._unpack(layout.format, data)[1])
            if self._timestamp is not None and timestamp != self._timestamp:
                return
            self._timestamp = timestamp

    def _ask(self, kind: int, payload: bytes, what: str) -> bytes:
        try:
            self._link.sendall(rtde.frame(kind, payload))
        except OSError as error:
            raise self._lost(what, error) from error
        return self._next(kind, what)

    def _next(self, kind: int, what: str) -> bytes:
        """Payload of the next message of this kind; texts on the way are kept for the error."""
        while True:
            while not self._waiting:
                self._waiting.extend(self._receive(what))
            got, payload = self._waiting.popleft()
            if got == kind:
                return payload
            if got == rtde.TEXT:
                self._said = rtde.text_of(payload)
            elif got != rtde.DATA:
                fault = f'{self._where} answers "{chr(got)}" when asked for {what}'
                raise self._error(fault, _RESTART)

    def _receive(self, what: str) -> list[tuple[int, bytes]]:
        remaining = self._deadline - time.monotonic()
        if remaining <= 0:
            raise self._mute(what)
        self._link.settimeout(remaining)
        try:
            data = self._link.recv(65536)
        except TimeoutError:
            raise self._mute(what) from None
        except OSError as error:
            raise self._lost(what, error) from error
        if not data:
            raise self._lost(what, None)
        try:
            return self._frames.feed(data)
        except rtde.FormatError as error:
            fault = f"{self._where} sent {error} when asked for {what}; that is no RTDE"
            raise self._error(fault, _RESTART) from error

    def _unpack(self, layout: str, payload: bytes) -> tuple[float, ...]:
        try:
            return struct.unpack(layout, payload)
        except struct.error as error:
            expected = struct.calcsize(layout)
            fault = f"{self._where} sent a message with {len(payload)} instead of {expected} bytes"
            raise self._error(fault, _RESTART) from error

    def _mute(self, what: str) -> DeviceError:
        if self._timestamp is not None:
            fault = f"the controller's timestamp stands still at {self._timestamp:.3f} s"
            return BadReply(self._device, fault, _RESTART)
        waited = time.monotonic() - self._began
        fault = (
            f"{self._where} accepts the connection but did not send {what} within {waited:.1f} s"
        )
        return self._error(fault, _RESTART)

    def _lost(self, what: str, error: OSError | None) -> DeviceError:
        why = f" ({error.strerror})" if error is not None and error.strerror else ""
        fault = f"{self._where} closed the connection when asked for {what}{why}"
        return self._error(fault, _SERVICES)

    def _error(self, fault: str, remedy: str) -> DeviceError:
        if self._said:
            fault += f'; it says: "{self._said}"'
        return CannotConnect(self._device, fault, remedy)
