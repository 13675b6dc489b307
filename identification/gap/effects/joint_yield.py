"""A joint gives way above a threshold torque: clamp of the controller, clutch, plastic flow.

Beyond the elastic deflection it moves by `w P_r(tau)`, P play of radius r = threshold (kinematic
hardening, Prandtl 1928): stiff below, knee, the rest stays after unloading. Rounded knees are
several radii from the threshold on; slow flow is the same state reached with a lag; a controller
that takes the joint back resets it between runs. w in units of the joint's elastic compliance:
1/w is the ratio of hardening to spring, so 0.3 (little) to 30 (clamp that hardly holds).
"""

from __future__ import annotations

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.history import play, rests, retarded
from identification.gap.variants import Variant, smooth_root, variant

WORD = "joint_yield"
THRESHOLDS = (0.3, 0.38, 0.46, 0.53, 0.6, 0.66, 0.72, 0.77, 0.82, 0.86, 0.9, 0.94, 0.97)
SCALES = (0.3, 1.0, 4.0, 20.0)
FLOW_S = (3.0, 15.0)


def variants(bench: Bench) -> list[Variant]:
    """Per joint, threshold, knee (sharp, rounded), memory between runs, and flow time."""
    out = []
    for j in bench.moving_joints():
        c = bench.compliance[j]

        def column(state: Array, j: int = j, c: float = float(c)) -> int:
            return bench.add_joint(j, bench.sense * c * state)

        out += knee_variants(bench, bench.torque[:, j], column, WORD, f"joint {j + 1}", {"joint": j})
    return out


def knee_variants(bench, load, column, word, name, info):  # type: ignore[no-untyped-def]
    """Variants of a threshold on `load` (n,); `column` turns a state (n,) into a pool index."""
    rest = rests(bench.rows)
    top = float(np.abs(load).max())
    if not top > 0:
        return []
    radius = top * np.array(THRESHOLDS)
    tiled = np.tile(load[:, None], (1, len(radius)))
    out = []
    several = np.sum(rest) > 1
    for reset in (False, True) if several else (False,):
        states = play(tiled, radius, rest, reset)
        for flow in (0.0, *(FLOW_S if not bench.rows.continuous else ())):
            moved = _flow(bench, states, flow, rest, reset)
            columns = [column(moved[:, k]) for k in range(len(radius))]
            kind = {**info, "reset": reset, "flow_s": flow}
            label = f"{name}{' reset' if reset else ''}{f' flow {flow:g} s' if flow else ''}"
            share = (0.7 if flow == 0 else 0.3 / len(FLOW_S)) / len(radius)
            for k in range(len(radius)):
                last = min(k + 3, len(radius))
                chosen = columns[k:last]
                width = len(chosen)
                root = np.diag(0.5 ** np.arange(width)) @ smooth_root(width, 0.0)
                out.append(
                    variant(word, f"{label} at {THRESHOLDS[k]:g}", chosen, SCALES, root,
                            prior=share, radius=radius[k:last], **kind)
                )  # fmt: skip
    return out


def _flow(bench: Bench, states: Array, flow: float, rest: Array, reset: bool) -> Array:
    """The states reached with a first-order lag (viscoplastic flow of Perzyna's kind)."""
    if flow == 0:
        return states
    never = np.zeros(len(rest), dtype=bool)
    times = np.full(states.shape[1], flow)
    return retarded(states, times, bench.rows, rest if reset else never)
