"""Explanations: none, single effects, pairs, more; their posterior and the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import log

import numpy as np

from identification.gap.compare import Scored, condition, log_mean, score
from identification.gap.data import Array
from identification.gap.effects import WORDS
from identification.gap.evidence import Engine, Level
from identification.gap.finer import gained
from identification.gap.imperfection import LINEAR, level_prior
from identification.gap.parts import Part, log_joints, part_sizes, signs_kept
from identification.gap.penalties import (
    FRICTION,
    cancelling,
    pettiness,
    straight,
    trifle,
    within_stated,
)
from identification.gap.priors import LOG_NONE, LOG_UNKNOWN, prior_of
from identification.gap.variants import Variant

# An explanation must leave less than this share of the gap (rms), with two effects half of it and
# so on: the more words are spent, the better they have to explain.
REMAINDER = 0.25
SOFT = 8.0  # how fast, per factor e beyond that, it loses what it explains to `unknown`
# Nor can a law be met better than to a few percent of what it does.
LAW_REMAINDER = 0.03
# Neighbouring points of one smooth run are no independent witnesses of its law.
TEMPER = 0.12
_REFINED = 2  # joints, or axes, at which it is refined
_LEADING = 6  # words that are refined
_SHARPENED = 8  # explanations at the most
_PROMISING = 7  # further words of an explanation that are looked at closely
_SEEDS = 6
_WINDOW = 12.0  # nats below the best that a word may lie and still be conditioned on


@dataclass(frozen=True, eq=False)
class Explanation:
    """Effects (largest first, none for the base alone), posterior weight as log, imperfection eta
    m, sizes (rms m) of the effects, and log share of the posterior with little remainder."""

    parts: tuple[Part, ...]
    log_weight: float
    eta: float
    sizes: tuple[float, ...]
    log_good: float

    @property
    def good(self) -> bool:
        """It leaves little enough."""
        return self.log_good > self.log_weight - log(2)

    @cached_property
    def words(self) -> frozenset[str]:
        """Names of its effects."""
        return frozenset(p.word for p in self.parts)


@dataclass(frozen=True, eq=False)
class Found:
    """What the search found: explanations (best first), evidence of the words alone (nats, against
    none), probabilities of all words, the engine it ran on, log weight and imperfection (m) of a
    gap that no law explains, and what share of its weight withheld data leave an explanation."""

    engine: Engine
    explanations: tuple[Explanation, ...]
    alone: dict[str, float]
    probabilities: dict[str, float]
    best: Explanation
    unknown: float
    unknown_eta: float
    kept: Mapping[frozenset[str], float] = field(default_factory=dict)


def search(engine: Engine, variants: list[Variant], singles: list[Scored] | None = None) -> Found:
    """All single effects, then sets around the best ones, each re-fitted jointly. Where no levels
    repeat from run to run, a third effect is but freedom of the other two's laws. singles: scores
    of the variants one by one, where they are known."""
    deepest = 2 if engine.bench.rows.continuous else 3
    levels = engine.levels
    by_word = _by_word(singles or score(engine, levels, variants))
    alone = {w: _marginal(s) for w, s in by_word.items()}
    pool: dict[frozenset[str], Explanation] = {}
    for word, scored in by_word.items():
        top = _closest(scored)
        part = Part(top.variant, top.scale)
        pool[frozenset([word])] = _explain(engine, (part,), alone[word])
    none = log_mean([levels[0].log_base, levels[1].log_base], [0.95, 0.05])
    empty = Explanation((), none + LOG_NONE, 0.0, (), none + LOG_NONE)
    pool[frozenset()] = empty
    front = _seeds(pool)
    for depth in range(2, deepest + 1):
        front = _deepen(engine, variants, pool, front, depth)
        if not front:
            break
    ranked = _sharpened(engine, sorted(pool.values(), key=lambda e: -e.log_weight))
    strange = [lv for lv in engine.levels if lv.eta > 0.6 * engine.bench.noise.stated]
    found = Found(
        engine=engine,
        explanations=tuple(ranked),
        alone={w: v - none for w, v in alone.items()},
        probabilities={},
        best=ranked[0],
        unknown=log_mean([lv.log_base for lv in strange]) + LOG_UNKNOWN,
        unknown_eta=max(strange, key=lambda lv: lv.log_base).eta,
    )
    return weighed(found, {})


def refine(engine: Engine, singles: list[Scored]) -> list[Variant]:
    """Finer shapes of the words that stand out among single effects and that a grid meets badly:
    thresholds and zones make the evidence piecewise smooth, offsets act by their squares."""
    from identification.gap.effects import (
        joint_backlash,
        joint_nonlinear_stiffness,
        joint_yield,
        pose_error,
    )

    by_word = _by_word(singles)
    least = engine.levels[0].log_base + _WINDOW
    ranked = sorted(by_word, key=lambda w: -_marginal(by_word[w]))[:_LEADING]
    beside = _beside_first(engine, by_word, ranked)
    out: list[Variant] = []
    for word in ranked:
        if _marginal(by_word[word]) < least:
            continue
        found = sorted(by_word[word], key=lambda s: -s.log_evidence)
        second = sorted(beside.get(word, []), key=lambda s: -s.log_evidence)
        if word in ("joint_yield", "base_slip"):
            for s in _places(found, second, "sharp"):
                out += joint_yield.refined(engine.bench, s.variant)
        elif word == "joint_backlash":
            finer = [v for s in _places(found, second)
                     for v in joint_backlash.refined(engine.bench, s.variant)]  # fmt: skip
            engine.extend()
            if finer:
                best = max(_scored_beside(engine, by_word, ranked, finer), key=_evidence)
                finer += joint_backlash.refined(engine.bench, best.variant, _CLOSE)
            out += finer
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
    engine: Engine, by_word: dict[str, list[Scored]], ranked: list[str]
) -> dict[str, list[Scored]]:
    """Scores of the words that grids meet badly beside the leading word: what that does must not
    decide where a smaller effect is looked for."""
    family = [s.variant for w in ranked[1:] if w in _GRIDS for s in by_word[w]]
    return _by_word(_scored_beside(engine, by_word, ranked, family)) if family else {}


def _scored_beside(
    engine: Engine, by_word: dict[str, list[Scored]], ranked: list[str], family: list[Variant]
) -> list[Scored]:
    first = _closest(by_word[ranked[0]])
    if not family or family[0].word == ranked[0]:
        return score(engine, engine.levels, family)
    levels, energy = conditioned(engine, (Part(first.variant, first.scale),))
    return score(engine, levels, family, energy)


def _evidence(scored: Scored) -> float:
    return scored.log_evidence


_GRIDS = ("joint_yield", "base_slip", "joint_backlash")
_CLOSE = 0.2  # of the first look's steps


def _estimate(engine: Engine, variant: Variant) -> tuple[Array, Array]:
    """Most probable coefficients of a variant whose columns the engine may not know yet, and
    relative changes of the springs' compliance with it."""
    from identification.gap.fit import fit

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


def force(
    engine: Engine, variants: list[Variant], pool: tuple[Explanation, ...], words: frozenset[str]
) -> Explanation:
    """The best explanation that contains all `words`, and what else it wants; where the search
    found none, the words alone, one fitted after the other."""
    with_all = [e for e in pool if words <= e.words]
    if with_all:
        return with_all[0]
    parts: tuple[Part, ...] = ()
    left, evidence = set(words), 0.0
    while left:
        levels, energy = conditioned(engine, parts)
        scored = score(engine, levels, [v for v in variants if v.word in left], energy)
        top = max(scored, key=lambda s: s.log_evidence)
        parts = (*parts, Part(top.variant, top.scale))
        left.discard(top.variant.word)
        evidence = _marginal([s for s in scored if s.variant.word == top.variant.word])
    return _polish(engine, variants, _explain(engine, parts, evidence))


def _seeds(pool: dict[frozenset[str], Explanation]) -> list[Explanation]:
    """Where to look for a second effect: around all good ones; where the best explains the data
    down to the noise, around those within reach of it."""
    ranked = sorted((e for e in pool.values() if e.parts), key=lambda e: -e.log_weight)
    best = max(e.log_weight for e in pool.values())
    clean = [e for e in pool.values() if e.log_weight == best and e.eta == 0]
    reach = _WINDOW / 2 if clean else np.inf
    return [e for e in ranked[:_SEEDS] if e.log_weight > best - reach]


def _by_word(scored: list[Scored]) -> dict[str, list[Scored]]:
    out: dict[str, list[Scored]] = {}
    for s in scored:
        out.setdefault(s.variant.word, []).append(s)
    return out


def _marginal(scored: list[Scored]) -> float:
    """log evidence of a word: mean over its variants, weighted by their prior."""
    weights = [s.variant.prior for s in scored]
    values = [s.log_evidence - log(s.variant.prior) for s in scored]
    return log_mean(values, weights)


def _closest(scored: list[Scored]) -> Scored:
    """Of the shapes of a word that are about equally likely, the one that needs least
    imperfection: a word is judged by how well it can explain, not by its crudest shape."""
    best = max(s.log_evidence for s in scored)
    near = [s for s in scored if s.log_evidence > best - _ABOUT_EQUAL]
    return min(near, key=lambda s: (s.level, -s.log_evidence))


_ABOUT_EQUAL = 3.0  # nats


def _deepen(
    engine: Engine,
    variants: list[Variant],
    pool: dict[frozenset[str], Explanation],
    front: list[Explanation],
    depth: int,
) -> list[Explanation]:
    """Adds one more effect to each explanation of the front; those that gain are the next front."""
    best = max(e.log_weight for e in pool.values())
    grown: dict[frozenset[str], Explanation] = {}
    for start in front:
        if len(start.parts) != depth - 1:
            continue
        if depth > 2 and start.log_weight < best - _WINDOW:
            continue
        grown |= _with_one_more(engine, variants, start, grown)
    for words, explanation in grown.items():
        if words not in pool or pool[words].log_weight < explanation.log_weight:
            pool[words] = explanation
    top = sorted(grown.values(), key=lambda e: -e.log_weight)[: max(2, _SEEDS // depth)]
    polished = [_polish(engine, variants, e) for e in top]
    for explanation in polished:
        if pool[explanation.words].log_weight < explanation.log_weight:
            pool[explanation.words] = explanation
    return [e for e in polished if e.log_weight > best - 2.0]


def _with_one_more(
    engine: Engine,
    variants: list[Variant],
    start: Explanation,
    known: dict[frozenset[str], Explanation],
) -> dict[frozenset[str], Explanation]:
    others = [v for v in variants if v.word not in start.words]
    levels, energy = _no_worse(engine, start.parts)
    out: dict[frozenset[str], Explanation] = {}
    found_words = _by_word(score(engine, levels, others, energy))
    promising = sorted(found_words, key=lambda w: -_marginal(found_words[w]))[:_PROMISING]
    for word in promising:
        scored = found_words[word]
        words = start.words | {word}
        top = _closest(scored)
        parts = (*start.parts, Part(top.variant, top.scale))
        found = _explain(engine, parts, _marginal(scored))
        if words not in known or known[words].log_weight < found.log_weight:
            out[words] = found
    return out


def _polish(engine: Engine, variants: list[Variant], start: Explanation) -> Explanation:
    """Lets every effect choose its variant anew, the others given."""
    best = start
    for index in range(len(start.parts)):
        rest = tuple(p for i, p in enumerate(best.parts) if i != index)
        word = best.parts[index].word
        levels, energy = _no_worse(engine, rest)
        family = [v for v in variants if v.word == word]
        scored = score(engine, levels, family, energy)
        top = _closest(scored)
        found = _explain(engine, (*rest, Part(top.variant, top.scale)), _marginal(scored))
        if found.log_weight > best.log_weight:
            best = found
    return best


def _no_worse(engine: Engine, parts: tuple[Part, ...]) -> tuple[list[Level], float]:
    """The same as `conditioned`, at levels up to the likeliest: with an effect more, no more
    imperfection is needed."""
    likeliest = int(np.argmax(log_joints(engine, parts)))
    return conditioned(engine, parts, engine.levels[: likeliest + 1])


def conditioned(
    engine: Engine, parts: tuple[Part, ...], among: list[Level] | None = None
) -> tuple[list[Level], float]:
    """Levels (all of them, or some) with the parts integrated out, and the mean square (m^2) of
    the parts at the likeliest of these."""
    levels = engine.levels if among is None else among
    for p in parts:
        levels = [condition(lv, p.variant.columns, p.variant.root, p.scale) for lv in levels]
    if not parts:
        return levels, 0.0
    weights = np.array([lv.log_base for lv in levels])
    return levels, part_sizes(engine, parts, int(weights.argmax())).energy


def _sharpened(engine: Engine, ranked: list[Explanation]) -> list[Explanation]:
    """With the evidence of those that matter between the levels of imperfection, best first."""
    done: dict[frozenset[str], Explanation] = {}
    for _ in range(_SHARPENED):
        ranked = sorted((done.get(e.words, e) for e in ranked), key=lambda e: -e.log_weight)
        near = [e for e in ranked if e.log_weight > ranked[0].log_weight - _WINDOW / 2]
        todo = [e for e in near if e.parts and e.words not in done]
        if not todo:
            break
        e = todo[0]
        level = int(np.argmin(np.abs(engine.etas - e.eta)))
        more = gained(engine, e.parts, part_sizes(engine, e.parts, level).energy)
        done[e.words] = replace(e, log_weight=e.log_weight + more, log_good=e.log_good + more)
    return sorted((done.get(e.words, e) for e in ranked), key=lambda e: -e.log_weight)


def _explain(engine: Engine, parts: tuple[Part, ...], log_evidence: float) -> Explanation:
    """The explanation with its prior; too small a part is charged as what it is: freedom of the
    larger one's law."""
    levels = engine.levels
    bases = log_joints(engine, parts)
    sizes = part_sizes(engine, parts, int(bases.argmax()))
    each, energy = _counted(engine, parts, sizes.gap), sizes.energy
    logs = bases + [level_prior(engine.etas, i, energy) for i in range(len(levels))]
    best = int(logs.argmax())
    least = max(
        0.6 * engine.bench.noise.stated,
        REMAINDER * engine.structural / max(len(parts), 1),
        LAW_REMAINDER * float(each.max(initial=0.0)),
    )
    good = 1 / (1 + (np.array([lv.eta for lv in levels]) / least) ** SOFT)
    share = np.exp(logs - logs.max())
    fraction = float(share @ good / share.sum())
    order = np.argsort(-each, kind="stable")
    weight = log_evidence + prior_of(frozenset(p.word for p in parts), engine.bench)
    weight -= trifle(engine, parts, sizes) + straight(engine, parts, sizes)
    weight -= within_stated(engine, parts, sizes)
    if len(parts) > 1:
        weight -= pettiness(engine, parts, sizes) + cancelling(engine, parts, each)
        weight += signs_kept(levels[best], parts)
    return Explanation(
        tuple(parts[i] for i in order),
        weight,
        levels[best].eta,
        tuple(float(each[i]) for i in order),
        weight + log(max(fraction, 1e-300)),
    )


def _counted(engine: Engine, parts: tuple[Part, ...], each: Array) -> Array:
    """Sizes of the parts. Without an arm friction brings its own mean stiffness, and what was
    simulated may be its first slope: a spring that is off beside it counts by what the friction
    leaves of the gap."""
    linear = np.array([p.word in LINEAR for p in parts], dtype=bool)
    rubs = np.array([p.word in FRICTION for p in parts], dtype=bool)
    if engine.bench.data.arm or not rubs.any():
        return each
    rest = max(engine.structural**2 - float(each[rubs].max()) ** 2, 0.0) ** 0.5
    return np.where(linear, np.minimum(each, rest), each)


# Of 132 verdicts of the blind check whose posterior was above 0.97, 128 named an effect that was
# there, of 40 on other people's rigs 32: the families are not all that nature has, and the
# posterior does not know that.
DOUBT, BENCH_DOUBT = 0.05, 0.1


def trusted(
    probabilities: dict[str, float], library: set[str], most: float = DOUBT
) -> dict[str, float]:
    """Probabilities in which an effect that is likelier than not gives up to `most` of its own
    away, the more the surer it is; half of that goes to `unknown`, half to all effects of the
    library alike. What says `none` or `unknown` stays."""
    given = {w: p for w, p in probabilities.items() if w in library}
    if len(given) < 2:
        return probabilities
    lost = {w: most * p * max(0.0, 2 * p - 1) for w, p in given.items()}
    doubt = sum(lost.values())
    out = {w: p - lost.get(w, 0.0) for w, p in probabilities.items()}
    out["unknown"] += 0.5 * doubt
    for w in given:
        out[w] += 0.5 * doubt / len(given)
    return out


def weighed(found: Found, kept: Mapping[frozenset[str], float]) -> Found:
    """With the posterior over words as main cause. kept: words of an explanation -> share of its
    weight that it keeps, where withheld data were looked at. What it loses, and what leaves a large
    remainder, goes to its heir."""
    ranked = found.explanations
    unknown = _of_the_strange(found, kept)
    top = max(ranked[0].log_weight, unknown)
    mass = dict.fromkeys([*WORDS, "none", "unknown"], 0.0)
    mass["unknown"] = float(np.exp(unknown - top))
    for e in ranked:
        whole, good = float(np.exp(e.log_weight - top)), float(np.exp(e.log_good - top))
        good *= kept.get(e.words, 1.0)
        if not e.parts and found.engine.bench.noise.raised > NOISY:
            good *= STATED
        many = THREE if len(e.parts) > 2 and e.sizes[2] > TELLING * e.sizes[0] else 1.0
        for word, share in _main(e, found.engine.bench.data.arm).items():
            mass[word] += many * share * good
        mass["unknown"] += (1 - many) * good
        mass[_heir(e, ranked, kept, found.engine.bench.noise.stated)] += whole - good
    if found.engine.bench.rows.continuous and ranked[0].eta > 0:
        mass = {w: m**TEMPER for w, m in mass.items()}
    total = sum(mass.values())
    doubt = DOUBT if found.engine.bench.data.arm else BENCH_DOUBT
    probabilities = trusted({w: m / total for w, m in mass.items()}, set(found.alone), doubt)
    return replace(found, probabilities=probabilities, kept=kept)


def _of_the_strange(found: Found, kept: Mapping[frozenset[str], float]) -> float:
    """log weight of a gap that no law explains. A short table any smooth path passes as well as the
    law that made it; but where a law leaves no more than the noise, it does explain."""
    bench = found.engine.bench
    if bench.data.arm:
        return found.unknown
    explains = [
        e.log_good - EXPLAINED
        for e in found.explanations
        if e.parts and e.good and e.eta <= bench.noise.stated and kept.get(e.words, 1.0) > 0.5
    ]
    return min([found.unknown, *explains[:1]])


EXPLAINED = 1.0  # nats
# Readings that scatter so many times more than stated are not explained by what was stated: so much
# is left of `none`.
NOISY, STATED = 3.0, 0.1

# What is left of three troubles at once: one that the library lacks may be likelier. Of 40 such
# explanations on two seeds of the blind check with and without withheld words, 12 were of a known
# gap, 28 stood in for a word that was taken away; but what is known must not be split into losing.
THREE = 0.8
TELLING = 0.1  # of the largest: a smaller one is no trouble beside it


def _main(explanation: Explanation, arm: bool) -> dict[str, float]:
    """Which effect of an explanation is its main one: each in proportion to its size, since how
    large an effect is alone is a matter of what else may take its place (of 33 mixtures of the
    blind check whose two effects were both found, twice as large at most, 22 were in the right
    order). Without an arm all words speak of one spring, and a second one is mostly more of the
    first one's law."""
    if not explanation.parts:
        return {"none": 1.0}
    if not arm:
        return {explanation.parts[0].word: 1.0}
    size = np.maximum(np.array(explanation.sizes), 0.0)
    size[0] = max(float(size[0]), 1e-300)
    share = size / size.sum()
    return {p.word: float(s) for p, s in zip(explanation.parts, share, strict=True)}


def _heir(
    explanation: Explanation, ranked: Sequence[Explanation],
    kept: Mapping[frozenset[str], float], noise: float,
) -> str:  # fmt: skip
    """Who gets the weight of an explanation that leaves too much for its number of effects: the
    best one with fewer of the same effects that explains enough for itself, else unknown."""
    for e in ranked:
        fewer = e.parts and e.words < explanation.words
        near = e.log_weight > explanation.log_weight - _INHERITS or e.eta < _CLOSELY * noise
        if fewer and near and e.good and kept.get(e.words, 1.0) > 0.5:
            return e.parts[0].word
    return "unknown"


_INHERITS = 40.0  # nats: what explains so much less is no explanation of the same,
_CLOSELY = 2.0  # but where it leaves no more than so many times the noise of one sample
