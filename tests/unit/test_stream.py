"""Blocks on their way to a slot: whose they are when the slot comes late."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from drivers.readings import Reading
from drivers.stream import Block, Stream
from rig.procedure.acquisition import Acquisition
from rig.procedure.devices import Devices
from tests.unit.fake_rig import Arm, FakeDynamometer, FakeLaser, FakeRobot, JumpClock


def stream(*ends: float) -> Stream:
    out = Stream(1, JumpClock(), "emulated+test")
    for end in ends:
        out.put(Block(end - 0.1, end, 4, (end,), (0.0,)))
    return out


@pytest.mark.parametrize(
    ("since", "start", "end", "count"),
    [(0.0, 0.9, 9.0, 16), (4.0, 3.9, 9.0, 12), (8.5, 8.9, 9.0, 4), (20.0, 8.9, 9.0, 4)],
)
def test_what_is_older_than_asked_for_is_left_out_but_for_the_last(
    since: float, start: float, end: float, count: int
) -> None:
    blocks = stream(1.0, 4.0, 5.0, 9.0)
    reading = blocks.collect(1.0, since)
    assert reading is not None
    assert (reading.start, reading.end) == pytest.approx((start, end))
    assert reading.count == count
    assert blocks.collect(0.0) is None  # and it never comes up again


def test_what_nobody_collects_in_time_is_counted_and_told_once() -> None:
    blocks = Stream(1, JumpClock(), "emulated+test", keep=2)
    for end in (1.0, 2.0, 3.0, 4.0):
        blocks.put(Block(end - 0.1, end, 4, (end,), (0.0,), invalid=1))
    newest = blocks.latest()
    assert newest is not None
    assert newest.lost == 0  # who looks takes nothing away
    reading = blocks.collect(1.0)
    assert reading is not None
    assert (reading.start, reading.count, reading.lost) == (2.9, 8, 10)
    blocks.put(Block(4.9, 5.0, 4, (5.0,), (0.0,)))
    reading = blocks.collect(1.0)
    assert reading is not None
    assert reading.lost == 0


class BlockedLaser(FakeLaser):
    """Blocks of 0.4 s, each of which reaches the computer half a second after its end."""

    taken = 0

    def collect(self, since: float = -math.inf) -> Reading:
        del since
        clock = self.arm.clock
        ready = int((clock.now() - 0.3) / 0.4)
        if ready <= self.taken:
            ready = self.taken + 1
            clock.sleep_until(0.3 + 0.4 * ready)
        first, self.taken = self.taken, ready
        return replace(self.latest(), start=0.4 * first - 0.2, end=0.4 * ready - 0.2)


def test_what_is_averaged_began_after_the_call() -> None:
    clock = JumpClock()
    arm = Arm(clock)
    devices = Devices(FakeRobot(arm), FakeDynamometer(arm), BlockedLaser(arm))
    acquisition = Acquisition(devices, clock, 1.0)
    for _ in range(3):
        clock.t = math.ceil(clock.t) + 1.0
        began = clock.now()
        _, _, laser = acquisition.average(2.0)
        assert began <= laser.start < began + 0.4
        assert laser.end > began + 1.5


def test_a_slot_that_comes_late_holds_its_own_period() -> None:
    clock = JumpClock()
    arm = Arm(clock)
    devices = Devices(FakeRobot(arm), FakeDynamometer(arm), FakeLaser(arm))
    slots = Acquisition(devices, clock, 1.0)
    for stalled, missed, since in ((1.0, 0, None), (7.4, 6, 7.4), (0.6, 0, None)):
        clock.t += stalled
        slot = slots.wait()
        while slot is None:
            slot = slots.wait()
        assert slot.missed == missed
        for device in devices.all():
            assert device.since == (float("-inf") if since is None else pytest.approx(since))
