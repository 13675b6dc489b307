"""Command words, replies and what is read out of them."""

from __future__ import annotations

import struct
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import BadReply
from drivers.ild2200 import commands, complaints, frames
from drivers.ild2200.commands import Command
from drivers.ild2200.settings import Ild2200Settings

VALUES = frames.encode(np.arange(1000, 1100, dtype=np.int32))


def settings_words(**changes: int) -> bytes:
    words = {
        "rate": 2,
        "number": 1,
        "hold": 0,
        "method": 1,
        "offset": 0,
        "zero": 0,
        "range": 10,
        "lock": 0,
        "output": 1,
        "laser": 1,
    }
    return struct.pack(">10I", *{**words, **changes}.values())


def station(**changes: object) -> Ild2200Settings:
    base = {"driver": "ild2200", "port": "/dev/null", "output_rate_Hz": 2500}
    return Ild2200Settings(**{**base, **changes})  # type: ignore[arg-type]


class FakePort:
    """Answers each command with the next of `replies`, in front of which values come."""

    def __init__(self, replies: list[bytes]) -> None:
        self.replies = replies
        self.written = b""
        self.waiting = b""

    @property
    def in_waiting(self) -> int:
        return len(self.waiting)

    def read(self, size: int = 1, /) -> bytes:
        data, self.waiting = self.waiting[:size], self.waiting[size:]
        if not data:
            time.sleep(0.001)
        return data

    def write(self, data: bytes, /) -> int:
        self.written += data
        self.waiting += VALUES + (self.replies.pop(0) if self.replies else b"")
        return len(data)


def soon() -> float:
    return time.monotonic() + 1.0


def test_words_of_a_command() -> None:
    assert commands.pack(Command.INFO).hex() == "2b2b2b0d494c443120490002"
    assert commands.pack(Command.AVERAGE_N, [7]).hex() == "2b2b2b0d494c44312075000300000007"


def test_words_of_a_reply_and_a_refusal() -> None:
    assert commands.pack_reply(Command.OUTPUT_STOP).hex() == "494c4431a076000220200d0a"
    refusal = commands.pack_reply(Command.AVERAGE_128, refusal=5)
    assert refusal.hex() == "494c4431e07300030000000520200d0a"


@given(st.integers(0, 90))
def test_a_reply_is_found_between_values(cut: int) -> None:
    reply = commands.pack_reply(Command.INFO, b"Range: 10")
    stream = VALUES[: 3 * cut] + reply + VALUES
    assert commands.find_reply(stream, Command.INFO) == b"Range: 10   "
    assert commands.find_reply(stream, Command.GET_SETTINGS) is None
    assert commands.find_reply(stream[: 3 * cut + len(reply) - 1], Command.INFO) is None


@given(st.lists(st.integers(0, 2**18 - 1), max_size=200))
def test_values_never_look_like_a_reply(raw: list[int]) -> None:
    assert commands.IDENTIFIER not in frames.encode(np.array(raw, dtype=np.int32))


@given(st.binary(max_size=100))
def test_garbage_is_no_reply(data: bytes) -> None:
    assert commands.find_reply(data + commands.IDENTIFIER + data, Command.INFO) is None


@pytest.mark.parametrize("code", [1, 2, 3, 4, 5, 6, 99])
def test_refusals_carry_their_reason(code: int) -> None:
    data = commands.pack_reply(Command.INFO, refusal=code)
    with pytest.raises(commands.Refused, match=rf"INFO: .*\(code {code}\)"):
        commands.find_reply(data, Command.INFO)


def test_an_answer_counts_when_it_came_twice() -> None:
    flipped, good = (commands.pack_reply(Command.INFO, t) for t in (b"Range: 90", b"Range: 10"))
    port = FakePort([flipped, good, good])
    assert commands.exchange(port, Command.INFO, soon()) == b"Range: 10   "
    assert port.written == 3 * commands.pack(Command.INFO)


def test_no_answer_ends_at_the_deadline_and_shows_what_came_instead() -> None:
    begin = time.monotonic()
    with pytest.raises(commands.NoReply) as caught:
        commands.exchange(FakePort([]), Command.INFO, begin + 0.05)
    assert VALUES in caught.value.received


@pytest.mark.parametrize(
    ("text", "serial", "range_mm"),
    [
        (b"Average: 0001\r\nRange: 10\r\nSerialN: 04711\r\n", "04711", 10.0),
        (b"S/N: 1234570 MR: 50", "1234570", 50.0),
        (b"Serial: 20110036 Measuring range: 10.00mm", "20110036", 10.0),
        (b"hello \xff", None, None),
    ],
)
def test_info_texts(text: bytes, serial: str | None, range_mm: float | None) -> None:
    info = commands.parse_info(text)
    assert (info.serial_number, info.range_mm) == (serial, range_mm)


def test_settings_words() -> None:
    parsed = commands.parse_settings(settings_words(rate=3, number=128, method=0))
    assert (parsed.rate_Hz, parsed.averaging, parsed.averaging_type) == (20000, 128, "recursive")
    assert commands.parse_settings(settings_words(number=5, method=2)).averaging == 7
    assert commands.parse_settings(settings_words(rate=8)).rate_Hz is None
    with pytest.raises(ValueError, match="3 words"):
        commands.parse_settings(bytes(12))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"range": 50}, "has a range of 50 mm, the station file says 10 mm"),
        ({"rate": 0}, "sends 10000 values/s, the station file says 2500"),
        ({"rate": 7}, "sends an unknown number of values/s"),
        ({"number": 4}, r"averages over 4 values \(moving\), the station file says 1"),
        ({"zero": 1}, "relative zero"),
        ({"laser": 0}, "laser is switched off"),
    ],
)
def test_what_differs_from_the_station_file_is_refused(
    changes: dict[str, int], message: str
) -> None:
    with pytest.raises(BadReply, match=message):
        complaints.check(commands.parse_settings(settings_words(**changes)), station())


def test_what_agrees_passes_and_info_counts_too() -> None:
    sensor = commands.parse_settings(settings_words())
    complaints.check(sensor, station(), 10.0)
    with pytest.raises(BadReply, match="10 mm and 20 mm"):
        complaints.check(sensor, station(), 20.0)
