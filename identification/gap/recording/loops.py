"""Loops of a running recording that is loaded from one side, let go and loaded again.

Friction and what is viscous use up work in every loop, down to the smallest; metal that has yielded
comes back along the line it was let go on. As long as it is loaded from one side, nothing makes it
flow back.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.recording.turns import turns

_PASS = 0.05  # of the range of what is driven: less is no turn
_POINTS = 50


def lost(u: Array, force: Array, imposed: bool) -> tuple[float, float]:
    """Share of the box around a loop that it encloses: of letting go, against the loading before,
    the largest; and of loading again, against letting go, the median. nan where there is none.

    u (n,), force (n,): of one run, in order. imposed: the displacement is driven."""
    driven = u if imposed else force
    edges = [0, *turns(driven, _PASS), len(force) - 1]
    let_go: list[float] = []
    again: list[float] = []
    for a, b, c in zip(edges, edges[1:], edges[2:], strict=False):
        share = _enclosed(u, force, a, b, c)
        if share is not None:
            valley = abs(driven[b]) < min(abs(driven[a]), abs(driven[c]))
            (again if valley else let_go).append(share)
    return max(let_go, default=float("nan")), float(np.median(again)) if again else float("nan")


def _enclosed(u: Array, force: Array, a: int, b: int, c: int) -> float | None:
    """Between two legs, over the displacement that both pass; None where there is no force."""
    legs = slice(a, b + 1), slice(b, c + 1)
    low = max(float(u[leg].min()) for leg in legs)
    high = min(float(u[leg].max()) for leg in legs)
    at = np.linspace(low, high, _POINTS)
    there, back = (np.interp(at, *_sorted(u[leg], force[leg])) for leg in legs)
    box = max(float(np.ptp(there)), float(np.ptp(back)))
    return float(np.mean(np.abs(there - back))) / box if box > 0 else None


def _sorted(u: Array, force: Array) -> tuple[Array, Array]:
    order = np.argsort(u, kind="stable")
    return u[order], force[order]
