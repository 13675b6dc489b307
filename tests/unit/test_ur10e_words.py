"""Which modes end a measurement, and in which words."""

from __future__ import annotations

import pytest

from drivers.ur10e.words import (
    NORMAL,
    PLAYING,
    REDUCED,
    RUNNING,
    SAFETY_MODES,
    STOPPED,
    Modes,
    program_changed,
    unsafe,
)


@pytest.mark.parametrize("safety_mode", SAFETY_MODES)
def test_normal_and_reduced_only_are_safe(safety_mode: int) -> None:
    found = unsafe(Modes(RUNNING, safety_mode, 1, PLAYING))
    if safety_mode in (NORMAL, REDUCED):
        assert found is None
    else:
        assert found is not None
        fault, remedy = found
        assert f"{SAFETY_MODES[safety_mode]} ({safety_mode})" in fault
        assert "loosen the screw by hand" in remedy
        assert "never from here" in remedy


@pytest.mark.parametrize(("bit", "stops"), [(b, 2 <= b <= 10) for b in range(13)])
def test_safety_bits_stop_by_themselves(bit: int, stops: bool) -> None:
    assert (unsafe(Modes(RUNNING, NORMAL, 1 | 1 << bit, PLAYING)) is not None) is stops


def test_the_bits_are_named() -> None:
    found = unsafe(Modes(RUNNING, 3, 1 << 2 | 1 << 10, PLAYING))
    assert found is not None
    assert found[0] == (
        "the controller's safety mode is protective stop (3), "
        "status bits: protective stop, stopped due to safety"
    )


@pytest.mark.parametrize("robot_mode", [-1, 0, 3, 5, 6, 8])
def test_an_arm_that_is_not_held_by_its_controller(robot_mode: int) -> None:
    found = unsafe(Modes(robot_mode, NORMAL, 1, PLAYING))
    assert found is not None
    assert f"({robot_mode}) instead of running" in found[0]


def test_an_unknown_mode_is_told_by_number() -> None:
    found = unsafe(Modes(RUNNING, 42, 0, PLAYING))
    assert found is not None
    assert "unknown (42)" in found[0]


def test_a_changed_program_state() -> None:
    fault, remedy = program_changed(PLAYING, STOPPED)
    assert fault == (
        "the program state changed from playing (2) to stopped (1) during the measurement"
    )
    assert "pendant" in remedy
