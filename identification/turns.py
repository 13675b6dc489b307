"""Where a signal turns."""

from __future__ import annotations

from identification.arrays import Array


def turning_points(values: Array, back: float) -> list[int]:
    """Where values (n,) turn: extremes from which they come back by more than `back`. Smaller
    reversals, noise among them, stay within a pass."""
    out: list[int] = []
    if values.size == 0 or not back > 0:
        return out
    path = values.tolist()
    high = low = 0
    rising: bool | None = None  # until it has left its beginning, whose noise is no turn
    for i, value in enumerate(path):
        if value > path[high]:
            high = i
        if value < path[low]:
            low = i
        if rising is not False and path[high] - value > back:
            if rising:
                out.append(high)
            rising, low = False, i
        elif rising is not True and value - path[low] > back:
            if rising is False:
                out.append(low)
            rising, high = True, i
    return out
