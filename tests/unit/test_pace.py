"""A machine that can't keep up with the speed of an emulated station."""

from __future__ import annotations

import pytest

from drivers.errors import ReadTimeout, SafetyStop
from rig.procedure.pace import Pace, speed_named


def run(speed: float, missed: list[int]) -> tuple[list[str], str | None]:
    """What is said on the way, and at the end."""
    said: list[str] = []
    pace = Pace(speed, said.append)
    for n in missed:
        pace.record("event", {"kind": "note", "text": "not counted"})
        pace.record("sample", {"values": {"slots_missed": float(n), "force_N": 1.0}})
    return said, pace.text()


@pytest.mark.parametrize("speed", [1.0, 25.0, 1000.0])
def test_a_device_that_fails_far_ahead_of_real_time_may_have_had_no_time(speed: float) -> None:
    fault = ReadTimeout("dynamometer", "no samples for 1 s", "Check its cable.")
    with pytest.raises(ReadTimeout) as raised, speed_named(speed):
        raise fault
    hint = (
        "At 1000 times real time this may be the emulation that can't keep up: try --speed 25 or "
        "less. If that does not help: "
    )
    told = f"dynamometer: no samples for 1 s. {hint if speed > 25 else ''}Check its cable."
    assert str(raised.value) == told


def test_a_safety_stop_is_never_put_down_to_the_speed() -> None:
    told = r"^robot: protective stop\. Keep clear\.$"
    with pytest.raises(SafetyStop, match=told), speed_named(999):
        raise SafetyStop("robot", "protective stop", "Keep clear.")


def test_it_is_said_once_and_with_a_speed_that_will_do() -> None:
    said, last = run(100, [2] * 30)
    assert said == [
        "This machine can't keep up with 100 times real time: 67 % of the sampling slots are "
        "missed, and whoever turns the screw sees the force too late: levels may be overshot, "
        "and values be wrong. Measure again with --speed 33 or less."
    ]
    assert last == said[0]


def test_a_slot_that_is_late_now_and_then_is_nothing() -> None:
    assert run(50, [0] * 99 + [3]) == ([], None)
    assert run(50, [0, 0, 1] * 30) == ([], None)
    assert run(50, [1] * 5) == ([], None)  # too few to tell


def test_of_real_time_nothing_is_said() -> None:
    assert run(1, [2] * 30) == ([], None)
