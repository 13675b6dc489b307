"""Which channel comes back to its zero when a rig without an arm is let go, and which does not.

A force that reads otherwise without load has drifted; a displacement that does, moved without load.
Where one of them comes back again and again, it is the other one that wanders.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from identification.gap.data import GapData

_NEAR, _BOTH = 0.08, 0.3  # of the ranges: one channel reads next to nothing, and neither much
_TIMES = 4.0  # times as far: plain
_FEWEST = 20  # readings
_PIECES, _OF = 20, 5  # medians of so many pieces, of so many readings at least


def wanders(data: GapData) -> Literal["force", "displacement"] | None:
    """The channel that moves while there is no load, None where that is not plain."""
    spans = float(np.ptp(data.force)), float(np.ptp(data.displacement))
    if not min(spans) > 0:  # a displacement that is read, and is the same to the last digit
        return "force" if spans[0] > 0 else None
    shares = [np.abs(v) / s for v, s in zip((data.force, data.displacement), spans, strict=True)]
    free = np.flatnonzero((np.minimum(*shares) < _NEAR) & (np.maximum(*shares) < _BOTH))
    if len(free) < _FEWEST:
        return None
    pieces = np.array_split(free, min(_PIECES, len(free) // _OF))
    force, displacement = (
        float(np.std([np.median(v[p]) for p in pieces])) / s
        for v, s in zip((data.force, data.displacement), spans, strict=True)
    )
    if force > _TIMES * displacement:
        return "force"
    return "displacement" if displacement > _TIMES * force else None
