"""Whether what was measured is of another order of size than what was simulated: most often a unit
that is not the stated one."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.answer.notes import FAULT, Note
from identification.gap.model.bench import Bench
from identification.slips import FAR, LINE, slip

_LEAST = 1e-9
_SEVERAL = 2  # poses and directions
_SPREAD, _BEYOND = 0.07, 3.0  # of what effects add to springs; times that is a fifth


def times_as_far(bench: Bench, predicted: Array) -> Array:
    """By how much the response goes further than predicted (n,) m, least squares over the rows less
    their mean, of every setup in which the two are alike; negative if the other way."""
    rows, out = bench.rows, []
    both = rows.about_means(np.column_stack([predicted, bench.response]))
    for s in range(len(bench.data.setups)):
        mine = both[rows.setup == s]
        (square, product), (_, own) = mine.T @ (rows.weight[rows.setup == s, None] * mine)
        if product**2 > LINE * square * own:
            out.append(float(product / square))
    return np.array(out)


def off_scale(bench: Bench, predicted: Array) -> tuple[Note, ...]:
    """A note where that is far off, or, of another simulator's curves, the other way."""
    times = times_as_far(bench, predicted)
    if not times.size:
        return ()
    if bench.data.curves is not None and np.all(times < 0):
        text = "The simulated curves go the other way than what was measured: see to their signs."
        return (Note(FAULT, text),)
    size = float(np.exp(np.median(np.log(np.maximum(np.abs(times), _LEAST)))))
    if 1 / FAR <= size <= FAR:
        return _in_another_unit(bench, times)
    far = f"{size:.0f} times as far as" if size > 1 else f"1/{1 / size:.0f} of the way that was"
    text = (
        f"What was measured moves {far} simulated: see first whether forces are in N, "
        "displacements in mm and stiffnesses in what META states. Until then believe no verdict."
    )
    return (Note(FAULT, text),)


def _in_another_unit(bench: Bench, times: Array) -> tuple[Note, ...]:
    """A note where an arm moves, in every pose and direction, as much further as it would in a unit
    that is slipped into often: its springs are known, and one factor on all of them is seldom
    theirs."""
    if not bench.data.arm or len(times) < _SEVERAL or not np.all(times > 0):
        return ()
    stiffer, stated = -np.log(times), float(bench.data.compliance_relative_sd.max())
    common = float(np.median(stiffer))
    units = slip(common, _SPREAD)
    if units is None or abs(common) < _BEYOND * stated or np.ptp(stiffer) > _BEYOND * _SPREAD:
        return ()
    text = (
        f"What was measured moves {np.exp(-common):.2g} times as far as simulated in "
        f"every pose and direction. Are these {units}? Until that is clear believe no verdict."
    )
    return (Note(FAULT, text),)
