"""Whether explanations earn their weight on withheld data.

An explanation is fitted without a repetition and judged on it. One that is far off there has fitted
this session and nothing that repeats: it loses weight, softly about the limit, to one with fewer of
the same effects, or to `unknown`.

Of a rig without an arm, one of two effects may foretell what was withheld better than both do: then
the other one is freedom of its law, and it speaks for both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Ints
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation, SearchResult, soft_limit
from identification.gap.explanations.fit import Fit, fit
from identification.gap.explanations.verdict import PASSES_ABOVE, passed_validation, with_posterior
from identification.gap.judging.heldout import folds, held_out
from identification.gap.judging.residuals import noise_rms, residual_rms
from identification.gap.judging.unread_ramps import unread_ramp_error
from identification.gap.model.bench import Bench
from identification.gap.words import (
    BETWEEN_RUNS,
    DRIFTS,
    FRICTION,
    LATE,
    LINEAR,
)

FAILS = 1.9  # times the noise: then a repetition was not foreseen
# Of the noise: what a fit to all repetitions leaves, too, is no failure to foresee one of them. The
# noise within holds may be less than that between them, or stated too small.
LEAVES = 1.6
CLOSED = 0.22  # of what the effects move: if no more is left, it was foreseen all the same
_LOOKED_AT, _WITHIN = 6, 9.0  # explanations, and nats below the best, that are looked at


def reweighted_by_validation(found: SearchResult) -> SearchResult:
    """The posterior after a look at withheld repetitions: the weights of the explanations that
    matter, times the share that these leave them. As it was where nothing can be withheld.
    Representatives that are registered already stay."""
    ways = folds(found.engine)
    if ways and _comes_again(found.engine.bench):
        simpler = _foretold(found, *next(iter(ways.items()))) | dict(found.representatives)
        found = (
            with_posterior(replace(found, representatives=simpler), found.kept)
            if simpler
            else found
        )
    fold = ways.get("repetition")
    if fold is None:
        return found
    kept: dict[frozenset[str], float] = {}
    for _ in range(_LOOKED_AT):
        todo = [e for e in _weighty(found, kept) if e.words not in kept]
        if not todo:
            break
        kept[todo[0].words] = _kept(found, todo[0], fold)
    return with_posterior(found, kept)


def predicts_held_out(found: SearchResult) -> bool:
    """Whether the best explanation foretells withheld repetitions, or nobody can look."""
    fold, best = folds(found.engine).get("repetition"), found.explanations[0]
    return fold is None or not best.parts or _kept(found, best, fold) > PASSES_ABOVE


def _comes_again(bench: Bench) -> bool:
    """Of a rig without an arm, whether what is withheld is met elsewhere too: the end of one pull
    nothing foretells."""
    return not bench.data.arm and bench.load_history.passes > _PASSES


_PASSES = 2


def _foretold(found: SearchResult, name: str, fold: Ints) -> dict[frozenset[str], Explanation]:
    """Of explanations with two effects that matter, the one effect that foretells withheld data
    better than both: words that stand for each other foretell the same; of two that do, alike, the
    one that explains more. What comes late speaks for no friction at one rate, at which they do the
    same; what another one speaks for speaks for none. What a drift does nothing foretells: where it
    is the larger one, another has to be plainly better to speak for both."""
    first, out = found.explanations[0].log_weight, {}
    pairs = [e for e in found.explanations[:_PAIRS] if e.log_weight > first - _NEAR]
    for both in (e for e in pairs if len(e.words) == 2):
        drifts = both.parts[0].word in BETWEEN_RUNS
        most = held_out(found.engine, both, name, fold).after * (_PLAINLY if drifts else _BETTER)
        rubs = found.engine.bench.load_history.one_rate and both.words & FRICTION
        mute = BETWEEN_RUNS | LATE if rubs else BETWEEN_RUNS
        fewer = [e for e in found.explanations if e.words < both.words and e.words - mute]
        each = [e for e in fewer if e.words not in found.representatives]
        after = [held_out(found.engine, e, name, fold).after for e in each]
        best = min(after, default=most)
        limit = min(_ALIKE * best, most)
        speaker = next((e for e, a in zip(each, after, strict=True) if a < limit), None)
        if speaker is not None:
            out[both.words] = speaker
    return out


_PAIRS, _NEAR = 3, 25.0  # so many of the best, and nats below the first, are looked at
_BETTER, _PLAINLY, _ALIKE = 0.98, 0.5, 1.1


def _weighty(found: SearchResult, kept: dict[frozenset[str], float]) -> list[Explanation]:
    """Explanations with effects that matter, the heaviest (with what it keeps) first."""
    weight = {
        e.words: e.log_weight + float(np.log(kept.get(e.words, 1.0) + 1e-300))
        for e in found.explanations
        if e.parts
    }
    if not weight:
        return []
    best = max(weight.values())
    matter = [e for e in found.explanations if e.parts and weight[e.words] > best - _WITHIN]
    heavy = [e for e in matter if e.words in kept]
    failed = [h.words for h in heavy if not passed_validation(kept, h.words)]
    fewer = [
        e for e in found.explanations if e.parts and e.adequate and any(e.words < w for w in failed)
    ]
    return [*matter, *[e for e in fewer if e not in matter]]


def _kept(found: SearchResult, explanation: Explanation, fold: Ints) -> float:
    """Share of the weight that is kept after a look at withheld repetitions."""
    if explanation.words & DRIFTS and explanation.words <= BETWEEN_RUNS:
        return 1.0
    engine = found.engine
    fitted = fit(engine, explanation)
    if _own_tips(engine, explanation, fitted):
        return 1.0
    loose = DRIFTS if len(explanation.words) <= 2 else frozenset[str]()  # three have to earn it all
    after = held_out(engine, explanation, "repetition", fold, loose).after
    seen = CLOSED * _moved(engine, fitted)
    unseen = engine.bench.rows.rms(unread_ramp_error(engine, fitted))
    noise = noise_rms(engine.bench)
    known = float(np.clip(residual_rms(engine, fitted), noise, LEAVES * noise))
    limit = max(FAILS * known, float(np.hypot(seen, unseen)))
    return soft_limit(after, limit)


def _own_tips(engine: Engine, explanation: Explanation, fitted: Fit) -> bool:
    """Whether every run of a rig without an arm was pushed askew in its own way, which the force
    across shows and no other run foretells, and nothing else is left."""
    if engine.bench.data.arm or not all(p.variant.own_tips for p in explanation.parts):
        return False
    return residual_rms(engine, fitted) < FAILS * noise_rms(engine.bench)


def _moved(engine: Engine, fitted: Fit) -> float:
    """rms (m) of what the effects that are no linear laws move, at least the gap's structure."""
    moved = fitted.together(engine, {p.word for p in fitted.parts} - LINEAR)
    return max(engine.structural, engine.bench.rows.rms_about_means(moved))
