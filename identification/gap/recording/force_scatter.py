"""A force that scatters more than was stated of it, while the displacement stands still.

What was stated of a dynamometer may be wrong by any factor: hum, a range that is too large. A row's
force is then off by more than the springs know, and a lag, which averages two readings of it,
explains that. Where the load itself trembles the displacement goes along, by what it goes with the
load elsewhere: that part is no noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.recording.holds import (
    hold_ids,
    in_common,
    is_continuous,
    rest_ids,
    scatter_of_three,
    scatter_within,
)

_MORE, _SURELY = 1.5, 1.0  # times what is stated; standard errors of what both have in common


def with_observed_force_noise(data: GapData) -> GapData:
    """The data with as much uncertainty of the force as its holds show; as they are where that is
    about what was stated, or where the force runs."""
    hold = hold_ids(data)
    if is_continuous(data, hold):
        return data
    rest = rest_ids(data, hold)
    scatter = scatter_within(data.force, rest) or scatter_of_three(data.force, rest)
    moves = _per_newton(data)
    if not scatter or not moves > 0:
        return data
    shared, error = in_common(data.force, data.displacement, rest)
    alone, stated = scatter**2 - shared / moves, data.instruments.force
    if alone - _SURELY * error / moves < (_MORE * stated) ** 2:
        return data
    noise = alone**0.5
    meter = replace(data.instruments, force=noise)
    return replace(data, instruments=meter, force_scatters=noise / stated)


def _per_newton(data: GapData) -> float:
    """m/N by which the displacement goes with the force, of whatever sense."""
    force, moved = (_about_mean(data, v) for v in (data.force, data.displacement))
    square = float(force @ force)
    return abs(float(force @ moved)) / square if square > 0 else 0.0


def _about_mean(data: GapData, values: Array) -> Array:
    """(n,) less the mean of the setup: directions have springs and a datum of their own."""
    count = np.bincount(data.setup)
    return np.asarray(values - (np.bincount(data.setup, values) / np.maximum(count, 1))[data.setup])
