"""Loops of force over displacement in running recordings.

Friction and what is viscous use up work in every loop, down to the smallest; metal that has yielded
comes back along the line it was let go on. As long as it is loaded from one side, nothing makes it
flow back. No passive rig gives out more work than was put in (second law of thermodynamics): loops
that run the other way round are read so, by a force that comes late or a sensor with a hysteresis
of its own, or something active drives them.
"""

from __future__ import annotations

from collections.abc import Iterator

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
    let_go: list[float] = []
    again: list[float] = []
    for a, b, c, there, back in _loops(u, force, driven):
        share = float(np.mean(np.abs(there - back))) / _box(there, back)
        valley = abs(driven[b]) < min(abs(driven[a]), abs(driven[c]))
        (again if valley else let_go).append(share)
    return max(let_go, default=float("nan")), float(np.median(again)) if again else float("nan")


def work_used(u: Array, force: Array, imposed: bool) -> Array:
    """(loops,) work that each loop of a run uses up, as a share of the box around it; below zero
    where it gives out work. Arguments as of `lost`."""
    found = _loops(u, force, u if imposed else force)
    return np.array(
        [
            np.sign(u[b] - u[a]) * float(np.mean(there - back)) / _box(there, back)
            for a, b, _, there, back in found
        ]
    )


_Loop = tuple[int, int, int, Array, Array]


def _loops(u: Array, force: Array, driven: Array) -> Iterator[_Loop]:
    """Turns a, b, c of what is driven, and the forces (k,) of the legs between them, there and
    back, over the displacement that both pass; none where there is no force."""
    edges = [0, *turns(driven, _PASS), len(force) - 1]
    for a, b, c in zip(edges, edges[1:], edges[2:], strict=False):
        legs = slice(a, b + 1), slice(b, c + 1)
        low = max(float(u[leg].min()) for leg in legs)
        high = min(float(u[leg].max()) for leg in legs)
        at = np.linspace(low, high, _POINTS)
        there, back = (np.interp(at, *_sorted(u[leg], force[leg])) for leg in legs)
        if _box(there, back) > 0:
            yield a, b, c, there, back


def _box(there: Array, back: Array) -> float:
    return max(float(np.ptp(there)), float(np.ptp(back)))


def _sorted(u: Array, force: Array) -> tuple[Array, Array]:
    order = np.argsort(u, kind="stable")
    return u[order], force[order]
