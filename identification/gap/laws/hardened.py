"""What yields on only beyond the largest load that it has borne: isotropic hardening."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.laws.lasting import HARDENS, lasting
from identification.gap.model.bench import Bench
from identification.gap.model.history import whiles
from identification.gap.model.variants import Variant
from identification.gap.recording.turns import way_back

HARDENED = " hardened"
UNDER_A_TIP, _CAME_BACK = (0.01, 0.04, 0.1), 0.2  # of the range
_LEFT = 0.2  # of the largest response: as much as friction seldom holds


def hardened(
    bench: Bench,
    load: Array,
    radius: Array,
    column: Callable[[Array], int],
    word: str,
    name: str,
    info: dict[str, Any],
) -> list[Variant]:
    """What hardens alike in both senses (Voce 1948) and is loaded again and again: it yields on
    only beyond the largest load it has borne. Specimens from one side, under a tip from the first
    load on (said of loads that come back before they grow, and of what is not taken back by a long
    way: a single loop may be friction); joints of an arm, whichever way they are pushed next."""
    top = float(np.abs(load).max())
    course, arm = bench.course, bench.data.arm
    told = "joint" in info and course.unloads if arm else course.lets_go and course.one_sided
    if not told:
        return []
    size = np.abs(load)
    if not arm and (
        way_back(size[: int(size.argmax()) + 1]) > _CAME_BACK * top
        or bench.course.left_behind > _LEFT
    ):
        radius = np.concatenate([top * np.array(UNDER_A_TIP), radius])
    columns = [column(s) for s in grown(load, radius, bench.moved).T]
    return [
        lasting(
            word,
            f"{name}{HARDENED} beyond {radius[k] / top:.3g}",
            columns[k:],
            np.diag([1.0, *[HARDENS] * (len(radius) - k - 1)]),
            0.7 / len(radius),
            info,
            memory=HARDENED,
            radius=radius[k:],
            load=load,
            column=column,
            knee="hardened",
        )
        for k in range(len(radius))
    ]


def grown(load: Array, radius: Array, fresh: Flags) -> Array:
    """(n, k): by how much the size of the load (n,) has ever been beyond the radii (k,) since the
    memory was fresh; each time with the sign that the load then had."""
    out = np.empty((len(load), len(radius)))
    for a, b in whiles(fresh):
        largest = np.maximum.accumulate(np.abs(load[a:b]))
        beyond = np.maximum(largest[:, None] - radius, 0.0)
        grows = np.diff(beyond, axis=0, prepend=0.0)
        out[a:b] = np.cumsum(np.sign(load[a:b])[:, None] * grows, axis=0)
    return out
