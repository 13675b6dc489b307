"""The load does not act along the nominal direction: a share t of it acts across.

The target then moves along the direction by `F n' C t`; recorded force components grow with the
load by t F. Screws on floors and stands are set up within 1 to 15 degrees.

Size: 1 to 15 degrees, tangents of 0.02 to 0.25.
Prior: tangents of either sign, sd out of SCALES, equally likely.
Source: how well screws are set up by eye on floors and stands.
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.variants import Variant, variant

WORD = "load_misalignment"
SCALES = (0.03, 0.1, 0.25)


def variants(bench: Bench) -> list[Variant]:
    """Two tangents per direction; each direction alone, and all."""
    rows, data = bench.rows, bench.data
    across = np.stack([s.tangent_lever for s in data.setups])[rows.setup]  # (n, 2, m)
    names = [s.direction for s in data.setups]
    out, every = [], []
    for name in dict.fromkeys(names):
        mine = np.array([n == name for n in names])[rows.setup]
        pair = []
        for k in range(2):
            load = np.where(mine, bench.load, 0.0)
            q = across[:, k, :] * bench.compliance * load[:, None]
            tangential = np.zeros((rows.n, 2))
            tangential[:, k] = load
            response = np.sum(bench.lever * q, axis=1)
            pair.append(bench.add(bench.stacked(response, q, tangential)))
        every += pair
        out.append(
            variant(WORD, f"direction {name}", pair, SCALES, positive=False, prior=0.5,
                    directions=[name])
        )  # fmt: skip
    if len(out) > 1:
        out.append(
            variant(WORD, "all directions", every, SCALES, positive=False,
                    directions=list(dict.fromkeys(names)))
        )  # fmt: skip
    return out
