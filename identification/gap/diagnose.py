"""The diagnosis: which effect, where, how far the gap shrinks, what to measure next."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from math import inf

from identification.arrays import Flags
from identification.gap.answer.discriminate import NextMeasurement, Others, next_measurement
from identification.gap.answer.forms import Form
from identification.gap.answer.found_notes import there_already
from identification.gap.answer.known import in_question, is_gone, knowing
from identification.gap.answer.notes import ordered
from identification.gap.answer.posterior import settled
from identification.gap.answer.result import ALIKE, GapResult, result_of, with_twins
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.fit import fit
from identification.gap.judging.choice import chosen_of
from identification.gap.judging.cross_validation import (
    learned,
    left_of,
    predicts_held_out,
    reweighted_by_validation,
)
from identification.gap.judging.heldout import first_repetitions
from identification.gap.judging.residual_checks import reweighted_by_residuals
from identification.gap.judging.unread_ramps import acts_only_after_overshoot
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from identification.gap.recording.digits import with_quantization_noise
from identification.gap.recording.ends import without_ends
from identification.gap.recording.force_scatter import with_observed_force_noise
from identification.gap.recording.glitches import without_glitches
from identification.gap.recording.lost_contact import without_lost_contact
from identification.gap.recording.ramps import with_ramps_marked
from identification.gap.search.overshoot_paths import Overshoots
from identification.gap.search.overshoots import by_one_word, overshoots_of_best
from identification.gap.search.refine import refine
from identification.gap.search.search import search, with_forced_words
from identification.gap.search.unmodelled_running import troubles_of, with_plain_trouble
from identification.gap.search.unmodelled_shapes import with_unmodelled_evidence
from identification.gap.words import WORDS

Progress = Callable[[str, float], None]


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
    told = with_observed_force_noise(with_ramps_marked(with_quantization_noise(data)))
    bench = make_bench(without_lost_contact(without_glitches(without_ends(told))))
    engine, variants = _prepared(bench, known, withheld)
    _check_shown(forced, variants)
    tell("comparing effects", 0.2)
    found = _with_unseen(_searched(engine, variants), known, withheld)
    found, gone = _without_what_is_gone(found, bench, known, withheld)
    tell("withheld data", 0.7)
    found = learned(reweighted_by_validation(found), withheld)
    verdict = max(found.probabilities, key=lambda w: found.probabilities[w])
    plain, fuller = chosen_of(found, verdict)
    chosen = with_forced_words(found.engine, found.variants, found.explanations, plain, forced)
    chosen, each = settled(found.engine, found.variants, chosen, found.explanations)
    result = with_twins(result_of(found, verdict, chosen, each, fuller), chosen, withheld)
    result = replace(result, gone=gone)
    if not forced <= plain.words:
        result = replace(result, without_added=left_of(found.engine, fit(found.engine, plain)))
    result = replace(result, said=ordered([*result.said, *there_already(plain, forced)]))

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
    unmodelled = troubles_of(engine.bench, engine.base, engine.target)
    for fresh in (finer, unmodelled):
        if fresh:
            singles += score(engine, engine.levels, fresh)
    found = search(engine, [*variants, *finer, *unmodelled], singles)
    return reweighted_by_residuals(with_unmodelled_evidence(with_plain_trouble(found)))


def _without_what_is_gone(
    found: SearchResult, bench: Bench, known: Sequence[Form], withheld: Collection[str]
) -> tuple[SearchResult, tuple[str, ...]]:
    """The search without those effects of the simulation that are not in the data as it has them,
    and their words: a mechanism was repaired since, or goes on at another load."""
    gone: list[str] = []
    asked = in_question(found)
    while asked:
        word = asked.pop(0)
        kept = [f for f in known if f.word not in (word, *gone)]
        again = _with_unseen(_searched(*_prepared(bench, kept, withheld)), kept, withheld)
        if is_gone(found, again):
            found, gone = again, [*gone, word]
            asked = in_question(found)
    return found, tuple(gone)


def _with_unseen(
    found: SearchResult, known: Sequence[Form], withheld: Collection[str]
) -> SearchResult:
    """The search once more with loads between readings, where these explain more than it costs to
    say which they are, or make foretold what was not."""
    first = found.explanations[0].log_weight
    found, paid = _by_one_word(found, known, withheld)
    paid_off = not paid or found.explanations[0].log_weight - first > _PAYS * paid
    for i in range(_ROUNDS):
        foretold = predicts_held_out(found)
        if _hopeless(found, foretold, paid_off):
            break
        tellers: list[Flags | None] = [] if foretold else [first_repetitions(found.engine)]
        if foretold or i == 0:
            tellers.append(None)  # all rows
        for more in filter(
            None, (overshoots_of_best(found, calibration_rows) for calibration_rows in tellers)
        ):
            again = _better_along(found, more, more.cost - paid, foretold, known, withheld)
            if again is not None:
                break
        else:
            break
        gain = again.explanations[0].log_weight - found.explanations[0].log_weight
        found, paid = again, more.cost
        paid_off = gain > _PAYS * paid
        if foretold:
            break
    return found


def _by_one_word(
    found: SearchResult, known: Sequence[Form], withheld: Collection[str]
) -> tuple[SearchResult, float]:
    """The search once more with the loads that one word alone asks for, and nats that it takes to
    say which, where that word then explains more than the best explanation does without."""
    if _hopeless(found, predicts_held_out(found), paid_off=True):
        return found, 0.0
    best, loads, clean = found.explanations[0].log_weight, None, frozenset[str]()
    for more in by_one_word(found):
        if more.words == clean:  # further lags, which come last
            break
        others = {w for w in WORDS if w not in more.words}
        asking = _along(found, more, known, {*withheld, *others})
        ahead = asking.explanations[0].log_weight - more.cost
        if ahead > best and not acts_only_after_overshoot(asking):
            best, loads = ahead, more
            left = asking.explanations[0].eta > found.engine.bench.noise.stated
            clean = frozenset() if left else more.words
    if loads is None:
        return found, 0.0
    again = _along(found, loads, known, withheld)
    if not _explains_more(again, loads.cost, found, foretold=True):
        return found, 0.0
    return again, loads.cost


def _better_along(
    found: SearchResult,
    more: Overshoots,
    cost: float,
    foretold: bool,
    known: Sequence[Form],
    withheld: Collection[str],
) -> SearchResult | None:
    """The search once more with those loads, where it explains more than these cost, nats; at first
    with the words that ask for them, as all of them take ten times as long."""
    others = [w for w in WORDS if w not in more.words]
    asking = _along(found, more, known, {*withheld, *others})
    if not _explains_more(asking, cost - _OTHERS, found, foretold):
        return None
    again = _along(found, more, known, withheld)
    return again if _explains_more(again, cost, found, foretold) else None


def _hopeless(found: SearchResult, foretold: bool, paid_off: bool) -> bool:
    """Whether no load between readings is looked for: nothing is left that one could explain, or it
    is the law that is wrong, by how likely a gap without a law is, or as it leaves more than noise
    with loads that hardly pay what they cost."""
    first = found.explanations[0]
    if foretold:
        return first.eta == 0
    left = first.eta > found.engine.bench.noise.stated
    return found.unknown > first.log_weight + _WRONG or (left and not paid_off)


_WRONG = 500.0  # nats by which a gap without a law is likelier than the best one
_PAYS = 2.0  # times their cost


def _explains_more(again: SearchResult, cost: float, found: SearchResult, foretold: bool) -> bool:
    """More than it costs beyond what was paid, nats; or at all, and foretells what was not; by
    what acts at other levels too."""
    gain = again.explanations[0].log_weight - found.explanations[0].log_weight
    pays = gain > cost or (not foretold and gain > 0 and predicts_held_out(again))
    return pays and not acts_only_after_overshoot(again)


def _along(
    found: SearchResult, more: Overshoots, known: Sequence[Form], withheld: Collection[str]
) -> SearchResult:
    """The search once more with those loads."""
    data = found.engine.bench.data
    rows = replace(found.engine.bench.rows, overshoot=more.overshoot)
    return _searched(*_prepared(make_bench(data, rows=rows), known, withheld))


_OTHERS = 25.0  # nats that other words may gain more along a path than those that ask for it
_ROUNDS = 3  # at most, and one where withheld repetitions are foretold


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


def _next(
    found: SearchResult,
    chosen: Explanation,
    result: GapResult,
    others: Others | None,
) -> NextMeasurement | None:
    """For the first open pair for which there is a proposal."""
    for pair in _open(found, chosen, result):
        proposal = next_measurement(found, chosen, pair, others)
        if proposal is not None:
            return proposal
    return None


def _open(found: SearchResult, chosen: Explanation, result: GapResult) -> list[tuple[str, str]]:
    """Pairs of words that the data leave open: effects and what can't be told from them, the
    likeliest first; then a verdict and its rivals. No rival is what is there for sure beside it,
    nor what explains the data without it far worse."""
    verdict, probabilities = result.verdict, result.probabilities
    pairs = [
        (e.name, other)
        for e in result.effects
        for other in sorted(e.indistinguishable_from, key=lambda w: -probabilities[w])
    ]
    sure = {e.name for e in result.effects if e.probability > _SURE}
    for word, p in sorted(probabilities.items(), key=lambda i: -i[1]):
        if word == verdict or not {verdict, word} <= set(WORDS) or p <= _RIVAL:
            continue
        without = [
            e.log_weight for e in found.explanations if word in e.words and verdict not in e.words
        ]
        as_good = max(without, default=-inf) > chosen.log_weight - ALIKE
        if as_good and not {verdict, word} <= sure:
            pairs.append((verdict, word))
    return list(dict.fromkeys(pairs))


_RIVAL = 0.02  # probability of a word that is asked about
_SURE = 0.95  # probability that an effect is there, beyond which nobody asks
