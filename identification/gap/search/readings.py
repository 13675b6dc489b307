"""Instruments read all that moves: beside another effect, a gain or a lag of the displacement acts
on what that effect does as well as on the springs. A fifth too much of a slip of 30 µm is 6 µm."""

from __future__ import annotations

from dataclasses import replace

from identification.gap.effects import EFFECTS, displacement_scale, time_lag
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.laws.effect import declared
from identification.gap.laws.interval import Parameter
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant

_CLOSE = 0.5  # of the steps between lags


def reading_all(engine: Engine, explanation: Explanation) -> list[Variant]:
    """Variants of an arm's instruments in an explanation that read its other effects as well; the
    pool of the bench holds their columns afterwards. None where nothing else moves, or where the
    displacement is imposed; no gain without joint readings, which see the other effects as they
    are: without, what an effect does by so much more is its own coefficient."""
    bench, n = engine.bench, engine.bench.rows.n
    mine = [i for i, p in enumerate(explanation.parts) if _reads(bench, p.variant)]
    if not bench.data.arm or bench.imposed or not mine or len(explanation.parts) == len(mine):
        return []
    fitted = fit(engine, explanation)
    shown = fitted.whole(engine)
    out = []
    for i in mine:
        found = explanation.parts[i].variant
        moves = shown
        if found.word == time_lag.WORD:  # acts on what there was, a gain is a share of what it read
            moves = shown - fitted.contribution(engine, i)[:n]
        out += [
            v.known_by(", of all that moves", of_all=True)
            for v in _about(replace(bench, moves=moves), found)
        ]
    return out


def _reads(bench: Bench, variant: Variant) -> bool:
    if variant.word == time_lag.WORD:
        return variant.late_channel == "displacement"
    return bench.has_q and variant.word == displacement_scale.WORD


def _about(bench: Bench, found: Variant) -> list[Variant]:
    if found.word == time_lag.WORD:
        return time_lag.refined(bench, found, _CLOSE)
    return displacement_scale.variants(bench)


def as_moved(
    bench: Bench, parts: tuple[Part, ...], read: list[dict[str, Parameter]]
) -> list[dict[str, Parameter]]:
    """Parameters of the parts of an explanation, where a gain of the laser is one of them: what
    only the laser saw of the others was read by that factor too large."""
    gain = next(
        (
            r["factor"]
            for p, r in zip(parts, read, strict=True)
            if p.word == displacement_scale.WORD
        ),
        None,
    )
    if gain is None or not bench.data.arm or bench.has_q:
        return read
    return [
        {n: p.over(gain) if declared(n, EFFECTS[part.word].lengths) else p for n, p in r.items()}
        for part, r in zip(parts, read, strict=True)
    ]
