"""What is to be known of what was found: what it leaves out, misses, or asks for."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

import numpy as np

from identification.gap.answer.notes import FAULT, REMARK, UNDECIDED, Note
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.fit import Fit, fit
from identification.gap.explanations.verdict import FLANKS, flanks_of_one_joint, troubles_named
from identification.gap.judging.heldout import HeldOut
from identification.gap.judging.limit_violation import limit_violation
from identification.gap.judging.prior_conflict import what_is_strained
from identification.gap.judging.residuals import noise_rms
from identification.gap.model.bench import Bench
from identification.gap.model.noise import SWINGS
from identification.gap.words import BETWEEN_RUNS


def across(bench: Bench, chosen: Explanation) -> tuple[Note, ...]:
    """Of an effect that other readings show, and nothing moves by."""
    each = zip(chosen.parts, chosen.sizes, strict=True)
    shown = [p for p, s in each if p.variant.shown > 1 and s < _MOVES * bench.noise.stated]
    if not shown:
        return ()
    text = (
        "The force across the direction shows that the load acts askew; the displacement does not "
        "move by it."
    )
    if len(shown) == len(chosen.parts):
        text += " What makes the gap smaller is springs and gains within what META states."
    return (Note(REMARK, text),)


_MOVES = 0.2  # of the noise of a sample


def left_out(chosen: Explanation, fuller: Explanation | None, after: float) -> tuple[Note, ...]:
    """Of effects that do too little to be named, though with them (fuller) more is explained.
    after: rms m that is left without them."""
    if fuller is None or fuller.words <= chosen.words:
        return ()
    small = {w: s for w, s in fuller.rms_by_word.items() if w not in chosen.words}
    larger = max(small.values()) > max(chosen.rms_by_word.values())
    most = max(small.values()) > _MOST_LEFT * after
    text = (
        f"{' and '.join(f'{w} ({1e3 * s:.2g} mm rms)' for w, s in small.items())} beside it would "
        f"explain {fuller.log_weight - chosen.log_weight:.0f} nats more"
        f"{f', most of the {1e3 * after:.2g} mm that are left' if most else ''}. "
        f"So {'few nats' if larger else 'little'} beside {' and '.join(chosen.rms_by_word)} may as "
        "well be how far that law is off: it is not named. To see it: "
        f"{' '.join(f'--add {w}' for w in small)}."
    )
    return (Note(REMARK, text),)


_MOST_LEFT = 0.5


def not_foretold(held: Iterable[HeldOut], words: Collection[str]) -> tuple[Note, ...]:
    """Of withheld data that the effects found, with these words, don't make smaller."""
    worse = [h.fold for h in held if h.shrink < _NO_WORSE]
    if not worse or not words:
        return ()
    folds = " and ".join(dict.fromkeys(worse))
    drifts = sorted(BETWEEN_RUNS & set(words))
    text = (
        f"Withheld {folds}: the effects found leave more there than the simulation as it stands. "
        + (
            f"Of {' and '.join(drifts)} that is no wonder: no run foretells what another one does."
            if drifts
            else "They were fitted to what others don't share, or hold of these alone."
        )
    )
    return (Note(UNDECIDED, text),)


_NO_WORSE = 0.98  # times: so much is chance


def at_few_readings(engine: Engine, fitted: Fit, after: float) -> tuple[Note, ...]:
    """Where what is left is small beside noise that few readings have, and large beside that of
    most of them. after: rms m that is left."""
    bench = engine.bench
    own = fitted.missed_responses(engine)
    typical, ratio = float(np.median(np.abs(own))), after / noise_rms(bench)
    if not typical > max(_STANDS_OUT, 2 * ratio):
        return ()
    text = (
        f"Half of the readings miss by more than {typical:.0f} times their own noise: the noise "
        "above is that of few readings, where the response is steep."
    )
    return (Note(REMARK, text),)


_STANDS_OUT = 3.0  # standard deviations


def there_already(plain: Explanation, forced: Collection[str]) -> tuple[Note, ...]:
    """Of effects that were to be added to an explanation that has them."""
    words = sorted(plain.words & set(forced))
    if not words:
        return ()
    are = "are effects" if len(words) > 1 else "is an effect"
    return (Note(REMARK, f"{' and '.join(words)} {are} that was found anyway: nothing is added."),)


def called(found: SearchResult, chosen: Explanation, verdict: str) -> tuple[Note, ...]:
    """Of a play and a curve of one joint of an arm, why the smaller one is the verdict."""
    arm = found.engine.bench.data.arm
    if not arm or verdict not in FLANKS or not flanks_of_one_joint(chosen):
        return ()
    (other,), named = FLANKS - {verdict}, troubles_named(chosen, found.explanations)
    if other in named or chosen.rms_by_word[verdict] > chosen.rms_by_word[other]:
        return ()
    text = (
        f"{verdict} and {other} of one joint are one trouble: the flanks of a play are curved. It "
        "is called by the one that explains more without the other."
    )
    return (Note(REMARK, text),)


def readings_missed(engine: Engine, fitted: Fit) -> tuple[Note, ...]:
    """Of joints that turn otherwise than an explanation has it: where the displacement's gap is
    large, its law may be so far off, and a joint that bends a little is a spring for all it
    knows."""
    return tuple(
        Note(
            REMARK,
            f"Joint {j + 1} turns otherwise than the effects found have it, by up to "
            f"{1e3 * m.most:.2g} mrad, "
            f"{m.beyond:.0f} times (rms) what its readings scatter: its stiffness is a mean over "
            "these loads.",
        )
        for j, m in joints_missed(engine, fitted).items()
    )


class Missed(NamedTuple):
    """By how much an explanation misses the readings of a joint: most rad; beyond: rms, times their
    noise; share: rms, of the way that the joint turns."""

    most: float
    beyond: float
    share: float


def joints_missed(engine: Engine, fitted: Fit) -> dict[int, Missed]:
    """Of joints (from 0) that plainly turn otherwise than an explanation has it."""
    bench = engine.bench
    if not bench.has_q:
        return {}
    missed, noise = fitted.missed_readings(engine)
    turned = np.ptp(bench.observed[bench.layout.q].reshape(missed.shape), axis=1)
    beyond = np.sqrt(np.mean((missed / noise) ** 2, axis=1))
    most, rms = np.abs(missed).max(axis=1), np.sqrt(np.mean(missed**2, axis=1))
    off = np.flatnonzero((beyond > _MISSED) & (most > _OF_WAY * turned))
    return {
        int(j): Missed(float(most[j]), float(beyond[j]), float(rms[j] / turned[j])) for j in off
    }


_MISSED, _OF_WAY = 5.0, 0.05  # times the noise; of the way that the joint turns


def springs_far_off(engine: Engine, fitted: Fit) -> tuple[Note, ...]:
    """Of springs that come out farther from what was simulated than what META states lets expect,
    where that alone is no effect: it is where the gap went."""
    base, data, out = engine.base, engine.bench.data, []
    for j, i in base.springs.items():
        off = float(fitted.base[i] / base.sd[i])
        if abs(off) < (_FAR_OFF_OF_MANY if data.arm else _FAR_OFF):
            continue
        ratio = max(1 + float(fitted.base[i]), _TINY)
        stiffer = ratio if engine.bench.imposed and not data.arm else 1 / ratio
        of = data.spring_name(j) if data.arm else f"the spring along {data.spring_name(j)}"
        text = (
            f"To explain that, {of} has to be {stiffer:.3g} times as stiff as simulated, "
            f"{abs(off):.1f} standard deviations of what META states: see to that number."
        )
        out.append(Note(REMARK, text))
    return tuple(out)


_FAR_OFF, _FAR_OFF_OF_MANY, _TINY = 2.0, 3.0, 1e-6  # standard deviations


def disbelieved(found: SearchResult, verdict: str) -> tuple[Note, ...]:
    """Why the best explanation was not believed, where that is what it does, or what an arm's asks
    for: META may state too little, and only its author can tell."""
    best, swings = found.explanations[0], found.engine.bench.noise.swings
    if verdict != "unknown":
        return ()
    words, fitted = " and ".join(best.rms_by_word), fit(found.engine, best)
    off, word = limit_violation(found.engine, best, fitted)
    asks = what_is_strained(found.engine, fitted, best.eta) if found.engine.bench.data.arm else ""
    look = " See whether META states too small an uncertainty." if asks else ""
    if off > 1:
        also = f"asks for {asks}" if asks else "what is allowed explains less"
        text = (
            f"What explains the gap best ({words}) takes a {word} outside what that word allows, "
            f"and {also}: it was not believed.{look}"
        )
        return (Note(REMARK, text),)
    if not found.engine.bench.data.arm:
        return ()
    if not best.parts and swings > SWINGS:
        text = (
            f"While nothing changes the displacement swings by {swings:.1f} times what is stated "
            "of one sample: a vibration, or a pick-up of the mains. Find it before you go on."
        )
        return (Note(FAULT, text),)
    if not asks:
        return ()
    what = f"What explains the gap best ({words})" if words else "Without any effect, the best fit"
    text = f"{what} asks for {asks}: it was not believed.{look}"
    return (Note(REMARK, text),)
