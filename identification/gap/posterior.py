"""Intervals of an effect's parameters: over all shapes of its family that the data leave open."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from identification.gap.compare import score
from identification.gap.data import Array
from identification.gap.evidence import Engine
from identification.gap.fit import Fit, fit
from identification.gap.imperfection import IMPERFECTION, LINEAR, level_prior
from identification.gap.interval import TWO_SIDED, Parameter, Softer
from identification.gap.parameters import parameters
from identification.gap.parts import Part, log_joint, part_sizes, signs_kept
from identification.gap.penalties import SAME_JOINT
from identification.gap.search import Explanation, conditioned
from identification.gap.variants import Variant

_MOST, _LEAST_SHARE = 10, 0.01  # shapes that count, and their least share of the posterior


def parameters_of(
    engine: Engine, variants: list[Variant], chosen: Explanation, index: int
) -> dict[str, Parameter]:
    """Parameters of effect `index` of the explanation: 95 % interval of the mixture of its
    likeliest shapes, wherever they sit, under every size of imperfection, the other effects as they
    are; value: of those that sit where the explanation says. What names its joint or axis is mixed
    over the shapes that have it."""
    found, weights, here = [], [], []
    place = _place(chosen.parts[index].variant)
    every = _open(engine, variants, chosen, index)
    least = max(weight for _, weight in every) + np.log(_LEAST_SHARE)
    open_ = [e for i, e in enumerate(every) if e[1] > least or i == 0]
    for explanation, weight in open_:
        found.append(_read(engine, explanation, index))
        weights.append(weight)
        here.append(_place(explanation.parts[index].variant) == place)
    beside = _beside(every, open_, index)
    step = _read(engine, beside, index) if beside is not None else {}
    share = np.exp(np.array(weights) - max(weights))
    out = {}
    for name in found[0]:
        has = np.array([name in f for f in found])
        mine = has & np.array(here)
        mixed = _mixture([f[name] for f in found if name in f], share[has])
        value = _mixture(
            [f[name] for f, m in zip(found, mine, strict=True) if m], share[mine]
        ).value
        grid = abs(step[name].value - value) / 12**0.5 if name in step else 0.0
        meant = 0.0 if chosen.parts[index].word in LINEAR else DEFINED * abs(value)
        more = TWO_SIDED * float(np.hypot(grid, meant)) if mixed.low < mixed.high else 0.0
        low, high = min(mixed.low - value, 0.0), max(mixed.high - value, 0.0)
        out[name] = replace(
            mixed,
            value=value,
            low=value - float(np.hypot(low, more)),
            high=value + float(np.hypot(high, more)),
        )
    return out


# Standard uncertainty of what a mechanism's parameter means, as its share (VIM 2.27): where a knee
# begins, how long a lag is, how far a play goes depends on who draws the line.
DEFINED = 0.01


def _read(engine: Engine, explanation: Explanation, index: int) -> dict[str, Parameter]:
    """Parameters of one effect of an explanation as it is."""
    fitted = fit(engine, explanation, alike=True)
    softer = _softer(engine, fitted, index)
    return parameters(engine.bench, explanation.parts[index], *fitted.of(index), softer)


_Weighed = list[tuple[Explanation, float]]


def _beside(every: _Weighed, open_: _Weighed, index: int) -> Explanation | None:
    """The next shape on the grid (of times, zones, thresholds) that the likeliest one stands on,
    where the data left none of them but that one: what is true lies between such shapes, and a
    shape stands for half the way to the next."""
    top = max(open_, key=lambda e: e[1])[0].parts[index].variant
    kind, place = _NUMBER.sub("#", top.label), _place(top)
    others = [
        (e, w)
        for e, w in every
        if (v := e.parts[index].variant) is not top
        and _NUMBER.sub("#", v.label) == kind
        and _place(v) == place
    ]
    left = {id(e.parts[index].variant) for e, _ in open_}
    if not others or any(id(e.parts[index].variant) in left for e, _ in others):
        return None
    return max(others, key=lambda e: e[1])[0]


_NUMBER = re.compile(r"\d[\d.e+-]*")


def _open(engine: Engine, variants: list[Variant], chosen: Explanation, index: int) -> _Weighed:
    """What the data may leave open, the chosen shape first: explanations with other shapes of the
    effect and other sizes of imperfection, with their log weights."""
    part = chosen.parts[index]
    rest = tuple(p for i, p in enumerate(chosen.parts) if i != index)
    levels, energy = conditioned(engine, rest)
    family = [v for v in variants if v.word == part.word]
    ranked = sorted(score(engine, levels, family, energy), key=lambda s: -s.log_evidence)
    shapes = [part, *(Part(s.variant, s.scale) for s in ranked[:_MOST])]
    out = []
    for shape in [shapes[0], *(s for s in shapes[1:] if s.variant is not part.variant)]:
        parts = (*chosen.parts[:index], shape, *chosen.parts[index + 1 :])
        prior = np.log(shape.variant.prior) - SAME_JOINT * _crowds(shape, rest)
        each = _levels(engine, replace(chosen, parts=parts), prior)
        out += sorted(each, key=lambda e: -e[1])
    return out


def _crowds(shape: Part, rest: tuple[Part, ...]) -> bool:
    """Whether it sits in the joint of another effect."""
    joint = shape.variant.info.get("joint")
    return joint is not None and any(p.variant.info.get("joint") == joint for p in rest)


def _levels(engine: Engine, explanation: Explanation, prior: float) -> _Weighed:
    """The explanation at every size of imperfection, with its log weight."""
    out = []
    for i, level in enumerate(engine.levels):
        energy = part_sizes(engine, explanation.parts, i).energy
        weight = prior + log_joint(level, explanation.parts) + level_prior(engine.etas, i, energy)
        weight += signs_kept(level, explanation.parts)
        out.append((replace(explanation, eta=_size(engine, i, energy)), float(weight)))
    return out


def _size(engine: Engine, i: int, energy: float) -> float:
    """Size of imperfection, m, that a level stands for; energy: mean square (m^2) of the effects.
    The lowest takes in all that the noise hides: no law is met exactly."""
    etas = engine.etas
    if i > 0:
        return float(etas[i])
    return float(min(IMPERFECTION * energy**0.5, etas[1] / 2.5**0.5))


def _softer(engine: Engine, fitted: Fit, index: int) -> Softer:
    """The springs beside an effect, with what their uncertainty has in common with it."""
    base, before = len(fitted.base), sum(len(p.variant.columns) for p in fitted.parts[:index])
    start = base + before
    mine = slice(start, start + len(fitted.parts[index].variant.columns))
    covariance = fitted.joint_covariance
    at = {int(engine.base.names[i].removeprefix("spring")) - 1: i
          for i in engine.base.index("spring")}  # fmt: skip
    return Softer(
        {j: float(fitted.base[i]) for j, i in at.items()},
        {j: float(covariance[i, i]) for j, i in at.items()},
        {j: covariance[i, mine] for j, i in at.items()},
    )


def _place(variant: Variant) -> tuple[str, ...]:
    """Where a variant acts."""
    info = variant.info
    return tuple(str(info.get(key)) for key in ("joint", "joints", "axis", "axes"))


def _mixture(each: list[Parameter], share: Array) -> Parameter:
    """Median and interval of a mixture of normals; one alone keeps its own, skewed as it may be."""
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
    sd = np.maximum(high - low, 0.0) / (2 * TWO_SIDED) + 1e-300
    out = [_quantile(mean, sd, share, q) for q in (0.5, 0.025, 0.975)]
    value, least, most = (float(np.exp(v)) for v in out) if skewed else out
    return Parameter(value, least, most, each[0].unit)


def _quantile(mean: Array, sd: Array, share: Array, q: float) -> float:
    from scipy.optimize import brentq
    from scipy.special import ndtr

    low, high = float((mean - 8 * sd).min()), float((mean + 8 * sd).max())
    if not low < high:
        return low
    return float(brentq(lambda x: float(share @ ndtr((x - mean) / sd)) - q, low, high))
