"""Finer shapes of the words that stand out among single effects, where a grid meets them badly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from identification.gap.compare import Scored, by_word, closest, marginal, score
from identification.gap.effects import (
    EFFECTS,
    base_slip,
    contact_seating,
    joint_backlash,
    joint_hysteresis,
    joint_nonlinear_stiffness,
    knees,
    knees_closer,
    pose_error,
    specimens,
    time_lag,
)
from identification.gap.evidence import Engine
from identification.gap.explanation import Explanation, conditioned
from identification.gap.fit import fit
from identification.gap.parts import Part
from identification.gap.variants import Variant, place_of
from identification.gap.words import LINEAR

_REFINED = 2  # joints, or axes, at which it is refined
_LEADING = 6  # words that are refined
_STEPS = 2  # to the springs beside what goes through them
_CLOSE = 0.2  # of the first look's steps
_LOOKS = 6  # at most, at one share of the steps
_FAR = 60.0  # nats below the best of them
_WINDOW = 12.0  # nats above `none` that a word must have to be refined


@dataclass(frozen=True, eq=False)
class _Word:
    """A word that stands out: its variants alone, and beside the leading word, best first; ranked:
    the leading words, whose scores are families."""

    engine: Engine
    families: dict[str, list[Scored]]
    ranked: list[str]
    alone: list[Scored]
    beside: list[Scored]

    @property
    def name(self) -> str:
        """What it is."""
        return self.alone[0].variant.word


def refine(engine: Engine, singles: list[Scored]) -> list[Variant]:
    """Finer shapes of the words that stand out among single effects and that a grid meets badly:
    thresholds and zones make the evidence piecewise smooth, offsets act by their squares."""
    families = by_word(singles)
    least = engine.levels[0].log_base + _WINDOW
    ranked = sorted(families, key=lambda w: -marginal(families[w]))[:_LEADING]
    beside = _beside_first(engine, families, ranked)
    out: list[Variant] = []
    for name in ranked:
        if name not in _FINER or marginal(families[name]) < least:
            continue
        alone, others = (
            sorted(s, key=lambda s: -s.log_evidence) for s in (families[name], beside.get(name, []))
        )
        out += _FINER[name](_Word(engine, families, ranked, alone, others))
    return out


def _knees(word: _Word) -> list[Variant]:
    if not _shows(word):
        return []
    places = _places(word.alone, word.beside, knees.is_sharp)
    finer = _closing_in(word, knees_closer.refined, places, knees_closer.CLOSE)
    flat = [v for s in places for v in specimens.plateaus(word.engine.bench, s.variant)]
    return finer + flat + _elsewhere(word, finer)


def _elsewhere(word: _Word, finer: list[Variant]) -> list[Variant]:
    """The best of the finer knees at the other places of the word: without joint readings one may
    be as good as another, and that none was looked for there as closely is no evidence."""
    bench = word.engine.bench
    others: dict[tuple[str, tuple[object, ...]], Variant] = {}
    for v in (s.variant for s in word.alone):
        if knees.is_sharp(v) and "weight" not in v.info:
            others.setdefault((v.info["memory"], _axle(v)), v)
    able = [v for v in finer if "weight" not in v.info]
    if not able or len({place for _, place in others}) < 2:
        return []
    word.engine.extend()
    found = sorted(_scored_beside(word.engine, word.families, word.ranked, able), key=_evidence)
    moved = []
    for v in (s.variant for s in found[-_ELSEWHERE:]):
        places = [
            (knees.place_in(there.label), there.info)
            for (memory, place), there in others.items()
            if memory == v.info["memory"] and place != _axle(v)
        ]
        places += base_slip.between(bench, v) if v.word == base_slip.WORD else []
        moved += [(v, place) for place in places]
    return knees_closer.elsewhere(bench, moved)


def _axle(variant: Variant) -> tuple[object, ...]:
    """Joint, or axis and its depth."""
    return (*place_of(variant), variant.info.get("depth_m"))


_ELSEWHERE = 3  # shapes that are looked at elsewhere


def _backlash(word: _Word) -> list[Variant]:
    """Beside the leading word; and alone, where it explains nearly as much: that may be a curve
    which does what the play does. Ends of which one is softer where a play is there to see."""
    seen = _seen(word)
    looks = [(word, _places(word.alone, word.beside), seen)]
    if word.beside and _nearly_leads(word):
        looks.append((replace(word, ranked=[joint_backlash.WORD]), word.alone[:1], True))
    out: list[Variant] = []
    for of, starts, uneven in looks:
        closer = joint_backlash.CLOSE if uneven else joint_backlash.CLOSE[:1]
        out += _closing_in(of, joint_backlash.refined, starts, closer)
        if uneven:
            out += _closing_in(of, joint_backlash.uneven, starts, joint_backlash.CLOSE)
    return out


def _shows(word: _Word) -> bool:
    """Whether it is worth closer looks."""
    return _seen(word) or _nearly_leads(word)


def _seen(word: _Word) -> bool:
    """Whether it explains something beside the leading word, or is that."""
    return not word.beside or word.beside[0].log_evidence > _lead(word) + _WINDOW


def _nearly_leads(word: _Word) -> bool:
    """Whether it explains alone nearly as much as the leading word does."""
    none = max(level.log_base for level in word.engine.levels)
    mine, first = (marginal(word.families[n]) - none for n in (word.name, word.ranked[0]))
    return mine > _NEARLY * first


_NEARLY = 0.7  # of what the leading word brings, nats above `none`


def _lead(word: _Word) -> float:
    return closest(word.families[word.ranked[0]]).log_evidence


def _friction(word: _Word) -> list[Variant]:
    bench, out = word.engine.bench, []
    for s in _places(word.alone, word.beside):
        out += joint_hysteresis.closer(bench, s.variant)
        out += joint_hysteresis.growing(bench, s.variant)
        out += joint_hysteresis.outlasting(bench, s.variant)
    for s in _places(word.alone, word.beside, joint_hysteresis.hangs):
        out += joint_hysteresis.refined(bench, s.variant)
    return out


def _seats(word: _Word) -> list[Variant]:
    kinds = {contact_seating.slack_of(s.variant): s for s in reversed(word.alone)}
    slacks = [s for kind, s in kinds.items() if kind]
    return _closing_in(word, contact_seating.refined, slacks)


def _lags(word: _Word) -> list[Variant]:
    if not _shows(word):
        return []
    channels = {s.variant.info["channel"]: s for s in reversed(word.beside or word.alone)}
    return _closing_in(word, time_lag.refined, list(channels.values()))


def _curves(word: _Word) -> list[Variant]:
    odd = [s.variant for s in word.alone if "line" in s.variant.info]
    bench = word.engine.bench
    bends = [s for s in word.alone if " bend " in s.variant.label]
    finer = _closing_in(word, joint_nonlinear_stiffness.corners, bends[:1])
    return finer + [f for v in odd[:1] for f in joint_nonlinear_stiffness.refined(bench, v)]


def _poses(word: _Word) -> list[Variant]:
    """Where arm and tool are, by what is found alone and beside the words that explain most of
    what that leaves: a second effect must not decide it."""
    engine, kinds = word.engine, {_kind(s.variant): s for s in reversed(word.alone)}
    finer = [
        f
        for s in kinds.values()
        for f in pose_error.refined(engine.bench, s.variant, partial(_estimate, engine))
    ]
    engine.extend()
    best = max(score(engine, engine.levels, finer), key=_evidence)
    levels, energy = conditioned(engine, (Part(best.variant, best.scale),))
    names = ({*word.ranked} | LINEAR) & word.families.keys() - {best.variant.word}
    others = [s.variant for w in sorted(names) for s in word.families[w]]
    found = by_word(score(engine, levels, others, energy))
    for name in sorted(found, key=lambda w: -marginal(found[w]))[:_BESIDE]:
        other = closest(found[name])
        estimate = partial(_estimate, engine, beside=(Part(other.variant, other.scale),))
        again = pose_error.refined(engine.bench, kinds[_kind(best.variant)].variant, estimate)
        finer += [replace(v, label=f"{v.label} beside {name}") for v in again]
    same = [v for v in finer if _kind(v) == _kind(best.variant)]
    share = best.variant.prior / len(same)  # they are one place, looked at more than once
    return [replace(v, prior=share) if v in same else v for v in finer]


def _kind(variant: Variant) -> tuple[str, str, bool]:
    """What stands elsewhere, in which pose only, and whether readings show it."""
    return str(variant.info["kind"]), str(variant.info["pose"]), bool(variant.info["read"])


_BESIDE = 2  # words


def _about_springs(word: _Word) -> list[Variant]:
    """What goes through the springs, with the springs as they are found to be beside it."""
    bench, laws, out = word.engine.bench, EFFECTS[word.name].laws, []
    for found in dict.fromkeys(s[0].variant for s in (word.alone, word.beside) if s):
        v = found
        for _ in range(_STEPS):
            softer = _estimate(word.engine, v).softer
            v = laws.about_springs(bench, found, bench.compliance * np.maximum(1 + softer, 0.1))
        out.append(v)
    return out


_FINER: dict[str, Callable[[_Word], list[Variant]]] = {
    "joint_yield": _knees,
    "base_slip": _knees,
    "joint_backlash": _backlash,
    "joint_hysteresis": _friction,
    "contact_seating": _seats,
    "time_lag": _lags,
    "joint_nonlinear_stiffness": _curves,
    "pose_error": _poses,
    "load_misalignment": _about_springs,
    "force_drift": _about_springs,
}


def _beside_first(
    engine: Engine, families: dict[str, list[Scored]], ranked: list[str]
) -> dict[str, list[Scored]]:
    """Scores of the words that grids meet badly beside the leading word: what that does must not
    decide where a smaller effect is looked for."""
    family = [s.variant for w in ranked[1:] if w in _GRIDS for s in families[w]]
    return by_word(_scored_beside(engine, families, ranked, family)) if family else {}


def _closing_in(
    word: _Word, refined: Callable[..., list[Variant]], starts: list[Scored],
    closer: tuple[float, ...] = (_CLOSE,),
) -> list[Variant]:  # fmt: skip
    """Finer shapes about those that were found, and finer ones still about the best of these. What
    is best moves along narrow valleys (a zone is as wide as the crossing is far): every look but
    the closest is moved after it until it stays, and the last one is kept. What was seen to be far
    worse is left out."""
    engine = word.engine
    fresh = [v for s in starts for v in refined(engine.bench, s.variant)]
    finer, found = list(fresh), list[Scored]()
    for share in closer if fresh else ():
        best: Variant | None = None
        for _ in range(_LOOKS if share > closer[-1] else 1):
            engine.extend()
            found += _scored_beside(engine, word.families, word.ranked, fresh)
            last, best = best, max(found, key=_evidence).variant
            if best is last:
                break
            fresh = refined(engine.bench, best, share)
        finer += fresh
    best_of = max(map(_evidence, found), default=0.0)
    far = {s.variant for s in found if s.log_evidence < best_of - _FAR}
    return [v for v in finer if v not in far]


def _scored_beside(
    engine: Engine, families: dict[str, list[Scored]], ranked: list[str], family: list[Variant]
) -> list[Scored]:
    first = closest(families[ranked[0]])
    if not family or family[0].word == ranked[0]:
        return score(engine, engine.levels, family)
    levels, energy = conditioned(engine, (Part(first.variant, first.scale),))
    return score(engine, levels, family, energy)


def _evidence(scored: Scored) -> float:
    return scored.log_evidence


_GRIDS = ("joint_yield", "base_slip", "joint_backlash", "joint_hysteresis", "time_lag")


def _estimate(
    engine: Engine, variant: Variant, beside: tuple[Part, ...] = ()
) -> pose_error.Estimate:
    """What is most probable with a variant whose columns the engine may not know yet, beside other
    parts."""
    engine.extend()
    levels, energy = conditioned(engine, beside)
    eta = engine.levels[score(engine, levels, [variant], energy)[0].level].eta
    fitted = fit(engine, Explanation((Part(variant, 1.0), *beside), 0.0, eta, (0.0,), 0.0))
    found = dict(zip(engine.base.names, fitted.base.tolist(), strict=True))
    softer = np.array([found.get(f"spring{j + 1}", 0.0) for j in range(engine.bench.data.joints)])
    reads = 1 + found.get("gain displacement", 0.0)
    return pose_error.Estimate(fitted.of(0)[0], softer, reads)


def _places(
    alone: list[Scored], beside: list[Scored], able: Callable[[Variant], bool] = lambda _: True
) -> list[Scored]:
    """The best of the _REFINED best joints, or axes, beside the leading word, and the best alone:
    of two words that explain the same neither has a place beside the other. able: of those."""
    places: dict[object, Scored] = {}
    first = [s for s in alone if able(s.variant)][:1]
    for s in (s for s in beside or alone if able(s.variant)):
        places.setdefault(place_of(s.variant), s)
    found = [*first, *list(places.values())[:_REFINED]]
    return [s for i, s in enumerate(found) if s.variant not in [f.variant for f in found[:i]]]
