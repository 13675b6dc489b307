"""What is to be known beside a verdict: faults, what was set aside, what data can't decide."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from identification.gap.data import GapData
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation, SearchResult
from identification.gap.explanations.fit import Fit, fit
from identification.gap.explanations.verdict import FLANKS, flanks_of_one_joint, troubles_named
from identification.gap.judging.broken import broken
from identification.gap.judging.strain import what_is_strained
from identification.gap.model.bench import Bench
from identification.gap.model.noise import NOISY, SWINGS
from identification.gap.recording.snaps import Snaps

FAULT, ASIDE, UNDECIDED, REMARK = KINDS = ("fault", "set aside", "undecided", "remark")


@dataclass(frozen=True)
class Note:
    """A sentence or two; kind: one of KINDS."""

    kind: str
    text: str


def ordered(notes: Iterable[Note]) -> tuple[Note, ...]:
    """By kind, what is to be seen to first."""
    return tuple(sorted(notes, key=lambda n: KINDS.index(n.kind)))


def notes_of(bench: Bench, verdict: str) -> Iterator[Note]:
    """What is said of the data. Where nothing moves, "no gap" is no finding; a drift may be one."""
    still = FAULT if verdict == "none" else UNDECIDED
    yield from (Note(still, text) for text in _nothing_moves(bench))
    yield from (Note(FAULT, text) for text in _faults(bench))
    yield from (Note(ASIDE, text) for text in bench.data.aside)
    yield from (Note(UNDECIDED, text) for text in _undecided(bench))
    yield from (Note(REMARK, text) for text in (*bench.data.notes, *_remarks(bench)))


def _faults(bench: Bench) -> Iterator[str]:
    force, moved = bench.data.force, bench.data.displacement
    if len(force) > _BY_CHANCE and not np.ptp(force) > 0 and not np.ptp(moved) > 0:
        yield (
            f"Force and displacement read one number each, {len(force)} times: real channels "
            "scatter. See whether they were connected."
        )
    yield from (f.text for f in bench.course.faults)
    if bench.data.force_scatters > NOISY:
        yield (
            f"The force scatters {bench.data.force_scatters:.0f} times as much as stated while the "
            "displacement stands still: an uncertainty that was judged too small, or hum. It was "
            "taken as uncertain as it is."
        )
    if bench.noise.raised > NOISY:
        yield (
            f"Readings scatter {bench.noise.raised:.0f} times as much as stated: vibration, or an "
            "uncertainty that was judged too small. They were taken as uncertain as they are."
        )


_BY_CHANCE = 3  # readings that may be alike


def _nothing_moves(bench: Bench) -> Iterator[str]:
    """Of data in which no gap could be seen."""
    if not np.ptp(bench.load) > 0:
        yield "The load does not change: nothing can be said of stiffness or of joints."
    elif bench.reach < bench.noise.stated:
        yield (
            f"Nothing moves by more than {1e3 * bench.reach:.2g} mm, less than a reading is "
            f"uncertain by ({1e3 * bench.noise.stated:.2g} mm): hardly anything can be said."
        )


def _undecided(bench: Bench) -> Iterator[str]:
    data, rows = bench.data, bench.rows
    if not bench.course.unloads:
        yield "Nothing was unloaded: lasting and elastic deflection look alike."
    if len(np.unique(rows.repetition)) < 2 and not rows.continuous:
        yield "One repetition: what repeats and what does not can't be told apart."
    if data.arm and not bench.has_q:
        alike = "joints, links and base look alike"
        if data.q is None:
            yield f"No joint readings to go by: {alike}."
        else:
            yield f"Joint readings are taken before the gear: {alike}."
    if data.session is None and data.arm:
        yield "No session clock: drifts are seen only within runs and from run to run."
    if bench.course.timeless:
        yield "No time was recorded: lags, creep and how fast it flowed are left out."
    elif not data.timed:
        yield "No time was recorded: readings are counted as one a second, and so are all times."


def _remarks(bench: Bench) -> Iterator[str]:
    if bench.known is not None and bench.known.left >= bench.noise.stated:
        yield (
            f"Up to {1e3 * bench.known.left:.3g} mm rms of what the simulation's effects do are no "
            "gap: no law is met better than that."
        )
    if bench.known is not None and bench.known.across:
        yield (
            "What the model's effects leave stays here while the arm goes from pose to pose. A "
            "model that was made in one pose can't know that, and the gap is what goes beyond it."
        )
    if bench.course.let_go:
        yield _let_go(bench.course.let_go, bench.data)
    beyond = int(np.count_nonzero(bench.rows.overshoot))
    if beyond:
        yield (
            f"Before {beyond} of {len(bench.rows.edges)} levels the load seems to have gone too "
            "far, and back, while nothing was read: what remembers stands on its other branch "
            "there. This was put in from the displacement itself, and these levels don't count "
            "as withheld. Come to each level from one side, or record the way there."
        )
    if bench.imposed:
        yield "The displacement is imposed: force is predicted from it."
    elif bench.data.imposed == "displacement":
        yield (
            "The displacement is imposed; at rest the joints bear the force that was read: "
            "displacement is predicted from it."
        )


def _let_go(snaps: Snaps, data: GapData) -> str:
    span = float(np.ptp(data.force))
    times = "once" if snaps.count == 1 else f"{snaps.count} times"
    return (
        f"The force falls at once while the stroke goes on, {times}, by up to "
        f"{snaps.largest * span:.3g} N (first {data.moment(snaps.first)}): it sticks and slips, "
        "snaps, cracks or is torn off, as no effect of the library does."
    )


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


def left_out(chosen: Explanation, fuller: Explanation | None) -> tuple[Note, ...]:
    """Of effects that do too little to be named, though with them (fuller) more is explained."""
    if fuller is None or fuller.words <= chosen.words:
        return ()
    small = {w: s for w, s in fuller.troubles.items() if w not in chosen.words}
    larger = max(small.values()) > max(chosen.troubles.values())
    text = (
        f"{' and '.join(f'{w} ({1e3 * s:.2g} mm rms)' for w, s in small.items())} beside it would "
        f"explain {fuller.log_weight - chosen.log_weight:.0f} nats more. "
        f"So {'few nats' if larger else 'little'} may as well be how far the law of "
        f"{' and '.join(chosen.troubles)} is off: it is not named. To see it: "
        f"{' '.join(f'--add {w}' for w in small)}."
    )
    return (Note(REMARK, text),)


def called(found: SearchResult, chosen: Explanation, verdict: str) -> tuple[Note, ...]:
    """Of a play and a curve of one joint of an arm, why the smaller one is the verdict."""
    arm = found.engine.bench.data.arm
    if not arm or verdict not in FLANKS or not flanks_of_one_joint(chosen):
        return ()
    (other,), named = FLANKS - {verdict}, troubles_named(chosen, found.explanations)
    if other in named or chosen.troubles[verdict] > chosen.troubles[other]:
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
    bench = engine.bench
    if not bench.has_q:
        return ()
    missed, noise = fitted.missed_readings(engine)
    turned = bench.observed[bench.layout.q].reshape(missed.shape)
    beyond = np.sqrt(np.mean((missed / noise) ** 2, axis=1))
    most = np.abs(missed).max(axis=1)
    off = (beyond > _MISSED) & (most > _OF_WAY * np.ptp(turned, axis=1))
    return tuple(
        Note(
            REMARK,
            f"Joint {j + 1} turns otherwise than the effects found have it, by up to "
            f"{1e3 * most[j]:.2g} mrad, "
            f"{beyond[j]:.0f} times (rms) what its readings scatter: its stiffness is a mean over "
            "these loads, and less certain than is said.",
        )
        for j in np.flatnonzero(off)
    )


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
    words, fitted = " and ".join(best.troubles), fit(found.engine, best)
    off, word = broken(found.engine, best, fitted)
    if off > 1:
        text = (
            f"What explains the gap best ({words}) takes a {word} outside what that word allows, "
            "and what is allowed explains less: it was not believed."
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
    asks = what_is_strained(found.engine, fitted, best.eta)
    if not asks:
        return ()
    what = f"What explains the gap best ({words})" if words else "Without any effect, the best fit"
    text = (
        f"{what} asks for {asks}: it was not believed. "
        "See whether META states too small an uncertainty."
    )
    return (Note(REMARK, text),)
