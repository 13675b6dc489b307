"""What explanations leave, looked at row by row.

The levels of imperfection are a coarse grid, of what may repeat from run to run as of what a row
has to itself: they rank explanations, but they don't say how much of the gap is left. For those
that matter that is looked up in the data.
"""

from __future__ import annotations

from dataclasses import replace
from math import log

import numpy as np

from identification.gap.evidence.engine import Engine
from identification.gap.evidence.imperfection import STEP
from identification.gap.explanations.explanation import (
    LAW_REMAINDER,
    Explanation,
    SearchResult,
    soft_limit,
    tolerated_residual,
)
from identification.gap.explanations.fit import Fit, fit
from identification.gap.explanations.verdict import (
    ARM_AS_STATED,
    AS_STATED,
    may_inherit,
    tolerated_misfit,
    with_posterior,
)
from identification.gap.judging.creep_or_lag import but_lags
from identification.gap.judging.dead_zone import spoken_for
from identification.gap.judging.limit_violation import limit_violation
from identification.gap.judging.paths import is_implausible_drift
from identification.gap.judging.prior_conflict import LIMIT, most_off, prior_conflict
from identification.gap.judging.residuals import (
    excess_joint_reading_rms,
    excess_response_rms,
    noise_rms,
    sample_rms,
)
from identification.gap.judging.stated import led_by_springs
from identification.gap.judging.unread_ramps import unread_ramp_error
from identification.gap.model.noise import UNSURE
from identification.gap.words import CURVES, FRICTION, LINEAR

# An elastic curve that falls while it is pushed on, or a force that is nearly lost, as none is that
# has made something yield or slide: a snap, a slip, a crack are likelier.
SNAPS, _FALL, _LOST = 0.1, 0.15, 0.6  # share that is kept; falls, of the range: beyond noise, most
LET_GO = 1e-8  # share that is kept where forces let go at once: no law does that
# Share that is kept by what uses up work where every loop gives some out.
GIVES_OUT, USES_UP = 1e-4, FRICTION | {"joint_backlash", "joint_creep"}
COMES_BACK = 14.0  # nats against a drift of the channel that reads the same whenever it is let go
BUT_A_LAG = 1e4  # nats against a creep that is but a lag: beyond what any data bring
_WANDERING = {"force": "thermal_drift", "displacement": "force_drift", None: ""}
FAULTY = 0.1  # share that is kept by laws of load and time where an instrument fails
# Times the noise that samples of a rig without an arm miss where nothing is said to be wrong: rows
# average fast swings away, and were these noise, second differences would have told so much of it.
SWINGS = 2.5
# What takes any path in time is bound by no law that could be off: as the main cause it leaves
# hardly anything of what springs leave. Of a stand that slips once, and stays there, it leaves a
# sixth beside the jump; the drifts of the blind check leave 0.03 at most.
OF_ANY_PATH = 0.1
NO_DRIFT = 0.03  # share that is kept by a drift that goes as none does
_LOOKED_AT, _WITHIN = 12, 40.0  # explanations, and nats below the best, that are looked at


def reweighted_by_residuals(found: SearchResult) -> SearchResult:
    """The posterior after checks of what the best explanations leave: row residuals against those
    that are tolerated, limits of the words, prior conflict. Faults of the instruments are looked
    for first."""
    engine = found.engine
    if engine.bench.load_history.faults:
        doubted = [
            replace(e, log_adequate=e.log_adequate + log(FAULTY)) for e in found.explanations
        ]
        return with_posterior(replace(found, explanations=tuple(doubted)), found.kept)
    judge = _checked_on_arm if engine.bench.data.arm else _checked_armless
    first = _near(found.explanations)
    done = {e.words: judge(engine, e) for e in first if e.parts}
    for none in (e for e in first if not e.parts):
        fitted = fit(engine, none)
        off = most_off(engine, fitted)
        if not engine.bench.data.arm:  # nothing is wrong while springs and gains are as stated
            share = soft_limit(off, AS_STATED)
            less = _less_likely(none, -float(np.log(max(share, 1e-300))))
            if sample_rms(engine.bench, fitted.whole(engine)) > SWINGS * noise_rms(engine.bench):
                less = replace(less, log_adequate=less.log_adequate + log(FAULTY))
            done[none.words] = less
            continue
        asked = max(prior_conflict(engine, fitted, none.eta), off * LIMIT / ARM_AS_STATED)
        done[none.words] = _unstrained(none, asked)
        clean = excess_response_rms(engine, fitted) < engine.bench.noise.stated
        if clean and off < AS_STATED:
            for_nothing = [e for e in done.values() if e.parts and e.words <= STATED]
            done |= {e.words: _less_likely(e, FOR_NOTHING) for e in for_nothing}
    if engine.bench.data.arm:  # what these lose, now or by what they foretell, goes to others
        closely, them = tolerated_misfit(engine), list(done.values())
        lost = [e.words for e in them if not e.adequate]
        heirs = [
            e
            for e in found.explanations
            if any(may_inherit(e, other, closely) for other in them)
            or (e.parts and any(e.words < w for w in lost))
        ]
        done |= {e.words: judge(engine, e) for e in heirs if e.words not in done}
    else:
        every = (*found.explanations, *found.unmodelled)
        done |= {e.words: _less_likely(e, BUT_A_LAG) for e in but_lags(engine, every)}
    done |= {e.words: judge(engine, e) for e in _near(found.unmodelled) if e.words not in done}
    active = engine.bench.load_history.gives_out > 0
    out, unmodelled = (
        tuple(
            _passive(e) if active else e
            for e in sorted((done.get(e.words, e) for e in each), key=lambda e: -e.log_weight)
        )
        for each in (found.explanations, found.unmodelled)
    )
    found = replace(found, explanations=out, unmodelled=unmodelled)
    if not engine.bench.data.arm:
        found = replace(found, representatives=spoken_for(engine, out))
        found = led_by_springs(found, _near(out))
    return with_posterior(found, found.kept)


def _near(ranked: tuple[Explanation, ...]) -> list[Explanation]:
    """Explanations that matter, of some that are ranked."""
    return [e for e in ranked[:_LOOKED_AT] if e.log_weight > ranked[0].log_weight - _WITHIN]


def _checked_on_arm(engine: Engine, explanation: Explanation) -> Explanation:
    """Of an arm: with as much of its weight as what it leaves allows it, of the displacement and of
    the joint readings, the less the more words are spent; with no more than what the sizes of the
    imperfection allow where these are far beyond: another channel, which the rows of the response
    do not show, asks for them."""
    allowed = _allowed(engine, explanation, engine.bench.noise.stated, words=len(explanation.words))
    fitted = fit(engine, explanation)
    share = soft_limit(
        max(excess_response_rms(engine, fitted), excess_joint_reading_rms(engine, fitted)), allowed
    )
    if is_implausible_drift(engine, fitted):
        share *= NO_DRIFT
    good = explanation.log_weight + float(np.log(max(share, 1e-300)))
    hands = engine.bench.rows.rms(unread_ramp_error(engine, fitted))
    if explanation.eta > STEP * float(np.hypot(allowed, hands)):  # so much the grid may be off
        good = min(good, explanation.log_adequate)
    asked = max(
        prior_conflict(engine, fitted, explanation.eta), _outside(engine, explanation, fitted)
    )
    off = most_off(engine, fitted)
    return _unstrained(replace(explanation, log_adequate=good, off=off), asked)


def _passive(explanation: Explanation) -> Explanation:
    """Where loops give out work: with little of its weight if its largest effect uses up work, or
    one does and nothing is late."""
    late = "time_lag" in explanation.words
    asked = {p.word for p in explanation.parts[: 1 if late else None]}
    if not asked & USES_UP:
        return explanation
    return replace(explanation, log_adequate=explanation.log_adequate + log(GIVES_OUT))


def _outside(engine: Engine, explanation: Explanation, fitted: Fit) -> float:
    """How far it lies outside the limits of its words, as what it asks of its priors is judged: by
    the square, as what others' laws do within is told sharply from what they don't."""
    return LIMIT * limit_violation(engine, explanation, fitted)[0] ** 2


def _unstrained(explanation: Explanation, asked: float) -> Explanation:
    """With as much of its weight as what it asks of its priors allows it."""
    kept = float(np.log(max(soft_limit(asked, LIMIT), 1e-300)))
    return replace(explanation, log_adequate=explanation.log_adequate + kept)


def _less_likely(explanation: Explanation, nats: float) -> Explanation:
    e = explanation
    return replace(e, log_weight=e.log_weight - nats, log_adequate=e.log_adequate - nats)


# Nats against an arm's explanations by linear effects alone where all is explained without them as
# it was stated: what springs and gains do within that is no fault. Of 245 linear faults of the
# blind check that do three times the noise six gains alone lay there, which have bounds of their
# own (`penalties.within_stated`); of 107 cases without a fault all.
FOR_NOTHING = 10.0
STATED = LINEAR - {"force_scale", "displacement_scale"}


def _allowed(engine: Engine, explanation: Explanation, unseen: float, words: int = 1) -> float:
    """What an explanation may leave, m. unseen: what noise hides."""
    remainder = tolerated_residual(engine, explanation.rms_by_word)
    if engine.bench.data.arm and explanation.parts[0].variant.free_pieces:
        remainder = min(remainder, OF_ANY_PATH * engine.structural)
    law = min(LAW_REMAINDER * max(explanation.sizes), remainder)
    return float(max(remainder / words**0.5, law, unseen))


def _checked_armless(engine: Engine, explanation: Explanation) -> Explanation:
    """With the share of its weight that it keeps by what it leaves beyond the noise."""
    course = engine.bench.load_history
    if explanation.parts[0].word == _WANDERING[course.wanders]:
        return _less_likely(explanation, COMES_BACK)
    fitted = fit(engine, explanation)
    left = excess_response_rms(engine, fitted)
    if course.only_a_curve and explanation.words <= CURVES:
        left = 0.0  # a curve as well: no reading of such a table stands off the next ones
    share = soft_limit(left, _allowed(engine, explanation, UNSURE * engine.bench.noise.stated))
    fall = course.fall
    gives = (fall > _FALL and explanation.words & CURVES) or (
        fall > _LOST and explanation.words & FRICTION
    )
    if course.let_go:
        share *= LET_GO
    elif gives:
        share *= SNAPS
    else:
        share = max(share, float(np.exp(explanation.log_adequate - explanation.log_weight)))
    good = explanation.log_weight + float(np.log(max(share, 1e-300)))
    outside = _outside(engine, explanation, fitted)
    return _unstrained(replace(explanation, log_adequate=good), outside)
