"""Frames, scale and plausibility: laws under any chunking, loss and garbage."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ild2200 import frames
from drivers.ild2200.frames import FrameDecoder, StepFilter

RAW = st.lists(st.integers(0, 2**18 - 1), max_size=60)


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    ends = sorted(c % (len(data) + 1) for c in cuts)
    return [data[a:b] for a, b in itertools.pairwise([0, *ends, len(data)])]


def decode(chunks: list[bytes]) -> tuple[list[int], int]:
    decoder = FrameDecoder()
    raw: list[int] = []
    lost = 0
    for chunk in chunks:
        values, more = decoder.feed(chunk)
        raw += values.tolist()
        lost += more
    return raw, lost


def contains_in_order(whole: list[int], part: list[int]) -> bool:
    remaining = iter(whole)
    return all(value in remaining for value in part)


def test_the_bytes_of_a_known_value() -> None:
    # 32760 = 0b000111_111111_111000 in sixes: low, middle, high
    assert frames.encode(np.array([32760])) == bytes([0b00111000, 0b01111111, 0b10000111])
    assert decode([bytes([0b00111000, 0b01111111, 0b10000111])]) == ([32760], 0)


def test_all_eighteen_bits_travel() -> None:
    assert decode([frames.encode(np.array([2**18 - 1, 65530]))])[0] == [2**18 - 1, 65530]


@pytest.mark.parametrize(("raw", "mm"), [(643, 0.0), (32760, 5.0), (64876, 10.0)])
def test_scale_gives_the_points_of_the_manual(raw: int, mm: float) -> None:
    two_digits = 2 * 10 * 1.02 / 65520
    assert frames.to_mm(np.array([raw]), 10.0)[0] == pytest.approx(mm, abs=two_digits)


@given(st.floats(-0.09, 10.09))
def test_digits_and_distances_are_inverse(mm: float) -> None:
    back = frames.to_mm(frames.to_raw(np.array([mm]), 10.0), 10.0)[0]
    assert abs(back - mm) <= 0.5 * 10 * 1.02 / 65520 + 1e-12


@given(RAW, st.lists(st.integers(0, 500), max_size=12))
def test_any_chunking_gives_the_same_values(raw: list[int], cuts: list[int]) -> None:
    data = frames.encode(np.array(raw, dtype=np.int32))
    assert decode(pieces(data, cuts)) == (raw, 0)


@given(st.binary(max_size=200), st.lists(st.integers(0, 500), max_size=12))
def test_chunking_does_not_matter_for_garbage_either(data: bytes, cuts: list[int]) -> None:
    assert decode(pieces(data, cuts)) == decode([data])


@given(RAW, st.sets(st.integers(0, 179), max_size=8))
def test_lost_bytes_cost_only_their_values(raw: list[int], lost: set[int]) -> None:
    data = frames.encode(np.array(raw, dtype=np.int32))
    left = bytes(b for i, b in enumerate(data) if i not in lost)
    touched = {i // 3 for i in lost}
    intact = [value for i, value in enumerate(raw) if i not in touched]
    decoded, _ = decode([left])
    assert contains_in_order(decoded, intact)
    # What remains of broken frames can at most look like one value per broken frame.
    assert len(decoded) <= len(intact) + len(touched)


@given(RAW, st.binary(max_size=30), st.integers(0, 60))
def test_garbage_between_values_costs_none(raw: list[int], garbage: bytes, at: int) -> None:
    data = frames.encode(np.array(raw, dtype=np.int32))
    cut = 3 * min(at, len(raw))
    decoded, _ = decode([data[:cut] + garbage + data[cut:]])
    assert contains_in_order(decoded, raw)


def test_a_start_in_mid_frame_begins_a_new_value() -> None:
    good = frames.encode(np.array([1234]))
    assert decode([good + good[:2] + good])[0] == [1234, 1234]


def test_lost_values_are_counted() -> None:
    data = frames.encode(np.arange(100, dtype=np.int32))
    assert decode([data[:30] + data[31:60] + data[62:]])[1] == 2
    assert decode([data[2:]])[1] == 0, "joining in mid-frame loses nothing"
    assert decode([data, b"\xff" * 30])[1] == 10


def test_error_names() -> None:
    assert frames.error_name(65522) == "no object (65522)"
    assert frames.error_name(70000) == "unknown error value (70000)"


def filtered(values: np.ndarray, cuts: list[int]) -> tuple[list[float], int, list[float]]:
    step = StepFilter(0.5)
    ends = sorted(c % (len(values) + 1) for c in cuts)
    accepted: list[float] = []
    rejected, jumps = 0, []
    for a, b in itertools.pairwise([0, *ends, len(values)]):
        good, bad, jump = step.feed(values[a:b])
        accepted += good.tolist()
        rejected += bad
        jumps += [jump] if jump else []
    return accepted, rejected, jumps


SMOOTH = 5.0 + 0.1 * np.sin(np.arange(200) / 15.0)


def test_single_flips_are_sorted_out_and_counted() -> None:
    values = SMOOTH.copy()
    flipped = [0, 17, 18, 60, 100]
    values[flipped] += [5.0, -2.5, 0.7, 1.2, -5.0]
    accepted, rejected, jumps = filtered(values, [])
    assert rejected == len(flipped)
    good = np.delete(values, flipped)
    assert accepted == good[: len(accepted)].tolist()
    assert len(accepted) == 200 - StepFilter.REACH - len(flipped)
    assert jumps == []


def test_a_jump_that_stays_is_kept_and_reported() -> None:
    values = SMOOTH.copy()
    values[90:] -= 2.0
    accepted, rejected, jumps = filtered(values, [])
    assert rejected == 0
    assert len(accepted) == 200 - StepFilter.REACH
    assert jumps == [pytest.approx(-2.0, abs=0.01)]


def test_motion_within_the_step_is_left_alone() -> None:
    ramp = np.linspace(1.0, 9.0, 200)
    accepted, rejected, jumps = filtered(ramp, [50, 51, 120])
    assert (rejected, jumps) == (0, [])
    assert accepted == ramp[: len(accepted)].tolist()


@given(
    st.lists(st.floats(0, 10), min_size=0, max_size=80),
    st.lists(st.integers(0, 200), max_size=10),
)
def test_plausibility_does_not_depend_on_chunks(values: list[float], cuts: list[int]) -> None:
    x = np.array(values)
    accepted, rejected, jumps = filtered(x, cuts)
    whole, rejected_whole, jumps_whole = filtered(x, [])
    assert accepted == whole
    assert rejected == rejected_whole
    assert bool(jumps) == bool(jumps_whole)


def test_after_a_gap_there_are_no_neighbours() -> None:
    step = StepFilter(0.5)
    step.feed(np.full(50, 2.0))
    step.reset()
    accepted, rejected, jump = step.feed(np.full(50, 7.0))
    assert (len(accepted), rejected, jump) == (50 - StepFilter.REACH, 0, 0.0)
