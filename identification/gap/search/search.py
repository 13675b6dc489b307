"""The search for explanations: none, single effects, pairs, more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.gap.evidence.compare import Scored, by_word, closest, log_mean, marginal, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.finer import BELOW, PARTS, gained
from identification.gap.evidence.imperfection import LOG_STEP
from identification.gap.evidence.lognormal_springs import lognormal_prior_correction, stated_between
from identification.gap.evidence.parts import Part, part_sizes
from identification.gap.explanations.explanation import (
    Explanation,
    SearchResult,
    explain,
    joined,
    up_to_likeliest,
)
from identification.gap.explanations.priors import LOG_NONE, log_unknown
from identification.gap.explanations.several import in_more_joints, in_one_joint_each, polished
from identification.gap.model.noise import UNSURE
from identification.gap.model.variants import Variant, able_beside
from identification.gap.search.mechanisms_refit import refit_mechanism_variants
from identification.gap.search.pose_refit import refit_pose_variants
from identification.gap.search.readings import reading_all
from identification.gap.search.shares import measured
from identification.gap.search.springs_refit import relinearised_variants
from identification.gap.words import MECHANISMS, SPRINGS, UNMODELLED

# Share of the prior of `none` on more noise than was stated: of instruments that are known, or to a
# factor of two.
_SURE_SHARE, _UNSURE_SHARE = 0.05, 0.2
_STEP = 0.6  # of the noise: between the least size of an imperfection and the next
_SHARPENED = 12  # explanations at the most
_BROUGHT = 90.0  # nats: the most that any effect is asked to bring beside others
_PROMISING = 7  # further words of an explanation that are looked at closely
# Explanations around which another effect is looked for. Of an arm, further ones cost a fifth of
# the time and change no verdict in 300 cases; on a bench the two that belong together may both look
# poor alone, where the spring is wrong as well.
_SEEDS, _ARMLESS_SEEDS = 4, 6
_READING = 6  # explanations whose instruments are looked at beside what else moves
_WINDOW = 12.0  # nats below the best that a word may lie and still be conditioned on


def search(
    engine: Engine, variants: Sequence[Variant], singles: Sequence[Scored] = ()
) -> SearchResult:
    """All single effects, then sets around the best ones, each re-fitted jointly. Where no levels
    repeat from run to run, a third effect is but freedom of the other two's laws. singles: scores
    of the variants one by one, where they are known. Probabilities come with what is judged
    (`judging.residual_checks`)."""
    deepest = 2 if engine.bench.rows.continuous else 3
    levels, all_of_them = engine.levels, list(variants)
    families = by_word(singles or score(engine, levels, all_of_them))
    alone = {w: marginal(s) for w, s in families.items()}
    pool: dict[frozenset[str], Explanation] = {}
    for word, scored in families.items():
        pool[frozenset([word])] = joined(engine, (), scored, 0.0)
    none = _as_stated(engine)
    empty = Explanation((), none + LOG_NONE, 0.0, (), none + LOG_NONE)
    pool[frozenset()] = empty
    seeds = _SEEDS if engine.bench.data.arm else _ARMLESS_SEEDS
    singly = _seeds(pool, seeds)
    near = _near(pool, singly)
    front, alone_best = _in_more_joints(engine, all_of_them, pool, near), _best(pool)
    closely: set[frozenset[str]] = set()
    for depth in range(2, deepest + 1):
        kept = max(2, seeds // depth)
        front = _deepen(engine, all_of_them, pool, front, depth, kept, closely)
        if depth == 2:  # what a second effect wins for the best, it may win for others as well
            reach = alone_best - (_best(pool) - alone_best)
            late = [e for e in singly if e not in near and e.log_weight > reach]
            late = _in_more_joints(engine, all_of_them, pool, late)
            front += _deepen(engine, all_of_them, pool, late, depth, kept, closely)
        if not front:
            break
    _polish_rivals(engine, all_of_them, pool, closely)
    ranked = _sharpened(engine, sorted(pool.values(), key=lambda e: -e.log_weight))
    ranked = measured(engine, ranked)
    named = tuple(e for e in ranked if not e.words & frozenset(UNMODELLED))
    strange = {
        lv.eta: _base_at(engine, lv.number) for lv in engine.levels if lv.eta > _hidden(engine)
    }
    return SearchResult(
        engine=engine,
        explanations=named,
        unmodelled=tuple(e for e in ranked if e not in named),
        alone={w: v - none for w, v in alone.items() if w not in UNMODELLED},
        probabilities={},
        unknown=log_mean(list(strange.values())) + log_unknown(engine.bench.load_history),
        unknown_eta=max(strange, key=lambda eta: strange[eta]),
        variants=tuple(all_of_them),
    )


def _as_stated(engine: Engine) -> float:
    """log evidence of what was stated: the noise, and a little more of it than that, as finely as
    it is looked at beside an effect."""
    least, hidden = float(engine.etas[1]), _hidden(engine)
    above = np.floor(PARTS * np.log(max(hidden / least, 1.0)) / LOG_STEP)
    etas = least * np.exp(np.arange(-BELOW * PARTS, above + 1) / PARTS * LOG_STEP)
    more = [stated_between(engine, float(eta)) for eta in etas]
    less = float(
        np.interp(hidden / engine.bench.noise.stated, [_STEP, 1.0], [_SURE_SHARE, _UNSURE_SHARE])
    )
    return log_mean([_base_at(engine, 0), *more], [1 - less, *(less / len(more) for _ in more)])


def _base_at(engine: Engine, level: int) -> float:
    """log evidence of the base alone at a level, springs as they are stated."""
    return engine.levels[level].log_base + lognormal_prior_correction(engine, (), level)


# What readings have in common with the next ones of their hold, they have with all of it, and more:
# noise of many colours (1/f) is as large from hold to hold.
_IN_HOLDS = 4.0
# What differs from hold to hold may wander over many of them, and does not average out.
_FROM_HOLD = 1.5


def _hidden(engine: Engine) -> float:
    """Imperfection (m) that passes for noise."""
    noise = engine.bench.noise
    swings = min(max(_STEP, _IN_HOLDS * noise.swings), 1.0)
    return (max(swings, _FROM_HOLD * noise.slow) if noise.sure else UNSURE) * noise.stated


def with_forced_words(
    engine: Engine,
    variants: Sequence[Variant],
    pool: tuple[Explanation, ...],
    start: Explanation,
    words: frozenset[str],
) -> Explanation:
    """`start` with all `words` beside its own effects: the best that the search found, or with one
    after the other fitted to what the others leave, whichever is likelier. None of them takes
    another's place."""
    left = set(words - start.words)
    if not left:
        return start
    with_all = [e for e in pool if words | start.words <= e.words]
    parts, evidence, energy = start.parts, 0.0, 0.0
    while left:
        levels, energy = up_to_likeliest(engine, parts)
        able = able_beside(variants, {p.word for p in parts})
        scored = score(engine, levels, [v for v in able if v.word in left], energy)
        top = max(scored, key=lambda s: s.log_evidence)
        parts = (*parts, Part(top.variant, top.scale))
        left.discard(top.variant.word)
        evidence = marginal([s for s in scored if s.variant.word == top.variant.word])
    taken = energy if len(parts) > 1 else None
    built = polished(engine, variants, explain(engine, parts, evidence, taken))
    return max([*with_all[:1], built], key=lambda e: e.log_weight)


def _seeds(pool: dict[frozenset[str], Explanation], most: int) -> list[Explanation]:
    """Around which explanations another effect may be looked for: the `most` best."""
    return sorted((e for e in pool.values() if e.parts), key=lambda e: -e.log_weight)[:most]


def _near(pool: dict[frozenset[str], Explanation], seeds: list[Explanation]) -> list[Explanation]:
    """Around which of them it is looked for at once: where the best of all leaves no more than the
    noise, those within half a window of it."""
    best = _best(pool)
    clean = [e for e in pool.values() if e.log_weight == best and e.eta == 0]
    reach = _WINDOW / 2 if clean else np.inf
    return [e for e in seeds if e.log_weight > best - reach]


def _best(pool: dict[frozenset[str], Explanation]) -> float:
    return max(e.log_weight for e in pool.values())


def _deepen(
    engine: Engine,
    variants: list[Variant],
    pool: dict[frozenset[str], Explanation],
    front: list[Explanation],
    depth: int,
    kept: int,
    closely: set[frozenset[str]],
) -> list[Explanation]:
    """Adds one more effect to each explanation of the front; those that gain, up to `kept`, are the
    next front. The variants grow by what is looked at beside others. closely: words of those that
    are polished, which grow, too."""
    best = _best(pool)
    grown: dict[frozenset[str], Explanation] = {}
    for start in front:
        if len(start.words) != depth - 1:
            continue
        if depth > 2 and start.log_weight < best - _WINDOW:
            continue
        grown |= _with_one_more(engine, variants, start, grown)
    for words, explanation in grown.items():
        if words not in pool or pool[words].log_weight < explanation.log_weight:
            pool[words] = explanation
    ranked = sorted(grown.values(), key=lambda e: -e.log_weight)
    first = [_anew(engine, variants, polished(engine, variants, e), pool) for e in ranked[:kept]]
    closely |= {e.words for e in first}
    lent = (_with_lent_shapes(engine, variants, e, first) for e in ranked[kept:_READING])
    others = [_anew(engine, variants, e, pool) for e in lent]
    for explanation in [*first, *others]:
        if pool[explanation.words].log_weight < explanation.log_weight:
            pool[explanation.words] = explanation
    good = _in_more_joints(engine, variants, pool, first)
    return [e for e in good if e.log_weight > best - 2.0]


def _polish_rivals(
    engine: Engine,
    variants: list[Variant],
    pool: dict[frozenset[str], Explanation],
    closely: set[frozenset[str]],
) -> None:
    """Polishes what differs from the best explanation in one word: the shape that a word had alone,
    before another effect stood beside it, may make up for what that explains, and lose by it."""
    for _ in range(_RIVALS):
        best = max(pool.values(), key=lambda e: e.log_weight)
        rivals = [
            e
            for e in pool.values()
            if len(e.words) == len(best.words) == len(e.words & best.words) + 1 > 1
            and e.words not in closely
            and e.log_weight > best.log_weight - _MAY_GAIN
        ]
        if not rivals:
            return
        rival = max(rivals, key=lambda e: e.log_weight)
        closely.add(rival.words)
        again = polished(engine, variants, rival)
        if again.log_weight > rival.log_weight:
            pool[rival.words] = again


_RIVALS, _MAY_GAIN = 3, 60.0  # at most; nats that polishing has been seen to bring


def _with_lent_shapes(
    engine: Engine, variants: list[Variant], start: Explanation, found: list[Explanation]
) -> Explanation:
    """Polished, if one of its parts does better in a shape that others found for that word. Its own
    one was chosen before the other part stood beside it, and makes up for what that explains."""
    for part in start.parts:
        shapes = [p.variant for e in found for p in e.parts if p.word == part.word]
        lent = [v for v in dict.fromkeys(shapes) if v is not part.variant]
        if not lent:
            continue
        levels, energy = up_to_likeliest(engine, tuple(p for p in start.parts if p is not part))
        if closest(score(engine, levels, [part.variant, *lent], energy)).variant in lent:
            return polished(engine, variants, start)
    return start


def _in_more_joints(
    engine: Engine,
    variants: list[Variant],
    pool: dict[frozenset[str], Explanation],
    front: list[Explanation],
) -> list[Explanation]:
    """The front, and what of it is better with its mechanisms in more joints, as the pool then
    holds it: beside a second effect one joint may do."""
    more = [in_more_joints(engine, variants, e) for e in front]
    better = [m for m, e in zip(more, front, strict=True) if m is not e]
    for e in better:
        if pool[e.words].log_weight < e.log_weight:
            pool[e.words] = e
    return [*front, *better]


def _with_one_more(
    engine: Engine,
    variants: list[Variant],
    start: Explanation,
    known: dict[frozenset[str], Explanation],
) -> dict[frozenset[str], Explanation]:
    others = [v for v in able_beside(variants, start.words) if v.word not in start.words]
    levels, energy = up_to_likeliest(engine, start.parts)
    out: dict[frozenset[str], Explanation] = {}
    found_words = by_word(score(engine, levels, others, energy))
    promising = sorted(found_words, key=lambda w: -marginal(found_words[w]))[:_PROMISING]
    for word in promising:
        words = start.words | {word}
        for scored in (found_words[word], _elsewhere(start, found_words[word])):
            if not scored:
                continue
            found = joined(engine, start.parts, scored, energy)
            better = out.get(words, known.get(words))
            if better is None or better.log_weight < found.log_weight:
                out[words] = found
    return out


def _elsewhere(start: Explanation, scored: list[Scored]) -> list[Scored]:
    """Of springs beside a mechanism, or a mechanism beside springs, those in other joints: a law
    brings the mean stiffness of its own joint, which is no second trouble."""
    words = start.words | {scored[0].variant.word}
    if not (SPRINGS in words and words & MECHANISMS):
        return []
    taken = {j for p in start.parts for j in p.variant.joints}
    apart = [s for s in scored if not taken.intersection(s.variant.joints)]
    return apart if len(apart) < len(scored) else []


def _anew(
    engine: Engine,
    variants: list[Variant],
    start: Explanation,
    pool: dict[frozenset[str], Explanation],
) -> Explanation:
    """With instruments that read what its other effects do, a pose, and what goes through the
    springs, that are looked at beside them, and mechanisms that answer to these, if that is better;
    the variants then hold these as well. Not so where hardly more than noise is left to gain, and
    others of the pool are far ahead; nor where far more is left than any of these corrections, a
    few percent of what the effects do."""
    noise = engine.bench.noise.stated
    if start.eta > max(_GROSS * noise, _MOST_LEFT * engine.structural):
        return start
    found = _with(engine, variants, start, _read_and_placed(engine, start))
    behind = found.log_weight < _best(pool) - _MAY_GAIN
    if behind and found.eta <= noise:
        return found
    for _ in range(_TURNS):  # where the arm stands was found beside a law of the simulated torques
        plain = in_one_joint_each(found)
        fresh = refit_mechanism_variants(engine, plain)
        acting = polished(engine, [*variants, *fresh], plain) if fresh else plain
        if acting.log_weight <= found.log_weight + _TURN_GAINS:
            break
        last = {(v.word, v.answers_to) for v in fresh}  # on the arm as it was found before
        variants[:] = [v for v in variants if (v.word, v.answers_to) not in last] + fresh
        found = _with(engine, variants, acting, _read_and_placed(engine, acting))
    return found


_TURNS, _TURN_GAINS = 4, 3.0  # at most; nats
_GROSS, _MOST_LEFT = 6.0, 0.3  # times the noise; of what springs leave


def _with(
    engine: Engine, variants: list[Variant], start: Explanation, fresh: list[Variant]
) -> Explanation:
    """Polished with fresh variants, which the variants then hold as well."""
    if not fresh:
        return start
    variants += fresh
    return polished(engine, variants, start)


def _read_and_placed(engine: Engine, start: Explanation) -> list[Variant]:
    """What reads all that moves, stands elsewhere, or goes through springs that are off."""
    return [
        *reading_all(engine, start),
        *refit_pose_variants(engine, start),
        *relinearised_variants(engine, start),
    ]


def _sharpened(engine: Engine, ranked: list[Explanation]) -> list[Explanation]:
    """With the evidence of those that matter between the levels of imperfection, best first: of
    what is near the best, and of what that is compared with for what its further effects bring.
    What was stated was looked at between them before, and shuts out nobody by what it gained there;
    but for what laws of the simulation's own effects may leave."""
    done: dict[frozenset[str], Explanation] = {}
    stated = _base_at(engine, 0) + LOG_NONE if engine.bench.known is None else np.inf
    first = max(e.log_weight if e.parts else min(e.log_weight, stated) for e in ranked)
    most = 0.0
    for _ in range(_SHARPENED):
        ranked = sorted((done.get(e.words, e) for e in ranked), key=lambda e: -e.log_weight)
        best = ranked[0].log_weight
        least = min(first, best) - _WINDOW / 2  # what is not done yet may gain, too
        todo = [e for e in ranked if e.parts and e.words not in done]
        near = [e for e in todo if e.log_weight > least]
        simpler = (e for e in todo if any(e.words < words for words in done))
        asked = [*near, *(e for e in simpler if e.log_weight > best - most - _BROUGHT)]
        if not asked:
            break
        e = asked[0]
        level = int(np.argmin(np.abs(engine.etas - e.eta)))
        more = gained(engine, e.parts, part_sizes(engine, e.parts, level).energy)
        most = max(most, more)
        done[e.words] = replace(
            e, log_weight=e.log_weight + more, log_adequate=e.log_adequate + more
        )
    return sorted((done.get(e.words, e) for e in ranked), key=lambda e: -e.log_weight)
