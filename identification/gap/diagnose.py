"""The diagnosis: which effect, where, how far the gap shrinks, what to measure next."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import inf

from identification.gap.answer.discriminate import NextMeasurement, Others, next_measurement
from identification.gap.answer.forms import Form
from identification.gap.answer.found_notes import there_already
from identification.gap.answer.notes import ordered
from identification.gap.answer.posterior import settled
from identification.gap.answer.result import ALIKE, GapResult, result_of, with_equivalent_places
from identification.gap.data import GapData
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.fit import fit
from identification.gap.explanations.verdict import as_before_data
from identification.gap.explore import (
    Library,
    prepared,
    searched,
    with_overshoots,
    without_what_is_gone,
)
from identification.gap.judging.choice import chosen_of
from identification.gap.judging.cross_validation import reweighted_by_validation
from identification.gap.judging.residuals import residual_rms
from identification.gap.model.bench import make_bench
from identification.gap.model.variants import Variant
from identification.gap.recording.digits import with_quantization_noise
from identification.gap.recording.ends import without_ends
from identification.gap.recording.force_scatter import with_observed_force_noise
from identification.gap.recording.glitches import without_glitches
from identification.gap.recording.lost_contact import without_lost_contact
from identification.gap.recording.ramps import with_ramps_marked
from identification.gap.search.search import with_forced_words
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
    return explain_gap(
        data, withhold=withhold, add=add, known=known, others=others, progress=progress
    )[1]()


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
    library, forced = Library(tuple(known), frozenset(withhold)), frozenset(add)
    check_words(library.withheld | forced)
    tell("preparing", 0.0)
    told = with_observed_force_noise(with_ramps_marked(with_quantization_noise(data)))
    bench = make_bench(without_lost_contact(without_glitches(without_ends(told))))
    engine, variants = prepared(bench, library)
    _check_shown(forced, variants)
    tell("comparing effects", 0.2)
    found = with_overshoots(searched(engine, variants), library)
    found, gone = without_what_is_gone(found, bench, library)
    tell("withheld data", 0.7)
    found = as_before_data(reweighted_by_validation(found), library.withheld)
    verdict = max(found.probabilities, key=lambda w: found.probabilities[w])
    plain, fuller = chosen_of(found, verdict)
    chosen = with_forced_words(found.engine, found.variants, found.explanations, plain, forced)
    chosen, each = settled(found.engine, found.variants, chosen, found.explanations)
    result = with_equivalent_places(
        result_of(found, verdict, chosen, each, fuller), chosen, library.withheld
    )
    result = replace(result, gone=gone)
    if not forced <= plain.words:
        result = replace(result, without_added=residual_rms(found.engine, fit(found.engine, plain)))
    result = replace(result, said=ordered([*result.said, *there_already(plain, forced)]))

    def whole() -> GapResult:
        tell("what to measure next", 0.9)
        following = _next(found, chosen, result, others)
        tell("done", 1.0)
        return replace(result, next_measurement=following)

    return result, whole


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
