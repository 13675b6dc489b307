"""Frames of RTDE: any chunking gives the same messages, impossible ones are refused."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ur10e import rtde

messages = st.lists(
    st.tuples(st.sampled_from(sorted(rtde.KINDS)), st.binary(max_size=40)), max_size=8
)


@given(messages, st.lists(st.integers(1, 7), min_size=1))
def test_any_chunking_gives_the_same_messages(
    sent: list[tuple[int, bytes]], sizes: list[int]
) -> None:
    data = b"".join(rtde.frame(kind, payload) for kind, payload in sent)
    frames = rtde.Frames()
    got = []
    turn = 0
    while data:
        size = sizes[turn % len(sizes)]
        got += frames.feed(data[:size])
        data = data[size:]
        turn += 1
    assert got == sent


def test_a_frame_as_the_guide_gives_it() -> None:
    assert rtde.frame(rtde.PROTOCOL, struct.pack(">H", 2)) == bytes([0, 5, 86, 0, 2])


def test_a_size_below_the_header_is_refused() -> None:
    with pytest.raises(rtde.FormatError, match=r"a message of 2 bytes \(a header alone has 3\)"):
        rtde.Frames().feed(bytes([0, 2, rtde.DATA]))


def test_an_unknown_kind_is_refused_and_shown() -> None:
    with pytest.raises(rtde.FormatError, match="bytes that begin with 00 08 01"):
        rtde.Frames().feed(bytes([0, 8, 1, 2, 3]))


def test_the_package_of_all_variables() -> None:
    """1 recipe byte, 1 + 7 x 6 doubles, 4 words of 4 bytes."""
    assert rtde.package(list(rtde.VARIABLES.values())).size == 1 + 8 * (1 + 7 * 6) + 4 * 4


def test_a_type_that_none_of_the_variables_has() -> None:
    with pytest.raises(rtde.FormatError, match="NOT_FOUND"):
        rtde.package(["DOUBLE", "NOT_FOUND"])


def test_words_of_a_text_message() -> None:
    payload = bytes([5]) + b"hello" + bytes([4]) + b"RTDE" + bytes([0])
    assert rtde.text_of(payload) == "hello"
    assert rtde.text_of(b"") == ""
