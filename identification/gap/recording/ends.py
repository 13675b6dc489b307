"""What does not belong to a running recording of a pull: readings from before the force was zeroed,
and from after the specimen broke.

A machine that goes on recording after a fracture shows what is left of the specimen, of which no
law of load and time knows anything. A few such readings are set aside, and said; where they are
much of the recording, `faults` says so.
"""

from __future__ import annotations

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.data import GapData
from identification.gap.recording.glitches import picked
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.gap.recording.turns import largest_reversal

_FEWEST = 20  # readings: of fewer nothing is known of what is sudden
_FALLS, _LOADED = 0.25, 0.5  # of the largest force: so far it falls, from that at least,
_SUDDENLY = 8.0  # times the usual step between readings, and the stated uncertainty
_BACK, _LITTLE = 0.05, 0.005  # of the stroke: a pull goes on, also while it breaks
_RECOVERS = 0.9  # of what it fell from: a slip, a crack that is bridged
_MOST = 0.1  # of the readings of a run


def without_ends(data: GapData) -> GapData:
    """The data without such readings, and a note for each kind; as they are where there are none or
    too many of them."""
    after, before = after_break(data), _before_zero(data)
    if any(after[data.run == r].mean() > _MOST for r in np.unique(data.run)):
        after[:] = False
    notes = []
    if after.any():
        notes.append(
            "The force falls at once while the stroke goes on "
            f"({data.time_label(int(after.argmax()))}): a break. "
            f"{_readings(after)} after it set aside."
        )
    if before.any():
        notes.append(
            f"{_readings(before)} at the beginning set aside: the force jumps there from beyond "
            "zero while nothing moves, as when it is zeroed."
        )
    return picked(data, ~(after | before), *notes) if notes else data


def _readings(which: Flags) -> str:
    count = int(which.sum())
    return "1 reading" if count == 1 else f"{count} readings"


def after_break(data: GapData) -> Flags:
    """(n,) readings after the force of a run broke off."""
    out = np.zeros(len(data.force), dtype=bool)
    for mine in _pulls(data):
        at = _break(data.force[mine], data.displacement[mine], data.instruments.force)
        if at is not None:
            out[mine[at:]] = True
    return out


def _pulls(data: GapData) -> list[Ints]:
    """Readings of every run that may be one: none of an arm, nor of levels at rest."""
    if data.arm or not is_continuous(data, hold_ids(data)):
        return []
    runs = (np.flatnonzero(data.run == run) for run in np.unique(data.run))
    return [mine for mine in runs if len(mine) >= _FEWEST]


def _break(force: Array, u: Array, uncertainty: float) -> int | None:
    """First reading of a pull after its first sudden fall of the force, if that is for good."""
    size = (force - force[0]) * np.sign((force - force[0])[int(np.abs(force - force[0]).argmax())])
    usual = max(float(np.median(np.abs(np.diff(size)))), uncertainty)
    step = -np.diff(size, append=size[-1])
    far = max(_FALLS * float(size.max()), _SUDDENLY * usual)
    sudden = np.maximum(step[:-1], step[:-1] + step[1:]) > far
    sudden &= size[:-1] > _LOADED * size.max()
    first = int(sudden.argmax())  # of two readings that a fall may take
    k = first + 1 + int(step[first + 1] > step[first])
    path = (u[: k + 1] - u[0]) * np.sign(u[k - 1] - u[0])
    pulled = largest_reversal(path[:k]) < _BACK * np.ptp(u) and path[k] > path[
        k - 1
    ] - _LITTLE * np.ptp(u)
    gone = size[k:].max() < _RECOVERS * size[k - 1] or len(size) - k <= _MOST * len(size)
    return k if sudden[first] and pulled and gone else None


_NONE = 0.02  # of the range: as good as none


def _before_zero(data: GapData) -> Flags:
    """(n,) first readings of runs, of which the force is of the other sense than all of the load,
    and jumps to zero while the displacement stands."""
    out = np.zeros(len(data.force), dtype=bool)
    for mine in _pulls(data):
        force, u = data.force[mine], data.displacement[mine]
        force = force * np.sign(force[1 + int(np.abs(force[1:]).argmax())])
        first, rest = force[0], force[1:]
        usual = float(np.median(np.abs(np.diff(rest))))
        zero = max(_NONE * float(np.ptp(rest)), _SUDDENLY * usual)
        stands = abs(u[1] - u[0]) < _NONE * np.ptp(u)
        out[mine[0]] = stands and first < min(rest.min(), 0.0) - zero and abs(rest[0]) < zero
    return out
