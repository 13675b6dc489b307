"""White noise of a signal, by its second differences: a path that is smooth has hardly any."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array

QUARTILE = 0.6745  # of a normal's standard deviations: half of its values lie within it


def white_sd(second: Array) -> float:
    """Standard deviation of the noise behind second differences, from their median size, so that
    jumps do not count: half of a normal's values lie within 0.6745 of its standard deviations, and
    three readings weigh 1, 2 and 1 in each."""
    return float(np.median(np.abs(second))) / QUARTILE / 6**0.5


_WHITE = 1.5  # ratio of second differences' variances over two samples and over one: noise has 1
LEAST_SAMPLES = 300  # fewer show no noise


def white_noise(values: Array, beside: Array | None = None) -> float:
    """Standard deviation of the white part of a signal that is sampled densely; 0 where second
    differences show how it moves rather than its noise. Of turning points alone, up and down by
    turns, every second one tells. beside (n,): what moves with it, and is read at the same moments:
    where these come unevenly both are off their course together, which is no noise."""
    if len(values) < LEAST_SAMPLES:
        return 0.0
    one, two = white_sd(_second(values, 1)), white_sd(_second(values, 2))
    if two >= _WHITE**0.5 * one:
        return 0.0
    if beside is None:
        return min(one, two)
    second = _second(values, 1)
    return min(one, two, white_sd(second - _in_common(second, _second(beside, 1))))


def _second(values: Array, step: int) -> Array:
    """Second differences over so many samples to either side."""
    return values[2 * step :] - 2 * values[step:-step] + values[: -2 * step]


def _in_common(values: Array, beside: Array) -> Array:
    """What of values (n,) goes in proportion to others, as most of them do."""
    sizes = [np.median(np.abs(v)) for v in (values, beside)]
    usual = (np.abs(values) <= _USUAL * sizes[0]) & (np.abs(beside) <= _USUAL * sizes[1])
    square = float(beside[usual] @ beside[usual])
    return beside * (float(beside[usual] @ values[usual]) / square if square > 0 else 0.0)


_USUAL = 5.0  # medians of their sizes
