"""The load does not act along the nominal direction: a share t of it acts across.

The target then moves along the direction by `F n' C t`; recorded force components grow with the
load by t F. Screws on floors and stands are set up within 1 to 15 degrees.

Size: 1 to 15 degrees, tangents of 0.02 to 0.25.
Prior: tangents of either sign, sd out of SCALES, equally likely.
Source: how well screws are set up by eye on floors and stands.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from identification.gap.bench import Bench
from identification.gap.variants import Variant, variant

WORD = "load_misalignment"
SCALES = (0.03, 0.1, 0.25)
# Of the load, from 0 up: a tip that drags on its pad turns the load soon and then no more.
POWERS = 3


def variants(bench: Bench) -> list[Variant]:
    """Two tangents per direction, constant or turning as the load grows, soon or late; one
    direction, and all."""
    rows, data = bench.rows, bench.data
    across = np.stack([s.tangent_lever for s in data.setups])[rows.setup]  # (n, 2, m)
    names = [s.direction for s in data.setups]
    top = float(np.abs(bench.load).max()) or 1.0
    out, every = [], []
    for name in dict.fromkeys(names):
        mine = np.array([n == name for n in names])[rows.setup]
        pair = []
        for power, k in product(range(POWERS), range(2)):
            load = np.where(mine, bench.load * np.abs(bench.load / top) ** power, 0.0)
            q = across[:, k, :] * bench.compliance * load[:, None]
            tangential = np.zeros((rows.n, 2))
            tangential[:, k] = load
            response = np.sum(bench.lever * q, axis=1)
            pair.append(bench.add(bench.stacked(response, q, tangential)))
        every += pair
        out.append(
            variant(WORD, f"direction {name}", pair[:2], SCALES, positive=False, prior=0.3,
                    directions=[name], powers=1, at_N=top)
        )  # fmt: skip
        out.append(
            variant(WORD, f"direction {name}, turning", pair, SCALES, positive=False, prior=0.2,
                    directions=[name], powers=POWERS, at_N=top)
        )  # fmt: skip
    if len(every) > 2 * POWERS:
        named = list(dict.fromkeys(names))
        straight = [c for i, c in enumerate(every) if i % (2 * POWERS) < 2]
        out.append(
            variant(WORD, "all directions", straight, SCALES, positive=False, prior=0.6,
                    directions=named, powers=1, at_N=top)
        )  # fmt: skip
        out.append(
            variant(WORD, "all directions, turning", every, SCALES, positive=False, prior=0.4,
                    directions=named, powers=POWERS, at_N=top)
        )  # fmt: skip
    return out
