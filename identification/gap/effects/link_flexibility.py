"""Arm segments bend and twist: beams in series with the joints, unseen by encoders.

Compliance along the direction of each nominal tube (model file of the robot), scaled by a
coefficient: 1 is the nominal aluminium tube, 50 to 870 um at 100 N; castings are 0.2 to 3 times it.

Size: 0.2 to 3 times the nominal tubes: 50 to 870 um at 100 N.
Prior: factors positive in sum, sd out of SCALES, equally likely.
Source: beam theory for the segments in the robot's model file.
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.variants import Variant, variant

WORD = "link_flexibility"
SCALES = (0.15, 0.5, 1.5)


def variants(bench: Bench) -> list[Variant]:
    """Each link, and both."""
    links = np.stack([s.links for s in bench.data.setups])[bench.rows.setup]
    columns = []
    for k in range(links.shape[1]):
        columns.append(bench.add(bench.outside_column(links[:, k] * bench.load)))
    out = [
        variant(WORD, f"segment {k + 1}", [c], SCALES, segments=[k]) for k, c in enumerate(columns)
    ]
    if len(columns) > 1:
        out.append(variant(WORD, "both arms", columns, SCALES, segments=list(range(len(columns)))))
    return out
