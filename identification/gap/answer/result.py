"""What a diagnosis says: the explanation that is shown, in numbers and words."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import log

import numpy as np

from identification.arrays import Ints
from identification.gap.answer.discriminate import NextMeasurement
from identification.gap.answer.equivalent_places import equivalent_place
from identification.gap.answer.forms import describe, lasting, realise
from identification.gap.answer.found_notes import (
    across,
    at_few_readings,
    called,
    disbelieved,
    left_out,
    not_foretold,
    readings_missed,
    springs_far_off,
)
from identification.gap.answer.gear_side import read_elsewhere
from identification.gap.answer.known import knowing
from identification.gap.answer.locate import Where, locate
from identification.gap.answer.notes import FAULT, Note, notes_of, ordered
from identification.gap.answer.posterior import Known
from identification.gap.answer.same_force import same_force
from identification.gap.answer.scale import off_scale
from identification.gap.data import GapData
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation, GapPattern, SearchResult
from identification.gap.explanations.fit import Fit, fit
from identification.gap.explanations.verdict import find_representative
from identification.gap.judging.heldout import HeldOut, folds, held_out, stated_prediction
from identification.gap.judging.residuals import noise_rms, residual_rms, sample_rms
from identification.gap.laws.interval import Parameter
from identification.gap.model.bench import Bench
from identification.gap.recording.faults import SIGNS, SILENT

# Nats within which two words explain data equally well: odds of 100 to 1 prove nothing while the
# laws themselves are only families.
ALIKE = 4.6
_NOISE_TO = 1.2  # times the noise


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
    explanation had them. written: `after` without what no model file holds; None where none is
    written. said: what is to be known beside, by kind. gone: words of the simulation's
    effects that are not in the data as it has them; all that is said is of the simulation without.
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
    looks_like: GapPattern | None
    said: tuple[Note, ...]
    bench: Bench
    engine: Engine
    fit: Fit
    found: SearchResult
    without_added: float | None = None
    written: float | None = None
    gone: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects, each once: one mechanism may sit in several joints."""
        return tuple(dict.fromkeys(e.name for e in self.effects))

    @property
    def met(self) -> bool:
        """Of an arm: what is left is no more than noise, which is known to a fifth."""
        known = self.bench.data.arm and not self.bench.noise.misjudged
        return known and self.after <= _NOISE_TO * self.noise

    @property
    def hidden(self) -> bool:
        """A gap that no effect explains, if there is one, is no more than readings scatter, which
        is far more than was stated."""
        lost = self.verdict == "unknown" and self.after <= _NOISE_TO * self.noise
        return lost and self.bench.noise.misjudged

    @property
    def learned_nothing(self) -> bool:
        """Nothing moved that could have shown a gap, and the probabilities are the priors."""
        return self.verdict == "none" and self.bench.still

    @property
    def notes(self) -> tuple[str, ...]:
        """What is said, without its kind."""
        return tuple(n.text for n in self.said)


def result_of(
    found: SearchResult,
    verdict: str,
    chosen: Explanation,
    known: list[Known],
    fuller: Explanation | None,
) -> GapResult:
    """The result but for what to measure next. known: of every effect of the chosen explanation
    what is known; fuller: as in `Choice`."""
    engine, bench = found.engine, found.engine.bench
    n = bench.rows.n
    fitted = fit(engine, chosen)
    ways = folds(engine)
    held = tuple(held_out(engine, chosen, name, number) for name, number in ways.items())
    springs = fit(engine, next(e for e in found.explanations if not e.parts))
    structural = engine.target[:n] - springs.response
    simulated = stated_prediction(engine)
    contradicted = (*off_scale(bench, simulated), *read_elsewhere(bench), *same_force(bench))
    notes = [*contradicted, *notes_of(bench, verdict)]
    notes += [*disbelieved(found, verdict), *across(bench, chosen)]
    notes += readings_missed(engine, fitted) if chosen.parts else ()
    notes += springs_far_off(engine, fitted) if verdict == "none" else ()
    after = residual_rms(engine, fitted)
    notes += [*called(found, chosen, verdict), *left_out(chosen, fuller, after)]
    notes += not_foretold(held, chosen.words)
    notes += at_few_readings(engine, fitted, after) if chosen.parts else ()
    result = GapResult(
        verdict=verdict,
        probabilities=found.probabilities,
        effects=_effects(found, chosen, known),
        where=locate(engine, verdict, fitted, chosen.sizes, structural),
        noise=noise_rms(bench),
        before=sample_rms(bench, simulated),
        after=after,
        held_out=held,
        runners_up=_runners_up(engine, found, verdict, ways),
        next_measurement=None,
        remainder=found.unknown_eta if verdict == "unknown" else chosen.eta,
        looks_like=_likeness(found, verdict, contradicted),
        said=ordered(notes),
        bench=bench,
        engine=engine,
        fit=fitted,
        found=found,
        written=_as_written(engine, fitted) if verdict != "unknown" else None,
    )
    return replace(result, looks_like=None) if result.hidden else result


def _as_written(engine: Engine, fitted: Fit) -> float | None:
    """rms (m) that a simulation with the springs as fitted, and with those effects that last, would
    leave as it is given: without tares, gains, the scatter of runs, and what drifts or jumps in
    this session. None without an arm, and of another simulator's curves."""
    bench, n = engine.bench, engine.bench.rows.n
    if not bench.data.arm or bench.data.curves is not None:
        return None
    softer = engine.base.softer(fitted.base, bench.data.joints)
    gives = bench.slope_of(bench.compliance * (1 + softer)) * bench.load
    last = [lasting(describe(bench, p, *fitted.of(i))) for i, p in enumerate(fitted.parts)]
    last = [form for form in last if form.law.terms]
    if last and bench.imposed:
        gives = gives + sum((realise(bench, form, last)[:n] for form in last), np.zeros(n))
    elif last:
        with_them = knowing(bench, last).known
        gives = gives + (0.0 if with_them is None else with_them.does[:n])
    return sample_rms(bench, gives + (0.0 if bench.known is None else bench.known.does[:n]))


def _likeness(found: SearchResult, verdict: str, said: tuple[Note, ...]) -> GapPattern | None:
    """Of an unknown gap; none where what is said is that META is wrong, or of one whose channels
    count in opposite senses, or of which one says nothing."""
    faults, wrong = found.engine.bench.load_history.faults, any(n.kind == FAULT for n in said)
    if verdict != "unknown" or wrong or any(f.kind in (SIGNS, SILENT) for f in faults):
        return None
    return found.looks_like


def _effects(
    found: SearchResult, chosen: Explanation, known: list[Known]
) -> tuple[EffectFound, ...]:
    all_of_them = (*found.explanations, *found.unmodelled)
    weights = np.array(
        [e.log_adequate + log(found.kept.get(e.words, 1.0) + 1e-300) for e in all_of_them]
    )
    share = np.exp(weights - weights.max())
    total = float(share.sum())
    squares = np.array(chosen.sizes) ** 2 if chosen.sizes else np.zeros(0)
    power = float(squares.sum())
    out = []
    for i, part in enumerate(chosen.parts):
        present = sum(
            float(s)
            for e, s in zip(all_of_them, share, strict=True)
            if part.word in e.words | _said(found, e)
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


def _said(found: SearchResult, explanation: Explanation) -> frozenset[str]:
    """What speaks for it says that is there."""
    speaker = find_representative(found, explanation, found.kept)
    return frozenset() if speaker is None else speaker.words


def _placed(data: GapData, places: dict[str, float]) -> dict[str, float]:
    """Of a rig without an arm the direction in which an effect sits, where there are several."""
    if data.arm:
        return places
    sits = {f"joint {j + 1}": s.direction for s in data.setups for j in np.flatnonzero(s.lever)}
    several = len(sits) > 1
    return {f"direction {sits[p]}": share for p, share in places.items() if several and p in sits}


def with_equivalent_places(
    result: GapResult, chosen: Explanation, withheld: Collection[str]
) -> GapResult:
    """Effects that no channel tells from the same law elsewhere share their probability with it,
    openly: between the two only priors and grids would decide. The verdict, which they are together
    the likeliest for, stays the most probable word."""
    probabilities, effects = dict(result.probabilities), []
    for i, (effect, part) in enumerate(zip(result.effects, result.fit.parts, strict=True)):
        twin = equivalent_place(result.engine, part, result.fit.of(i)[0], chosen.eta)
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
