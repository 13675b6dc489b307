"""Intervals of an effect's parameters: over all shapes of its family that the data leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.gap.compare import Scored, score
from identification.gap.data import Array
from identification.gap.evidence import Engine
from identification.gap.fit import fit
from identification.gap.parameters import Parameter, parameters
from identification.gap.parts import Part
from identification.gap.search import Explanation, conditioned
from identification.gap.variants import Variant

_MOST, _LEAST_SHARE = 6, 0.02  # shapes that count, and their least share of the posterior
_TWO_SIDED = 1.959964  # standard deviations of a normal 95 % interval


def parameters_of(
    engine: Engine, variants: list[Variant], chosen: Explanation, index: int
) -> dict[str, Parameter]:
    """Parameters of effect `index` of the explanation: value and 95 % interval of the mixture of
    its likeliest shapes, the other effects as they are."""
    part = chosen.parts[index]
    rest = tuple(p for i, p in enumerate(chosen.parts) if i != index)
    levels, energy = conditioned(engine, rest)
    family = [v for v in variants if v.word == part.word]
    likely, share = _likeliest(score(engine, levels, family, energy), part)
    found = []
    for scored in likely:
        parts = list(chosen.parts)
        parts[index] = Part(scored.variant, scored.scale)
        fitted = fit(engine, replace(chosen, parts=tuple(parts)))
        found.append(parameters(engine.bench, parts[index], *fitted.of(index)))
    return {
        name: _mixture([f[name] for f in found if name in f],
                       share[[name in f for f in found]])
        for name in found[0]
    }  # fmt: skip


def _likeliest(scored: list[Scored], part: Part) -> tuple[list[Scored], Array]:
    """The chosen shape first, then others of its element that meet the data as closely, with their
    shares of the posterior."""
    mine = next(s for s in scored if s.variant is part.variant)
    place = _place(part.variant)
    near = [s for s in scored if s is not mine and s.level <= mine.level]
    others = [s for s in near if _place(s.variant) == place]
    ranked = [mine, *sorted(others, key=lambda s: -s.log_evidence)[: _MOST - 1]]
    weight = np.array([s.log_evidence for s in ranked])
    share = np.exp(weight - weight.max())
    share /= share.sum()
    if share[0] < _LEAST_SHARE:  # chosen for its place beside the other effects
        return [mine], np.ones(1)
    kept = np.flatnonzero((share >= _LEAST_SHARE) | (np.arange(len(ranked)) == 0))
    return [ranked[i] for i in kept], share[kept] / share[kept].sum()


def _place(variant: Variant) -> tuple[object, ...]:
    """Where a variant acts: parameters of other joints or axes are other parameters."""
    info = variant.info
    return tuple(str(info.get(key)) for key in ("joint", "joints", "axis", "axes", "depth_m"))


def _mixture(each: list[Parameter], share: Array) -> Parameter:
    """Value and interval of a mixture of normals; one alone keeps its own, skewed as it may be."""
    if len(each) == 1:
        return each[0]
    share = share / share.sum()
    ends = np.array([[p.value, p.low, p.high] for p in each])
    # what spans factors (a time constant, a force scale) is mixed by its logarithm
    factors = np.all(ends > 0) and np.any(ends[:, 2] > 1.5 * ends[:, 1])
    skewed = bool(
        factors and np.allclose(ends[:, 2] * ends[:, 1], ends[:, 0] ** 2, rtol=0.1, atol=0)
    )
    mean, low, high = (np.log(ends) if skewed else ends).T
    sd = np.maximum(high - low, 0.0) / (2 * _TWO_SIDED) + 1e-300
    out = [float(share @ mean), *(_quantile(mean, sd, share, q) for q in (0.025, 0.975))]
    value, least, most = (float(np.exp(v)) for v in out) if skewed else out
    return Parameter(value, least, most, each[0].unit)


def _quantile(mean: Array, sd: Array, share: Array, q: float) -> float:
    from scipy.optimize import brentq
    from scipy.special import ndtr

    low, high = float((mean - 8 * sd).min()), float((mean + 8 * sd).max())
    if not low < high:
        return low
    return float(brentq(lambda x: float(share @ ndtr((x - mean) / sd)) - q, low, high))
