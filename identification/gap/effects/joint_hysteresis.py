"""Rate-independent friction beside a joint's spring, from the first load on.

A friction element of strength r carries `S_r(tau) = tau - P_r(tau)` (stop operator; P play): the
spring feels so much less, and deflects less. A spectrum of strengths makes any loop that obeys
Masing's rules (Iwan 1967). Friction that does not obey them: an asperity model whose bristles
bend exponentially (Dahl 1968), and one that lets go elastically (Bouc 1967, Wen 1976; beta = gamma).
The coefficients are the shares of the joint's compliance that work through friction, 0 to 1.
Size: gears of ratio >= 80 lose about 1 arcmin; friction is 2 to 20 % of the torque they see.
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.history import bristles
from identification.gap.variants import Variant, smooth_root, variant

WORD = "joint_hysteresis"
RADII = (0.012, 0.03, 0.07, 0.13, 0.22, 0.35, 0.55, 0.85)  # of the joint's range of torque
REACHES = (0.08, 0.2, 0.5, 1.2)  # of exponential laws, of the joint's range of torque
SCALES = (0.015, 0.05, 0.15, 0.5)


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
                    smooth_root(len(columns), 0.6, 0.3), prior=0.25, **info)
        )  # fmt: skip
        for k in range(len(columns) - 1):
            pair = {"joint": j, "radius": radius[k : k + 2]}
            out.append(
                variant(WORD, f"joint {j + 1} r {RADII[k]}", columns[k : k + 2], SCALES,
                        smooth_root(2, 0.7), prior=0.25 / (len(columns) - 1), **pair)
            )  # fmt: skip
        out += _exponential(bench, j, span)
    return out


def _exponential(bench: Bench, joint: int, span: float) -> list[Variant]:
    """Dahl's and Bouc and Wen's laws, with neighbouring reaches."""
    torque, c = bench.torque[:, joint], bench.compliance[joint]
    out = []
    for law in ("Dahl", "Bouc-Wen"):
        reach = span * np.array(REACHES)
        z = bristles(torque, reach, bench.moved, elastic=law == "Bouc-Wen")
        columns = [
            bench.add_joint(joint, -bench.sense * c * reach[k] * z[:, k]) for k in range(len(reach))
        ]
        for k in range(len(reach) - 1):
            out.append(
                variant(WORD, f"joint {joint + 1} {law} {REACHES[k]}", columns[k : k + 2], SCALES,
                        smooth_root(2, 0.5), prior=0.25 / (len(reach) - 1), joint=joint,
                        radius=reach[k : k + 2])
            )  # fmt: skip
    return out
