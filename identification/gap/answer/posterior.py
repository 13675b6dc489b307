"""Intervals of an effect's parameters: over all shapes of its family that the data leave open."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identification.gap.answer.mixing import apart, mixture, stretched, wider
from identification.gap.answer.parameters import parameters
from identification.gap.effects import EFFECTS
from identification.gap.effects.base_slip import ACROSS, slides
from identification.gap.evidence.compare import Scored, log_prior_of_joint, logsumexp, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.imperfection import IMPERFECTION, STEP, level_priors
from identification.gap.evidence.parts import Part, energies, log_joints, part_sizes, signs_kept
from identification.gap.explanations.explanation import Explanation, conditioned
from identification.gap.explanations.fit import Fit, fit
from identification.gap.explanations.penalties import SAME_JOINT, minor_parts
from identification.gap.explanations.several import family_of
from identification.gap.laws.effect import declared
from identification.gap.laws.interval import ComplianceChange, Parameter
from identification.gap.model.variants import Variant, place_of
from identification.gap.search.readings import as_moved
from identification.gap.search.shares import sized
from identification.gap.words import LINEAR

Parameters = dict[str, Parameter]


class Known(NamedTuple):
    """What the data say of an effect. places: "joint 3" or "axis y" -> probability that it sits
    there, given that it is that effect; empty for what sits at no single joint or axis."""

    parameters: Parameters
    places: dict[str, float]


_MOST, _LEAST_SHARE = 10, 0.01  # shapes that count, and their least share of the posterior
# So many nats between the shapes of a family count as one: that one of them comes closest to the
# true law says little of where the true law puts a width or a depth. Of 139 parameters of a blind
# run 115 lay in intervals that counted each nat, 121 in these, which are a fifth wider.
LEFT_OPEN = 4.0


def settled(
    engine: Engine,
    variants: Sequence[Variant],
    chosen: Explanation,
    rivals: Iterable[Explanation] = (),
) -> tuple[Explanation, list[Known]]:
    """The explanation with its effects at their likeliest joints or axes (a grid's best shape may
    sit where few others do), and parameters and places of each.

    Of parameters: value: that of the explanation itself, whose terms a model file takes; 95 %
    intervals of the mixture of the effect's likeliest shapes, wherever they sit, under every size
    of imperfection. By how much a value moves with the shapes of the effects beside it, and with
    which effects these are (rivals: other explanations, by their weights), adds to its variance. No
    interval reaches beyond what is possible, or was seen."""
    each = _all_shapes(engine, variants, chosen)
    for shapes in each:
        better = shapes.elsewhere()
        if better is not None:
            chosen = sized(engine, better) if len(better.words) > 1 else better
            each = _all_shapes(engine, variants, chosen)
            break
    return chosen, _known(engine, chosen, each, rivals)


def _all_shapes(engine: Engine, variants: Sequence[Variant], chosen: Explanation) -> list[_Shapes]:
    return [_Shapes(engine, variants, chosen, i) for i in range(len(chosen.parts))]


def _known(
    engine: Engine, chosen: Explanation, each: list[_Shapes], rivals: Iterable[Explanation]
) -> list[Known]:
    likely = _likely(rivals, chosen)
    others = [(_by_word(e, _read(engine, e)), weight) for e, weight in likely]
    said, out = _read(engine, chosen), []
    for i, shapes in enumerate(each):
        word, own = chosen.parts[i].word, shapes.own(said[i])
        beside = [e for e in each if e.index != i]
        of_rivals = [(r[word], w) for r, w in others if word in r]
        wide = {n: wider(p, _moves(n, p, i, beside, of_rivals)) for n, p in own.items()}
        found = {n: stretched(p) for n, p in wide.items()} if beside else wide
        found = {n: p.possible(_least(word, n)) for n, p in found.items()}
        out.append(Known(found, shapes.places()))
    return out


def _least(word: str, name: str) -> float:
    """Of a parameter, by its name."""
    return 0.0 if declared(name, EFFECTS[word].not_negative) else -np.inf


class _Shapes:
    """An effect of an explanation in all shapes that the data leave open, the others as they are;
    every[0] has the shape of the explanation, read: parameters of all effects in those that count.
    """

    def __init__(
        self, engine: Engine, variants: Sequence[Variant], chosen: Explanation, index: int
    ) -> None:
        self.engine, self.chosen, self.index = engine, chosen, index
        self.every = _open(engine, variants, chosen, index)
        least = max(weight for _, weight in self.every) + LEFT_OPEN * np.log(_LEAST_SHARE)
        self.open = [e for i, e in enumerate(self.every) if e[1] > least or i == 0]
        self.read = [_read(engine, explanation) for explanation, _ in self.open]
        weights = np.array([weight for _, weight in self.open])
        self.share = np.exp((weights - weights.max()) / LEFT_OPEN)

    def own(self, said: Parameters) -> Parameters:
        """Parameters of the effect, the others as they are; said: of the explanation itself."""
        found, index, word = [r[self.index] for r in self.read], self.index, self._part.word
        beside = _beside(self.every, self.open, index)
        step = _read(self.engine, beside)[index] if beside is not None else {}
        out = {}
        for name in said:
            mine = np.array([name in f for f in found])
            alike = [f[name] for f, m in zip(found, mine, strict=True) if m]
            value = said[name].value
            mixed = mixture(alike, self.share[mine]) if alike else said[name]
            about = replace(mixed, value=value)
            grid = apart(about, step[name].value) / 12**0.5 if name in step else 0.0
            meant = 0.0 if word in LINEAR else apart(about, value * (1 + self._defined))
            out[name] = wider(about, grid**2 + meant**2)
        return out

    def places(self) -> dict[str, float]:
        """As of `Known`, the likeliest first."""
        weights = np.array([weight for _, weight in self.every])
        out: dict[str, float] = {}
        for (e, _), share in zip(self.every, np.exp(weights - logsumexp(weights)), strict=True):
            name = _named(e.parts[self.index].variant)
            if name:
                out[name] = out.get(name, 0.0) + float(share)
        ranked = sorted(out.items(), key=lambda item: -item[1])
        return {name: min(share, 1.0) for name, share in ranked if share > _LEAST_SHARE}

    def elsewhere(self) -> Explanation | None:
        """The best shape at the likeliest place, where that is another one than the explanation's;
        None of what sits at several."""
        top = next(iter(self.places()), "")
        word = self._part.word
        once = sum(p.word == word for p in self.chosen.parts) == 1
        if not once or top in ("", _named(self._part.variant)):
            return None
        there = [e for e in self.every if _named(e[0].parts[self.index].variant) == top]
        return max(there, key=lambda e: e[1])[0]

    @property
    def _defined(self) -> float:
        return FLOWING if self._part.variant.flows else DEFINED

    @property
    def _part(self) -> Part:
        return self.chosen.parts[self.index]


def _named(variant: Variant) -> str:
    """The joint, or the axis of the base's motion, that a variant sits at."""
    if variant.joint is not None:
        return f"joint {variant.joint + 1}"
    if variant.axis is None:
        return ""
    return f"sliding along {ACROSS[variant.axis]}" if slides(variant) else f"axis {variant.axis}"


def _moves(
    name: str,
    found: Parameter,
    index: int,
    beside: list[_Shapes],
    rivals: list[tuple[Parameters, float]],
) -> float:
    """Mean square by which a parameter of an effect moves with what stands beside it; shapes beside
    which there is none say nothing of it. Of what is known to a factor: nats^2."""
    total = 0.0
    for other in beside:
        with_it = [i for i, r in enumerate(other.read) if name in r[index]]
        values = np.array([apart(found, other.read[i][index][name].value) for i in with_it])
        share = other.share[with_it]
        if values.size:
            total += float(share @ (values - values[0]) ** 2) / float(share.sum())
    have = [(apart(found, r[name].value), weight) for r, weight in rivals if name in r]
    whole = 1.0 + sum(weight for _, weight in have)
    return total + sum(weight * off**2 for off, weight in have) / whole


def _likely(rivals: Iterable[Explanation], chosen: Explanation) -> _Weighed:
    """Explanations by other words that count beside the chosen one, with their weights over its."""
    out = []
    for e in rivals:
        weight = float(np.exp(min(e.log_weight - chosen.log_weight, 0.0)))
        if e.words != chosen.words and e.words & chosen.words and weight > _LEAST_SHARE:
            out.append((e, weight))
    return out


def _by_word(explanation: Explanation, read: list[Parameters]) -> dict[str, Parameters]:
    return dict(zip((p.word for p in explanation.parts), read, strict=True))


# Standard uncertainty of what a mechanism's parameter means, as its share (VIM 2.27): where a knee
# begins, how long a lag is, how far a play goes depends on who draws the line.
DEFINED = 0.01
# Where it gives way only slowly nobody sees it begin: of 11 such thresholds of the blind check
# whose intervals were 3 to 5 % wide, 7 were off by 4 to 11 %.
FLOWING = 0.06


def _read(engine: Engine, explanation: Explanation) -> list[Parameters]:
    """Parameters of the effects of an explanation as it is."""
    fitted = fit(engine, explanation, alike=True)
    read = [
        parameters(engine.bench, part, *fitted.of(i), _softer(engine, fitted, i))
        for i, part in enumerate(explanation.parts)
    ]
    return as_moved(engine.bench, explanation.parts, read)


_Weighed = list[tuple[Explanation, float]]


def _beside(every: _Weighed, open_: _Weighed, index: int) -> Explanation | None:
    """The next shape on the grid (of times, zones, thresholds) that the likeliest one stands on,
    where the data left none of them but that one: what is true lies between such shapes, and a
    shape stands for half the way to the next."""
    top = max(open_, key=lambda e: e[1])[0].parts[index].variant
    others = [
        (e, w) for e, w in every if (v := e.parts[index].variant) is not top and v.grid == top.grid
    ]
    left = {id(e.parts[index].variant) for e, _ in open_}
    if not others or any(id(e.parts[index].variant) in left for e, _ in others):
        return None
    return max(others, key=lambda e: e[1])[0]


def _open(engine: Engine, variants: Sequence[Variant], chosen: Explanation, index: int) -> _Weighed:
    """What the data may leave open, the chosen shape first: explanations with other shapes of the
    effect and other sizes of imperfection, with their log weights."""
    part = chosen.parts[index]
    rest = tuple(p for i, p in enumerate(chosen.parts) if i != index)
    levels, energy = conditioned(engine, rest)
    family = family_of(variants, part.word, rest)
    stand = _representatives(score(engine, levels, family, energy))
    first = next((more for s, more in stand if s.variant is part.variant), 0.0)
    shapes = [(part, first)]
    shapes += [(Part(s.variant, s.scale), m) for s, m in stand if s.variant is not part.variant]
    out = []
    for shape, more in shapes:
        parts = (*chosen.parts[:index], shape, *chosen.parts[index + 1 :])
        likely = shape.variant.log_prior + log_prior_of_joint(engine, shape.variant) + more
        each = _levels(engine, replace(chosen, parts=parts), likely)
        level = max(range(len(each)), key=lambda i: each[i][1])
        charge = max(SAME_JOINT * _crowds(shape, rest), _petty(engine, parts, level))
        out += sorted(((e, weight - charge) for e, weight in each), key=lambda e: -e[1])
    return out


def _petty(engine: Engine, parts: tuple[Part, ...], level: int) -> float:
    """Nats that a set of effects is charged where one of them does next to nothing: what has moved
    to another joint must still be an effect there."""
    return minor_parts(engine, parts, part_sizes(engine, parts, level)) if len(parts) > 1 else 0.0


def _representatives(scored: Sequence[Scored]) -> list[tuple[Scored, float]]:
    """The likeliest shapes of every place that counts, as many as its share of the posterior, and
    by how many nats each stands for more of its place than itself: the many shapes of a joint that
    was looked at closely push no other joint out."""
    places: dict[tuple[str, ...], list[Scored]] = {}
    for s in sorted(scored, key=lambda s: -s.log_evidence):
        places.setdefault(place_of(s.variant), []).append(s)
    logs = {p: logsumexp(np.array([s.log_evidence for s in each])) for p, each in places.items()}
    whole = logsumexp(np.array(list(logs.values())))
    out = []
    for place, each in places.items():
        share = float(np.exp(logs[place] - whole))
        if share < _LEAST_SHARE:
            continue
        kept = each[: max(1, round(_MOST * share))]
        more = float(logs[place] - logsumexp(np.array([s.log_evidence for s in kept])))
        out += [(s, more) for s in kept]
    return sorted(out, key=lambda e: -e[0].log_evidence)


def _crowds(shape: Part, rest: tuple[Part, ...]) -> bool:
    """Whether it sits in the joint of another effect."""
    joint = shape.variant.joint
    return joint is not None and any(p.variant.joint == joint for p in rest)


def _levels(engine: Engine, explanation: Explanation, prior: float) -> _Weighed:
    """The explanation at every size of imperfection, with its log weight."""
    out = []
    joint, energy = log_joints(engine, explanation.parts), energies(engine, explanation.parts)
    weights = prior + joint + level_priors(engine.etas, energy)
    least = weights.max() - _COUNTS
    for i, (level, weight) in enumerate(zip(engine.levels, weights, strict=True)):
        signs = signs_kept(level, explanation.parts) if weight > least else 0.0
        out.append((replace(explanation, eta=_size(engine, i, energy[i])), float(weight + signs)))
    return out


_COUNTS = 40.0  # nats


def _size(engine: Engine, i: int, energy: float) -> float:
    """Size of imperfection, m, that a level stands for; energy: mean square (m^2) of the effects.
    The lowest takes in all that the noise hides: no law is met exactly."""
    etas = engine.etas
    if i > 0:
        return float(etas[i])
    return float(min(IMPERFECTION * energy**0.5, etas[1] / STEP**0.5))


def _softer(engine: Engine, fitted: Fit, index: int) -> ComplianceChange:
    """The springs beside an effect, with what their uncertainty has in common with it."""
    mine, covariance, at = fitted.among_all(index), fitted.joint_covariance, engine.base.springs
    return ComplianceChange(
        {j: float(fitted.base[i]) for j, i in at.items()},
        {j: float(covariance[i, i]) for j, i in at.items()},
        {j: covariance[i, mine] for j, i in at.items()},
    )
