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
from identification.gap.data import Array
from identification.gap.variants import Variant, variant

WORD = "contact_seating"
FORCES = (0.02, 0.05, 0.1, 0.2, 0.4)  # of the largest force
# A bench has no second direction that would tell a seat from a curved spring: only low forces.
BENCH_FORCES = (0.002, 0.006, 0.02, 0.05, 0.1)
BENCH_SHARES = (0.01, 0.03, 0.1)
SLACKS = (0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4)  # of an imposed stroke
SHARES = (0.003, 0.01, 0.03, 0.1)  # of the deflection


def variants(bench: Bench) -> list[Variant]:
    """Per force scale and law, and a mixture of scales. What bears both ways is no seat: what is
    slack there is a play."""
    top = float(np.abs(bench.load).max())
    if not top > 0 or not (bench.data.arm or bench.one_sided):
        return []
    scales = tuple(s * bench.reach for s in (SHARES if bench.data.arm else BENCH_SHARES))
    size, sign = pressed(bench)
    out, columns = [], []
    forces = FORCES if bench.data.arm else BENCH_FORCES
    for share in forces:
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
            laws=tuple(("exponential", s * top) for s in forces),
        )
    )
    return [*out, *_slacks(bench, top)]


def pressed(bench: Bench) -> tuple[Array, Array]:
    """Force (n,) N on the seat and its sense. A bench that is loaded from one side presses on it
    from where its load begins, wherever the zero of its force is."""
    if bench.data.arm or not bench.one_sided:
        return np.abs(bench.load), np.sign(bench.load)
    sense = 1.0 if bench.load.max() >= -bench.load.min() else -1.0
    pushed = sense * bench.load
    return np.asarray(pushed - pushed.min()), np.full(bench.rows.n, sense)


def _slacks(bench: Bench, top: float) -> list[Variant]:
    """Where the stroke is imposed, from one side: slack that is taken up before force rises,
    `d min(u / d, 1)`, told by the stroke: the force that is simulated for it knows of no slack."""
    if bench.data.arm or not bench.imposed or not bench.one_sided:
        return []
    stroke = np.asarray(bench.slope * np.abs(bench.load))
    out, (size, sign) = [], pressed(bench)
    for share in SLACKS:
        d, f0 = share * float(stroke.max()), share * top
        column = bench.add(bench.outside_column(sign * np.minimum(size / f0, 1.0)))
        out.append(variant(WORD, f"slack {share:g}", [column], (0.5 * d, d), force_N=f0,
                           laws=(("slack", f0),)))  # fmt: skip
    return out
