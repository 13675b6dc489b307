"""Digits that are coarser than what was stated of a channel.

Whoever reads a whole number of steps is off by a step over the root of 12, whatever else was stated
of the instrument (GUM F.2.2.1): a range that is too large for its converter, a display that was
copied. What is left then goes up and down with the digits, as waves and bends of the curve do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.data import GapData
from identification.gap.recording.holds import ENOUGH

_ONE_NUMBER = 0.7  # of successive readings of a hold: they scatter by a quarter of the step
_FEWEST = 6  # values that tell a lattice, and readings that come again
_MULTIPLE = 0.05  # of a step by which a value may be off the lattice: conversions round, too
_SAME = 1e-9  # of the range: digits that a conversion of units leaves


def with_quantization_noise(data: GapData) -> GapData:
    """The data with an uncertainty of force and displacement that their digits allow; as they are
    where these are fine enough."""
    meter, notes = data.instruments, list[str]()
    for channel, unit, per_unit in (("force", "N", 1.0), ("displacement", "mm", 1e-3)):
        stated, step = getattr(meter, channel), quantization_step(data, channel)
        if (least := step / 12**0.5) > stated:
            meter = replace(meter, **{channel: least})
            notes.append(
                f"The {channel} is read in steps of {step / per_unit:.3g} {unit}, which nobody "
                f"knows to better than {least / per_unit:.2g} {unit}, but {stated / per_unit:.2g} "
                f"{unit} is stated. It was taken as uncertain as its digits leave it."
            )
    return replace(data, instruments=meter, notes=(*data.notes, *notes)) if notes else data


def in_one_number(values: Array, hold: Ints) -> bool:
    """Whether values (n,) mostly stay at one number in holds (n,), as they scatter by less than a
    step: taking more of them tells no more."""
    again = np.diff(hold) == 0
    return bool(again.sum() >= ENOUGH and np.mean(np.diff(values)[again] == 0) >= _ONE_NUMBER)


def left_of(means: Array, setup: Ints, step: float) -> Array:
    """(h,) what digits leave of the means (h,) of holds that stay at one number. Holds of a setup
    that read the same are off by about the same, and together tell no more than one."""
    same = np.unique(np.stack([setup, np.round(means / step)]), axis=1, return_inverse=True)[1]
    return np.asarray(step / 12**0.5 * np.sqrt(np.bincount(same.ravel())[same.ravel()]))


def quantization_step(data: GapData, channel: str) -> float:
    """Step (N, m) in which a channel is read; 0 where none shows, or where it may be what was set
    rather than read."""
    values = from_first(getattr(data, channel), data.run)
    step = step_of(values)
    drives = channel == ("displacement" if data.imposed == "displacement" else "force")
    return 0.0 if drives and _may_be_set(values, step) else step


def from_first(values: Array, group: Ints) -> Array:
    """Values (n, ...) less the first one of their group: what a run was zeroed by is no digit."""
    _, first, which = np.unique(group, return_index=True, return_inverse=True)
    return np.asarray(values - values[first][which])


def _may_be_set(values: Array, step: float) -> bool:
    """Whether values (n,) of what drives may be its levels, as somebody set or weighed them, rather
    than readings: large steps, or a few round numbers."""
    if step <= 0 or step > _LARGE * float(np.ptp(values)):
        return True
    leading = step / 10 ** np.floor(np.log10(step * (1 + _SAME)))
    is_round = min(abs(leading - d) for d in (1, 2, 5)) < _SAME
    return is_round and len(_each(values)) <= _MANY


_LARGE = 0.02  # of the range


def step_of(values: Array) -> float:
    """Step of the lattice on which all values (n,) lie, to which some come again; 0 where they lie
    on none. Where they are at every place of it, a converter reads one again and again, and a ramp
    does not; a few places are levels, and what answered to these: of them the decimals tell."""
    each = _each(values)
    if not _FEWEST <= len(each) <= len(values) - _FEWEST:
        return 0.0
    steps = np.diff(each)
    places = steps / steps.min()
    if np.any(np.abs(places - np.round(places)) > _MULTIPLE):
        return 0.0
    step = float(np.median(steps / np.round(places)))
    if places.max() > _EVENLY:
        return step
    if np.mean(np.diff(values) == 0) < _AGAIN:
        return 0.0
    return step if len(steps) > _MANY else _decimal(values, step)


def _each(values: Array) -> Array:
    """Values (n,) each once, but for what a conversion of units leaves."""
    least = _SAME * float(np.ptp(values)) or 1.0
    return np.asarray(np.unique(np.round((values - values[0]) / least)) * least)


_MANY, _EVENLY = 50, 1.5  # places that are no levels; of the least step
_AGAIN = 0.1  # of the readings


def _decimal(values: Array, most: float) -> float:
    """The largest power of ten, no larger than `most`, of which all values are multiples."""
    step = 10.0 ** np.floor(np.log10(most * (1 + _SAME)))
    for _ in range(_DECIMALS):
        places = values / step
        if np.all(np.abs(places - np.round(places)) < _MULTIPLE):
            return float(step)
        step /= 10
    return 0.0


_DECIMALS = 4  # powers of ten that are tried
