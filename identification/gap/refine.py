"""Finer shapes of the words that stand out among single effects, where a grid meets them badly."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from identification.gap.compare import Scored, by_word, closest, marginal, score
from identification.gap.data import Array
from identification.gap.effects import (
    contact_seating,
    joint_backlash,
    joint_nonlinear_stiffness,
    joint_yield,
    pose_error,
    time_lag,
)
from identification.gap.evidence import Engine
from identification.gap.explanation import Explanation, conditioned
from identification.gap.fit import fit
from identification.gap.parts import Part
from identification.gap.variants import Variant

_REFINED = 2  # joints, or axes, at which it is refined
_LEADING = 6  # words that are refined
_WINDOW = 12.0  # nats above `none` that a word must have to be refined


def refine(engine: Engine, singles: list[Scored]) -> list[Variant]:
    """Finer shapes of the words that stand out among single effects and that a grid meets badly:
    thresholds and zones make the evidence piecewise smooth, offsets act by their squares."""
    families = by_word(singles)
    least = engine.levels[0].log_base + _WINDOW
    ranked = sorted(families, key=lambda w: -marginal(families[w]))[:_LEADING]
    beside = _beside_first(engine, families, ranked)
    closing_in = partial(_closing_in, engine, families, ranked)
    out: list[Variant] = []
    for word in ranked:
        if marginal(families[word]) < least:
            continue
        found = sorted(families[word], key=lambda s: -s.log_evidence)
        second = sorted(beside.get(word, []), key=lambda s: -s.log_evidence)
        if word in ("joint_yield", "base_slip"):
            for s in _places(found, second, "sharp"):
                out += joint_yield.refined(engine.bench, s.variant)
        elif word == "joint_backlash":
            out += closing_in(joint_backlash.refined, _places(found, second))
        elif word == "contact_seating":
            kinds = {contact_seating.slack_of(s.variant): s for s in reversed(found)}
            slacks = [s for kind, s in kinds.items() if kind]
            out += closing_in(contact_seating.refined, slacks)
        elif word == "time_lag":
            channels = {s.variant.info["channel"]: s for s in reversed(second or found)}
            out += closing_in(time_lag.refined, list(channels.values()))
        elif word == "joint_nonlinear_stiffness":
            odd = [s for s in found if "line" in s.variant.info]
            for s in odd[:1]:
                out += joint_nonlinear_stiffness.refined(engine.bench, s.variant)
        elif word == "pose_error":
            kinds = {str(s.variant.info["kind"]): s for s in reversed(found)}
            for s in kinds.values():
                out += pose_error.refined(engine.bench, s.variant, partial(_estimate, engine))
    return out


def _beside_first(
    engine: Engine, families: dict[str, list[Scored]], ranked: list[str]
) -> dict[str, list[Scored]]:
    """Scores of the words that grids meet badly beside the leading word: what that does must not
    decide where a smaller effect is looked for."""
    family = [s.variant for w in ranked[1:] if w in _GRIDS for s in families[w]]
    return by_word(_scored_beside(engine, families, ranked, family)) if family else {}


def _closing_in(
    engine: Engine,
    families: dict[str, list[Scored]],
    ranked: list[str],
    refined: Callable[..., list[Variant]],
    starts: list[Scored],
) -> list[Variant]:
    """Finer shapes about those that were found, and finer ones still about the best of these."""
    finer = [v for s in starts for v in refined(engine.bench, s.variant)]
    engine.extend()
    if not finer:
        return []
    best = max(_scored_beside(engine, families, ranked, finer), key=_evidence)
    return finer + refined(engine.bench, best.variant, _CLOSE)


def _scored_beside(
    engine: Engine, families: dict[str, list[Scored]], ranked: list[str], family: list[Variant]
) -> list[Scored]:
    first = closest(families[ranked[0]])
    if not family or family[0].word == ranked[0]:
        return score(engine, engine.levels, family)
    levels, energy = conditioned(engine, (Part(first.variant, first.scale),))
    return score(engine, levels, family, energy)


def _evidence(scored: Scored) -> float:
    return scored.log_evidence


_GRIDS = ("joint_yield", "base_slip", "joint_backlash", "time_lag")
_CLOSE = 0.2  # of the first look's steps


def _estimate(engine: Engine, variant: Variant) -> tuple[Array, Array]:
    """Most probable coefficients of a variant whose columns the engine may not know yet, and
    relative changes of the springs' compliance with it."""
    engine.extend()
    eta = engine.levels[score(engine, engine.levels, [variant])[0].level].eta
    alone = Explanation((Part(variant, 1.0),), 0.0, eta, (0.0,), 0.0)
    fitted = fit(engine, alone)
    softer = np.zeros(engine.bench.data.joints)
    for i in engine.base.index("spring"):
        softer[int(engine.base.names[i].removeprefix("spring")) - 1] = fitted.base[i]
    return fitted.coefficients, softer


def _places(alone: list[Scored], beside: list[Scored], knee: str | None = None) -> list[Scored]:
    """The best of the _REFINED best joints, or axes, beside the leading word, and the best alone:
    of two words that explain the same neither has a place beside the other. knee: of that kind."""

    def able(scored: list[Scored]) -> list[Scored]:
        return [s for s in scored if knee is None or s.variant.info["knee"] == knee]

    places: dict[object, Scored] = {}
    for s in able(beside or alone):
        places.setdefault((s.variant.info.get("joint"), s.variant.info.get("axis")), s)
    found = [*able(alone)[:1], *list(places.values())[:_REFINED]]
    return [s for i, s in enumerate(found) if s.variant not in [f.variant for f in found[:i]]]
