"""The fixture between flange and laser target seats itself: soft start at low force.

The same saturating function of the force in every direction and pose: `d (1 - exp(-F/F0))` or
`d F / (F + F0)`; unseen by encoders, 2 to 100 um.

Size: 2 to 100 um; 0.3 to 10 % of the deflection.
Prior: depth positive, sd out of SHARES, equally likely; force scales and laws equally likely.
Source: flattening of asperities in clamped joints, Greenwood and Williamson 1966.
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.variants import Variant, variant

WORD = "contact_seating"
FORCES = (0.02, 0.05, 0.1, 0.2, 0.4)  # of the largest force
SHARES = (0.003, 0.01, 0.03, 0.1)  # of the deflection


def variants(bench: Bench) -> list[Variant]:
    """Per force scale and law, and a mixture of scales."""
    top = float(np.abs(bench.load).max())
    if not top > 0:
        return []
    scales = tuple(s * bench.reach for s in SHARES)
    size, sign = np.abs(bench.load), np.sign(bench.load)
    out, columns = [], []
    for share in FORCES:
        f0 = share * top
        for law, shape in (
            ("exponential", 1 - np.exp(-size / f0)),
            ("hyperbolic", size / (size + f0)),
        ):
            column = bench.add(bench.outside_column(sign * shape))
            if law == "exponential":
                columns.append(column)
            out.append(
                variant(WORD, f"{law} {share:g}", [column], scales, force_N=f0, laws=((law, f0),))
            )
    out.append(
        variant(
            WORD,
            "mixture",
            columns,
            scales,
            prior=2.0,
            force_N=0.1 * top,
            laws=tuple(("exponential", s * top) for s in FORCES),
        )
    )
    return out
