"""Bauschinger's effect: what has yielded flows back early once it is unloaded, and creeps on with
every cycle.

Smaller plays from the first reversal on, and a ratchet. What never yielded leaves nothing to flow
back: cycles within a threshold lose nothing, whatever threshold lies above them.

Source: Bauschinger 1881; the plays are those of kinematic hardening (Prandtl 1928).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.model.bench import Bench
from identification.gap.model.history import beginnings, whiles

BACK = (0.1, 0.2, 0.3, 0.42, 0.56)  # radii of what flows back after a reversal, of the range
RATCHET_FROM = 0.6  # of the range
RATCHETS = 0.3  # of a cycle's path beyond that: creeps on so much slower than it flows
BACK_FROM = (0.25, 0.5, 0.75)  # of the range: loads from which on a joint may have yielded
_REVERSED = 0.05  # of the largest load: so far back it is a reversal


def flowing_back(
    bench: Bench, load: Array, column: Callable[[Array], int], top: float, fresh: Flags
) -> dict[float, list[int]]:
    """By the share (of BACK_FROM) of `top` beyond which it has yielded, columns of what that leaves
    behind: smaller plays from the first reversal on, zero before (the first loading has a knee as
    sharp as it likes), and a ratchet; empty where nothing is reversed. A specimen that is only let
    go takes back what is elastic: where more comes back, a curve or friction does that.

    load (n,); column: from a state (n,) to its place in the pool; top: range of the load."""
    out: dict[float, list[int]] = {}
    if not bench.data.arm and bench.load_history.one_sided:
        return out
    for share in BACK_FROM:
        peak_of = peaks(load, share * top, fresh)
        after = peak_of >= 0
        if not after.any():
            break
        if not out:
            states = bench.plays(load, top * np.array(BACK), fresh)
            path = RATCHETS * ratchet(load, RATCHET_FROM * top, fresh)
        back = [np.where(after, s - s[peak_of], 0.0) for s in states.T]
        out[share] = [column(s) for s in (*back, np.where(after, path, 0.0))]
    return out


def yielded_from(info: Mapping[str, Any]) -> float:
    """Of BACK_FROM, the load (share of `top`) from which on a knee's lowest radius was passed: what
    never yielded leaves nothing to flow back."""
    alone = float(np.abs(info.get("weight", 0.0)).max())
    lowest = (float(np.min(info["radius"])) - alone) / float(info["top"])
    return max((share for share in BACK_FROM if share <= lowest + 1e-9), default=BACK_FROM[0])


def peaks(load: Array, threshold: float, fresh: Flags) -> Ints:
    """(n,) row of the largest load before a row, -1 where nothing beyond the threshold has been
    reversed since the memory was last fresh."""
    size = np.abs(load)
    peak_of = np.full(len(load), -1)
    for a, b in whiles(fresh):
        peak = np.maximum.accumulate(size[a:b])
        turned = (peak > threshold) & (size[a:b] < peak - _REVERSED * size.max())
        if turned.any():
            first = a + int(turned.argmax())
            peak_of[first:b] = a + int(size[a:first].argmax())
    return peak_of


def ratchet(load: Array, threshold: float, fresh: Flags) -> Array:
    """(n,) path on which the size of the load has grown beyond the threshold, with its sign, since
    the memory was fresh: what creeps on with every cycle is in proportion to it."""
    size = np.maximum(np.abs(load) - threshold, 0.0)
    step = np.maximum(np.diff(size, prepend=size[0]), 0.0) * np.sign(load)
    total = np.cumsum(step)
    start = np.flatnonzero(beginnings(fresh))
    group = np.cumsum(beginnings(fresh)) - 1
    return np.asarray(total - (total - step)[start][group])
