"""Effects that a simulation already has: measured data less what they do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.gap.bench import Bench, make_bench
from identification.gap.data import Array, GapData
from identification.gap.forms import Form, lawful, realise


def less_known(data: GapData, forms: Sequence[Form]) -> GapData:
    """The data with the effects' part taken out of every channel, so that what is left is the gap
    of a simulation with them. Raises ValueError where the displacement is imposed: the effects then
    take force away, and what is left is no measurement any more."""
    bench = make_bench(data)
    if bench.imposed:
        raise ValueError("effects of a model are known as displacements, and here the displacement "
                         "is imposed")  # fmt: skip
    total = np.zeros(bench.layout.size)
    for f in forms:
        total += realise(bench, lawful(f))
    count = bench.rows.weight.astype(np.int64)
    holds = np.add.reduceat(count, np.flatnonzero(bench.rows.hold_starts))
    layout, q, across = bench.layout, data.q, data.tangential
    if q is not None and bench.has_q:
        q = q - np.repeat(total[layout.q].reshape(-1, len(holds)).T, holds, axis=0)
    if across is not None:
        parts = total[layout.tangential].reshape(2, len(holds)).T
        across = across - np.repeat(parts, holds, axis=0)
    zero = np.zeros(bench.rows.n)
    zero[bench.rows.zero] = total[layout.zero_force]
    return replace(
        data,
        force=data.force - np.repeat(zero, count),
        displacement=data.displacement - np.repeat(_from_datum(bench, total), count),
        q=q,
        tangential=across,
    )


def _from_datum(bench: Bench, total: Array) -> Array:
    """(n,): the response counted from where the laser was zeroed."""
    rows = bench.rows
    group = rows.run if bench.data.datum == "repetition" else rows.setup
    out = total[: rows.n].copy()
    for g in np.unique(group):
        mine = group == g
        out[mine] -= out[int(np.argmax(mine))]
    return out
