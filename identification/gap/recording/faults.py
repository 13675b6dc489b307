"""Readings that nothing on a rig makes: faults of an instrument, which no effect explains.

A laser on a loose mount rings in spells; a camera loses its target, and hands out its last number;
a dial is misread by a whole turn; an amplifier is full; a specimen has long been broken; a cable is
not plugged in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from identification.arrays import Array
from identification.gap.data import LOADING, GapData
from identification.gap.recording.ends import after_break
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.gap.recording.white import QUARTILE
from identification.gap.recording.wraps import wraps
from identification.running import first_rows


@dataclass(frozen=True)
class Fault:
    """kind: one of the names below; text: what is wrong, where, and what to see to."""

    kind: str
    text: str


SIGNS, BURSTS, FROZEN, GOES_BACK, JUMPS, WRAPS, FULL, BROKEN, SILENT = (
    "signs",
    "bursts",
    "frozen",
    "goes back",
    "jumps",
    "wraps",
    "full",
    "broken",
    "silent",
)


def found_in(data: GapData) -> tuple[Fault, ...]:
    """Every fault that is found."""
    told = {kind: text for kind, detector in _DETECTORS.items() if (text := detector(data))}
    if SIGNS in told:  # what counts the wrong way goes back all the time
        told.pop(GOES_BACK, None)
    return tuple(Fault(kind, text) for kind, text in told.items())


# --- what is said of each ------------------------------------------------------------------------


def _signs(data: GapData) -> str:
    against = goes_against(data)
    if not against:
        return ""
    return (
        f"The displacement falls while the force grows, in {', '.join(against)}: one of the "
        "two has the wrong sign. See which way force and displacement count, turn one of them in "
        "the table, and diagnose again."
    )


def _bursts(data: GapData) -> str:
    if not bursts(data):
        return ""
    sensor = "laser" if data.arm else "displacement sensor"
    return (
        "Readings at rest scatter in spells, far beyond what they scatter mostly: vibration or "
        f"glitches, which no effect explains. See to the {sensor}'s mounting and to the cables."
    )


def _lost(data: GapData) -> str:
    since = frozen_since(data)
    if since is None:
        return ""
    at = f"After {since:.4g} s" if data.timed else f"After {since:.0f} readings of a run"
    return (
        f"{at} the displacement is the same number, less than was read before, while the force "
        "goes on growing: the sensor has lost its target, or stands still. See to it."
    )


def _goes_back(data: GapData) -> str:
    back = goes_back(data)
    if back is None:
        return ""
    return (
        f"At {data.force[back]:.4g} N the displacement goes back, from "
        f"{1e3 * data.displacement[back - 1]:.4g} to {1e3 * data.displacement[back]:.4g} mm, "
        "though the force grows: misread, mistyped, a sensor that slipped, or something else "
        "that moves the target. See to these readings."
    )


def _jumps(data: GapData) -> str:
    stuck = jumps_to(data)
    if stuck is None:
        return ""
    share = float(np.mean(data.displacement == stuck))
    return (
        f"The displacement jumps to one and the same number, {1e3 * stuck:.6g} mm, and back "
        f"again and again ({100 * share:.0f} % of the readings) while the force stands: what a "
        "sensor, or its converter, says when it has nothing to say. See to it."
    )


def _wraps(data: GapData) -> str:
    size = wraps(data)
    if size is None:
        return ""
    return (
        f"The displacement jumps by {1e3 * size:.4g} mm against its way, from one end of its range "
        "to the other, again and again: a counter that starts again. Unwrap it in the table, and "
        "diagnose again."
    )


def _full(data: GapData) -> str:
    full = saturates(data)
    if full is None:
        return ""
    return (
        f"From step to step the force stays at {full:.4g} N, while the displacement goes on as "
        "before: an amplifier that is full, or a range that is too small. See to it."
    )


def _broken(data: GapData) -> str:
    broken = after_break(data)
    if not broken.any():
        return ""
    return (
        "The force falls at once while the stroke goes on "
        f"({data.time_label(int(broken.argmax()))}), and {100 * broken.mean():.0f} % of the "
        "readings come after that: a break. End the recording there to learn of what was before."
    )


def _silent(data: GapData) -> str:
    said = []
    if quiet := ", ".join(silent(data, "force")):
        said.append(
            f"The force does not answer the displacement ({quiet}): it stays within its noise. See "
            "whether anything bears at all, and to the force sensor and its cables."
        )
    if quiet := ", ".join(silent(data, "displacement")):
        sensor = "laser" if data.arm else "displacement sensor"
        said.append(
            f"The displacement does not answer the force ({quiet}): it stays within its noise. See "
            f"whether the {sensor} looks at the target, and to its cables."
        )
    return " ".join(said)


_DETECTORS: dict[str, Callable[[GapData], str]] = {
    SIGNS: _signs,
    BURSTS: _bursts,
    FROZEN: _lost,
    GOES_BACK: _goes_back,
    JUMPS: _jumps,
    WRAPS: _wraps,
    FULL: _full,
    BROKEN: _broken,
    SILENT: _silent,
}


# --- how each is found ---------------------------------------------------------------------------

_AGAINST = -0.8  # correlation of force and displacement
_BEGINS = 0.5  # of the largest force: a record that starts above that may be one of giving way


def goes_against(data: GapData) -> tuple[str, ...]:
    """Poses and directions in which the displacement falls while the force grows from little, all
    the way and by far more than the instrument's uncertainty, as nothing goes that is pressed."""
    out = []
    for i, setup in enumerate(data.setups):
        mine = data.setup == i
        raw, moved = data.force[mine], data.displacement[mine]
        if not raw.size:
            continue
        _, first, run = np.unique(data.run[mine], return_index=True, return_inverse=True)
        force, u = (v - (np.bincount(run, v) / np.bincount(run))[run] for v in (raw, moved))
        size = float(np.sqrt((force @ force) * (u @ u)))
        far = np.ptp(moved) > _CLEARLY * data.instruments.displacement
        grows = float(np.abs(raw[first]).max()) < _BEGINS * float(np.abs(raw).max())
        if far and grows and float(force @ u) < _AGAINST * size:
            out.append(f"{setup.pose}/{setup.direction}" if data.arm else setup.direction)
    return tuple(out)


_SURE = 4.0  # standard errors of what goes with it
_QUIET = 2.0  # standard uncertainties: what is stated is known to a factor of two (GUM G.4.2)
_EXPECTED = 30.0  # standard uncertainties that are simulated, of either channel
_LEVELS = 3  # of a force that is said to be stepped: without one a displacement may stay


def silent(data: GapData, channel: Literal["force", "displacement"]) -> tuple[str, ...]:
    """Poses and directions in which that channel is noise while the other one, which the rig
    drives, goes far: nothing of it goes with that, as little as that may be. A force that stays
    while nobody said that a stroke is imposed is the force of a rig that drifts."""
    out, meter = [], data.instruments
    for i, setup in enumerate(data.setups):
        mine = data.setup == i
        levels = np.unique(data.step[mine & (data.branch == LOADING)])
        stepped = data.imposed == "force" or len(levels) >= _LEVELS
        driven = data.imposed == "displacement" if channel == "force" else stepped
        if not mine.any() or not driven:
            continue
        slope = float(setup.lever**2 @ data.compliance) + setup.outside
        force, stroke = slope * data.force[mine], data.displacement[mine]
        u_force, u_stroke = slope * meter.force, meter.displacement
        gone, answer, u = (
            (stroke, force, u_force) if channel == "force" else (force, stroke, u_stroke)
        )
        if np.ptp(gone) > _EXPECTED * max(u_force, u_stroke) and _is_noise(gone, answer, u):
            out.append(f"{setup.pose}/{setup.direction}" if data.arm else setup.direction)
    return tuple(out)


def _is_noise(gone: Array, answer: Array, u: float) -> bool:
    """Whether an answer (n,) is noise of standard uncertainty u, of which nothing goes with what
    was gone (n,), in the same unit."""
    x, y = gone - gone.mean(), answer - answer.mean()
    with_it = float(x @ y) / float(x @ x)
    left = y - with_it * x
    error = float(np.sqrt((left @ left) / max(len(x) - 2, 1) / (x @ x)))
    return bool(abs(with_it) <= _SURE * error and np.sqrt(np.mean(y**2)) < _QUIET * u)


_SETTLED = 2  # samples of a hold at least: a lag, or a joint that still creeps
_BEYOND, _BURSTS = 4.5, 0.03  # robust standard deviations, and the share that is too much
_FEWEST_STEPS = 50
_ONE_WAY = 0.7  # of 20 spells by chance once in 400 times


def bursts(data: GapData) -> bool:
    """Whether readings at rest scatter in spells, far beyond what they scatter mostly: vibration,
    glitches. Samples of the later half of a hold, where no effect jumps and lags have caught up,
    against the straight line between their neighbours, which creep follows closely. What comes late
    is off the way the load last went; spells know no way."""
    hold = hold_ids(data)
    if is_continuous(data, hold):
        return False
    starts = first_rows(hold)
    within = np.arange(len(hold)) - starts[hold]
    settled = np.maximum(_SETTLED, np.bincount(hold)[hold] // 2)
    late = (hold[2:] == hold[:-2]) & (within >= settled)[1:-1]
    t = data.time
    share = np.clip((t[1:-1] - t[:-2]) / np.maximum(t[2:] - t[:-2], 1e-300), 0.0, 1.0)
    away, pushed = (
        (v[1:-1] - v[:-2] - share * (v[2:] - v[:-2]))[late] for v in (data.displacement, data.force)
    )
    if away.size < _FEWEST_STEPS:
        return False
    away = away - pushed * float(pushed @ away) / max(float(pushed @ pushed), 1e-300)
    usual = max(float(np.median(np.abs(away))) / QUARTILE, data.instruments.displacement)
    far = np.abs(away) > _BEYOND * usual
    came = np.diff(data.force[starts], prepend=0.0)[hold][1:-1][late]
    ways = np.sign(away * came)[far]
    return bool(np.mean(far) > _BURSTS and abs(ways.mean()) < _ONE_WAY)


_MORE, _BACK = 0.02, 0.1  # of the ranges of force and displacement in a run


def goes_back(data: GapData) -> int | None:
    """First reading of a level that is read further back than the one before it, by far more than
    the instrument's uncertainty, under a force that is larger throughout, as nothing goes that is
    pressed: one that relaxes at a stroke recovers after the stroke went back. None where there is
    none. Of levels at rest: in a running recording glitches are set aside."""
    hold = hold_ids(data)
    if is_continuous(data, hold):
        return None
    first = first_rows(hold)
    count = np.bincount(hold)
    force, u = (np.add.reduceat(v, first) / count for v in (data.force, data.displacement))
    least = np.minimum.reduceat(np.abs(data.force), first)
    most = np.maximum.reduceat(np.abs(data.force), first)
    for run in np.unique(data.run):
        at = np.flatnonzero(data.run[first] == run)
        step = np.diff(u[at])
        way = np.sign(force[at][1:] + force[at][:-1]) * step  # wherever the datum lies
        far = max(_CLEARLY * data.instruments.displacement, _BACK * float(np.ptp(u[at])))
        same = force[at][1:] * force[at][:-1] >= 0
        branch = data.branch[first][at]  # a force that comes late still grows when it is let go
        same &= branch[1:] == branch[:-1]
        grows = least[at][1:] - most[at][:-1] > _MORE * float(np.ptp(force[at]))
        wrong = np.flatnonzero(same & grows & (way < -far))
        if wrong.size:
            return int(first[at[wrong[0] + 1]])
    return None


_SAME_FORCE, _GOES_ON = 3.0, 0.3  # standard uncertainties; of the usual way from step to step
_SATURATED = 2  # steps
_NO_STEP = 0.02  # of the largest force: less is no step, whatever a reading is uncertain by


def saturates(data: GapData) -> float | None:
    """Force (N), the largest of its run either way, that holds of ascending steps share while the
    displacement goes on; None where there is none. Of an arm: its steps are steps of the force."""
    hold = hold_ids(data)
    if not data.arm or is_continuous(data, hold):
        return None
    first, count = first_rows(hold), np.bincount(hold)
    force, u = (np.add.reduceat(v, first) / count for v in (data.force, data.displacement))
    seen = 0
    for run in np.unique(data.run):
        at = np.flatnonzero((data.run[first] == run) & (data.branch[first] == LOADING))
        if not at.size:
            continue
        top = float(force[at][np.abs(force[at]).argmax()])  # below zero where it is pulled
        same = min(_SAME_FORCE * data.instruments.force, _NO_STEP * abs(top))
        ways, steps = np.sign(top) * np.diff(u[at]), np.diff(data.step[first][at])
        goes_on = ways > max(
            _CLEARLY * data.instruments.displacement,
            _GOES_ON * float(np.median(np.abs(ways))) if ways.size else 0.0,
        )
        stays = (np.abs(np.diff(force[at])) < same) & (steps > 0) & goes_on
        stays &= np.abs(force[at][1:] - top) < same
        seen += int(stays.sum())
        if seen >= _SATURATED and stays.any():
            return top
    return None


_OFTEN, _SHARE, _SAME = 5, 0.05, 0.02  # times; share of the readings; of the range of the force


def jumps_to(data: GapData) -> float | None:
    """The number (m) to which the displacement jumps from one side, and comes back from, again and
    again, by far more than the instrument's uncertainty while the force stands; None where there is
    none."""
    u, force = data.displacement, data.force
    far = max(_CLEARLY * data.instruments.displacement, _BACK * float(np.ptp(u)))
    still = _SAME * float(np.ptp(force))
    values, count = np.unique(u, return_counts=True)
    for value in values[count >= max(_OFTEN, _SHARE * len(u))]:
        at = np.diff(u == value, prepend=False, append=False).nonzero()[0]
        first, last = at[::2] - 1, at[1::2]  # the readings before and after
        inside = (first >= 0) & (last < len(u))
        a, b = first[inside], last[inside]
        jumps = np.minimum((u[a] - value) * np.sign(u[b] - value), np.abs(u[b] - value)) > far
        stands = (data.run[a] == data.run[b]) & (np.abs(force[a] - force[b]) <= still)
        stands &= np.abs(force[a + 1] - force[b]) <= still
        if np.sum(jumps & stands) >= _OFTEN and np.mean(jumps & stands) > 0.5:
            return float(value)
    return None


_LONG = 10  # readings
_GROWS = 0.2  # of the range of the force of a run
_CLEARLY = 10.0  # standard uncertainties: so far back no law of mechanics goes under more force


def frozen_since(data: GapData) -> float | None:
    """Time (s, within a run) from which the displacement is one and the same number, which it had
    passed before, while the force grows beyond all that was; None where there is no such time."""
    for run in np.unique(data.run):
        mine = data.run == run
        at = _frozen(data.displacement[mine], data.force[mine], data.instruments.displacement)
        if at is not None:
            return float(data.time[mine][at])
    return None


def _frozen(u: Array, force: Array, uncertainty: float) -> int | None:
    """First reading of a stretch of equal ones under a force that no earlier one was under."""
    edges = np.flatnonzero(np.diff(u, prepend=np.nan, append=np.nan) != 0)
    size, sign = np.abs(force - force[0]), np.sign(u[int(np.abs(u - u[0]).argmax())] - u[0])
    for a, b in pairwise(edges.tolist()):
        if b - a < _LONG or a == 0:
            continue
        grown = float(size[a:b].max()) - float(size[:a].max())
        back = float(np.max(sign * (u[:a] - u[a])))
        if grown > _GROWS * float(size.max()) and back > _CLEARLY * uncertainty:
            return a
    return None
