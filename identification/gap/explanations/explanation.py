"""An explanation: effects with what they leave of the gap, its evidence and its prior."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from math import log, nan

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.compare import Scored, closest, condition, marginal
from identification.gap.evidence.engine import Engine, NoiseLevel
from identification.gap.evidence.imperfection import level_priors
from identification.gap.evidence.lognormal_springs import lognormal_prior_correction
from identification.gap.evidence.parts import (
    Part,
    Sizes,
    energies,
    evidence_correction,
    log_joints,
    needed,
    part_sizes,
    signs_kept,
)
from identification.gap.explanations.penalties import (
    TOE_AND_KNEE,
    below_noise,
    cancelling,
    in_directions_of_their_own,
    minor_parts,
    unbent_curves,
    within_stated,
)
from identification.gap.explanations.priors import prior_of
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant
from identification.gap.words import CURVES, DRIFTS, FRICTION, LINEAR

# An explanation must leave less than this share of the gap (rms), with two effects half of it and
# so on: the more words are spent, the better they have to explain. Laws of other people's rigs are
# known less well: what explains four fifths of a gap's square there is its main cause.
REMAINDER, REMAINDER_ARMLESS = 0.25, 0.45
_SOFT = 8.0  # how fast, per factor e beyond a limit, weight is lost to `unknown`
# Nor can a law be met better than to a few percent of what it does, where that is no more than such
# a share of the gap: effects that cancel each other explain nothing.
LAW_REMAINDER = 0.03


@dataclass(frozen=True, eq=False)
class Explanation:
    """Effects (largest first, none for the base alone), posterior weight as log, imperfection eta
    m, sizes (rms m) of the effects, and log share of the posterior with little remainder. off: by
    how many standard deviations springs and gains are off at most; NaN where nobody looked."""

    parts: tuple[Part, ...]
    log_weight: float
    eta: float
    sizes: tuple[float, ...]
    log_adequate: float
    off: float = nan

    def sized(self, sizes: Iterable[float]) -> Explanation:
        """With other sizes (rms m) of its effects, the largest first."""
        each = list(sizes)
        order = _order(self.parts, each)
        return replace(
            self,
            parts=tuple(self.parts[i] for i in order),
            sizes=tuple(float(each[i]) for i in order),
        )

    @property
    def adequate(self) -> bool:
        """It leaves little enough."""
        return self.log_adequate > self.log_weight - log(2)

    @cached_property
    def words(self) -> frozenset[str]:
        """Names of its effects."""
        return frozenset(p.word for p in self.parts)

    @cached_property
    def rms_by_word(self) -> dict[str, float]:
        """Word -> rms m of what it does in all its joints together, the largest first."""
        return _together(self.parts, self.sizes)


def _order(parts: tuple[Part, ...], sizes: Sequence[float] | Array) -> list[int]:
    """The effects that do most in all their joints together first."""
    whole = _together(parts, sizes)
    return sorted(range(len(parts)), key=lambda i: (-whole[parts[i].word], -sizes[i]))


def _together(parts: tuple[Part, ...], sizes: Iterable[float]) -> dict[str, float]:
    squares: dict[str, float] = {}
    for p, size in zip(parts, sizes, strict=True):
        squares[p.word] = squares.get(p.word, 0.0) + float(size) ** 2
    return {w: s**0.5 for w, s in sorted(squares.items(), key=lambda i: -i[1])}


PLAIN = 3.0  # nats that a shape must explain the gap better than anything else, to be named


@dataclass(frozen=True)
class GapPattern:
    """What an unknown gap looks like. kind: slopes, swings, waves, rough, jumps or settles; of a
    recording that runs on jerks, damage, softening, wanders or slopes; period: s of a swing, m of
    a wave, None of others; log_evidence: of the kind, nats; wanders: slopes that change within runs
    too."""

    kind: str
    period: float | None
    log_evidence: float
    wanders: bool = False


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What the search found, and what is thought of it since."""

    engine: Engine
    explanations: tuple[Explanation, ...]  # best first
    alone: dict[str, float]  # word -> log evidence by itself against `none`, nats
    probabilities: dict[str, float]  # of all words, `none` and `unknown`
    unknown: float  # log weight of a gap that no law explains
    unknown_eta: float  # m: its imperfection
    # words of an explanation -> share of its weight that withheld data leave it
    kept: Mapping[frozenset[str], float] = field(default_factory=dict)
    # what a gap that no law explains looks like, if like anything
    looks_like: GapPattern | None = None
    # explanations with a trouble that no word names, best first
    unmodelled: tuple[Explanation, ...] = ()
    # words of an explanation -> the simpler one that represents it in the verdict: fewer of
    # its effects that foretell withheld data better, a play in a curve's place, or springs or
    # gains that are off by more than it does
    representatives: Mapping[frozenset[str], Explanation] = field(default_factory=dict)
    variants: tuple[Variant, ...] = ()  # all that were compared, those made on the way with them

    def representative_of(self, explanation: Explanation | None) -> Explanation | None:
        """Who speaks for an explanation, if anybody does."""
        return None if explanation is None else self.representatives.get(explanation.words)


def explain(
    engine: Engine, parts: tuple[Part, ...], log_evidence: float, taken: float | None = None
) -> Explanation:
    """The explanation with its prior; too small a part is charged as what it is: freedom of the
    larger one's law. log_evidence: of the last part beside the others. taken: mean square (m^2)
    that this took all others to have; left out: there are none."""
    levels = engine.levels
    bases = log_joints(engine, parts)
    likeliest = int(bases.argmax())
    sizes = part_sizes(engine, parts, likeliest)
    each, energy = _ranking_sizes(engine, parts, sizes, likeliest), sizes.energy
    together = _together(parts, each)
    logs = bases + level_priors(engine.etas, energy)
    best = int(logs.argmax())
    remainder = tolerated_residual(engine, together)
    least = max(
        0.6 * engine.bench.noise.stated,
        remainder / max(len(together), 1),
        min(LAW_REMAINDER * float(each.max(initial=0.0)), remainder),
    )
    share = np.exp(logs - logs.max())
    good = sum(s * soft_limit(lv.eta, least) for s, lv in zip(share, levels, strict=True))
    fraction = float(good / share.sum())
    order = _order(parts, each)
    if taken is not None:
        log_evidence += evidence_correction(engine, parts, taken, bases)
    weight = log_evidence + prior_of(frozenset(p.word for p in parts), engine.bench)
    weight -= below_noise(engine, parts, sizes) + unbent_curves(engine, parts, sizes)
    weight += lognormal_prior_correction(engine, parts, best) - within_stated(engine, parts, sizes)
    if len(parts) > 1:
        weight -= sum(p.variant.cost for p in parts[:-1])
        weight -= minor_parts(engine, parts, sizes) + cancelling(engine, parts, sizes, each)
        weight += signs_kept(levels[best], parts)
    return Explanation(
        tuple(parts[i] for i in order),
        weight,
        levels[best].eta,
        tuple(float(each[i]) for i in order),
        weight + log(max(fraction, 1e-300)),
    )


def joined(
    engine: Engine,
    rest: tuple[Part, ...],
    scored: Sequence[Scored],
    energy: float,
    charge: float = 0.0,
) -> Explanation:
    """The rest with the closest of a word's shapes, as they were scored beside it. energy: mean
    square (m^2) that this took the rest to have; charge: nats against the word."""
    top, taken = closest(scored), energy if rest else None
    parts = (*rest, Part(top.variant, top.scale))
    return explain(engine, parts, marginal(scored) - charge, taken)


def tolerated_residual(engine: Engine, troubles: Mapping[str, float]) -> float:
    """Tolerated rms (m) of the residual of an explanation by one effect: REMAINDER of what springs
    leave. Of a rig without an arm OF_A_BENCH of that, or of its largest effect where that is a
    spring or a gain and larger. troubles: word -> rms m, the largest first."""
    if engine.bench.data.arm:
        return REMAINDER * engine.structural
    word, size = next(iter(troubles.items()), ("", 0.0))
    return REMAINDER_ARMLESS * max(engine.structural, size if word in LINEAR else 0.0)


def soft_limit(value: float, limit: float) -> float:
    """1 / (1 + (value / limit)^8): about 1 below the limit, half at it, next to nothing beyond. The
    weight of an explanation is multiplied by it."""
    return float(1 / (1 + (value / limit) ** _SOFT))


def _ranking_sizes(engine: Engine, parts: tuple[Part, ...], sizes: Sizes, level: int) -> Array:
    """Sizes (p,) m by which parts are ranked: what each does to the gap, but on a rig without an
    arm, whose one spring in a direction may hide most of any mechanism, see the rules below."""
    bench = engine.bench
    apart = any(in_directions_of_their_own(bench, a, b) for a, b in combinations(parts, 2))
    if bench.data.arm or apart:
        return sizes.gap
    leads = _leading_of_two(engine, parts, sizes.gap, level)
    if leads is not None:
        return sizes.gap if sizes.gap.argmax() == leads else sizes.gap[::-1]
    if _toe_and_knee(parts):
        return sizes.moved
    return _beside_friction(engine, parts, sizes)


def _leading_of_two(
    engine: Engine, parts: tuple[Part, ...], sizes: Array, level: int
) -> int | None:
    """Which one of friction (or yield) and another effect is the larger, where sizes (p,) m can't
    say.

    - Beside a curve the friction, where most of the way is left when the load is gone: no curve
      keeps anything.
    - Beside creep at one rate the friction: creep then differs from it in details only; beside a
      lag as well, where that does no more than a few times as much.
    - Beside a drift the friction, where the driven load goes to and fro about a mean and
      the drift is the way of that: what yields ratchets so (Armstrong and Frederick 1966).
    - Beside creep under an imposed stroke the one that the other can do less without: both bring a
      mean stiffness, and what a spring leaves of either says little.
    """
    bench, words = engine.bench, [p.word for p in parts]
    rubs = next((i for i, w in enumerate(words) if w in FRICTION), None)
    if len(parts) != _PAIR or rubs is None:
        return None
    if DRIFTS & frozenset(words) and _walks(bench):
        return rubs
    curves, creeps = any(w in CURVES for w in words), "joint_creep" in words
    late = creeps or ("time_lag" in words and sizes[rubs] > _OF_A_LAG * sizes.max())
    if (curves and bench.load_history.stays > _STAYS) or (late and bench.load_history.one_rate):
        return rubs
    return int(needed(engine, parts, level).argmax()) if creeps and bench.imposed else None


_PAIR, _STAYS = 2, 0.5  # effects; of the way
_OF_A_LAG = 0.2  # of what a lag does, by friction beside it


def _walks(bench: Bench) -> bool:
    """Whether the response to a driven force that goes to and fro walks the way of its mean."""
    load, n = bench.load, bench.rows.n
    mean, third = (float(load.max()) + float(load.min())) / 2, n // 3
    if bench.imposed or bench.load_history.passes < _CYCLES or abs(mean) < _ASIDE * np.ptp(load):
        return False
    left = bench.response - bench.slope * load
    return bool((left[-third:].mean() - left[:third].mean()) * mean > 0)


_CYCLES, _ASIDE = 6, 0.1  # passes of the load; of its range: so far its mean is from none


def _toe_and_knee(parts: tuple[Part, ...]) -> bool:
    """A soft start and a yield, which count as they move: what a spring would hide of either the
    other shows. A seat that gets ever stiffer (a ball on a plate) ends in no spring of its own."""
    goes_on = any(p.variant.goes_on for p in parts)
    return frozenset(p.word for p in parts) == TOE_AND_KNEE and not goes_on


def _beside_friction(engine: Engine, parts: tuple[Part, ...], sizes: Sizes) -> Array:
    """Sizes in which linear effects beside friction count by what it leaves of the gap: friction
    brings its own mean stiffness, and what was simulated may be its first slope. Where one would
    move more than was measured, which the friction takes back, it counts for less than that."""
    rubs = np.array([p.word in FRICTION for p in parts], dtype=bool)
    if not rubs.any():
        return sizes.gap
    linear = np.array([p.word in LINEAR for p in parts], dtype=bool)
    friction = float(sizes.gap[rubs].max())
    rest = max(engine.structural**2 - friction**2, 0.0) ** 0.5
    rest = np.where(sizes.moved**2 > engine.most, min(rest, _LESS * friction), rest)
    return np.where(linear, np.minimum(sizes.gap, rest), sizes.gap)


_LESS = 0.99


def conditioned(
    engine: Engine, parts: tuple[Part, ...], among: list[NoiseLevel] | None = None
) -> tuple[list[NoiseLevel], float]:
    """Levels (all of them, or some) with the parts integrated out, and the mean square (m^2) of
    the parts at the likeliest of these."""
    levels = engine.levels if among is None else among
    for p in parts:
        engine.beside(p.variant.columns, 1 + max(lv.number for lv in levels))  # all at once
        levels = [condition(lv, p.variant.columns, p.variant.root, p.scale) for lv in levels]
    if not parts:
        return levels, 0.0
    weights = np.array([lv.log_base for lv in levels])
    return levels, part_sizes(engine, parts, int(weights.argmax())).energy


def up_to_likeliest(engine: Engine, parts: tuple[Part, ...]) -> tuple[list[NoiseLevel], float]:
    """The same as `conditioned`, at levels up to the likeliest: with an effect more, no more
    imperfection is needed. All levels where there are no parts."""
    if not parts:
        return conditioned(engine, parts)
    energy = energies(engine, parts)
    likeliest = int(np.argmax(log_joints(engine, parts) + level_priors(engine.etas, energy)))
    return conditioned(engine, parts, engine.levels[: likeliest + 1])
