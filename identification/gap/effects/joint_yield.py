"""A joint gives way above a threshold torque: clamp of the controller, clutch, plastic flow.

Beyond the elastic deflection it moves by `w P_r(tau)`, P play of radius r = threshold (kinematic
hardening, Prandtl 1928): stiff below, knee, the rest stays after unloading. Rounded knees are
several radii from the threshold on; slow flow is the same state reached with a lag; a controller
that takes the joint back resets it between runs. w in units of the joint's elastic compliance:
1/w is the ratio of hardening to spring, so 0.3 (little) to 30 (clamp that hardly holds).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array, Flags
from identification.gap.history import retarded
from identification.gap.variants import Variant, variant

WORD = "joint_yield"
THRESHOLDS = (0.18, 0.24, 0.3, 0.4, 0.5, 0.6, 0.68, 0.75, 0.81, 0.86, 0.9, 0.94, 0.97)
# A joint that is taken back leaves nothing behind: then a curved spring is the simpler reading.
_LIKELY = {"": 1.0, " lasting": 0.5, " taken back": 0.3}
_HARDENS = 0.3  # plastic paths far beyond the knee harden or soften on
_FIRST = 2  # lower ones only round off the knees above them
# Prior weights of a rounded knee: radii by the steps they lie from its centre. The lower ones are
# Bauschinger's effect: after a reversal metal yields earlier than at first.
_SHARP = {0: 1.0, 1: 0.5}
_ROUND = {-6: 0.1, -4: 0.15, -2: 0.25, -1: 0.5, 0: 1.0, 1: 0.5, 2: 0.25}
SCALES = (0.5, 1.5, 6.0, 25.0)
FLOW_S = (5.0,)


def variants(bench: Bench) -> list[Variant]:
    """Per joint, threshold, knee (sharp, rounded), memory between runs, and flow time."""
    out = []
    for j in bench.moving_joints():
        c = bench.compliance[j]

        def column(state: Array, j: int = j, c: float = float(c)) -> int:
            return bench.add_joint(j, bench.sense * c * state)

        out += knee_variants(
            bench, bench.torque[:, j], column, WORD, f"joint {j + 1}", {"joint": j}
        )
    return out


def knee_variants(
    bench: Bench,
    load: Array,
    column: Callable[[Array], int],
    word: str,
    name: str,
    info: dict[str, Any],
) -> list[Variant]:
    """Variants of a threshold on `load` (n,); `column` turns a state (n,) into a pool index."""
    top = float(np.abs(load).max())
    if not top > 0:
        return []
    top *= bench.reach_of(load) / float(np.ptp(np.append(load, 0.0)))
    if not top > 0:
        return []
    radius = bench.radii(load, top * np.array(THRESHOLDS))
    out = []
    for memory, fresh in _memories(bench).items():
        states = bench.plays(load, radius, fresh)
        for flow in (0.0, *(FLOW_S if not bench.rows.continuous else ())):
            moved = _flow(bench, states, flow, fresh)
            columns = [column(moved[:, k]) for k in range(len(radius))]
            label = f"{name}{memory}{f' flow {flow:g} s' if flow else ''}"
            share = (0.7 if flow == 0 else 0.3 / len(FLOW_S)) / len(radius) * _LIKELY[memory]
            extra = list(range(len(THRESHOLDS), len(radius)))
            for k in range(_FIRST, len(THRESHOLDS)):
                for knee, steps in (("sharp", _SHARP), ("round", _ROUND)):
                    inside = {k + d: w for d, w in steps.items() if 0 <= k + d < len(THRESHOLDS)}
                    place = [*inside, *extra]
                    kept = [*inside.values(), *[_HARDENS] * len(extra)]
                    chosen = [columns[i] for i in place]
                    out.append(
                        variant(word, f"{label} at {THRESHOLDS[k]:g} {knee}", chosen, SCALES,
                                np.diag(kept), prior=share / 2, memory=memory, flow_s=flow,
                                radius=radius[place], centre=radius[k], load=load,
                                column=column, **info)
                    )  # fmt: skip
    return out


FINE = 15  # radii between the neighbours of a threshold that was found on the grid


def refined(bench: Bench, found: Variant) -> list[Variant]:
    """Sharp knees at finely spaced thresholds about a variant that was found."""
    info = dict(found.info)
    radius = float(info["centre"]) * np.linspace(0.88, 1.12, FINE)
    fresh = _memories(bench)[info["memory"]]
    states = _flow(bench, bench.plays(info["load"], radius, fresh), info["flow_s"], fresh)
    columns = [info["column"](states[:, k]) for k in range(FINE)]
    out = []
    for k in range(FINE):
        exact = {**info, "radius": radius[k : k + 1], "centre": radius[k]}
        label = f"{found.label.split(' at ')[0]} at {radius[k]:.4g} fine"
        out.append(variant(found.word, label, [columns[k]], SCALES, prior=0.5 / FINE, **exact))
    return out


def _memories(bench: Bench) -> dict[str, Flags]:
    """When the joint gets back to where it was: never, when the arm moves, before every run."""
    moved, first = bench.moved, np.zeros(bench.rows.n, dtype=bool)
    out = {"": moved}
    if np.sum(moved) > 1:
        out[" lasting"] = first
    if np.sum(bench.rest) > np.sum(moved):
        out[" taken back"] = moved | bench.rest
    return out


def _flow(bench: Bench, states: Array, flow: float, fresh: Flags) -> Array:
    """The states reached with a first-order lag (viscoplastic flow of Perzyna's kind)."""
    if flow == 0:
        return states
    return retarded(states, np.full(states.shape[1], flow), bench.rows, fresh)
