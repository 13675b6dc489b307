"""The way from a bench to the explanations that are judged: one search, and further ones along
loads that no row shows, or without effects of the simulation that are gone."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from identification.arrays import Flags
from identification.gap.answer.forms import Form
from identification.gap.answer.known import in_question, is_gone, knowing
from identification.gap.effects import library as variants_of
from identification.gap.evidence.compare import score
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.explanations.explanation import SearchResult
from identification.gap.judging.cross_validation import predicts_held_out
from identification.gap.judging.heldout import first_repetitions
from identification.gap.judging.residual_checks import reweighted_by_residuals
from identification.gap.judging.unread_ramps import acts_only_after_overshoot
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from identification.gap.search.overshoot_paths import Overshoots
from identification.gap.search.overshoots import by_one_word, overshoots_of_best
from identification.gap.search.refine import refine
from identification.gap.search.search import search
from identification.gap.search.unmodelled_running import troubles_of, with_plain_trouble
from identification.gap.search.unmodelled_shapes import with_unmodelled_evidence
from identification.gap.words import WORDS


@dataclass(frozen=True)
class Library:
    """What explanations are made of. known: effects that the simulation has already; withheld:
    words that are left out."""

    known: tuple[Form, ...] = ()
    withheld: frozenset[str] = frozenset()

    @property
    def words(self) -> list[str]:
        """Those that explanations may have."""
        return [w for w in WORDS if w not in self.withheld]

    def only(self, words: Collection[str]) -> Library:
        """Without all other words."""
        return replace(self, withheld=self.withheld.union(w for w in WORDS if w not in words))

    def knowing_less(self, words: Collection[str]) -> Library:
        """Of a simulation without the effects of these words."""
        return replace(self, known=tuple(f for f in self.known if f.word not in words))


def prepared(bench: Bench, library: Library) -> tuple[Engine, list[Variant]]:
    """What explanations are scored by, and the library's variants."""
    bench = knowing(bench, library.known)
    base = base_columns(bench)
    target = bench.observed - prediction(bench)
    variants = variants_of(bench, library.words)
    return Engine(bench, base, target, eta_levels(bench, base, target)), variants


def searched(engine: Engine, variants: Sequence[Variant]) -> SearchResult:
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


def without_what_is_gone(
    found: SearchResult, bench: Bench, library: Library
) -> tuple[SearchResult, tuple[str, ...]]:
    """The search without those effects of the simulation that are not in the data as it has them,
    and their words: a mechanism was repaired since, or goes on at another load."""
    gone: list[str] = []
    asked = in_question(found)
    while asked:
        word = asked.pop(0)
        kept = library.knowing_less({word, *gone})
        again = with_overshoots(searched(*prepared(bench, kept)), kept)
        if is_gone(found, again):
            found, gone = again, [*gone, word]
            asked = in_question(found)
    return found, tuple(gone)


def with_overshoots(found: SearchResult, library: Library) -> SearchResult:
    """The search once more with loads between readings, where these explain more than it costs to
    say which they are, or make foretold what was not."""
    first = found.explanations[0].log_weight
    found, paid = _by_one_word(found, library)
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
            again = _better_along(found, more, more.cost - paid, foretold, library)
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


def _by_one_word(found: SearchResult, library: Library) -> tuple[SearchResult, float]:
    """The search once more with the loads that one word alone asks for, and nats that it takes to
    say which, where that word then explains more than the best explanation does without."""
    if _hopeless(found, predicts_held_out(found), paid_off=True):
        return found, 0.0
    best, loads, clean = found.explanations[0].log_weight, None, frozenset[str]()
    for more in by_one_word(found):
        if more.words == clean:  # further lags, which come last
            break
        asking = _along(found, more, library.only(more.words))
        ahead = asking.explanations[0].log_weight - more.cost
        if ahead > best and not acts_only_after_overshoot(asking):
            best, loads = ahead, more
            left = asking.explanations[0].eta > found.engine.bench.noise.stated
            clean = frozenset() if left else more.words
    if loads is None:
        return found, 0.0
    again = _along(found, loads, library)
    if not _explains_more(again, loads.cost, found, foretold=True):
        return found, 0.0
    return again, loads.cost


def _better_along(
    found: SearchResult,
    more: Overshoots,
    cost: float,
    foretold: bool,
    library: Library,
) -> SearchResult | None:
    """The search once more with those loads, where it explains more than these cost, nats; at first
    with the words that ask for them, as all of them take ten times as long."""
    asking = _along(found, more, library.only(more.words))
    if not _explains_more(asking, cost - _OTHERS, found, foretold):
        return None
    again = _along(found, more, library)
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


def _along(found: SearchResult, more: Overshoots, library: Library) -> SearchResult:
    """The search once more with those loads."""
    data = found.engine.bench.data
    rows = replace(found.engine.bench.rows, overshoot=more.overshoot)
    return searched(*prepared(make_bench(data, rows=rows), library))


_OTHERS = 25.0  # nats that other words may gain more along a path than those that ask for it
_ROUNDS = 3  # at most, and one where withheld repetitions are foretold
