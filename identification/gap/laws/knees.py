"""Knees: shapes of what gives way above a threshold of any load: a joint's torque, or a mounting's
moment about an axis. `knees_closer` looks closer at those that are found."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws.bauschinger import flowing_back, yielded_from
from identification.gap.laws.cyclic_accumulation import walking
from identification.gap.laws.isotropic_hardening import hardened
from identification.gap.laws.lasting import GIVES_LEAST, HARDENS, LEAST, SCALES
from identification.gap.laws.memories import LIKELY, fresh_of, memories
from identification.gap.laws.specimens import softening
from identification.gap.model.bench import Bench
from identification.gap.model.variants import (
    CALLED,
    RESET_PER_RUN,
    Variant,
    block,
    smooth_root,
    variant,
)

THRESHOLDS = (0.18, 0.24, 0.3, 0.4, 0.5, 0.6, 0.68, 0.75, 0.81, 0.86, 0.9, 0.94, 0.97)
_FIRST = 2  # lower ones only round off the knees above them
# Prior weights of a rounded knee: radii by the steps they lie from its centre. The lower ones are
# Bauschinger's effect: after a reversal metal yields earlier than at first.
_SHARP = {0: 1.0, 1: 0.5}
_ROUND = {-6: 0.1, -4: 0.15, -2: 0.25, -1: 0.5, 0: 1.0, 1: 0.5, 2: 0.25}
_SLOW = 0.25  # prior of what gives way more and more, of no one knee


def knee_variants(
    bench: Bench,
    load: Array,
    column: Callable[[Array], int],
    word: str,
    name: str,
    info: dict[str, Any],
    top: float | None = None,
) -> list[Variant]:
    """Variants of a threshold on `load` (n,); `column` turns a state (n,) into a pool index. top:
    what the thresholds are shares of; left out: the largest load."""
    top = _range(bench, load) if top is None else top
    if not top > 0:
        return []
    radius = bench.radii(load, top * np.array(THRESHOLDS))
    out = hardened(bench, load, radius, column, word, name, info)
    out += walking(bench, load, top, column, word, name, info)
    for memory, fresh in memories(bench).items():
        columns = [column(s) for s in bench.plays(load, radius, fresh).T]
        exact = {**info, **knee_at(bench, load, column, memory, top), "flow_s": 0.0}
        out += knees(bench, word, f"{name}{memory}", columns, radius, exact)
    return out


def knee_at(
    bench: Bench, load: Array, column: Callable[[Array], int], memory: str, top: float | None = None
) -> dict[str, Any]:
    """What knees on a load (n,) have in common at a place: memory, load, column, `top` of what
    flows back, and `back`, its columns by the share of `top` beyond which it has yielded."""
    top = _range(bench, load) if top is None else top
    # what a controller takes back it had clamped: no metal that flows back
    metal = memory != RESET_PER_RUN
    back = flowing_back(bench, load, column, top, fresh_of(bench, memory)) if metal else {}
    return {"memory": memory, "load": load, "column": column, "top": top, "back": back}


def _range(bench: Bench, load: Array) -> float:
    """Largest size of a load (n,), as far as data reach; where it was told to have gone on beyond
    a row, so far."""
    top = float(np.abs(load * (1 + np.append(bench.rows.onward[1:], 0.0))).max())
    return top * bench.reach_of(load) / float(np.ptp(np.append(load, 0.0))) if top > 0 else 0.0


def knees(
    bench: Bench, word: str, name: str, columns: list[int], radius: Array, info: dict[str, Any]
) -> list[Variant]:
    """Sharp and rounded knees at the radii of THRESHOLDS; further radii belong to all of them.
    What begins to give way bit by bit and flows back is friction, of an arm: `joint_hysteresis`;
    what holds small loads firmly, and then more and more gives way, is not (Ramberg and Osgood
    1943). What is pulled once, without an arm, may soften. name: joint or axis, and memory, with
    which labels begin."""
    info = {**info, CALLED: name}
    arm, share = bench.data.arm, 0.7 / len(radius) * LIKELY[info["memory"]]
    softens = not arm and not bench.load_history.unloads
    extra, out = list(range(len(THRESHOLDS), len(radius))), []
    for k in range(_FIRST, len(THRESHOLDS)):
        for knee, steps in (("sharp", _SHARP), ("round", _ROUND)):
            inside = {k + d: w for d, w in steps.items() if 0 <= k + d < len(THRESHOLDS)}
            place = [*inside, *extra]
            kept = [*inside.values(), *[HARDENS] * len(extra)]
            exact = {
                **info,
                "radius": radius[place],
                "centre": radius[k],
                "back": {} if knee == "round" and arm else info["back"],
                "knee": knee,
                "softens": softens,
            }
            at, chosen = f"{name} at {THRESHOLDS[k]:g} {knee}", [columns[i] for i in place]
            out += with_back(word, at, chosen, np.diag(kept), share / 4, exact)
    if arm and bench.load_history.unloads:
        exact = {
            **info,
            "radius": radius,
            "centre": radius[0],
            "back": {},
            "knee": "slow",
            "softens": False,
        }
        at, likely = f"{name} at {THRESHOLDS[0]:g} and on", _SLOW * LIKELY[info["memory"]]
        root = smooth_root(len(radius), 0.6, 0.3)
        out += with_back(word, at, columns, root, likely, exact)
    return out


def with_back(
    word: str, label: str, columns: list[int], root: Array, prior: float, info: dict[str, Any]
) -> list[Variant]:
    """A knee as it is, and with Bauschinger's effect: once it has yielded, metal flows back early
    when unloaded."""
    out, share = [], yielded_from(info)
    back = info["back"].get(share, [])
    info = {key: info[key] for key in info if key != "flows_back"} | {"back_from": share}
    for more, name in ([], ""), *([(back, FLOWS_BACK)] if back else []):
        k, n = len(columns), len(columns) + len(more)
        each, within = softening(np.asarray(info["radius"]), n) if info["softens"] else (True, None)
        out.append(
            variant(
                word,
                label + name,
                [*columns, *more],
                SCALES,
                root=block([root, _RETURNS * np.eye(len(more))]),
                positive=np.repeat([1.0, 0.0], [k, n - k]),
                prior=prior,
                least=info.get(GIVES_LEAST, LEAST),
                each=each,
                within=within,
                flows_back=bool(more),
                **info,
            )
        )
    return out


FLOWS_BACK = ", flows back"
_RETURNS = 0.4  # coefficients of what flows back, against those of the knee


def is_sharp(v: Variant) -> bool:
    """Whether the threshold is one of the grid, without rounding: about such it is refined."""
    return bool(v.info["knee"] == "sharp")
