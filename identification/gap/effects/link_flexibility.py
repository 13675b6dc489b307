"""Arm segments bend and twist: beams in series with the joints, unseen by encoders.

Compliance along the direction of each nominal tube (model file of the robot), scaled by a
coefficient: 1 is the nominal aluminium tube, 50 to 870 um at 100 N; castings are 0.2 to 3 times it.
No data sheet says where a casting's neutral axis runs: where the model file has the tube, beside
the plane of the joints, or from joint to joint.

Size: 0.2 to 3 times the nominal tubes: 50 to 870 um at 100 N.
Prior: factors positive, sd out of SCALES, equally likely.
Source: beam theory for the segments in the robot's model file.
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.variants import Variant, variant

WORD = "link_flexibility"
SCALES = (0.15, 0.5, 1.5)


STRAINS = ("bending", "twist")
PLACED = ("as modelled", "joint to joint")
ALIKE = 0.9  # correlation of the two in one segment: both go with its wall and material


def variants(bench: Bench) -> list[Variant]:
    """Each link, and both; bending and twist of one are alike, but not the same."""
    links = np.stack([s.links for s in bench.data.setups])[bench.rows.setup]  # (n, 2, l, 2)
    out = []
    for k, placed in enumerate(PLACED):
        if k and np.allclose(links[:, k], links[:, 0], rtol=1e-6, atol=0.0):
            break
        out += _placed(bench, links[:, k], placed)
    return out


def _placed(bench: Bench, links: Array, placed: str) -> list[Variant]:
    """Of links (n, l, 2) m/N."""
    count, root = links.shape[1], np.array([[1.0, 0.0], [ALIKE, np.sqrt(1 - ALIKE**2)]])
    columns = [
        bench.add(bench.outside_column(links[:, k, i] * bench.load))
        for k in range(count)
        for i in range(2)
    ]
    where = "" if placed == PLACED[0] else f" {placed}"
    out = [
        variant(WORD, f"segment {k + 1}{where}", columns[2 * k : 2 * k + 2], SCALES, root,
                each=True, segments=[k], placed=placed)
        for k in range(count)
    ]  # fmt: skip
    if count > 1:
        both = np.kron(np.eye(count), root).astype(float)
        out.append(variant(WORD, f"both arms{where}", columns, SCALES, both, each=True,
                           segments=list(range(count)), placed=placed))  # fmt: skip
    return out
