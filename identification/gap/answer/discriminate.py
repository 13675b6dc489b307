"""What to measure next: the procedure that would tell two explanations apart, by expectation.

For every procedure that could follow the present one, both explanations' fitted forms are simulated
along its path and judged there as a measurement would be: the log odds that the right one would win
by. The smaller of the two (either may be the true one), beyond what repeating the present procedure
gives, per minute of measuring, decides; little may turn out to be nothing on a rig whose laws are
not quite these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from identification.arrays import Array
from identification.gap.answer.designs import (
    Candidate,
    Design,
    Elsewhere,
    candidates,
    planned,
    present_design,
)
from identification.gap.answer.forms import realise, rows_of
from identification.gap.answer.rivals import Rival, rival_of, same_elsewhere
from identification.gap.data import LOADING, GapData
from identification.gap.effects import EFFECTS
from identification.gap.evidence.compare import condition, log_mean, score
from identification.gap.evidence.engine import Engine, NoiseLevel, eta_levels
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.laws.flows import make
from identification.gap.laws.law import AS_IT_STANDS, Law
from identification.gap.model.base import Base, base_columns
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant

ENOUGH = 3.0  # nats: odds of 20 to 1
_LITTLE = 0.5  # nats below which no procedure is better than any other
_HALF = 30.0  # nats of which half may come to nothing: laws of a rig are not those that were fitted
_BESIDES = 2  # further procedures that would do, for who can't do the best
_REPETITIONS = 2  # simulated
_GAINS = {"force_scale": "force_gain", "displacement_scale": "displacement_gain"}


@dataclass(frozen=True)
class Option:
    """A procedure with its expected discrimination (nats, the worse of the two cases) and time."""

    kind: str
    text: str
    expected_nats: float
    minutes: float


@dataclass(frozen=True)
class NextMeasurement:
    """What to do, which two words it separates, what it is expected to give, and the other
    options, best first. kind "none": nothing that was tried reaches ENOUGH; design is None then.
    reached: m, of every setup of the design how far loading to each level goes at the most, by
    either explanation; empty without an arm. present: the procedure that the design came from, as
    nearly as the data tell."""

    text: str
    separates: tuple[str, str]
    kind: str
    expected_nats: float = 0.0
    minutes: float = 0.0
    alternatives: tuple[Option, ...] = ()
    design: Design | None = None
    reached: tuple[tuple[float, ...], ...] = ()
    present: Design | None = None


Others = Callable[[], Sequence[Elsewhere]]


def next_measurement(
    found: SearchResult,
    chosen: Explanation,
    pair: tuple[str, str],
    others: Others | None = None,
) -> NextMeasurement | None:
    """The proposal for two words, of which the first is in the chosen explanation.

    others: setups elsewhere, asked for only here. None where one of the words has no explanation,
    no load moves the rig, or no procedure gives more than next to nothing, nor a look at the stand.
    """
    engine = found.engine
    if not engine.bench.reach > 0 or not np.ptp(engine.bench.load) > 0:
        return None
    first = rival_of(found, chosen, pair[0], pair[0])
    if first is None:
        return None
    second = same_elsewhere(found, chosen, first, pair[1]) or rival_of(
        found, chosen, pair[0], pair[1]
    )
    if second is None:
        return None
    design = present_design(engine.bench)
    known = _discrimination(engine.bench, design, (first, second))
    rated: list[tuple[Option, Candidate]] = []
    every = candidates(design, engine.bench.data.arm, others() if others else ())
    for c in sorted(every, key=lambda c: c.design.minutes):
        if _settled([o for o, _ in rated], c.design.minutes):
            break
        nats = _discrimination(engine.bench, c.design, (first, second)) - max(known, 0.0)
        if c.kind == "calibrate":
            nats += _calibrated(c.design, (first, second))
        rated.append((Option(c.kind, c.text, max(nats, 0.0), c.design.minutes), c))
    rated.sort(key=lambda r: -_worth(r[0]))
    proposal = _proposal(rated, pair)
    if proposal is None or proposal.design is None or not engine.bench.data.arm:
        return proposal
    reached = _reached(engine.bench, proposal.design, (first, second))
    return replace(proposal, reached=reached, present=design)


def _settled(options: list[Option], minutes: float) -> bool:
    """Whether nothing that takes so long can be worth more than what was looked at, of which a few
    would do besides."""
    do = sorted((_worth(o) for o in options if o.expected_nats >= ENOUGH), reverse=True)
    return len(do) > _BESIDES and do[0] > 1 / max(minutes, 1e-9)


def _worth(option: Option) -> float:
    """What reaches enough comes first, by the chance that it tells per minute; then whatever gives
    most."""
    nats = option.expected_nats
    if nats < ENOUGH:
        return nats * 1e-6
    return nats / (nats + _HALF) / max(option.minutes, 1e-9)


def _proposal(
    rated: list[tuple[Option, Candidate]], pair: tuple[str, str]
) -> NextMeasurement | None:
    if rated and rated[0][0].expected_nats < _LITTLE:
        # but a gain can always be calibrated
        rated = sorted(rated, key=lambda r: r[0].kind != "calibrate")
        if rated[0][0].kind != "calibrate" or not _GAINS.keys() & set(pair):
            return _by_eye(pair)
    if not rated:
        return _by_eye(pair)
    best, candidate = rated[0]
    rest = tuple(o for o, _ in rated[1:])
    odds = f"expected: {_nats(best.expected_nats)} in about {best.minutes:.0f} min"
    if best.expected_nats >= ENOUGH:
        return NextMeasurement(
            f"{best.text} ({odds}.)",
            pair,
            best.kind,
            best.expected_nats,
            best.minutes,
            rest,
            candidate.design,
        )
    text = (
        f"No procedure derived from this one is expected to tell them apart (odds of 20 to 1, "
        f"{ENOUGH:g} nats). The best of {len(rated)}: {best.text} ({odds}.)"
    )
    return NextMeasurement(
        text, pair, "none", best.expected_nats, best.minutes, tuple(o for o, _ in rated)
    )


def _by_eye(pair: tuple[str, str]) -> NextMeasurement | None:
    """Of an arm on its stand, where to look; no procedure is left to propose."""
    if len(_OF_THE_STAND & set(pair)) != 1:
        return None
    return NextMeasurement(_LOOK_AT_THE_STAND, pair, "none")


_OF_THE_STAND = frozenset({"base_slip", "base_compliance"})
_LOOK_AT_THE_STAND = (
    "No procedure of this rig is expected to tell them apart: both move the arm alike, as far as "
    "its channels see. A dial gauge, or the laser, against the foot of the arm shows whether that "
    "moves."
)


def _nats(value: float) -> str:
    return f"{value:.1f} nats" if value < 100 else "more than 100 nats"


# --- expectation ---------------------------------------------------------------------------------


def _discrimination(bench: Bench, design: Design, rivals: tuple[Rival, Rival]) -> float:
    """Log odds (nats) by which the true one is expected to win, whichever of the two it is.

    At most two repetitions are simulated: more of them say little that these do not.
    """
    brief = replace(design, repetitions=min(design.repetitions, _REPETITIONS))
    truths, there = _simulated(bench, brief, rivals)
    carried = [_carried(there, r) for r in rivals]
    places = [there.add(truth) for truth in truths]
    base = base_columns(there)
    etas = _imperfections(there, base, truths, min(r.eta for r in rivals))
    engine = Engine(there, base, np.zeros(there.layout.size), etas)
    won = []
    for k, place in enumerate(places):
        engine.beside((place,), len(engine.levels))  # of all levels at once, for `_told`
        levels = [_told(level, place) for level in engine.levels]
        marginal = [_marginal(engine, levels, c) for c in carried]
        won.append(marginal[k] - marginal[1 - k])
    return float(min(won))


def _imperfections(there: Bench, base: Base, truths: list[Array], seen: float) -> Array:
    """Sizes m of the imperfection, from the one on that was seen: laws that are so far off now are
    no better there. Every other size: to rank procedures, that is fine enough."""
    every = eta_levels(there, base, max(truths, key=lambda t: float(np.abs(t).max())))
    larger = every[every > 1.01 * seen][1::2]
    return np.append(seen, larger)


def _marginal(engine: Engine, levels: list[NoiseLevel], carried: _Carried) -> float:
    """log evidence of a word, of its shapes by their weights."""
    for p in carried.further:
        levels = [condition(lv, p.variant.columns, p.variant.root, p.scale) for lv in levels]
    found = {id(s.variant): s.log_evidence for s in score(engine, levels, carried.variants)}
    return log_mean([found[id(v)] - log(v.prior) for v in carried.variants], carried.weights)


def _told(level: NoiseLevel, place: int) -> NoiseLevel:
    """The level of a bench on which nothing was observed, had the pool's column been observed."""
    moment = level.beside([place])[0]
    misfit = float(moment[place])
    return replace(level, moment=moment, misfit=misfit, log_base=level.log_base - 0.5 * misfit)


def _simulated(
    bench: Bench, design: Design, rivals: tuple[Rival, Rival]
) -> tuple[list[Array], Bench]:
    """What each of the two would add to the simulation along the design, and the bench there."""
    data = planned(design, bench)
    plain = make_bench(data)
    _ahead(plain, rivals)
    moved = [_moved(plain, r) for r in rivals]
    # the noise of a force counts by the slope of the curve: knees belong into it
    middle = (moved[0][: plain.rows.n] + moved[1][: plain.rows.n]) / 2
    count = plain.rows.weight.astype(np.int64)
    there = make_bench(_with_response(plain, data, np.repeat(middle, count)))
    there = replace(_with_noise(bench, there), flows=plain.flows)  # the load is the same
    return [_moved(there, r) for r in rivals], there


def _moved(there: Bench, rival: Rival) -> Array:
    """(size,) what a rival's effects and springs add to the simulation."""
    beside = (*rival.forms, *rival.rest)
    return sum((realise(there, f, beside) for f in rival.forms), _spring_changes(there, rival))


def _ahead(there: Bench, rivals: tuple[Rival, Rival]) -> None:
    """Makes all at once, for a bench, what takes a loop over its rows."""
    flows = []
    for r in rivals:
        flow = EFFECTS[r.word].laws.flow
        laws = [f.law for f in r.forms] + [law for _, law, *_ in r.shapes]
        laws += [law for _, law, _ in r.further]
        laws = [law for law in laws if not law.constants.get(AS_IT_STANDS)]  # on other benches
        flows += [flow(there, law) for law in laws] if flow is not None else []
    make(there, flows)


def _with_response(bench: Bench, data: GapData, added: Array) -> GapData:
    if bench.imposed:
        return data
    return replace(data, displacement=data.displacement + added)


def _with_noise(bench: Bench, there: Bench) -> Bench:
    """Noise is what the present samples have, which a simulation can't tell."""
    now = bench.noise
    count = np.ones(bench.rows.n) if bench.rows.continuous else bench.rows.weight
    sample = float(np.median(now.response * np.sqrt(count)))
    root = np.sqrt(there.rows.weight) if not there.rows.continuous else 1.0
    noise = replace(
        there.noise,
        response=np.maximum(there.noise.response, sample / root),
        q=now.q,
        q_run=now.q_run,
        q_setup=now.q_setup,
        force=now.force,
        run=now.run,
        stated=now.stated,
        hold=np.maximum(there.noise.hold, float(now.hold.min())),
    )
    return replace(there, noise=noise)


def _spring_changes(there: Bench, rival: Rival) -> Array:
    out = np.zeros(there.layout.size)
    for j, change in enumerate(rival.springs):
        out += change * there.joint_column(j, there.elastic[:, j])
    return out


@dataclass(frozen=True, eq=False)
class _Carried:
    """A word on another bench: its shapes, their weights, and what each of them has beside it."""

    variants: list[Variant]
    weights: list[float]
    further: list[Part]


def _carried(there: Bench, rival: Rival) -> _Carried:
    def placed(variant: Variant, law: Law, unit: Array) -> Variant:
        columns = rows_of(there, rival.word, law, rival.rest) * unit
        return replace(variant, columns=tuple(there.add(c) for c in columns.T))

    top = max(w for *_, w in rival.shapes)
    return _Carried(
        [placed(v, law, unit) for v, law, unit, _ in rival.shapes],
        [float(np.exp(weight - top)) for *_, weight in rival.shapes],
        [replace(p, variant=placed(p.variant, law, unit)) for p, law, unit in rival.further],
    )


def _reached(
    bench: Bench, design: Design, rivals: tuple[Rival, Rival]
) -> tuple[tuple[float, ...], ...]:
    """m: how far either explanation, with all that lasts of it, moves on the way up to each level
    of the design, from the first reading of the setup on."""
    there = make_bench(planned(design, bench))
    n, rows = there.rows.n, there.rows
    far = []
    for r in rivals:
        moved = rows.displacement + _spring_changes(there, r)[:n]
        every = (*r.forms, *r.rest)
        for form in every:
            moved = moved + realise(there, form, every)[:n]
        datum = np.array([moved[np.argmax(rows.setup == s)] for s in range(len(design.setups))])
        far.append(np.abs(moved - datum[rows.setup]))
    largest, up = np.max(far, axis=0), rows.branch == LOADING
    out = []
    for s, levels in enumerate(design.levels):
        mine = up & (rows.setup == s)
        each = [largest[mine & (rows.step == k + 1)].max(initial=0.0) for k in range(len(levels))]
        out.append(tuple(np.maximum.accumulate(each).tolist()))
    return tuple(out)


def _calibrated(design: Design, rivals: tuple[Rival, Rival]) -> float:
    """What the calibration itself says: the gain is known to u, of a prior of `s`; what it reads of
    no gain scatters by u, and passes for one as far as that."""
    gained = []
    for k, r in enumerate(rivals):
        if r.word not in _GAINS:
            continue
        u = float(getattr(design.instruments, _GAINS[r.word]))
        s = max(abs(float(r.forms[0].values[0])), u)
        occam = 0.5 * log(1 + (s / u) ** 2)
        out = occam - 0.5 * s**2 / (s**2 + u**2)
        won = [out, out]  # right to have left the gain out
        won[k] = 0.5 * (s / u) ** 2 - occam
        gained.append(min(won))
    return max(0.0, sum(gained))


__all__ = ["ENOUGH", "Design", "Elsewhere", "NextMeasurement", "Option", "next_measurement"]
