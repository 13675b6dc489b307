"""The arm stands, or the tool is, elsewhere than simulated: wrong leverage.

Tool offset d in the base frame changes every lever by `d . (n x z)`; a joint that stands elsewhere
by e changes them by `dJ/dq e`, and its reading at zero load shows e. First and second order, the
second with its own coefficients. Offsets of 5 to 300 mm, angles of 0.2 to 5 degrees.

Size: tools 5 to 300 mm off, joints 0.2 to 5 degrees.
Prior: either sign, sd out of OFFSETS_M or ANGLES_RAD, equally likely.
Source: wrong tool frames and zero positions of joints.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.variants import Variant, variant

WORD = "pose_error"
OFFSETS_M = (0.01, 0.04, 0.15)
ANGLES_RAD = (0.005, 0.02, 0.06)


def variants(bench: Bench) -> list[Variant]:
    """Tool offset, and joints standing elsewhere."""
    return _tool(bench) + _joints(bench)


def _tool(bench: Bench) -> list[Variant]:
    change = np.stack([s.offset_lever for s in bench.data.setups])[bench.rows.setup]  # (n, m, 3)
    first = [_column(bench, change[:, :, k]) for k in range(3)]
    second = []
    for a, b in combinations_with_replacement(range(3), 2):
        product = change[:, :, a] * change[:, :, b] * (1.0 if a == b else 2.0)
        response = (product @ bench.compliance) * bench.load
        second.append(bench.add(bench.stacked(response)))
    out = []
    for size in OFFSETS_M:
        root = np.diag([size] * 3 + [size**2] * 6)
        out.append(
            variant(WORD, f"tool {size * 1e3:g} mm", [*first, *second], (1.0,), root,
                    positive=False, kind="tool")
        )  # fmt: skip
    return out


def _joints(bench: Bench) -> list[Variant]:
    turned = np.stack([s.turned_lever for s in bench.data.setups])[bench.rows.setup]
    columns = []
    for j in range(bench.data.joints):
        stands = np.zeros((bench.rows.n, bench.data.joints))
        stands[:, j] = 1.0
        columns.append(_column(bench, turned[:, :, j], stands))
    return [
        variant(WORD, f"joints {size:g} rad", columns, (size,), positive=False, kind="joints")
        for size in ANGLES_RAD
    ]


def _column(bench: Bench, change: Array, stands: Array | None = None) -> int:
    """What a change (n, m) of the levers does: twice in the laser, once in the readings."""
    deflection = change * bench.compliance * bench.load[:, None]
    response = 2 * np.sum(bench.lever * deflection, axis=1)
    return bench.add(bench.stacked(response, deflection if stands is None else deflection + stands))
