"""The force at which screw and arm meet."""

from __future__ import annotations

import math
from collections.abc import Callable

ACCURACY_M = 1.0e-11
ACCURACY_N = 1.0e-9


def root(excess: Callable[[float], float], guess: float, compliance: float, most: float) -> float:
    """The force (N) in [0, most] at which `excess` (m, rising with force) passes zero.

    Zero if it is not negative there. From `guess` steps as the `compliance` (m/N) suggests, ever
    longer, until the root is enclosed; then false position with the Illinois rule (Dowell, Jarratt
    1971), which also closes in on a jump. `brentq` of scipy takes no guess: from the force of a
    moment ago four looks at the arm do, it takes ten, and its import a third of a second.
    """
    low, below = 0.0, excess(0.0)
    if below >= 0:
        return 0.0
    high, above = most, math.inf
    force, stride, side = min(max(guess, 0.0), most), 1.0, 0
    for _ in range(200):
        value = excess(force)
        if abs(value) < ACCURACY_M:
            break
        if value > 0:
            high, above = force, value
            below = 0.5 * below if side > 0 else below
            side = 1
        else:
            low, below = force, value
            above = 0.5 * above if side < 0 else above
            side = -1
        if high - low < ACCURACY_N:
            break
        if math.isinf(above):
            stride *= 2.0
            force = min(most, low - stride * below / compliance)
        else:
            force = (low * above - high * below) / (above - below)
    return force
