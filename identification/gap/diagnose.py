"""The diagnosis: which effect, where, how far the gap shrinks, what to measure next."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from identification.arrays import Ints
from identification.gap.answer.discriminate import NextMeasurement, Others, next_measurement
from identification.gap.answer.forms import Form
from identification.gap.answer.known import knowing
from identification.gap.answer.locate import NOWHERE, Where, locate
from identification.gap.answer.notes import FAULT, REMARK, Note, notes_of, ordered
from identification.gap.answer.posterior import Known, settled
from identification.gap.answer.scale import off_scale
from identification.gap.answer.twins import twin_of
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.explanations.explanation import Explanation, Likeness, SearchResult
from identification.gap.explanations.fit import Fit, fit
from identification.gap.judging.choice import chosen_of
from identification.gap.judging.earned import earned, left_of, noise_of, sample_rms
from identification.gap.judging.heldout import HeldOut, folds, held_out, stated_prediction
from identification.gap.judging.leftover import looked_up
from identification.gap.judging.strain import what_is_strained
from identification.gap.laws.interval import Parameter
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.noise import SWINGS
from identification.gap.model.variants import Variant
from identification.gap.recording.ends import without_ends
from identification.gap.recording.faults import SIGNS, SILENT
from identification.gap.recording.glitches import without_glitches
from identification.gap.recording.ramps import ramps_told
from identification.gap.recording.slack import without_slack
from identification.gap.search.breaks import troubles_of, with_plain_trouble
from identification.gap.search.refine import refine
from identification.gap.search.search import force, search
from identification.gap.search.strange import with_strangers
from identification.gap.search.unseen import unseen
from identification.gap.words import WORDS

# Nats within which two words explain data equally well: odds of 100 to 1 prove nothing while the
# laws themselves are only families.
ALIKE = 4.6
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class EffectFound:
    """One effect of the chosen explanation; probability: that it is present at all. places:
    "joint 3", "axis y" or, without an arm, "direction x" -> probability that it sits there, the
    likeliest first."""

    name: str
    label: str
    probability: float
    parameters: dict[str, Parameter]
    places: dict[str, float]
    indistinguishable_from: tuple[str, ...]
    share_of_gap: float
    size: float  # rms, m


@dataclass(frozen=True, eq=False)
class GapResult:
    """All lengths in m. before, after, noise: rms over samples. held_out: the main fold first.

    runners_up: word -> rms after on the main fold, of the best explanations by other words.
    remainder: imperfection that the laws are taken to have, of no law for `unknown`; what is left
    on average stands in `after`. looks_like: of an unknown gap, where that is plain. without_added:
    `after` without the words that were to be added; None where there were none, or the
    explanation had them. said: what is to be known beside, by kind.
    """

    verdict: str
    probabilities: dict[str, float]
    effects: tuple[EffectFound, ...]
    where: Where
    noise: float
    before: float
    after: float
    held_out: tuple[HeldOut, ...]
    runners_up: dict[str, float]
    next_measurement: NextMeasurement | None
    remainder: float
    looks_like: Likeness | None
    said: tuple[Note, ...]
    bench: Bench
    engine: Engine
    fit: Fit
    found: SearchResult
    without_added: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects, each once: one mechanism may sit in several joints."""
        return tuple(dict.fromkeys(e.name for e in self.effects))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is said, without its kind."""
        return tuple(n.text for n in self.said)


def diagnose_gap(
    data: GapData,
    *,
    withhold: Iterable[str] = (),
    add: Iterable[str] = (),
    known: Sequence[Form] = (),
    others: Others | None = None,
    progress: Progress | None = None,
) -> GapResult:
    """The diagnosis of a data set. withhold: words taken out of the library; add: words that the
    explanation must contain beside what it has; known: effects that the simulation has; others:
    setups that the rig could take up next. Raises ValueError for unknown words, NotKnown for
    effects that can't be known here, NotShown for words to add that these data can't show."""
    _, whole = explain_gap(
        data, withhold=withhold, add=add, known=known, others=others, progress=progress
    )
    return whole()


def explain_gap(
    data: GapData,
    *,
    withhold: Iterable[str] = (),
    add: Iterable[str] = (),
    known: Sequence[Form] = (),
    others: Others | None = None,
    progress: Progress | None = None,
) -> tuple[GapResult, Callable[[], GapResult]]:
    """The diagnosis but for what to measure next, for who need not wait for that, and what makes it
    whole; otherwise as `diagnose_gap`."""
    tell = progress or _silent
    withheld, forced = set(withhold), frozenset(add)
    check_words(withheld | forced)
    tell("preparing", 0.0)
    bench = make_bench(without_slack(without_glitches(without_ends(ramps_told(data)))))
    engine, variants = _prepared(bench, known, withheld)
    _check_shown(forced, variants)
    tell("comparing effects", 0.2)
    found = _with_unseen(_searched(engine, variants), known, withheld)
    tell("withheld data", 0.7)
    found = earned(found)
    verdict = max(found.probabilities, key=lambda w: found.probabilities[w])
    plain = chosen_of(found, verdict)
    chosen = force(found.engine, found.variants, found.explanations, plain, forced)
    chosen, each = settled(found.engine, found.variants, chosen, found.explanations)
    result = _with_twins(_result(found, verdict, chosen, each), chosen, withheld)
    if not forced <= plain.words:
        result = replace(result, without_added=left_of(found.engine, fit(found.engine, plain)))

    def whole() -> GapResult:
        tell("what to measure next", 0.9)
        following = _next(found, chosen, result, others)
        tell("done", 1.0)
        return replace(result, next_measurement=following)

    return result, whole


def _prepared(
    bench: Bench, known: Sequence[Form], withheld: Collection[str]
) -> tuple[Engine, list[Variant]]:
    """What explanations are scored by, and the library's variants."""
    bench = knowing(bench, known)
    base = base_columns(bench)
    target = bench.observed - prediction(bench)
    variants = library(bench, [w for w in WORDS if w not in withheld])
    return Engine(bench, base, target, eta_levels(bench, base, target)), variants


def _searched(engine: Engine, variants: Sequence[Variant]) -> SearchResult:
    """The search over explanations, with finer variants as well, and those of troubles that no word
    names."""
    singles = score(engine, engine.levels, variants)
    finer = refine(engine, singles)
    nameless = troubles_of(engine.bench, engine.base, engine.target)
    for fresh in (finer, nameless):
        if fresh:
            singles += score(engine, engine.levels, fresh)
    found = search(engine, [*variants, *finer, *nameless], singles)
    return looked_up(with_strangers(with_plain_trouble(found)))


def _with_unseen(
    found: SearchResult, known: Sequence[Form], withheld: Collection[str]
) -> SearchResult:
    """The search once more with loads between readings, where these explain more than it costs to
    say which they are."""
    more = unseen(found)
    if more is None:
        return found
    bench = found.engine.bench
    rows = replace(bench.rows, overshoot=more.overshoot)
    again = _searched(*_prepared(make_bench(bench.data, rows=rows), known, withheld))
    gain = again.explanations[0].log_weight - found.explanations[0].log_weight
    return again if gain > more.cost else found


class NotShown(ValueError):
    """A word that the data at hand could not show."""


def _check_shown(forced: frozenset[str], variants: Sequence[Variant]) -> None:
    shown = dict.fromkeys(v.word for v in variants)
    for word in sorted(forced - shown.keys()):
        raise NotShown(
            f"{word} is nothing that these data could show; they could: "
            f"{', '.join(shown) or 'no effect'}"
        )


def _silent(_: str, __: float) -> None:
    """Progress that nobody looks at."""


def check_words(words: set[str] | frozenset[str]) -> None:
    """Raises ValueError for a word that is no effect."""
    for word in sorted(words):
        if word not in WORDS:
            raise ValueError(f'"{word}" is no effect; known: {", ".join(WORDS)}')


def _result(
    found: SearchResult, verdict: str, chosen: Explanation, known: list[Known]
) -> GapResult:
    engine, bench = found.engine, found.engine.bench
    n = bench.rows.n
    fitted = fit(engine, chosen)
    ways = folds(engine)
    held = tuple(held_out(engine, chosen, name, number) for name, number in ways.items())
    springs = fit(engine, next(e for e in found.explanations if not e.parts))
    structural = engine.target[:n] - springs.response
    simulated = stated_prediction(engine)
    scale = off_scale(bench, simulated)
    notes = [*scale, *notes_of(bench, verdict)]
    notes += [*_disbelieved(found, verdict), *_across(bench, chosen)]
    return GapResult(
        verdict=verdict,
        probabilities=found.probabilities,
        effects=_effects(found, chosen, known),
        where=NOWHERE if verdict == "none" else locate(engine, fitted, chosen.sizes, structural),
        noise=noise_of(bench),
        before=sample_rms(bench, simulated),
        after=left_of(engine, fitted),
        held_out=held,
        runners_up=_runners_up(engine, found, verdict, ways),
        next_measurement=None,
        remainder=found.unknown_eta if verdict == "unknown" else chosen.eta,
        looks_like=None if scale else _likeness(found, verdict),
        said=ordered(notes),
        bench=bench,
        engine=engine,
        fit=fitted,
        found=found,
    )


def _likeness(found: SearchResult, verdict: str) -> Likeness | None:
    """Of an unknown gap; none of one whose channels count in opposite senses, or of which one says
    nothing."""
    course = found.engine.bench.course
    if verdict != "unknown" or any(f.kind in (SIGNS, SILENT) for f in course.faults):
        return None
    return found.looks_like


def _effects(
    found: SearchResult, chosen: Explanation, known: list[Known]
) -> tuple[EffectFound, ...]:
    all_of_them = (*found.explanations, *found.nameless)
    weights = np.array(
        [e.log_good + log(found.kept.get(e.words, 1.0) + 1e-300) for e in all_of_them]
    )
    share = np.exp(weights - weights.max())
    total = float(share.sum())
    squares = np.array(chosen.sizes) ** 2 if chosen.sizes else np.zeros(0)
    power = float(squares.sum())
    out = []
    for i, part in enumerate(chosen.parts):
        present = sum(
            float(s) for e, s in zip(all_of_them, share, strict=True) if part.word in e.words
        )
        out.append(
            EffectFound(
                name=part.word,
                label=part.variant.label,
                probability=min(1.0, present / total),
                parameters=known[i].parameters,
                places=_placed(found.engine.bench.data, known[i].places),
                indistinguishable_from=_alike(found, chosen, part.word),
                share_of_gap=float(squares[i] / power) if power > 0 else 1.0 / len(squares),
                size=float(chosen.sizes[i]),
            )
        )
    return tuple(out)


def _placed(data: GapData, places: dict[str, float]) -> dict[str, float]:
    """Of a rig without an arm the direction in which an effect sits, where there are several."""
    if data.arm:
        return places
    sits = {f"joint {j + 1}": s.direction for s in data.setups for j in np.flatnonzero(s.lever)}
    several = len(sits) > 1
    return {f"direction {sits[p]}": share for p, share in places.items() if several and p in sits}


def _with_twins(result: GapResult, chosen: Explanation, withheld: set[str]) -> GapResult:
    """Effects that no channel tells from the same law elsewhere share their probability with it,
    openly: between the two only priors and grids would decide. The verdict, which they are together
    the likeliest for, stays the most probable word."""
    probabilities, effects = dict(result.probabilities), []
    for i, (effect, part) in enumerate(zip(result.effects, result.fit.parts, strict=True)):
        twin = twin_of(result.engine, part, result.fit.of(i)[0], chosen.eta)
        same = [twin.word] if twin is not None and twin.word not in withheld else []
        alike = tuple(dict.fromkeys([*effect.indistinguishable_from, *same]))
        effects.append(replace(effect, indistinguishable_from=alike))
        if effect.name == result.verdict and same:
            probabilities |= _shared(probabilities, effect.name, same[0])
    return replace(result, effects=tuple(effects), probabilities=probabilities)


def _shared(probabilities: Mapping[str, float], word: str, twin: str) -> dict[str, float]:
    """The same for both, or as much more for the word as another one has."""
    both = probabilities[word] + probabilities[twin]
    others = max(p for w, p in probabilities.items() if w not in (word, twin))
    mine = min(max(both / 2, others), both)
    return {word: mine, twin: both - mine}


def _alike(found: SearchResult, chosen: Explanation, word: str) -> tuple[str, ...]:
    """Words that could stand in for `word` in the explanation, at the same evidence."""
    rest = chosen.words - {word}
    out = []
    for e in found.explanations:
        extra = e.words - rest
        if rest <= e.words and len(extra) == 1 and word not in extra:
            (other,) = extra
            if e.log_weight > chosen.log_weight - ALIKE:
                out.append(other)
    return tuple(out)


def _runners_up(
    engine: Engine, found: SearchResult, verdict: str, ways: dict[str, Ints]
) -> dict[str, float]:
    """The three best explanations by one other word: withheld rms on the main fold."""
    if not ways or verdict == "none":
        return {}
    name, number = next(iter(ways.items()))
    others = [e for e in found.explanations if len(e.words) == 1 and verdict not in e.words]
    return {e.parts[0].word: held_out(engine, e, name, number).after for e in others[:3]}


def _next(
    found: SearchResult,
    chosen: Explanation,
    result: GapResult,
    others: Others | None,
) -> NextMeasurement | None:
    """For the likeliest pair that can't be told apart; for an unsure verdict, its rival."""
    verdict, effects, probabilities = result.verdict, result.effects, result.probabilities
    for e in effects:
        for other in sorted(e.indistinguishable_from, key=lambda w: -probabilities[w]):
            proposal = next_measurement(found, chosen, (e.name, other), others)
            if proposal is not None:
                return proposal
    ranked = sorted(probabilities.items(), key=lambda i: -i[1])
    words = [w for w, p in ranked[:2] if p > 0.02 and w in WORDS]
    if verdict in WORDS and len(words) == 2:
        return next_measurement(found, chosen, (words[0], words[1]), others)
    return None


def _across(bench: Bench, chosen: Explanation) -> tuple[Note, ...]:
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


def _disbelieved(found: SearchResult, verdict: str) -> tuple[Note, ...]:
    """Why an arm's best explanation was not believed, where that is what it asks for: META may
    state too little, and only its author can tell."""
    best, swings = found.explanations[0], found.engine.bench.noise.swings
    if verdict != "unknown" or not found.engine.bench.data.arm:
        return ()
    if not best.parts and swings > SWINGS:
        text = (
            f"While nothing changes the displacement swings by {swings:.1f} times what is stated "
            "of one sample: a vibration, or a pick-up of the mains. Find it before you go on."
        )
        return (Note(FAULT, text),)
    asks = what_is_strained(found.engine, fit(found.engine, best), best.eta)
    if not asks:
        return ()
    words = " and ".join(best.troubles)
    what = f"What explains the gap best ({words})" if words else "Without any effect, the best fit"
    text = (
        f"{what} asks for {asks}: it was not believed. "
        "See whether META states too small an uncertainty."
    )
    return (Note(REMARK, text),)
