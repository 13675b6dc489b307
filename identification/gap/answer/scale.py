"""Whether what was measured is of another order of size than what was simulated: most often a unit
that is not the stated one."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.answer.notes import FAULT, Note
from identification.gap.model.bench import Bench

# Of 1300 recordings, of rigs and of their simulations, none was off by more than twenty where the
# response is a line for the most part.
FAR = 50.0
_ALIKE = 0.5  # of the response's square is what the simulation, scaled, explains
_LEAST = 1e-9


def times_as_far(bench: Bench, predicted: Array) -> Array:
    """By how much the response goes further than predicted (n,) m, least squares over the rows less
    their mean, of every setup in which the two are alike; negative if the other way."""
    rows, out = bench.rows, []
    both = rows.moved(np.column_stack([predicted, bench.response]))
    for s in range(len(bench.data.setups)):
        mine = both[rows.setup == s]
        (square, product), (_, own) = mine.T @ (rows.weight[rows.setup == s, None] * mine)
        if product**2 > _ALIKE * square * own:
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
        return ()
    far = f"{size:.0f} times as far as" if size > 1 else f"1/{1 / size:.0f} of the way that was"
    text = (
        f"What was measured moves {far} simulated: see first whether forces are in N, "
        "displacements in mm and stiffnesses in what META states. Until then believe no verdict."
    )
    return (Note(FAULT, text),)
