"""A closer look at knees that were found: between the thresholds and flow times of the grid, and at
other places of the word."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from identification.gap.laws import flows, isotropic_hardening
from identification.gap.laws.closer import (
    RefinementTarget,
    closing_in,
    estimate,
    evidence,
    places,
    scored,
    shows,
)
from identification.gap.laws.flows import Flow
from identification.gap.laws.isotropic_hardening import HARDENED
from identification.gap.laws.knees import FLOWS_BACK, is_sharp, with_back
from identification.gap.laws.lasting import SCALES
from identification.gap.laws.memories import fresh_of
from identification.gap.laws.specimens import OWN, plateaus, with_other_springs
from identification.gap.model.bench import Bench
from identification.gap.model.variants import (
    BACK_UNDER_WEIGHT,
    CALLED,
    RESET_PER_RUN,
    Variant,
    place_of,
)

FINE = 13  # radii about a threshold that was found on the grid, from 0.84 to 1.2 of it
FLOWS_S = (1.2, 2.5, 5.0, 10.0, 25.0)  # in proportion to the overstress,
SQUARE_S = (2.5, 6.0, 15.0)  # or with its square
ROUNDED = "fine rounded"
CLOSE = (0.4,)  # of a closer look
_BETWEEN = (-0.5, -0.25, 0.25, 0.5)  # powers of two of a flow time

Place = tuple[str, Mapping[str, Any]]  # with which a knee's label begins; its `knee_at`
Between = Callable[[Bench, Variant], Sequence[Place]]


def finer(word: RefinementTarget, between: Between | None = None) -> list[Variant]:
    """Closer to the best knees that were found, and these at the word's other places. between:
    places about a knee that was found, where the grid of them is coarse."""
    if not shows(word):
        return []
    best = places(word.alone, word.beside, is_sharp)
    closer = closing_in(word, refined, best, CLOSE)
    flat = [v for s in best for v in plateaus(word.engine.bench, s.variant)]
    firm = places(word.alone, word.beside, lambda v: bool(v.info["knee"] == HARDENED))
    lasts = closing_in(word, partial(_hardened, word), firm, CLOSE, to_the_last=True)
    return closer + flat + lasts + _elsewhere(word, closer, between)


def _hardened(
    word: RefinementTarget, bench: Bench, found: Variant, close: float = 1.0
) -> list[Variant]:
    return isotropic_hardening.refined(
        bench, found, estimate(word.engine, found).coefficients, close
    )


def refined(bench: Bench, found: Variant, close: float = 1.0) -> list[Variant]:
    """Finely spaced thresholds and flow times about a variant that was found. close: share of the
    steps; below 1 only of what flows, between the times that were looked at."""
    info, ways = dict(found.info), _ways(bench, str(found.info["memory"]))
    if close < 1:
        flow, square = float(info["flow_s"]), bool(info.get("square"))
        ways = [(flow * 2.0**step, square) for step in _BETWEEN if flow > 0]
    weight = info.get("weight")
    alone = 0.0 if weight is None else float(np.abs(weight).max())
    radius = alone + (float(info["centre"]) - alone) * (1 + close * np.linspace(-0.16, 0.2, FINE))
    fresh = fresh_of(bench, info["memory"])
    out = []
    at = Flow(info["load"], radius, 0.0, fresh, weight)
    for (flow, square), states in flows.each_way(bench, ways, at):
        columns = [info["column"](s) for s in states.T]
        share = 0.25 / FINE / (1 if flow == 0 else len(FLOWS_S) + len(SQUARE_S))
        for k in range(FINE):
            exact = {**info, "centre": radius[k], "flow_s": flow, "square": square}
            for form, place in (("fine", slice(k, k + 1)), (ROUNDED, slice(max(k - 2, 0), k + 3))):
                exact |= {"radius": radius[place], "form": form}
                root, label = np.eye(len(radius[place])), _label(exact)
                out += with_back(found.word, label, columns[place], root, share, exact)
    if info.get("other_springs"):
        return with_other_springs(bench, int(info["joint"]), out, SCALES, OWN)
    return out


def _label(info: Mapping[str, Any]) -> str:
    """Of a finely spaced knee: where, how it flows, threshold and form."""
    squared = " squared" if info["square"] else ""
    flow = f" flow {info['flow_s']:.3g} s{squared}" if info["flow_s"] else ""
    return f"{info[CALLED]}{flow} at {info['centre']:.4g} {info['form']}"


def _elsewhere(
    word: RefinementTarget, closer: list[Variant], between: Between | None
) -> list[Variant]:
    """The best of the finer knees at the other places of the word: without joint readings one may
    be as good as another, and that none was looked for there as closely is no evidence."""
    bench = word.engine.bench
    others: dict[tuple[str, tuple[object, ...]], Variant] = {}
    for v in (s.variant for s in word.alone):
        if is_sharp(v) and "weight" not in v.info:
            others.setdefault((v.info["memory"], _axle(v)), v)
    able = [v for v in closer if "weight" not in v.info]
    if not able or len({place for _, place in others}) < 2:
        return []
    found = sorted(scored(word, able), key=evidence)
    moved = []
    for v in (s.variant for s in found[-_ELSEWHERE:]):
        there = [
            (str(other.info[CALLED]), other.info)
            for (memory, place), other in others.items()
            if memory == v.info["memory"] and place != _axle(v)
        ]
        there += between(bench, v) if between is not None else []
        moved += [(v, place) for place in there]
    return elsewhere(bench, moved)


def _axle(variant: Variant) -> tuple[object, ...]:
    """Joint, or axis and its depth."""
    return (*place_of(variant), variant.info.get("depth_m"))


_ELSEWHERE = 3  # shapes that are looked at elsewhere


def elsewhere(bench: Bench, found: Sequence[tuple[Variant, Place]]) -> list[Variant]:
    """Knees that were found, at other places (joint, or axis) of the same memory, where they begin
    at the same load of the rig: thresholds in proportion to what loads the two places. Without
    those that nothing loads there then, or where nothing flows back."""
    moved = [(v, place, _factor(v.info, place[1])) for v, place in found]
    moved = [(v, place, factor) for v, place, factor in moved if factor > 0]
    flows.make(bench, [_followed(bench, *one) for one in moved])
    out = [_moved(bench, *one) for one in moved]
    return [v for v in out if v is not None]


def _factor(here: Mapping[str, Any], there: Mapping[str, Any]) -> float:
    """What loads one place over what loads another, where the load is largest here."""
    most = int(np.abs(here["load"]).argmax())
    return float(np.abs(there["load"][most]) / np.abs(here["load"][most]))


def _followed(bench: Bench, found: Variant, place: Place, factor: float) -> Flow:
    """Its states at another place."""
    info = found.info
    radius, fresh = factor * np.asarray(info["radius"]), fresh_of(bench, info["memory"])
    square = bool(info.get("square"))
    return Flow(place[1]["load"], radius, float(info["flow_s"]), fresh, square=square)


def _moved(bench: Bench, found: Variant, place: Place, factor: float) -> Variant | None:
    info, (name, other) = found.info, place
    flow = _followed(bench, found, place, factor)
    columns = [other["column"](s) for s in flows.states(bench, flow).T]
    if len(found.columns) > len(flow.radius):
        columns += other["back"].get(info["back_from"], [])
    if len(columns) != len(found.columns):
        return None
    exact = {
        **other,
        CALLED: name,
        "form": info["form"],
        "back_from": info["back_from"],
        "flows_back": info["flows_back"],
        "radius": flow.radius,
        "flow_s": flow.time,
        "centre": factor * float(info["centre"]),
        "square": flow.square,
        "knee": info["knee"],
    }
    label = _label(exact) + (FLOWS_BACK if info["flows_back"] else "")
    return replace(found, label=label, columns=tuple(columns), info=exact)


def _ways(bench: Bench, memory: str) -> list[flows.Way]:
    """What flows at once, and in all times that are looked for. A controller gives way at once."""
    clamped = memory in (RESET_PER_RUN, BACK_UNDER_WEIGHT)
    if clamped or bench.rows.continuous or bench.load_history.timeless:
        return [(0.0, False)]
    # what slows down so under a load that stands, a single spring can't tell from creep
    squared = SQUARE_S if bench.data.arm else ()
    return [(0.0, False), *((t, False) for t in FLOWS_S), *((t, True) for t in squared)]
