"""Whether a repetition was zeroed while the screw still pressed: one rule, for the procedure and
for the evaluation.

What was zeroed under load shows once the load is gone: force and displacement stand on the unloaded
side of their zeros, both at once, and in the ratio of the loading curve itself. An amplifier that
drifts moves the force alone, an arm that gives way the displacement, and the other way.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

Pair = tuple[float, float]  # force N, and displacement or the laser's reading, mm

LEAST = 0.05  # of the largest load: a zero nearer than that is another's concern (drift)
_CURVED = 2.0  # so far beyond its flattest and steepest secant a curve may go on where none looked
_NEAR = 0.1  # of the largest load: nearer to the zero a secant is noise


def tared_under_load(before: Pair, loaded: Sequence[Pair], after: Pair) -> bool:
    """Whether that is how a repetition looks.

    before, after: without load, ahead of the steps and behind them; loaded: at the steps. The
    displacement may have any sign and datum.
    """
    rises = [(f - before[0], u - before[1]) for f, u in loaded]
    top = max((f for f, _ in rises), key=abs, default=0.0)
    if top == 0.0:
        return False
    secants = [u / f for f, u in rises if abs(f) > _NEAR * abs(top)]  # mm/N
    usual = median(secants)
    back_N, back_mm = before[0] - after[0], before[1] - after[1]
    if back_N / top <= LEAST or usual == 0.0:
        return False
    ratios = [s / usual for s in secants]
    return min(ratios) / _CURVED <= back_mm / back_N / usual <= _CURVED * max(ratios)
