"""Knees in absolute units: plays beyond thresholds, in newton metres and compliances."""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.laws import bauschinger
from identification.gap.laws.cyclic_accumulation import WALKS, walked
from identification.gap.laws.flows import Flow, states
from identification.gap.laws.isotropic_hardening import HARDENED, grown
from identification.gap.laws.law import (
    ACROSS,
    ANEW,
    HUNG,
    HUNG_LOST,
    KEPT,
    LOST,
    Law,
    Term,
    fresh_after,
)
from identification.gap.model.bench import Bench
from identification.gap.model.variants import (
    BACK_UNDER_WEIGHT,
    LASTING,
    RESET_PER_RUN,
    RESET_PER_SETUP,
    UNDER_WEIGHT,
    Variant,
)

_MEMORY = {
    "": KEPT,
    LASTING: ACROSS,
    RESET_PER_RUN: LOST,
    UNDER_WEIGHT: HUNG,
    BACK_UNDER_WEIGHT: HUNG_LOST,
    RESET_PER_SETUP: ANEW,
}
_SQUARE = 2.0  # of the overstress; without a word it flows in proportion


def law_of_knee(v: Variant, place: dict[str, Any], unit: float) -> tuple[Law, Array]:
    """Terms: plays (threshold), what flows back once the threshold `after` was passed, and a spring
    of its own. place: constants that say where it is; unit: of all coefficients."""
    info = v.info
    constants = {"memory": _MEMORY[info["memory"]], "flow_time": float(info["flow_s"])}
    if info.get("square"):
        constants["flow_exponent"] = _SQUARE
    radius = [float(r) for r in info["radius"]]
    if info["knee"] == WALKS:
        pairs = zip(radius, map(float, info["fading"]), strict=True)
        terms = [Term("compliance", {"walks_beyond": r, "fading": p}) for r, p in pairs]
    else:
        begins = "grows_beyond" if info["knee"] == HARDENED else "threshold"
        terms = [Term("compliance", {begins: r}) for r in radius]
    own = bool(info.get("other_springs"))
    if len(v.columns) > len(radius) + own:
        top = float(info["top"])
        after = {"after": info["back_from"] * top}
        terms += [Term("compliance", {"returns_beyond": f * top} | after) for f in bauschinger.BACK]
        ratchet = {"ratchets_beyond": bauschinger.RATCHET_FROM * top}
        terms.append(Term("compliance", ratchet | after))
    terms += [Term("compliance")] * own
    return Law(constants | place, tuple(terms)), np.full(len(terms), unit)


def states_of(bench: Bench, law: Law, load: Array) -> dict[int, Array]:
    """Number of the term -> its state (n,); those of a kind are made in one go. None of a spring of
    its own."""
    flow = flow_of(bench, law, load)
    out = dict(zip(_with(law, "threshold")[0], states(bench, flow).T, strict=True))
    growing, beyond = _with(law, "grows_beyond")
    out |= zip(growing, grown(load, beyond, flow.fresh).T, strict=True)
    walking, beyond = _with(law, "walks_beyond")
    fading = _with(law, "fading")[1]
    out |= zip(walking, walked(load, beyond, fading, flow.fresh).T, strict=True)
    return out | _back(bench, law, load, flow.fresh)


def flow_of(bench: Bench, law: Law, load: Array) -> Flow:
    """The plays of a law on a load (n,)."""
    constants, weight = law.constants, None
    if constants["memory"] in (HUNG, HUNG_LOST) and "joint" in constants:  # a twin is elsewhere
        weight = bench.weight(constants["joint"])
    return Flow(
        load,
        _with(law, "threshold")[1],
        constants["flow_time"],
        fresh_after(bench, constants["memory"]),
        weight,
        constants.get("flow_exponent") == _SQUARE,
    )


def _with(law: Law, shape: str) -> tuple[list[int], Array]:
    """Numbers of the terms with that key, and its values (k,)."""
    mine = [i for i, t in enumerate(law.terms) if shape in t.shape]
    return mine, np.array([law.terms[i].shape[shape] for i in mine])


def _back(bench: Bench, law: Law, load: Array, fresh: Flags) -> dict[int, Array]:
    """Number of the term -> state (n,) of what flows back, or ratchets, once `after` was passed."""
    number, after = _with(law, "after")
    if not number:
        return {}
    returning, returns = _with(law, "returns_beyond")
    out = dict(zip(returning, bench.plays(load, returns, fresh).T, strict=True))
    for i, beyond in zip(*_with(law, "ratchets_beyond"), strict=True):
        out[i] = bauschinger.RATCHETS * bauschinger.ratchet(load, beyond, fresh)
    peaks = {a: bauschinger.peaks(load, a, fresh) for a in set(after.tolist())}
    for i, a in zip(number, after.tolist(), strict=True):
        start = out[i][peaks[a]] if i in returning else 0.0
        out[i] = np.where(peaks[a] >= 0, out[i] - start, 0.0)
    return out
