"""Loads that relax while they stand, by less than a reading of the force scatters.

A screw that is let go, its thread and the skin of the target give a little with the logarithm of
time, in proportion to what they carry. A laser sees that of a soft arm in single holds; the force
shows it in all holds together. What both say alike is taken into the load; a force reading alone
may drift, a displacement alone creeps.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array, Flags, Ints

_PLAIN = 4.0  # standard errors
_ALIKE = 0.5  # of the larger: so far the channels may be apart, or as far as their errors say
_FEWEST = 3  # rows of a hold


def relaxed(
    force: Array, displacement: Array, time: Array, hold: Ints, weight: Array, still: Flags
) -> Array:
    """(n,) by which share of its mean over a hold (n,) the load is higher in a row; 0 everywhere
    where force N and displacement (n,) don't show that plainly. time s, weight (n,); still (n,):
    rows at which the force stands within its noise."""
    weight = np.where(still, weight, 0.0)
    rows = np.bincount(hold, weights=still)[hold]
    weight = np.where(rows >= _FEWEST, weight, 0.0)
    total = np.maximum(np.bincount(hold, weights=weight), np.finfo(float).tiny)

    def about_mean(values: Array) -> tuple[Array, Array]:
        mean = (np.bincount(hold, weights=weight * values) / total)[hold]
        return values - mean, mean

    begin = np.full(len(total), np.inf)
    np.minimum.at(begin, hold[weight > 0], time[weight > 0])
    since = np.where(weight > 0, time - begin[hold], 0.0)
    unit = np.min(since[since > 0], initial=np.inf)
    if not np.isfinite(unit):
        return np.zeros(len(force))
    shape, _ = about_mean(np.log1p(since / unit))
    (of_force, error), (of_displacement, other) = (
        _share(shape * mean, off, weight) for off, mean in map(about_mean, (force, displacement))
    )
    apart = max(_ALIKE * max(-of_force, -of_displacement), _PLAIN * float(np.hypot(error, other)))
    plain = max(of_force / error, of_displacement / other) < -_PLAIN
    if not plain or abs(of_force - of_displacement) > apart:
        return np.zeros(len(force))
    trust = np.array([error**-2, other**-2])
    share = float(trust @ [of_force, of_displacement]) / float(trust.sum())
    return np.where(weight > 0, share * shape, 0.0)


def _share(column: Array, values: Array, weight: Array) -> tuple[float, float]:
    """Coefficient of a column (n,) in values (n,), and its standard error by what is left."""
    square = float(weight @ column**2)
    if not square > 0:
        return 0.0, np.inf
    share = float(weight @ (column * values)) / square
    free = max(int(np.sum(weight > 0)) - 1, 1)
    left = float(weight @ (values - share * column) ** 2) / free
    return share, max((left / square) ** 0.5, np.finfo(float).tiny)
