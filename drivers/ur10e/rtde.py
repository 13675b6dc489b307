"""The bytes of the Real-Time Data Exchange, protocol version 2: frames, variables, recipes.

Source: Universal Robots' RTDE guide. Big endian; a frame is `u16 size (header included), u8 kind`
and its payload. Shared by the probe and the emulator; what judges both is the real client library.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

PORT = 30004  # fixed in the client library, too
PROTOCOL_VERSION = 2
HEADER = struct.Struct(">HB")

PROTOCOL, CONTROLLER, OUTPUTS, INPUTS = ord("V"), ord("v"), ord("O"), ord("I")
START, PAUSE, DATA, TEXT = ord("S"), ord("P"), ord("U"), ord("M")
KINDS = frozenset((PROTOCOL, CONTROLLER, OUTPUTS, INPUTS, START, PAUSE, DATA, TEXT))

# What is asked of the controller, always by name: a variable that the client library's own table
# lacks would shift all later fields without a word.
VARIABLES: Mapping[str, str] = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "target_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
    "actual_TCP_pose": "VECTOR6D",
    "actual_current": "VECTOR6D",
    "target_current": "VECTOR6D",
    "joint_temperatures": "VECTOR6D",
    "robot_mode": "INT32",
    "safety_mode": "INT32",
    "safety_status_bits": "UINT32",
    "runtime_state": "UINT32",
}

_FORMATS: Mapping[str, str] = {
    "DOUBLE": "d",
    "VECTOR6D": "6d",
    "INT32": "i",
    "UINT32": "I",
}


class FormatError(ValueError):
    """The bytes are no RTDE; the text says what is wrong with them."""


def frame(kind: int, payload: bytes = b"") -> bytes:
    """One message, header included."""
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def package(types: Sequence[str]) -> struct.Struct:
    """Layout of a data package's payload: the recipe's number, then the variables.

    Raises FormatError for a type that none of `VARIABLES` has.
    """
    unknown = [name for name in types if name not in _FORMATS]
    if unknown:
        raise FormatError(f"variables of type {', '.join(unknown)}")
    return struct.Struct(">B" + "".join(_FORMATS[name] for name in types))


class Frames:
    """Cuts a stream of bytes into messages, whatever the chunks it arrives in."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Complete messages (kind, payload) so far; FormatError at the first impossible one."""
        self._rest += data
        messages = []
        while len(self._rest) >= HEADER.size:
            size, kind = HEADER.unpack_from(self._rest)
            if size < HEADER.size:
                raise FormatError(f"a message of {size} bytes (a header alone has {HEADER.size})")
            if kind not in KINDS:
                raise FormatError(f"bytes that begin with {self._rest[:8].hex(' ')}")
            if len(self._rest) < size:
                break
            messages.append((kind, self._rest[HEADER.size : size]))
            self._rest = self._rest[size:]
        return messages


def text_of(payload: bytes) -> str:
    """The words of a text message (version 2: length and text, then length and source)."""
    length = payload[0] if payload else 0
    return payload[1 : 1 + length].decode("utf-8", "replace").strip()
