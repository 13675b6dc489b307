"""What is to be known of the data beside a verdict: faults, what was set aside, what they can't
decide."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from identification.gap.data import GapData
from identification.gap.model.bench import Bench
from identification.gap.model.noise import NOISY
from identification.gap.recording.force_drops import ForceDrops

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
    if bench.load_history.gives_out and verdict != "time_lag":
        yield Note(REMARK, _gives_out(bench.load_history.gives_out))


def _faults(bench: Bench) -> Iterator[str]:
    force, moved = bench.data.force, bench.data.displacement
    if len(force) > _BY_CHANCE and not np.ptp(force) > 0 and not np.ptp(moved) > 0:
        yield (
            f"Force and displacement read one number each, {len(force)} times: real channels "
            "scatter. See whether they were connected."
        )
    yield from (f.text for f in bench.load_history.faults)
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
    if not bench.load_history.unloads:
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
    if bench.load_history.timeless:
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
    if bench.load_history.let_go:
        yield _let_go(bench.load_history.let_go, bench.data)
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


def _gives_out(share: float) -> str:
    return (
        "Every loop of force over displacement runs the other way round: it gives out work, "
        f"{100 * share:.0f} % of the box around it, as nothing does that is only pushed. A force "
        "that is read late shows it so, a transducer with a hysteresis of its own, or something "
        "active drives the rig."
    )


def _let_go(snaps: ForceDrops, data: GapData) -> str:
    span = float(np.ptp(data.force))
    times = "once" if snaps.count == 1 else f"{snaps.count} times"
    return (
        f"The force falls at once while the stroke goes on, {times}, by up to "
        f"{snaps.largest * span:.3g} N (first {data.time_label(snaps.first)}): it sticks and "
        "slips, snaps, cracks or is torn off, as no effect of the library does."
    )
