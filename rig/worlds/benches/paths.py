"""How a machine drives a specimen: from turning point to turning point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.benches.trial import Ints, log_uniform

_LEAST_A_LEG = 25


@dataclass(frozen=True, eq=False)
class Path:
    """time (n,) from 0 to 1, what is driven (n,), and the leg (n,) from 0 each sample lies on."""

    time: Array
    value: Array
    leg: Ints

    @property
    def speed(self) -> Array:
        """(n,) change a unit of time."""
        return np.asarray(np.gradient(self.value, self.time))

    @property
    def repetition(self) -> Ints:
        """(n,) there and back counts as one."""
        return self.leg // 2 + 1


def through(
    points: Sequence[float], count: int, *, eased: bool = False, seconds: Sequence[float] = ()
) -> Path:
    """count samples through the turning points, at one speed, or with the seconds of each leg
    (in any unit). eased: every leg is half a cosine, as a crank gives it."""
    at = np.asarray(points, dtype=float)
    length = np.asarray(seconds, dtype=float) if len(seconds) else np.abs(np.diff(at))
    edges = np.concatenate([[0.0], np.cumsum(length)]) / length.sum()
    time = np.linspace(0.0, 1.0, count)
    leg = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(length) - 1)
    share = (time - edges[leg]) / np.maximum(np.diff(edges)[leg], 1e-300)
    if eased:
        share = 0.5 - 0.5 * np.cos(np.pi * share)
    value = at[leg] + (at[leg + 1] - at[leg]) * share
    return Path(time, value, leg.astype(np.int64))


def to_and_fro(low: float, high: float, cycles: int, growth: float = 0.0) -> list[float]:
    """Turning points from 0: `cycles` times high, low. growth: the first cycle has this share of
    the last one less in amplitude (0: all alike)."""
    out = [0.0]
    for k in range(cycles):
        size = 1.0 - growth * (1.0 - k / max(1, cycles - 1))
        out += [size * high, size * low]
    return out


def samples(random: Generator, legs: int, most: int = 20_000) -> int:
    """How many: some hundred to `most`, seldom up to a hundred thousand, enough for every leg."""
    if random.random() < 0.05:
        most = 100_000
    return int(max(_LEAST_A_LEG * legs, log_uniform(random, 120, most)))
