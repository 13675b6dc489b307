"""Commands of the sensor: 32-bit words, most significant byte first, and what it answers.

A command is a start word, the identifier, command number and length (identifier and this word
included), data words. A reply repeats identifier and number with the top bit set, carries data
words and ends with a closing word; with the two top bits set it refuses, and gives a reason.
"""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

START = bytes.fromhex("2B2B2B0D")
IDENTIFIER = b"ILD1"
CLOSING = bytes.fromhex("20200D0A")
REPLY, REFUSAL = 0x8000, 0xC000
LONGEST_WORDS = 1024  # a length beyond it is a damaged one
RESEND_AFTER_S = 0.5


class Command(IntEnum):
    """Command numbers."""

    INFO = 0x2049
    GET_SETTINGS = 0x204A
    ZERO = 0x2066
    AVERAGE_1 = 0x2070
    AVERAGE_4 = 0x2071
    AVERAGE_32 = 0x2072
    AVERAGE_128 = 0x2073
    AVERAGE_N = 0x2075  # one data word: log2 of the number
    OUTPUT_STOP = 0x2076
    OUTPUT_START = 0x2077
    AVERAGING_TYPE = 0x207D
    LASER_OFF = 0x2086
    LASER_ON = 0x2087
    RESET = 0x20F0


REFUSALS = {
    1: "unknown command",
    2: "incorrect value",
    3: "invalid parameter",
    4: "timeout",
    5: "command failed",
    6: "averaging does not allow it",
}
RATES_HZ = {0: 10000, 1: 5000, 2: 2500, 3: 20000}
AVERAGING_TYPES = {0: "recursive", 1: "moving", 2: "median"}
MEDIAN_LENGTHS = {0: 3, 2: 5, 5: 7, 7: 9}


class Refused(Exception):
    """The sensor answered a command with an error code."""

    def __init__(self, command: Command, code: int) -> None:
        reason = REFUSALS.get(code, "no known reason")
        super().__init__(f"refuses the command {command.name}: {reason} (code {code})")
        self.code = code


class NoReply(Exception):
    """No intact reply before the deadline; `received` is what came instead."""

    def __init__(self, command: Command, received: bytes) -> None:
        super().__init__(f"no answer to {command.name}")
        self.command = command
        self.received = received


class Port(Protocol):
    """What is needed of a serial port; `serial.Serial` opened with a read timeout has it."""

    @property
    def in_waiting(self) -> int:
        """Bytes that `read` gives at once."""

    def read(self, size: int = ..., /) -> bytes:
        """Up to `size` bytes; fewer, or none, when the port's timeout has passed."""

    def write(self, data: bytes, /) -> int | None:
        """Sends `data`."""


def pack(command: int, data: Sequence[int] = ()) -> bytes:
    """The bytes of a command."""
    return START + IDENTIFIER + struct.pack(f">HH{len(data)}I", command, len(data) + 2, *data)


def pack_reply(command: int, data: bytes = b"", refusal: int | None = None) -> bytes:
    """The bytes of a reply with `data` (filled up to whole words), or of a refusal."""
    if refusal is not None:
        return IDENTIFIER + struct.pack(">HHI", command | REFUSAL, 3, refusal) + CLOSING
    data += b" " * (-len(data) % 4)
    head = struct.pack(">HH", command | REPLY, len(data) // 4 + 2)
    return IDENTIFIER + head + data + CLOSING


def find_reply(received: bytes, command: Command) -> bytes | None:
    """The data of the first intact reply to `command` among values and other replies, or None.

    Raises `Refused`. Values cannot look like a reply: their tags never stand in the order that
    the identifier's letters would need.
    """
    at = received.find(IDENTIFIER)
    while at >= 0:
        head = received[at + 4 : at + 8]
        if len(head) == 4:
            number, words = struct.unpack(">HH", head)
            end = at + 4 * words
            whole = 2 <= words <= LONGEST_WORDS and received[end : end + 4] == CLOSING
            if whole and number == command | REPLY:
                return received[at + 8 : end]
            if whole and number == command | REFUSAL and words == 3:
                raise Refused(command, int.from_bytes(received[at + 8 : end]))
        at = received.find(IDENTIFIER, at + 1)
    return None


class Inquiry:
    """Asks until two equal replies have come: nothing protects a reply against a flipped bit.

    Whoever reads the port passes the bytes on; so values need not stop while a question is open.
    """

    def __init__(self, port: Port, command: Command) -> None:
        self._port = port
        self._command = command
        self._received = b""
        self._before: bytes | None = None
        self._ask()

    def feed(self, data: bytes) -> bytes | None:
        """The data of the confirmed reply, once there. Raises `Refused`, and OSError when the
        port has gone."""
        self._received += data
        reply = find_reply(self._received, self._command)
        if reply is not None and reply == self._before:
            return reply
        if reply is not None:
            self._before = reply
            self._ask()
        elif time.monotonic() > self._ask_again:
            self._ask()
        return None

    def _ask(self) -> None:
        self._received = b""
        self._ask_again = time.monotonic() + RESEND_AFTER_S
        self._port.write(pack(self._command))


def exchange(port: Port, command: Command, deadline: float) -> bytes:
    """Sends a command without data words and returns the data of its confirmed reply.

    `deadline` is an instant of `time.monotonic`. Raises `NoReply`, `Refused`, and OSError when
    the port has gone.
    """
    inquiry = Inquiry(port, command)
    received = b""
    while time.monotonic() < deadline:
        data = port.read(max(1, port.in_waiting))
        received = (received + data)[-4096:]
        reply = inquiry.feed(data)
        if reply is not None:
            return reply
    raise NoReply(command, received)


@dataclass(frozen=True, slots=True)
class SensorInfo:
    """What INFO says; None where the text does not."""

    text: str
    serial_number: str | None
    range_mm: float | None


def parse_info(data: bytes) -> SensorInfo:
    """Reads serial number and range out of the text; its wording differs between models."""
    text = " ".join(data.decode("ascii", errors="replace").split())
    serial = re.search(r"(?:serial\s*(?:n(?:umber|o)?)?|S/N)\s*[.:=]*\s*(\w+)", text, re.IGNORECASE)
    span = re.search(r"(?:range|\bMR)\s*[.:=]*\s*(\d+(?:\.\d+)?)", text, re.IGNORECASE)
    return SensorInfo(
        text=text,
        serial_number=serial.group(1) if serial else None,
        range_mm=float(span.group(1)) if span else None,
    )


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """What GET_SETTINGS says. `averaging` counts values; `rate_Hz` None: an unknown code."""

    rate_Hz: int | None
    averaging: int
    averaging_type: str
    relative_zero: bool
    range_mm: int
    output_on: bool
    laser_on: bool


def parse_settings(data: bytes) -> SensorSettings:
    """Ten words: rate, averaging number, hold last value, averaging method, offset, zero point,
    range, key lock, data output, laser. Raises ValueError when fewer came."""
    if len(data) < 40:
        raise ValueError(f"answers with {len(data) // 4} words of settings; ten are expected")
    words = struct.unpack(">10I", data[:40])
    method = AVERAGING_TYPES.get(words[3], f"method {words[3]}")
    number = MEDIAN_LENGTHS.get(words[1], words[1]) if method == "median" else words[1]
    return SensorSettings(
        rate_Hz=RATES_HZ.get(words[0]),
        averaging=number,
        averaging_type=method,
        relative_zero=words[5] != 0,
        range_mm=words[6],
        output_on=words[8] != 0,
        laser_on=words[9] != 0,
    )
