"""Rate-independent friction beside a joint's spring, from the first load on.

A friction element of strength r carries `S_r(tau) = tau - P_r(tau)` (stop operator; P play): the
spring feels so much less, and deflects less. A spectrum of strengths makes any loop that obeys
Masing's rules (Iwan 1967), the family behind Coulomb, Dahl, LuGre without lag and Bouc-Wen alike.
The coefficients are the shares of the joint's compliance that work through friction, 0 to 1.
Size: gears of ratio >= 80 lose about 1 arcmin; friction is 2 to 20 % of the torque they see.
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.variants import Variant, smooth_root, variant

WORD = "joint_hysteresis"
RADII = (0.01, 0.02, 0.04, 0.08, 0.14, 0.22, 0.32, 0.45)  # of the joint's range of torque
SCALES = (0.05, 0.15, 0.5, 1.0)


def variants(bench: Bench) -> list[Variant]:
    """Per joint: each strength alone with its neighbour, and the whole spectrum."""
    out = []
    for j in bench.moving_joints():
        torque = bench.torque[:, j]
        span = float(np.ptp(np.append(torque, 0.0)))
        if not span > 0:
            continue
        radius = span * np.array(RADII)
        states = bench.plays(torque, radius)
        c = bench.compliance[j]
        columns = [
            bench.add_joint(j, -bench.sense * c * (torque - states[:, k]))
            for k in range(len(radius))
        ]
        info = {"joint": j, "radius": radius}
        out.append(
            variant(WORD, f"joint {j + 1} spectrum", columns, SCALES,
                    smooth_root(len(columns), 0.6), prior=0.5, **info)
        )  # fmt: skip
        for k in range(len(columns) - 1):
            pair = {"joint": j, "radius": radius[k : k + 2]}
            out.append(
                variant(WORD, f"joint {j + 1} r {RADII[k]}", columns[k : k + 2], SCALES,
                        smooth_root(2, 0.7), prior=0.5 / (len(columns) - 1), **pair)
            )  # fmt: skip
    return out
