"""A part that has let go of the rig: what the stroke does then is not done to the part.

What yields, or creeps and relaxes, is longer (or flatter) after the first push than before. On the
way back its force ends before the stroke does, and begins again where it ended; a press, a probe
or a tendon's grip moves on by itself between. A law of the imposed stroke would ask for a pull
there that nobody exerts. So readings without force are set aside where the part lets go further
in than it was met; what plays or gets in touch the same way every time stays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Flags, Ints
from identification.gap.data import GapData
from identification.gap.recording.glitches import picked
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.gap.recording.imposed import displacement_imposed
from identification.gap.recording.white import white_sd

_FEWEST = 20  # readings: of fewer nothing is known of what noise is
_NOTHING, _NOISE = 0.01, 4.0  # of the largest force; standard deviations
_TOUCHED = 5.0  # times nothing
_UNLOADED = 2.0  # times nothing, from zero or where it began: beyond that a part is held, and pulls
_FURTHER = 0.02  # of the stroke


def without_lost_contact(data: GapData) -> GapData:
    """The data without such readings, and a note; as they are where there are none."""
    if data.arm or not (is_continuous(data, hold_ids(data)) and displacement_imposed(data)):
        return data
    off = np.zeros(len(data.force), dtype=bool)
    for run in np.unique(data.run):
        mine = np.flatnonzero(data.run == run)
        if len(mine) >= _FEWEST:
            off[mine] = _let_go(data, mine)
    if not off.any():
        return data
    note = (
        f"The part lets go of the rig before the stroke is back where it was met "
        f"({data.time_label(int(off.argmax()))}): "
        f"{int(off.sum())} readings without force set aside."
    )
    return replace(picked(data, ~off, note), imposed="displacement", lets_go=True)


def _let_go(data: GapData, mine: Ints) -> Flags:
    """(m,) readings of a run between its last force on a way back and its first on the next."""
    none = np.zeros(len(mine), dtype=bool)
    force, path = data.force[mine], data.displacement[mine]
    most = int(np.abs(force - force[0]).argmax())
    force = force * np.sign(force[most] - force[0])
    path = (path - path[0]) * np.sign(path[most] - path[0])
    noise = max(data.instruments.force, white_sd(np.diff(force, 2)))
    nothing = max(_NOTHING * float(np.ptp(force)), _NOISE * noise)
    level = float(np.median(force[force < force.min() + 2 * nothing]))
    if min(abs(level), abs(level - force[0])) > _UNLOADED * nothing:
        return none
    felt = force > level + nothing
    touched = force > level + _TOUCHED * nothing
    if not touched.any():
        return none
    met = int(np.argmax(touched))
    first = path[:met][~felt[:met]]
    start = float(first[-1]) if first.size else 0.0
    edges = np.flatnonzero(np.diff(felt[met:], prepend=True, append=True)) + met
    least = _FURTHER * float(np.ptp(path))
    for begin, end in edges.reshape(-1, 2):
        # what loses its force on the way in breaks, or snaps
        back = path[begin] < path[: begin + 1].max() - least
        lowest = float(path[begin:end].min())
        again = end == len(path) or path[end - 1] > lowest + 0.25 * least  # after the next turn
        went = back and again and path[begin] - lowest > least
        later = path[begin] > start + least
        none[begin + 1 : end if end == len(path) else end - 1] = went and later
    return none
