"""Blocks of single values on their way from a device's thread to the procedure."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.readings import Reading


@dataclass(frozen=True, slots=True)
class Block:
    """Reduced single values of about a tenth of a second.

    `mean` and `m2` (sum of squared deviations from the mean) run over the signals.
    """

    start: float
    end: float
    count: int
    mean: tuple[float, ...]
    m2: tuple[float, ...]
    invalid: int = 0
    problems: tuple[str, ...] = ()


def pool(blocks: list[Block], width: int) -> tuple[int, tuple[float, ...], tuple[float, ...]]:
    """Count, means and standard deviations of pooled blocks (Chan, Golub, LeVeque 1983)."""
    count = 0
    mean = [math.nan] * width
    m2 = [0.0] * width
    for block in blocks:
        if block.count == 0:
            continue
        if count == 0:
            mean = list(block.mean)
            m2 = list(block.m2)
        else:
            total = count + block.count
            for i in range(width):
                delta = block.mean[i] - mean[i]
                mean[i] += delta * block.count / total
                m2[i] += block.m2[i] + delta * delta * count * block.count / total
        count += block.count
    if count > 1:
        sd = tuple(math.sqrt(max(0.0, v) / (count - 1)) for v in m2)
    else:
        sd = (math.nan,) * width
    return count, tuple(mean), sd


class Stream:
    """Thread-safe hand-over of blocks: `collect` gives each block once, `latest` peeks.

    One thread puts, one thread collects, any thread may peek. Holds at most `keep` blocks that
    nobody has collected yet; the single values of older ones are lost, and the next reading that
    is collected says how many (`Reading.lost`).
    """

    def __init__(self, width: int, clock: Clock, source: str, keep: int = 4096) -> None:
        self._width = width
        self._clock = clock
        self._source = source
        self._keep = keep
        self._blocks: deque[Block] = deque()
        self._newest: Block | None = None
        self._arrived = math.nan
        self._condition = threading.Condition()
        self._failure: Exception | None = None
        self._lost = 0  # single values, since the last collection

    def put(self, block: Block) -> None:
        """Called by the device's thread."""
        with self._condition:
            if len(self._blocks) >= self._keep:
                pushed_out = self._blocks.popleft()
                self._lost += pushed_out.count + pushed_out.invalid
            self._blocks.append(block)
            self._newest = block
            self._arrived = time.monotonic()
            self._condition.notify_all()

    def fail(self, error: Exception) -> None:
        """Called by the device's thread when it gives up; `collect` and `latest` then raise it."""
        with self._condition:
            if self._failure is None:
                self._failure = error
            self._condition.notify_all()

    @property
    def failure(self) -> Exception | None:
        """The error that ended the stream, if any."""
        return self._failure

    def age_s(self) -> float:
        """Wall-clock seconds since a block arrived; infinite before the first."""
        return math.inf if self._newest is None else time.monotonic() - self._arrived

    def collect(self, wait_s: float, since: float = -math.inf) -> Reading | None:
        """Everything since the last call, but for blocks that ended before `since` (seconds of the
        clock) where there are newer ones; waits up to `wait_s` wall seconds for a first block."""
        deadline = time.monotonic() + wait_s
        with self._condition:
            while not self._blocks:
                if self._failure is not None:
                    raise self._failure
                remaining = deadline - time.monotonic()
                if remaining <= 0:
                    return None
                self._condition.wait(remaining)
            blocks = list(self._blocks)
            self._blocks.clear()
            lost, self._lost = self._lost, 0
        return self._reading([b for b in blocks if b.end >= since] or blocks[-1:], lost)

    def latest(self) -> Reading | None:
        """The newest block, whether collected or not; None before the first."""
        with self._condition:
            if self._failure is not None:
                raise self._failure
            newest = self._newest
        return None if newest is None else self._reading([newest])

    def _reading(self, blocks: list[Block], lost: int = 0) -> Reading:
        count, mean, sd = pool(blocks, self._width)
        problems = tuple(dict.fromkeys(p for b in blocks for p in b.problems))
        return Reading(
            start=blocks[0].start,
            end=blocks[-1].end,
            values=mean,
            sd=sd,
            count=count,
            invalid=sum(b.invalid for b in blocks),
            age_s=self.age_s(),
            source=self._source,
            problems=problems,
            lost=lost,
        )
