"""Paths of a channel in pieces, a line or half a cosine each, and what the fewest of them cost."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Ints

TURNS = (0.5, 0.2, 0.08)  # of the range: what counts as going back
MISJUDGED = 3.0  # factor by which a stated uncertainty may be too small
TOP = 0.03  # of a leg: a level next to its turning point
_PER_PIECE = 0.1  # nats that one more piece costs, of a path of a few legs,
_FEW_LEGS = 10  # and of more the less: legs that both channels go tell nothing of either
_MOST_PIECES, _PIECES_PER_LEG, _SPARE = 200, 4, 9


@dataclass(frozen=True, eq=False)
class Channel:
    """values (n,) over time (n,) in units of their range; noise: standard deviation of a point."""

    time: Array
    values: Array
    noise: float


def legs(channel: Channel) -> int:
    """How often a channel goes one way."""
    return len(zigzag(channel.values, max(TURNS[-1], 6 * channel.noise))) - 1


def cost(channel: Channel, floor: float, of: int = 1) -> float:
    """Nats: half the logarithm of what the best number of pieces leaves, and what they cost. of:
    legs that it has in common with the channel that it is compared with."""
    costs, known = [], set()
    per_piece = _PER_PIECE * min(1.0, _FEW_LEGS / of)
    for share in (np.inf, *TURNS):
        edges, times = _turns(channel, max(share, 6 * channel.noise))
        if len(edges) > _MOST_PIECES or edges.tobytes() in known:
            continue
        known.add(edges.tobytes())
        costs += [
            0.5 * float(np.log(left + floor)) + per_piece * pieces
            for pieces, left in _refined(channel, edges, times, 0.1 * floor)
        ]
    return min(costs)


def _turns(channel: Channel, back: float) -> tuple[Ints, Array]:
    """Ends of the legs (from 0 to n), and when the channel turned there: where it goes back by
    `back`, between passing a level next to it on the way there and back. Line and cosine alike
    pass it at a distance in proportion to the length of their leg."""
    t, y, edges = channel.time, channel.values, zigzag(channel.values, back)
    places, times = [0], [float(t[0])]
    for before, here, after in zip(edges, edges[1:], edges[2:], strict=False):
        low, high = here - (here - before) // 4, here + (after - here) // 4
        depth = np.abs(y[low : high + 1] - y[here])
        leg = min(abs(y[here] - y[before]), abs(y[here] - y[after - 1]))
        start, end = _passes(t[low : high + 1], depth, max(3 * channel.noise, TOP * float(leg)))
        came, goes = t[here] - t[before], t[after - 1] - t[here]
        times.append(start + (end - start) * float(came / max(came + goes, 1e-300)))
        places.append(int(np.searchsorted(t, times[-1])))
    kept, first = np.unique([*places, len(y)], return_index=True)
    return kept.astype(np.int64), np.array([*times, float(t[-1])])[first]


def _passes(t: Array, depth: Array, level: float) -> tuple[float, float]:
    """When the depth under a turning point first is less than the level, and last."""
    near = np.flatnonzero(depth <= level)
    first, last = int(near[0]), int(near[-1])
    start, end = float(t[first]), float(t[last])
    if first > 0:
        start = float(np.interp(-level, -depth[first - 1 : first + 1], t[first - 1 : first + 1]))
    if last + 1 < len(t):
        end = float(np.interp(level, depth[last : last + 2], t[last : last + 2]))
    return start, end


def zigzag(y: Array, back: float) -> list[int]:
    """Ends of the legs of a channel (n,), from 0 to n: where it goes back by so much."""
    turns, low, high, rising = [0], 0, 0, None
    values = y.tolist()
    for i, x in enumerate(values):
        low = i if x < values[low] else low
        high = i if x > values[high] else high
        if rising is not False and values[high] - x > back:
            turns.append(high)
            low, rising = i, False
        elif rising is not True and x - values[low] > back:
            turns.append(low)
            high, rising = i, True
    return sorted({*turns, len(values)})


def _refined(channel: Channel, edges: Ints, times: Array, enough: float) -> list[tuple[int, float]]:
    """(pieces, squared share that they leave), the worst piece cut in two again and again."""
    when = {int(i): float(t) for i, t in zip(edges, times, strict=True)}
    broken = _broken_off(edges, times)

    def misfit(start: int, end: int) -> Array:
        spans = [(when[start], when[end]), *broken.get((start, end), [])]
        return _misfit(channel.time[start:end], channel.values[start:end], spans)

    pieces = {(int(a), int(b)): misfit(int(a), int(b)) for a, b in pairwise(edges)}
    most, out = min(_MOST_PIECES, _PIECES_PER_LEG * len(pieces) + _SPARE), []
    while True:
        left = _structure(channel, np.concatenate([pieces[p] for p in sorted(pieces)]))
        out.append((len(pieces), left))
        start, end = max(pieces, key=lambda p: float(pieces[p] @ pieces[p]))
        if left < enough or len(pieces) >= most or end - start < 3:
            return out
        cut = start + _best_cut(channel.time[start:end], channel.values[start:end])
        when[cut] = float(channel.time[cut])
        del pieces[start, end]
        for a, b in ((start, cut), (cut, end)):
            pieces[a, b] = misfit(a, b)


def _broken_off(edges: Ints, times: Array) -> dict[tuple[int, int], list[tuple[float, float]]]:
    """Of the first and the last leg, of which the recording may hold a part: from when to when
    they last if they are as long as their neighbours."""
    if len(edges) < 3:
        return {}
    e, t = edges.tolist(), times.tolist()
    return {
        (e[0], e[1]): [(t[1] - (t[2] - t[1]), t[1])],
        (e[-2], e[-1]): [(t[-2], t[-2] + (t[-2] - t[-3]))],
    }


def _misfit(t: Array, y: Array, spans: list[tuple[float, float]]) -> Array:
    """What a line leaves of the points, or half a cosine over one of the spans of time, whichever
    is least."""
    if len(t) < 3:
        return np.zeros(len(t))
    y = y - y.mean()
    left = [_beside(t, y)]
    left += [_beside(np.cos(np.pi * (t - a) / max(b - a, 1e-300)), y) for a, b in spans]
    return min(left, key=lambda e: float(e @ e))


def _beside(shape: Array, y: Array) -> Array:
    """What of y (n,) of mean 0 the shape does not explain."""
    x = shape - shape.mean()
    return np.asarray(y - x * float(x @ y) / max(float(x @ x), 1e-300))


def _structure(channel: Channel, misfit: Array) -> float:
    """Mean square of what is no noise: it repeats in the next point, or goes beyond the noise."""
    repeats = float(misfit[1:] @ misfit[:-1]) / len(misfit)
    beyond = float(misfit @ misfit) / len(misfit) - (MISJUDGED * channel.noise) ** 2
    return max(repeats, beyond, 0.0)


def _best_cut(t: Array, y: Array) -> int:
    """Where two lines, one after the other, leave least of the points (at least three)."""
    t, y = t - t[0], y - y.mean()
    sums = np.cumsum([np.ones_like(t), t, t * t, y, t * y, y * y], axis=1)
    at = np.arange(1, len(t))
    first = sums[:, at - 1]
    return int(at[np.argmin(_left_of(first) + _left_of(sums[:, -1:] - first))])


def _left_of(sums: Array) -> Array:
    """Square sums (k,) that lines leave, of the sums (6, k) of 1, t, t^2, y, t y, y^2."""
    n, t, tt, y, ty, yy = sums
    across, spread = ty - t * y / n, tt - t * t / n
    flat = yy - y * y / n
    line = np.divide(across**2, spread, out=np.zeros_like(flat), where=spread > 0)
    return np.asarray(flat - line)
